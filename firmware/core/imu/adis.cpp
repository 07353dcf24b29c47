// SPDX-License-Identifier: BSD-3-Clause
#include "imu/adis.hpp"

#include "imu/imu_words.hpp"

namespace versavis::firmware {

namespace {

constexpr std::uint32_t clock_hz = 1'000'000;  // the limit of bursts
constexpr std::uint16_t reset_command = 0x80;
constexpr std::size_t crc_words = 11;

/// What four bits leave in a register that shifts right.
struct CrcTable {
    constexpr CrcTable() {
        for (std::uint16_t nibble = 0; nibble < 16; ++nibble) {
            std::uint32_t crc = nibble;
            for (int bit = 0; bit < 4; ++bit)
                crc = (crc & 1U) != 0 ? (crc >> 1U) ^ 0x1021U : crc >> 1U;
            remainders[nibble] = static_cast<std::uint16_t>(crc);
        }
    }
    std::uint16_t remainders[16] = {};
};
constexpr CrcTable crc_table;

}  // namespace

std::uint16_t adis16448_crc(const std::uint16_t* words) {
    std::uint32_t crc = 0xFFFF;
    for (std::size_t i = 0; i < crc_words; ++i) {
        crc ^= words[i];  // low byte first, least significant bit first
        for (int nibble = 0; nibble < 4; ++nibble)
            crc = (crc >> 4U) ^ crc_table.remainders[crc & 0xFU];
    }
    crc = ~crc & 0xFFFFU;
    return static_cast<std::uint16_t>(crc << 8U | crc >> 8U);
}

/// 819.2 Hz / 2^D, or base / (D + 1).
std::uint16_t Adis::rate_code(std::uint32_t millihertz) const {
    const std::uint32_t parts = facts_.fastest_millihertz / millihertz;
    if (!facts_.octaves)
        return static_cast<std::uint16_t>(parts == 0 ? 0 : parts > 2000 ? 1999 : parts - 1);
    std::uint16_t octaves = 0;
    while (parts >= 2U << octaves) ++octaves;
    return octaves;
}

std::uint32_t Adis::rate(std::uint32_t wanted_millihertz) const {
    const std::uint16_t code = rate_code(wanted_millihertz);
    return facts_.octaves ? facts_.fastest_millihertz >> code
                          : facts_.fastest_millihertz / (code + 1U);
}

void Adis::setup(const PartSettings& settings, Setup& setup) const {
    const std::uint16_t code = rate_code(settings.rate_millihertz);
    // In octaves the rate is in the high byte, beside the bit that selects the internal clock.
    const auto rate =
        static_cast<std::uint16_t>(facts_.octaves ? std::uint32_t{code} << 8U | 1U : code);
    const auto filters = static_cast<std::uint16_t>(facts_.filter_base | settings.filter);
    constexpr std::uint32_t settle_us = 300;
    setup.write(0, facts_.command_register, reset_command, facts_.reset_us);
    setup.expect(0, facts_.product_register, facts_.product);
    setup.write(0, facts_.control_register, facts_.control, settle_us);
    setup.write(0, facts_.rate_register, rate, settle_us);
    setup.write(0, facts_.filter_register, filters, settle_us);
    // Changing the range may change the filter.
    setup.write(0, facts_.filter_register, filters, settle_us);
    setup.expect(0, facts_.rate_register, rate);
    setup.expect(0, facts_.filter_register, filters);
}

void Adis::access(const SetupStep& step, ImuTransfer& transfer) const {
    transfer.clock_hz = clock_hz;
    transfer.word_gap_ns = facts_.word_gap_ns;
    transfer.size = 4;
    if (step.action == SetupStep::Action::expect) {
        transfer.bytes[0] = step.address;
        return;
    }
    transfer.bytes[0] = static_cast<std::uint8_t>(0x80U | step.address);
    transfer.bytes[1] = static_cast<std::uint8_t>(step.value);
    // All commands are in the low byte; while the part resets, it must not be asked for more.
    if (step.address == facts_.command_register) transfer.size = 2;
    transfer.bytes[2] = static_cast<std::uint8_t>(transfer.bytes[0] + 1U);
    transfer.bytes[3] = static_cast<std::uint8_t>(step.value >> 8U);
}

std::uint16_t Adis::answer(const ImuTransfer& /*asked*/, const ImuReply& reply) const {
    return big_endian(reply.bytes, 1);  // in the word after the question
}

void Adis::reading(unsigned /*index*/, ImuTransfer& transfer) const {
    transfer.clock_hz = clock_hz;
    transfer.size = static_cast<std::uint8_t>(2 + 2 * facts_.words);
    transfer.bytes[0] = facts_.command_register;
}

bool Adis::check(const std::uint16_t* words, const std::uint8_t* bytes) const {
    const std::size_t last = facts_.words - 1U;
    if (facts_.check == AdisFacts::Check::crc) return words[last] == adis16448_crc(words + 1);
    std::uint16_t sum = 0;
    for (std::size_t i = 0; i < 2 * last; ++i) sum = static_cast<std::uint16_t>(sum + bytes[i]);
    return sum != 0 && words[last] == sum;  // zeros are a dead bus
}

void Adis::fill(const std::uint16_t* words, wire::ImuSample& sample) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        sample.gyro[axis] = signed_word(words[1 + axis]);
        sample.accel[axis] = signed_word(words[4 + axis]);
        if (facts_.magnetic) sample.magnetic[axis] = signed_word(words[7 + axis]);
    }
    if (facts_.magnetic) sample.pressure = words[10];
    std::uint16_t temperature = words[facts_.magnetic ? 11 : 7];
    // Twelve bits in the older parts; the other bits are unused.
    if (facts_.octaves)
        temperature = static_cast<std::uint16_t>(((temperature & 0xFFFU) ^ 0x800U) - 0x800U);
    sample.temperature = signed_word(temperature);
    if ((words[0] & facts_.failures) != 0) sample.flags |= wire::imu_self_test_failed;
}

Verdict Adis::parse(const ImuReply* replies, unsigned count, wire::ImuSample& sample) const {
    // What arrives while the command goes out means nothing.
    const std::uint8_t* newest = replies[count - 1].bytes + 2;
    decltype(ImuImage::burst) words;  // no part has a longer one
    for (std::size_t i = 0; i != facts_.words; ++i) words[i] = big_endian(newest, i);
    if (facts_.check != AdisFacts::Check::twice) {
        fill(words, sample);
        if (!check(words, newest)) sample.flags |= wire::imu_check_failed;
        return Verdict::taken;
    }
    const std::uint8_t* before = replies[count - 2].bytes + 2;
    for (unsigned i = 0; i != count; ++i)  // reading clears its flags
        words[0] = static_cast<std::uint16_t>(words[0] | big_endian(replies[i].bytes + 2, 0));
    bool equal = true;
    bool alive = false;
    for (std::size_t i = 1; i != facts_.words; ++i) {
        equal = equal && words[i] == big_endian(before, i);
        alive = alive || (words[i] != 0 && words[i] != 0xFFFF);
    }
    // An update may fall between two readings, or within one.
    if (!equal && count < max_readings) return Verdict::unsure;
    fill(words, sample);
    if (!equal || !alive) sample.flags |= wire::imu_check_failed;
    return Verdict::taken;
}

}  // namespace versavis::firmware

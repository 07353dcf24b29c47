// SPDX-License-Identifier: BSD-3-Clause
#include "imu/adis.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

#include "imu_setup.hpp"

using namespace versavis;
using namespace versavis::firmware;
using wire::ImuKind;

namespace {

using Words = std::vector<std::uint16_t>;
using Steps = std::vector<std::string>;

const ImuPart& adis_part(ImuKind kind) { return *find_part(kind); }

/// The maker's description, bit by bit.
std::uint16_t slow_adis_crc(const std::uint16_t* words) {
    unsigned crc = 0xFFFF;
    for (std::size_t word = 0; word < 11; ++word)
        for (unsigned bit = 0; bit < 16; ++bit) {
            const bool carry = ((crc ^ unsigned{words[word]} >> bit) & 1U) != 0;
            crc = crc >> 1U ^ (carry ? 0x1021U : 0U);
        }
    crc = ~crc & 0xFFFFU;
    return static_cast<std::uint16_t>(crc << 8U | crc >> 8U);
}

/// What a part answers to a burst with these words.
ImuReply reply(const Words& words) {
    ImuReply reply;
    reply.bytes[0] = reply.bytes[1] = 0x5A;  // while the command goes out
    for (std::size_t i = 0; i < words.size(); ++i) {
        reply.bytes[2 + 2 * i] = static_cast<std::uint8_t>(words[i] >> 8U);
        reply.bytes[3 + 2 * i] = static_cast<std::uint8_t>(words[i]);
    }
    return reply;
}

Words with_crc(Words words) {
    words.push_back(slow_adis_crc(words.data() + 1));
    return words;
}

Words with_sum(Words words) {
    unsigned sum = 0;
    for (const std::uint16_t word : words) sum += (word >> 8U) + (word & 0xFFU);
    words.push_back(static_cast<std::uint16_t>(sum));
    return words;
}

struct Read {
    Verdict verdict;
    wire::ImuSample sample;
};

Read read_bursts(ImuKind kind, const std::vector<Words>& bursts) {
    std::array<ImuReply, max_readings> replies;
    for (std::size_t i = 0; i < bursts.size(); ++i) replies.at(i) = reply(bursts[i]);
    Read read{};
    read.verdict =
        adis_part(kind).parse(replies.data(), static_cast<unsigned>(bursts.size()), read.sample);
    return read;
}

unsigned flags(ImuKind kind, const std::vector<Words>& bursts) {
    const Read result = read_bursts(kind, bursts);
    REQUIRE(result.verdict == Verdict::taken);
    return result.sample.flags;
}

template <std::size_t N, class Word>
std::vector<int> axes(const Word (&words)[N]) {
    return {words, words + N};
}

const Words motion{0, 1, 0xFFFE, 3, 4, 0xFFFB, 6, 7, 0xFFF8, 9, 0x9C40, 0xF801};

}  // namespace

TEST_CASE("adis: the CRC of an ADIS16448B's burst is that of the maker's example") {
    const std::uint16_t words[] = {0x000F, 0xFFF8, 0x000A, 0xFE41, 0xFFCC, 0x0456,
                                   0x0227, 0xFDA3, 0xF412, 0xC13C, 0xFF6C};
    CHECK(adis16448_crc(words) == 0x9AF4);
    const std::uint16_t zeros[11] = {};
    CHECK(adis16448_crc(zeros) != 0);  // a dead bus does not pass
}

TEST_CASE("adis: the CRC is that of its description, bit by bit") {
    std::mt19937 random(1);  // NOLINT(cert-msc51-cpp): the same words each time
    for (int i = 0; i < 1000; ++i) {
        std::uint16_t words[11];
        for (std::uint16_t& word : words) word = static_cast<std::uint16_t>(random());
        REQUIRE(adis16448_crc(words) == slow_adis_crc(words));
    }
}

TEST_CASE("adis: rates are those of the part, the slowest that is not slower than asked") {
    const auto octaves = GENERATE(ImuKind::adis16445, ImuKind::adis16448a, ImuKind::adis16448b);
    for (unsigned code = 0; code <= 9; ++code) {
        const std::uint32_t rate = 819'200U >> code;
        CHECK(adis_part(octaves).rate(rate) == rate);
        CHECK(adis_part(octaves).rate(rate - 1) == rate);
        CHECK(adis_part(octaves).rate(rate + 1) == (code == 0 ? rate : 2 * rate));
    }
    CHECK(adis_part(octaves).rate(8'000'000) == 819'200);
    CHECK(adis_part(ImuKind::adis16460).rate(600'000) == 682'666);
    CHECK(adis_part(ImuKind::adis16470).rate(1'000) == 1'000);
    CHECK(adis_part(ImuKind::adis16470).rate(1'001) == 2'000'000 / 1998);
    for (const auto& [kind, fastest] :
         {std::pair{ImuKind::adis16460, 2'048'000U}, {ImuKind::adis16470, 2'000'000U}}) {
        CHECK(adis_part(kind).rate(fastest + 1) == fastest);
        CHECK(adis_part(kind).rate(2 * fastest) == fastest);
        for (unsigned divider = 1; divider <= 2000; ++divider)
            REQUIRE(adis_part(kind).rate(fastest / divider) == fastest / divider);
    }
    CHECK(adis_part(ImuKind::adis16460).rate(1'023) == 1'024);  // it has no slower one
    // A rate that a part has is kept: the answer of a configuration can be sent again.
    for (std::uint32_t wanted = 1'000; wanted < 2'000'000; wanted += 777)
        for (const auto kind : {ImuKind::adis16445, ImuKind::adis16460, ImuKind::adis16470})
            REQUIRE(adis_part(kind).rate(adis_part(kind).rate(wanted)) ==
                    adis_part(kind).rate(wanted));
}

TEST_CASE("adis: each part is set up by the registers of its data sheet") {
    CHECK(setup_of(ImuKind::adis16448b, {204'800, 5, false}) ==
          Steps{"0:3E=80, 110000", "0:56?4040, 0", "0:34=16, 300", "0:36=201, 300", "0:38=405, 300",
                "0:38=405, 300", "0:36?201, 0", "0:38?405, 0"});
    CHECK(setup_of(ImuKind::adis16448a, {819'200, 0, false}) ==
          Steps{"0:3E=80, 110000", "0:56?4040, 0", "0:34=6, 300", "0:36=1, 300", "0:38=400, 300",
                "0:38=400, 300", "0:36?1, 0", "0:38?400, 0"});
    CHECK(setup_of(ImuKind::adis16445, {1'600, 6, false}) ==
          Steps{"0:3E=80, 75000", "0:56?403D, 0", "0:34=6, 300", "0:36=901, 300", "0:38=406, 300",
                "0:38=406, 300", "0:36?901, 0", "0:38?406, 0"});
    CHECK(setup_of(ImuKind::adis16460, {512'000, 3, false}) ==
          Steps{"0:3E=80, 260000", "0:56?404C, 0", "0:32=C1, 300", "0:36=3, 300", "0:38=503, 300",
                "0:38=503, 300", "0:36?3, 0", "0:38?503, 0"});
    CHECK(setup_of(ImuKind::adis16470, {2'000'000, 1, false}) ==
          Steps{"0:68=80, 230000", "0:72?4056, 0", "0:60=C1, 300", "0:64=0, 300", "0:5C=1, 300",
                "0:5C=1, 300", "0:64?0, 0", "0:5C?1, 0"});
}

TEST_CASE("adis: a register is written byte by byte, and read by a word that asks for it") {
    using Action = SetupStep::Action;
    const ImuPart& adis = adis_part(ImuKind::adis16448b);
    const ImuTransfer write = access_of(ImuKind::adis16448b, {Action::write, 0, 0x36, 0x1234, 300});
    CHECK(write.bus == ImuTransfer::Bus::spi);
    CHECK(write.clock_hz == 1'000'000);
    CHECK(write.word_gap_ns == 25'000);
    REQUIRE(write.size == 4);
    CHECK(Words(write.bytes, write.bytes + 4) == Words{0xB6, 0x34, 0xB7, 0x12});
    // Nothing may follow a command that resets the part.
    const ImuTransfer reset = access_of(ImuKind::adis16470, {Action::write, 0, 0x68, 0x80, 300});
    REQUIRE(reset.size == 2);
    CHECK(Words(reset.bytes, reset.bytes + 2) == Words{0xE8, 0x80});
    const ImuTransfer question = access_of(ImuKind::adis16448b, {Action::expect, 0, 0x56, 1, 0});
    CHECK(question.clock_hz == 1'000'000);
    CHECK(question.word_gap_ns == 25'000);
    REQUIRE(question.size == 4);
    CHECK(Words(question.bytes, question.bytes + 4) == Words{0x56, 0, 0, 0});
    ImuReply reply;
    reply.bytes[0] = reply.bytes[1] = 0xEE;  // the answer to the question before
    reply.bytes[2] = 0x40;
    reply.bytes[3] = 0x3D;
    CHECK(adis.answer(question, reply) == 0x403D);
}

TEST_CASE("adis: a sample is one burst as long as the part's, without gaps") {
    const auto [kind, command, size] =
        GENERATE(table<ImuKind, int, int>({{ImuKind::adis16445, 0x3E, 18},
                                           {ImuKind::adis16448a, 0x3E, 26},
                                           {ImuKind::adis16448b, 0x3E, 28},
                                           {ImuKind::adis16460, 0x3E, 22},
                                           {ImuKind::adis16470, 0x68, 22}}));
    for (unsigned index = 0; index < adis_part(kind).readings(); ++index) {
        ImuTransfer transfer;
        adis_part(kind).reading(index, transfer);
        CHECK(transfer.clock_hz == 1'000'000);
        CHECK(transfer.word_gap_ns == 0);
        CHECK(transfer.size == size);
        CHECK(transfer.bytes[0] == command);
        CHECK(transfer.bytes[1] == 0);
    }
}

TEST_CASE("adis: a burst with a CRC") {
    const Words good = with_crc(motion);
    const wire::ImuSample sample = read_bursts(ImuKind::adis16448b, {good}).sample;
    CHECK(axes(sample.gyro) == std::vector{1, -2, 3});
    CHECK(axes(sample.accel) == std::vector{4, -5, 6});
    CHECK(axes(sample.magnetic) == std::vector{7, -8, 9});
    CHECK(sample.pressure == 40'000);
    CHECK(sample.temperature == -2047);  // twelve bits
    CHECK(sample.flags == 0);
    for (std::size_t i = 0; i < good.size(); ++i) {
        Words damaged = good;
        damaged[i] ^= 0x0100U;
        // The status is not covered.
        CHECK(flags(ImuKind::adis16448b, {damaged}) == (i == 0 ? 0 : wire::imu_check_failed));
    }
    CHECK(flags(ImuKind::adis16448b, {Words(13, 0)}) == wire::imu_check_failed);
    CHECK((flags(ImuKind::adis16448b, {Words(13, 0xFFFF)}) & wire::imu_check_failed) != 0);
}

TEST_CASE("adis: temperatures of twelve bits, whatever the other bits are") {
    const auto [word, temperature] = GENERATE(table<int, int>(
        {{0x0000, 0}, {0x07FF, 2047}, {0xF7FF, 2047}, {0x0800, -2048}, {0x0FFF, -1}, {0x1001, 1}}));
    Words words = motion;
    words[11] = static_cast<std::uint16_t>(word);
    CHECK(read_bursts(ImuKind::adis16448b, {with_crc(words)}).sample.temperature == temperature);
}

TEST_CASE("adis: a burst with a sum of its bytes") {
    const auto kind = GENERATE(ImuKind::adis16460, ImuKind::adis16470);
    const Words good = with_sum({0, 0x8001, 2, 0xFFFF, 4, 0xFEFB, 6, 0x9002, 8});
    const wire::ImuSample sample = read_bursts(kind, {good}).sample;
    CHECK(axes(sample.gyro) == std::vector{-32767, 2, -1});
    CHECK(axes(sample.accel) == std::vector{4, -261, 6});
    CHECK(axes(sample.magnetic) == std::vector{0, 0, 0});
    CHECK(sample.pressure == 0);
    CHECK(sample.temperature == -28670);  // all bits count
    CHECK(sample.flags == 0);
    for (std::size_t i = 0; i < good.size(); ++i)
        for (const unsigned bit : {1U, 0x100U}) {
            Words damaged = good;
            damaged[i] = static_cast<std::uint16_t>(damaged[i] ^ bit);
            CHECK((flags(kind, {damaged}) & wire::imu_check_failed) != 0);
        }
    CHECK(flags(kind, {Words(10, 0)}) == wire::imu_check_failed);  // a dead bus
    CHECK((flags(kind, {Words(10, 0xFFFF)}) & wire::imu_check_failed) != 0);
    CHECK(flags(kind, {with_sum({0, 0, 0, 0, 0, 0, 0, 0, 1})}) == 0);
}

TEST_CASE("adis: without a checksum, two readings in a row must be equal") {
    const auto kind = GENERATE(ImuKind::adis16445, ImuKind::adis16448a);
    const std::size_t size = kind == ImuKind::adis16445 ? 8 : 12;
    const Words good(motion.begin(), motion.begin() + static_cast<std::ptrdiff_t>(size));
    const Read twice = read_bursts(kind, {good, good});
    CHECK(twice.verdict == Verdict::taken);
    CHECK(twice.sample.flags == 0);
    CHECK(axes(twice.sample.gyro) == std::vector{1, -2, 3});
    CHECK(axes(twice.sample.accel) == std::vector{4, -5, 6});
    const bool magnetic = kind == ImuKind::adis16448a;
    CHECK(axes(twice.sample.magnetic) == (magnetic ? std::vector{7, -8, 9} : std::vector{0, 0, 0}));
    CHECK(twice.sample.pressure == (magnetic ? 40'000 : 0));
    CHECK(twice.sample.temperature == (magnetic ? -2047 : 7));
    for (std::size_t i = 1; i < size; ++i) {
        Words other = good;
        other[i] ^= 0x0100U;
        CHECK(read_bursts(kind, {good, other}).verdict == Verdict::unsure);
        CHECK(read_bursts(kind, {good, other, good}).verdict == Verdict::unsure);
        // An update came between, or within one: the newest two agree.
        const Read settled = read_bursts(kind, {good, other, other});
        CHECK(settled.verdict == Verdict::taken);
        CHECK(settled.sample.flags == 0);
        CHECK(read_bursts(kind, {good, other, good, other}).verdict == Verdict::unsure);
        CHECK(flags(kind, {good, other, good, other, other}) == 0);
        // Five of which no two agree are enough.
        CHECK(flags(kind, {good, other, good, other, good}) == wire::imu_check_failed);
    }
    Words status = good;
    status[0] = 0x0008;  // it reports no failure, and is not compared
    CHECK(flags(kind, {good, status}) == 0);
}

TEST_CASE("adis: a bus that is dead gives two equal readings, and no sample") {
    const auto kind = GENERATE(ImuKind::adis16445, ImuKind::adis16448a);
    const std::size_t size = kind == ImuKind::adis16445 ? 8 : 12;
    for (const std::uint16_t dead : {std::uint16_t{0}, std::uint16_t{0xFFFF}}) {
        Words words(size, dead);
        CHECK((flags(kind, {words, words}) & wire::imu_check_failed) != 0);
        words[0] = 0x0008;  // a status alone is no life
        CHECK(flags(kind, {words, words}) == wire::imu_check_failed);
        words[size - 1] = 1;
        CHECK(flags(kind, {words, words}) == 0);
    }
    Words words(size, 0);
    words[0] = 8;
    words[1] = 1;
    CHECK(flags(kind, {words, words}) == 0);
}

TEST_CASE("adis: the part's own diagnosis is reported, by whichever reading had it") {
    const auto [kind, failures] =
        GENERATE(table<ImuKind, unsigned>({{ImuKind::adis16445, 0xFC64U},
                                           {ImuKind::adis16448a, 0xFC67U},
                                           {ImuKind::adis16448b, 0xFC67U},
                                           {ImuKind::adis16460, 0x0064U},
                                           {ImuKind::adis16470, 0x0076U}}));
    Words words(motion.begin(), motion.begin() + (kind == ImuKind::adis16445    ? 8
                                                  : kind == ImuKind::adis16448a ? 12
                                                  : kind == ImuKind::adis16448b ? 12
                                                                                : 9));
    for (unsigned bit = 0; bit < 16; ++bit) {
        const unsigned expected = (failures >> bit & 1U) != 0 ? wire::imu_self_test_failed : 0;
        words[0] = static_cast<std::uint16_t>(1U << bit);
        CAPTURE(bit);
        if (adis_part(kind).readings() == 1) {
            CHECK(flags(kind, {kind == ImuKind::adis16448b ? with_crc(words) : with_sum(words)}) ==
                  expected);
            continue;
        }
        Words clear = words;  // reading clears its flags
        clear[0] = 0;
        Words other = clear;
        other[1] ^= 2U;
        CHECK(flags(kind, {words, clear}) == expected);
        CHECK(flags(kind, {clear, words}) == expected);
        CHECK(flags(kind, {words, other, clear, clear}) == expected);
        Words between = other;
        between[0] = words[0];
        CHECK(flags(kind, {clear, between, clear, clear}) == expected);
        CHECK(flags(kind, {clear, clear}) == 0);
    }
}

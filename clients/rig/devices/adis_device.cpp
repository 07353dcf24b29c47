// SPDX-License-Identifier: BSD-3-Clause
#include "adis_device.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::devices {

namespace {

constexpr Nanoseconds us = 1'000;
constexpr Nanoseconds ms = 1'000'000;
constexpr double pi = 3.14159265358979323846;
constexpr std::uint32_t burst_clock_limit_hz = 1'000'000;
constexpr std::uint32_t clock_limit_hz = 2'000'000;

/// The manufacturer's recipe: shift right by the unreversed polynomial, invert, swap.
std::uint16_t crc16(const std::vector<std::uint16_t>& words, std::size_t first, std::size_t last) {
    unsigned crc = 0xFFFF;
    for (std::size_t i = first; i <= last; ++i)
        for (const unsigned byte : {words[i] & 0xFFU, static_cast<unsigned>(words[i] >> 8U)})
            for (unsigned bit = 0; bit < 8; ++bit)
                crc = ((crc ^ (byte >> bit)) & 1U) != 0 ? crc >> 1U ^ 0x1021U : crc >> 1U;
    crc = ~crc & 0xFFFFU;
    return static_cast<std::uint16_t>((crc & 0xFFU) << 8U | crc >> 8U);
}

}  // namespace

const AdisDevice::Map& AdisDevice::map(AdisModel model) {
    static const std::map<AdisModel, Map> maps{
        {AdisModel::adis16445,
         {0x403D, 0x56,       0x3E, 0x34,  0x36,   0x38,    0.01,    0.00025, 0.07386, 31,
          819.2,  {404, 757}, true, false, 9 * us, 55 * ms, 40 * us, 0x0006,  0x0001,  0x0402}},
        {AdisModel::adis16448a,
         {0x4040, 0x56,       0x3E, 0x34, 0x36,   0x38,    0.04,    1.0 / 1200, 0.07386, 31,
          819.2,  {404, 757}, true, true, 9 * us, 90 * ms, 40 * us, 0x0006,     0x0001,  0x0402}},
        {AdisModel::adis16448b,
         {0x4040, 0x56,       0x3E, 0x34, 0x36,   0x38,    0.04,    1.0 / 1200, 0.07386, 31,
          819.2,  {404, 757}, true, true, 9 * us, 90 * ms, 40 * us, 0x0006,     0x0001,  0x0402}},
        {AdisModel::adis16460,
         {0x404C, 0x56,       0x3E,  0x32,  0x36,    0x38,     0.005,   0.00025, 0.05,   25,
          2048,   {456, 854}, false, false, 16 * us, 225 * ms, 24 * us, 0x00C1,  0x0000, 0x0500}},
        {AdisModel::adis16470,
         {0x4056, 0x72,        0x68,  0x60,  0x64,    0x5C,     0.1,     0.00125, 0.1,    0,
          2000,   {668, 1253}, false, false, 16 * us, 193 * ms, 24 * us, 0x00C1,  0x0000, 0x0000}},
    };
    return maps.at(model);
}

AdisDevice::AdisDevice(AdisModel model, World world, Nanoseconds answers_from)
    : model_(model), map_(map(model)), world_(std::move(world)) {
    reset(answers_from);
}

void AdisDevice::reset(Nanoseconds ready_at) {
    ready_at_ = ready_at;
    response_ = 0;
    registers_[map_.control_at] = map_.control_default;
    registers_[map_.rate_at] = map_.rate_default;
    registers_[map_.filter_at] = map_.filter_default;
}

UpdateTimes AdisDevice::updates() const {
    const unsigned rate = registers_.at(map_.rate_at);
    const double hz =
        map_.octaves ? map_.base_hz / (1U << (rate >> 8U)) : map_.base_hz / (rate + 1);
    return {ready_at_, 1e9 / hz};
}

bool AdisDevice::signals(Nanoseconds at) const {
    if (resetting(at)) return false;
    return !map_.octaves || (registers_.at(map_.control_at) & 0x4U) != 0;
}

bool AdisDevice::has_crc() const {
    return model_ == AdisModel::adis16448b && (registers_.at(map_.control_at) & 0x10U) != 0;
}

/// Samples of the sensor that make one of the output, as their mean.
unsigned AdisDevice::averaged() const {
    const unsigned rate = registers_.at(map_.rate_at);
    return map_.octaves ? 1U << (rate >> 8U) : rate + 1;
}

Nanoseconds AdisDevice::motion_shown(Nanoseconds at) const {
    const UpdateTimes times = updates();
    return times.time(times.index_at(at)) - delays().gyro;
}

/// Of the element and of the averages that follow each other.
SampleDelays AdisDevice::delays() const {
    const double element = 1 / (2 * pi * map_.poles_hz[0]) + 1 / (2 * pi * map_.poles_hz[1]);
    const double averages = (taps() - 1 + (averaged() - 1) / 2.0) / map_.base_hz;
    const Nanoseconds delay = std::llround((element + averages) * 1e9);
    return {delay, delay};
}

/// Of the newest sample and those before it: the mean over the taps, over these means again, and
/// over those that make one of the output.
std::vector<double> AdisDevice::weights() const {
    std::vector<double> weights{1};
    for (const unsigned length : {taps(), taps(), averaged()}) {
        std::vector<double> mean(weights.size() + length - 1);
        for (std::size_t i = 0; i < weights.size(); ++i)
            for (std::size_t back = 0; back < length; ++back) mean[i + back] += weights[i] / length;
        weights = std::move(mean);
    }
    return weights;
}

/// The element remembers the motion for the time constants of its poles: shown here by two instants
/// with the mean and the spread of its response.
Inertial AdisDevice::filtered(Nanoseconds at) const {
    Inertial felt = world_(at);
    felt.gyro_deg_s = felt.accel_g = {};
    const double first = 1 / (2 * pi * map_.poles_hz[0]), second = 1 / (2 * pi * map_.poles_hz[1]);
    const double spread = std::hypot(first, second);
    double back = 0;
    for (const double weight : weights()) {
        for (const double element : {first + second - spread, first + second + spread}) {
            const double age = back / map_.base_hz + element;
            const Inertial then = world_(at - std::llround(age * 1e9));
            for (std::size_t axis = 0; axis < 3; ++axis) {
                felt.gyro_deg_s.at(axis) += weight / 2 * then.gyro_deg_s.at(axis);
                felt.accel_g.at(axis) += weight / 2 * then.accel_g.at(axis);
            }
        }
        ++back;
    }
    return felt;
}

std::vector<std::uint16_t> AdisDevice::burst_words(Nanoseconds at) const {
    const UpdateTimes times = updates();
    const std::int64_t index = times.index_at(at);
    const Inertial felt = filtered(times.time(index));
    std::vector<std::uint16_t> words{diagnosis_};
    const auto add = [&words](double value, double lsb) {
        words.push_back(static_cast<std::uint16_t>(counts(value, lsb)));
    };
    for (const double rate : felt.gyro_deg_s) add(rate, map_.gyro_lsb);
    for (const double acceleration : felt.accel_g) add(acceleration, map_.accel_lsb);
    if (map_.magnetic) {
        for (const double field : felt.magnetic_gauss) add(field, 1.0 / 7000);
        words.push_back(static_cast<std::uint16_t>(std::lround(felt.pressure_mbar / 0.02)));
    }
    add(felt.temperature_c - map_.temperature_zero, map_.temperature_lsb);
    if (map_.octaves) words.back() &= 0xFFFU;
    if (has_crc()) words.push_back(crc16(words, 1, 11));
    if (!map_.octaves) {
        words.push_back(static_cast<std::uint16_t>(index));
        unsigned sum = 0;
        for (const unsigned word : words) sum += (word & 0xFFU) + (word >> 8U);
        words.push_back(static_cast<std::uint16_t>(sum));
    }
    return words;
}

std::uint16_t AdisDevice::read(unsigned address, Nanoseconds at) const {
    if (address == map_.product_at) return map_.product;
    const auto found = registers_.find(address);
    if (found != registers_.end()) return found->second;
    const bool diagnosis = address == (map_.octaves ? 0x3CU : 0x02U);
    if (diagnosis) return diagnosis_;
    const std::vector<std::uint16_t> words = burst_words(at);
    if (map_.octaves && address >= 0x04 && address <= 0x18) return words[1 + (address - 0x04) / 2];
    return 0;
}

void AdisDevice::write(unsigned address, std::uint8_t byte, Nanoseconds at) {
    const bool high = (address & 1U) != 0;
    const unsigned even = address & ~1U;
    if (even == map_.command_at) {
        if (high || (byte & 0x80U) == 0) return;
        return reset(at + map_.reset);
    }
    const auto found = registers_.find(even);
    if (found == registers_.end()) return;
    const unsigned word = found->second;
    found->second =
        static_cast<std::uint16_t>(high ? (word & 0xFFU) | byte << 8U : (word & 0xFF00U) | byte);
}

void AdisDevice::transfer(Nanoseconds at, const firmware::ImuTransfer& transfer,
                          std::span<std::uint8_t> received) {
    std::fill(received.begin(), received.end(), std::uint8_t{0});
    const bool burst = transfer.word_gap_ns == 0 && transfer.size > 2;
    if (transfer.chip != 0 || transfer.size % 2 != 0) ++breaches_;
    if (transfer.clock_hz > (burst ? burst_clock_limit_hz : clock_limit_hz)) ++breaches_;
    const auto bits = [&](Nanoseconds bytes) {
        return bytes * 8 * 1'000'000'000 / transfer.clock_hz;
    };
    const auto gap = static_cast<Nanoseconds>(transfer.word_gap_ns);
    if (!burst && transfer.size > 2 && (gap < map_.stall || bits(2) + gap < map_.word_interval))
        ++breaches_;
    if (at - last_end_ < map_.stall) ++breaches_;
    last_end_ = at + bits(transfer.size) + transfer.size / 2 * gap;
    if (resetting(at)) {
        ++breaches_;
        return;
    }
    const auto put = [&](std::size_t word, std::uint16_t value) {
        received[2 * word] = static_cast<std::uint8_t>(value >> 8U);
        received[2 * word + 1] = static_cast<std::uint8_t>(value);
    };
    put(0, response_);
    if (burst) {
        if (transfer.bytes[0] != map_.command_at) return;
        const std::vector<std::uint16_t> words = burst_words(at);
        for (std::size_t i = 0; i < words.size() && 2 * i + 3 < received.size(); ++i)
            put(i + 1, words[i]);
        diagnosis_ = 0;
        if (corrupted_ > 0) {
            --corrupted_;
            received[5] ^= 0x04U;
        }
        return;
    }
    for (std::size_t i = 0; i < received.size() / 2; ++i) {
        if (resetting(at)) ++breaches_;  // since the word before
        put(i, response_);
        const unsigned address = transfer.bytes[2 * i];
        response_ = 0;
        if ((address & 0x80U) != 0)
            write(address & 0x7FU, transfer.bytes[2 * i + 1], at);
        else
            response_ = read(address, at);
    }
}

}  // namespace versavis::devices

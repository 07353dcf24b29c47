// SPDX-License-Identifier: BSD-3-Clause
#include "byte_register_device.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace versavis::devices {

namespace {

constexpr Nanoseconds us = 1'000;
constexpr Nanoseconds ms = 1'000'000;

std::uint8_t high(std::int16_t word) {
    return static_cast<std::uint8_t>(static_cast<std::uint16_t>(word) >> 8U);
}
std::uint8_t low(std::int16_t word) { return static_cast<std::uint8_t>(word); }

/// From the start of a transfer to its byte `index`.
Nanoseconds byte_time(std::size_t index, unsigned bits, std::uint32_t clock_hz) {
    return static_cast<Nanoseconds>(index * bits) * 1'000'000'000 / clock_hz;
}

}  // namespace

void Icm42688pDevice::reset() {
    registers_.fill(0);
    registers_[0x4C] = 0x30;  // both interfaces answer
    registers_[0x4F] = registers_[0x50] = 0x06;
    registers_[0x52] = 0x11;
    registers_[0x64] = registers_[0x65] = 0x10;
    registers_[0x75] = 0x47;
    read_index_ = -1;
}

UpdateTimes Icm42688pDevice::updates() const {
    static const std::map<unsigned, double> rates{{3, 8000}, {4, 4000}, {5, 2000}, {6, 1000},
                                                  {15, 500}, {7, 200},  {8, 100},  {9, 50},
                                                  {10, 25},  {11, 12.5}};
    const auto found = rates.find(registers_[0x4F] & 0x0FU);
    return {on_at_, 1e9 / (found == rates.end() ? 1000 : found->second)};
}

bool Icm42688pDevice::signals(Nanoseconds at) const {
    const bool routed =
        registers_[0x65] == 0x08 && registers_[0x14] == 0x03 && (registers_[0x64] & 0x10U) == 0;
    const bool fast = updates().period_ns <= 250'000;
    return !unplugged_ && running() && routed && (!fast || registers_[0x64] == 0x60) &&
           at >= on_at_ + 45 * ms;
}

void Icm42688pDevice::write(unsigned address, std::uint8_t value, Nanoseconds at) {
    if (address == 0x11 && (value & 1U) != 0) {
        reset();
        ready_at_ = at + ms;
        return;
    }
    const bool mode = address == 0x4E || address == 0x4F || address == 0x50;
    // While it is running only rate, range and mode may change; and nothing right after it was
    // switched on.
    if (running() && (!mode || at < on_at_ + 200 * us)) ++breaches_;
    if (address == 0x4E && (value & 0x0FU) == 0x0F && !running()) on_at_ = at;
    registers_[address] = value;
}

/// By the data sheet's table of group delays, for filters of second order: a row for each rate,
/// from GYRO_ODR = 3 (8 kHz) on, in units of 0.1 ms.
Nanoseconds Icm42688pDevice::filter_delay(unsigned filter) const {
    static const std::map<unsigned, std::array<unsigned, 8>> rows{
        {3, {2, 2, 2, 2, 2, 2, 2, 2}},
        {4, {4, 4, 4, 4, 4, 4, 4, 4}},
        {5, {8, 8, 8, 8, 8, 8, 8, 8}},
        {6, {7, 21, 24, 32, 37, 52, 61, 120}},
        {15, {13, 41, 47, 64, 73, 104, 122, 240}},
        {7, {33, 51, 58, 80, 91, 129, 153, 300}},
        {8, {65, 51, 58, 80, 91, 129, 153, 300}},
        {9, {129, 51, 58, 80, 91, 129, 153, 300}},
        {10, {257, 51, 58, 80, 91, 129, 153, 300}},
        {11, {257, 51, 58, 80, 91, 129, 153, 300}}};
    const auto row = rows.find(registers_[0x4F] & 0x0FU);
    return row == rows.end() ? 0 : row->second.at(filter & 7U) * 100 * us;
}

/// With the anti-alias filters before them, of 585 and 1163 Hz.
SampleDelays Icm42688pDevice::delays() const {
    return {filter_delay(registers_[0x52] & 0x0FU) + 385 * us,
            filter_delay(registers_[0x52] >> 4U) + 193 * us};
}

std::uint8_t Icm42688pDevice::read(unsigned address, Nanoseconds at) {
    if (address < 0x1D || address > 0x2D) return registers_[address];
    if (!running() || at < on_at_ + 30 * ms) return address % 2 == 1 ? 0x80 : 0x00;
    if (address == 0x2D) return status(at);
    const UpdateTimes times = updates();
    const Nanoseconds taken = times.time(times.index_at(std::min(at, frozen_at_)));
    const unsigned word = (address - 0x1D) / 2;
    const Inertial felt = world_(taken - (word > 3 ? delays().gyro : delays().accel));
    std::int16_t value = 0;
    if (word == 0)
        value = counts(felt.temperature_c - 25, 1 / 132.48);
    else if (word <= 3)
        value = counts(felt.accel_g[word - 1], 1.0 / 2048);
    else if (word <= 6)
        value = counts(felt.gyro_deg_s[word - 4], 1 / 16.4);
    return address % 2 == 1 ? high(value) : low(value);
}

/// Reading it clears it.
std::uint8_t Icm42688pDevice::status(Nanoseconds at) {
    const std::int64_t index = updates().index_at(std::min(at, frozen_at_));
    const bool fresh = index != read_index_;
    read_index_ = index;
    return fresh ? 0x08 : 0x00;
}

void Icm42688pDevice::transfer(Nanoseconds at, const firmware::ImuTransfer& transfer,
                               std::span<std::uint8_t> received) {
    std::fill(received.begin(), received.end(), unplugged_ ? std::uint8_t{0xFF} : std::uint8_t{0});
    if (unplugged_ || address_ != 0) return;
    if (transfer.chip != 0 || transfer.clock_hz > 24'000'000 || at < ready_at_) ++breaches_;
    const unsigned address = transfer.bytes[0] & 0x7FU;
    if ((transfer.bytes[0] & 0x80U) == 0) {
        if (transfer.size != 2) ++breaches_;
        return write(address, transfer.bytes[1], at);
    }
    for (std::size_t i = 1; i < received.size(); ++i)
        received[i] =
            read(address + static_cast<unsigned>(i) - 1, at + byte_time(i, 8, transfer.clock_hz));
}

/// The register's address is kept and counts up; of bytes beyond the registers none is
/// acknowledged. Each register shows what it holds when its byte is sent.
bool Icm42688pDevice::i2c(Nanoseconds at, const firmware::ImuTransfer& transfer,
                          std::span<std::uint8_t> received) {
    std::fill(received.begin(), received.end(), std::uint8_t{0});
    if (unplugged_ || address_ == 0 || transfer.chip != address_) return false;
    if (transfer.clock_hz > 1'000'000 || at < ready_at_) ++breaches_;
    const unsigned pointer = transfer.bytes[0];
    if (pointer + transfer.size - 1U > registers_.size()) {
        ++breaches_;  // bit 7 is of SPI
        return false;
    }
    const bool reads = transfer.bus == firmware::ImuTransfer::Bus::i2c_read;
    for (unsigned i = 1; i < transfer.size; ++i) {
        // Behind both addresses and the register's, or behind one address.
        const Nanoseconds then = at + byte_time(i + (reads ? 2 : 1), 9, transfer.clock_hz);
        if (reads)
            received[i] = read(pointer + i - 1, then);
        else
            write(pointer + i - 1, transfer.bytes[i], then);
    }
    return true;
}

void Bmi088Device::reset_gyro(Nanoseconds at) {
    gyro_.fill(0);
    gyro_[0x00] = 0x0F;
    gyro_[0x10] = 0x80;
    gyro_[0x16] = 0x0F;
    gyro_ready_ = at + 30 * ms;
}

void Bmi088Device::reset_accel(Nanoseconds at) {
    accel_.fill(0);
    accel_[0x00] = 0x1E;
    accel_[0x03] = 0x10;
    accel_[0x40] = 0xA8;
    accel_[0x41] = 0x01;
    accel_[0x7C] = 0x03;
    accel_ready_ = at + ms;
    accel_spi_ = false;
}

UpdateTimes Bmi088Device::updates() const {
    constexpr double rates[] = {2000, 2000, 1000, 400, 200, 100, 200, 100};
    return {gyro_ready_, 1e9 / rates[gyro_[0x10] & 0x7U]};
}

bool Bmi088Device::signals(Nanoseconds at) const {
    const bool push_pull_high = (gyro_[0x16] & 0x3U) == 0x1;
    return at >= gyro_ready_ && gyro_[0x15] == 0x80 && gyro_[0x18] == 0x01 && push_pull_high;
}

void Bmi088Device::write(unsigned chip, unsigned address, std::uint8_t value, Nanoseconds at) {
    const Nanoseconds pause = chip == 1 && !accel_on() ? ms : 2 * us;
    if (at - last_write_[chip] < pause) ++breaches_;
    last_write_[chip] = at;
    auto& registers = chip == 1 ? accel_ : gyro_;
    if (address == (chip == 1 ? 0x7EU : 0x14U) && value == 0xB6)
        return chip == 1 ? reset_accel(at) : reset_gyro(at);
    if (address == 0x00) return;
    if (chip == 1 && address == 0x7D) accel_on_at_ = at;
    registers[address] =
        chip == 0 && address == 0x10 ? static_cast<std::uint8_t>(value | 0x80U) : value;
}

std::uint8_t Bmi088Device::read_gyro(unsigned address, Nanoseconds at) const {
    if (address < 0x02 || address > 0x07) return gyro_[address];
    const UpdateTimes times = updates();
    const std::int16_t value = counts(
        world_(times.time(times.index_at(at))).gyro_deg_s[(address - 2) / 2], 2000.0 / 32768);
    return address % 2 == 0 ? low(value) : high(value);
}

/// It samples with a clock of its own, 0.4 % off.
UpdateTimes Bmi088Device::accel_updates() const {
    constexpr double rates[] = {1, 1, 1, 1, 1, 12.5, 25, 50, 100, 200, 400, 800, 1600, 1, 1, 1};
    return {accel_on_at_, 1.004e9 / rates[accel_[0x40] & 0xFU]};
}

bool Bmi088Device::accel_signals(Nanoseconds at) const {
    const bool push_pull_high_output = (accel_[0x53] & 0x1EU) == 0x0A;
    return accel_on() && at > accel_on_at_ && (accel_[0x58] & 0x4U) != 0 && push_pull_high_output;
}

std::uint8_t Bmi088Device::read_accel(unsigned address, Nanoseconds at) const {
    const bool data = (address >= 0x12 && address <= 0x17) || address == 0x22 || address == 0x23;
    if (!data || !accel_on()) return accel_[address];
    const UpdateTimes times = accel_updates();
    const Inertial felt = world_(times.time(times.index_at(at)));
    if (address >= 0x22) {
        const auto eleven_bits =
            static_cast<std::int16_t>(counts(felt.temperature_c - 23, 0.125) * 32);
        return address == 0x22 ? high(eleven_bits) : low(eleven_bits);
    }
    constexpr double full_scale_g[] = {3, 6, 12, 24};
    const std::int16_t value =
        counts(felt.accel_g[(address - 0x12) / 2], full_scale_g[accel_[0x41] & 0x3U] / 32768);
    return address % 2 == 0 ? low(value) : high(value);
}

void Bmi088Device::transfer(Nanoseconds at, const firmware::ImuTransfer& transfer,
                            std::span<std::uint8_t> received) {
    std::fill(received.begin(), received.end(), std::uint8_t{0});
    const unsigned chip = transfer.chip;
    if (chip > 1 || transfer.clock_hz > 10'000'000) ++breaches_;
    if (at < (chip == 1 ? accel_ready_ : gyro_ready_)) {
        ++breaches_;
        return;
    }
    const unsigned address = transfer.bytes[0] & 0x7FU;
    if (chip == 1 && !accel_spi_) {
        accel_spi_ = true;  // by the rising edge of this selection; what it carries is lost
        return;
    }
    if ((transfer.bytes[0] & 0x80U) == 0) return write(chip, address, transfer.bytes[1], at);
    const std::size_t dummies = chip == 1 ? 1 : 0;
    if (chip == 1) received[1] = 0xA5;
    // A burst shows the values of one instant: when it comes to the first of them.
    const unsigned first = chip == 1 ? 0x12 : 0x02;
    const Nanoseconds shown =
        at + byte_time(first < address ? 0 : first - address + 1 + dummies, 8, transfer.clock_hz);
    if (chip == 1 && accel_on() && address <= first && address + received.size() > first + 6)
        accel_reads_.emplace_back(at, accel_updates().time(accel_updates().index_at(shown)));
    for (std::size_t i = 1 + dummies; i < received.size(); ++i) {
        const unsigned from = address + static_cast<unsigned>(i - 1 - dummies);
        received[i] = chip == 1 ? read_accel(from, shown) : read_gyro(from, shown);
    }
}

}  // namespace versavis::devices

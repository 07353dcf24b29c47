// SPDX-License-Identifier: BSD-3-Clause
#include "vn100_device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <sstream>

namespace versavis::devices {

namespace {

constexpr Nanoseconds base_period = 1'250'000;  // 800 Hz
constexpr Nanoseconds answer_time = 1'000'000;
constexpr double gravity = 9.80665;
constexpr double radians = 3.14159265358979 / 180;

/// Bytes at one speed are read right at the other.
bool is_near(std::uint32_t one, std::uint32_t other) {
    constexpr std::uint32_t tolerance_percent = 2;
    return std::max(one, other) - std::min(one, other) <= other * tolerance_percent / 100;
}

std::string framed(const std::string& text) {
    unsigned sum = 0;
    for (const char c : text) sum ^= static_cast<unsigned char>(c);
    return fmt::format("${}*{:02X}\r\n", text, sum);
}

std::vector<std::string> fields(const std::string& text) {
    std::vector<std::string> out;
    std::stringstream stream(text);
    for (std::string field; std::getline(stream, field, ',');) out.push_back(field);
    return out;
}

unsigned crc_step(unsigned crc, unsigned byte) {
    crc = ((crc >> 8U) | (crc << 8U)) & 0xFFFFU;
    crc ^= byte;
    crc ^= (crc & 0xFFU) >> 4U;
    crc ^= (crc << 12U) & 0xFFFFU;
    crc ^= ((crc & 0xFFU) << 5U) & 0xFFFFU;
    return crc;
}

}  // namespace

Vn100Device::Burst Vn100Device::send(Nanoseconds at, std::vector<std::uint8_t> bytes,
                                     std::uint32_t baud) const {
    return {at + static_cast<Nanoseconds>(bytes.size()) * 10'000'000'000 / baud, std::move(bytes)};
}

std::optional<std::string> Vn100Device::execute(const std::string& command) {
    const std::size_t star = command.rfind('*');
    if (star == std::string::npos || framed(command.substr(1, star - 1)) != command + "\r\n")
        return "VNERR,03";
    const std::string text = command.substr(1, star - 1);
    const std::vector<std::string> part = fields(text);
    if (part[0] == "VNASY" && part.size() == 2) {
        paused_ = part[1] == "0";
        return text;
    }
    if (part[0] != "VNWRG" || part.size() < 3) return "VNERR,04";
    switch (std::stoul(part[1])) {
        case 5: baud_ = static_cast<std::uint32_t>(std::stoul(part[2])); return text;
        case 6: text_output_ = static_cast<unsigned>(std::stoul(part[2])); return text;
        case 32:
            if (part.size() != 11) return "VNERR,05";
            sync_mode_ = static_cast<unsigned>(std::stoul(part[6]));
            sync_skip_ = static_cast<unsigned>(std::stoul(part[8]));
            return text;
        case 75:
        case 76:
        case 77:
            if (part[2] == "0") return text;
            if (part.size() != 6 || part[4] != "01" || part[5] != "0601") return "VNERR,07";
            divider_ = static_cast<unsigned>(std::stoul(part[3]));
            if (58.0 * 10 * 800 / divider_ > baud_) return "VNERR,0C";
            return text;
        default: return "VNERR,08";
    }
}

std::vector<Vn100Device::Burst> Vn100Device::receive(Nanoseconds at, std::uint32_t baud,
                                                     std::span<const std::uint8_t> bytes) {
    std::vector<Burst> answers;
    if (muted_ || !is_near(baud, baud_)) return answers;
    for (const std::uint8_t byte : bytes) {
        line_ += static_cast<char>(byte);
        if (byte != '\n') continue;
        const std::size_t begin = line_.find('$');
        const std::string command =
            begin == std::string::npos ? "" : line_.substr(begin, line_.size() - begin - 2);
        line_.clear();
        const std::uint32_t before = baud_;
        const auto answer = command.empty() ? std::nullopt : execute(command);
        if (!answer) continue;
        const std::string out = framed(*answer);
        answers.push_back(send(at + answer_time, {out.begin(), out.end()}, before));
    }
    return answers;
}

Vn100Device::Burst Vn100Device::chatter(Nanoseconds at) const {
    const std::string text =
        framed("VNYMR,+100.949,-006.786,+000.390,+01.0640,-00.2531,+03.0614,+00.005");
    return send(at, {text.begin(), text.end()}, baud_);
}

std::optional<Nanoseconds> Vn100Device::next_sample(Nanoseconds after) const {
    if (muted_ || paused_) return std::nullopt;
    return (after / base_period + 1) * base_period;
}

bool Vn100Device::pulses(Nanoseconds at) const {
    // Skipped pulses and skipped packets have nothing to do with each other.
    return sync_mode_ == 1 && at / base_period % (sync_skip_ + 1) == sync_skip_ / 2;
}

bool Vn100Device::sends(Nanoseconds at) const {
    return divider_ != 0 && at / base_period % divider_ == 0;
}

Vn100Device::Burst Vn100Device::packet(Nanoseconds at) {
    const Inertial felt = world_(std::min(at, frozen_at_));
    std::vector<std::uint8_t> bytes{0xFA, 0x01, 0x01, 0x06};
    const auto put = [&bytes](const void* data, std::size_t size) {
        const auto* first = static_cast<const std::uint8_t*>(data);
        bytes.insert(bytes.end(), first, first + size);
    };
    const auto put_float = [&put](double value) {
        const auto narrow = static_cast<float>(value);
        put(&narrow, sizeof narrow);
    };
    const auto startup = static_cast<std::uint64_t>(at);
    put(&startup, sizeof startup);
    for (const double a : felt.accel_g) put_float(a * gravity);
    for (const double rate : felt.gyro_deg_s) put_float(rate * radians);
    for (const double field : felt.magnetic_gauss) put_float(field);
    put_float(felt.temperature_c);
    put_float(felt.pressure_mbar / 10);
    unsigned crc = 0;
    for (std::size_t i = 1; i < bytes.size(); ++i) crc = crc_step(crc, bytes[i]);
    bytes.push_back(static_cast<std::uint8_t>(crc >> 8U));
    bytes.push_back(static_cast<std::uint8_t>(crc));
    if (corrupted_ > 0) {
        --corrupted_;
        bytes[20] ^= 0x10U;
    }
    return send(at + delay_, std::move(bytes), baud_);
}

}  // namespace versavis::devices

// SPDX-License-Identifier: BSD-3-Clause
#include "imu_sampler.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds set_ahead = 500'000;  // of 1 ms at the highest rate

std::uint16_t word(const std::uint8_t* words, std::size_t index) {
    return static_cast<std::uint16_t>(words[2 * index] << 8U | words[2 * index + 1]);
}

}  // namespace

std::uint16_t adis16448::burst_crc(const std::uint8_t* words) {
    std::uint16_t crc = 0xFFFF;
    const auto take = [&crc](std::uint8_t byte) {
        crc = static_cast<std::uint16_t>(crc ^ byte);
        for (int bit = 0; bit < 8; ++bit)
            crc = static_cast<std::uint16_t>((crc & 1U) != 0 ? (crc >> 1U) ^ 0x8408U : crc >> 1U);
    };
    for (std::size_t i = 1; i <= 11; ++i) {
        take(words[2 * i + 1]);
        take(words[2 * i]);
    }
    crc = static_cast<std::uint16_t>(~crc);
    return static_cast<std::uint16_t>(crc << 8U | crc >> 8U);
}

void ImuSampler::configure(const wire::ImuConfiguration& configuration, Nanoseconds now) {
    enabled_ = configuration.kind != wire::ImuKind::none;
    overrun_ = false;
    if (enabled_) grid_ = Grid(now + set_ahead, configuration.rate_uhz);
}

bool ImuSampler::poll(Nanoseconds now, wire::ImuSample& sample) {
    Transfer transfer;
    const bool completed = bus_.complete(transfer);
    if (completed) parse(transfer, sample);
    if (enabled_ && grid_.next() - set_ahead <= now) {
        const std::uint8_t command[adis16448::burst_bytes] = {adis16448::burst_command};
        if (!bus_.start(grid_.next(), command, sizeof command)) overrun_ = true;
        grid_.advance();
    }
    return completed;
}

void ImuSampler::parse(const Transfer& transfer, wire::ImuSample& sample) {
    const std::uint8_t* words = transfer.received + 2;  // what comes while the command goes out means nothing
    sample = {};
    sample.kind = wire::ImuKind::adis16448b;
    sample.number = number_++;
    sample.time_ns = transfer.started;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        sample.gyro[axis] = static_cast<std::int16_t>(word(words, 1 + axis));
        sample.accel[axis] = static_cast<std::int16_t>(word(words, 4 + axis));
        sample.magnetic[axis] = static_cast<std::int16_t>(word(words, 7 + axis));
    }
    sample.pressure = word(words, 10);
    sample.temperature = static_cast<std::int16_t>(word(words, 11));
    if (transfer.size != adis16448::burst_bytes || word(words, 12) != adis16448::burst_crc(words))
        sample.flags |= wire::imu_checksum_failed;
    if (word(words, 0) != 0) sample.flags |= wire::imu_self_test_failed;
    if (overrun_) sample.flags |= wire::imu_overrun;
    overrun_ = false;
    if (sample.flags != 0) ++errors_;
}

Nanoseconds ImuSampler::next_wake() const { return enabled_ ? grid_.next() - set_ahead : INT64_MAX; }

}  // namespace versavis::firmware

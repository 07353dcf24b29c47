// SPDX-License-Identifier: BSD-3-Clause
// ADIS16445, ADIS16448 (A and B), ADIS16460 and ADIS16470 as their SPI master sees them.
#pragma once

#include <map>
#include <vector>

#include "inertial.hpp"

namespace versavis::devices {

enum class AdisModel { adis16445, adis16448a, adis16448b, adis16460, adis16470 };

class AdisDevice final : public SpiImuDevice {
 public:
    /// It answers from 290 ms after power-up on, like the slowest of them.
    AdisDevice(AdisModel model, World world, Nanoseconds answers_from = 290'000'000);

    void transfer(Nanoseconds at, const firmware::ImuTransfer& transfer,
                  std::span<std::uint8_t> received) override;
    UpdateTimes updates() const override;
    bool signals(Nanoseconds at) const override;
    SampleDelays delays() const override;
    void brown_out(Nanoseconds at) override { reset(at + map_.reset); }

    /// When the motion was that it shows at `at`.
    Nanoseconds motion_shown(Nanoseconds at) const;

    /// The next `bursts` have a flipped bit.
    void corrupt(unsigned bursts) { corrupted_ = bursts; }
    /// Bits that DIAG_STAT shows from now on.
    void diagnose(std::uint16_t bits) { diagnosis_ = bits; }

    /// Bytes on the wire for a burst of the data taken at or before `at`, without the junk of the
    /// command.
    std::vector<std::uint16_t> burst_words(Nanoseconds at) const;

 private:
    struct Map {
        std::uint16_t product;
        unsigned product_at, command_at, control_at, rate_at, filter_at;
        double gyro_lsb, accel_lsb, temperature_lsb, temperature_zero;
        double base_hz;
        double poles_hz[2];  ///< of its sensor element
        bool octaves;
        bool magnetic;
        Nanoseconds stall, reset;
        Nanoseconds word_interval;  ///< shortest time from word to word, outside bursts
        std::uint16_t control_default, rate_default, filter_default;
    };
    static const Map& map(AdisModel model);

    unsigned taps() const { return 1U << (registers_.at(map_.filter_at) & 7U); }
    unsigned averaged() const;
    std::vector<double> weights() const;
    Inertial filtered(Nanoseconds at) const;

    bool resetting(Nanoseconds at) const { return at < ready_at_; }
    std::uint16_t read(unsigned address, Nanoseconds at) const;
    void write(unsigned address, std::uint8_t byte, Nanoseconds at);
    void reset(Nanoseconds ready_at);
    bool has_crc() const;

    AdisModel model_;
    const Map& map_;
    World world_;
    Nanoseconds ready_at_ = 0;
    std::map<unsigned, std::uint16_t> registers_;
    std::uint16_t response_ = 0;
    Nanoseconds last_end_ = -1'000'000'000;
    std::uint16_t diagnosis_ = 0;
    unsigned corrupted_ = 0;
};

}  // namespace versavis::devices

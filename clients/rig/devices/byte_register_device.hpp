// SPDX-License-Identifier: BSD-3-Clause
// ICM-42688-P and BMI088 as their SPI master sees them.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "inertial.hpp"

namespace versavis::devices {

class Icm42688pDevice final : public SpiImuDevice {
 public:
    explicit Icm42688pDevice(World world) : world_(std::move(world)) { reset(); }

    void transfer(Nanoseconds at, const firmware::ImuTransfer& transfer,
                  std::span<std::uint8_t> received) override;
    bool i2c(Nanoseconds at, const firmware::ImuTransfer& transfer,
             std::span<std::uint8_t> received) override;
    UpdateTimes updates() const override;
    bool signals(Nanoseconds at) const override;
    SampleDelays delays() const override;

    /// Its interface is wired for I2C, at this address.
    void wire_i2c(std::uint8_t address) { address_ = address; }
    /// It takes no new data after `at`, though its data-ready line goes on; never: it does again.
    void freeze(Nanoseconds at) { frozen_at_ = at; }

    void brown_out(Nanoseconds at) override {
        reset();
        ready_at_ = at + 1'000'000;
    }
    /// The bus reads all ones: the part has come off.
    void unplug(bool unplugged) { unplugged_ = unplugged; }

 private:
    void reset();
    void write(unsigned address, std::uint8_t value, Nanoseconds at);
    std::uint8_t read(unsigned address, Nanoseconds at);
    std::uint8_t status(Nanoseconds at);
    Nanoseconds filter_delay(unsigned filter) const;
    bool running() const { return (registers_[0x4E] & 0x0FU) == 0x0F; }

    World world_;
    std::array<std::uint8_t, 128> registers_{};
    Nanoseconds ready_at_ = 0;
    Nanoseconds on_at_ = 0;
    std::int64_t read_index_ = -1;  ///< update whose data-ready flag was read
    bool unplugged_ = false;
    std::uint8_t address_ = 0;  ///< on I2C; 0: it is wired for SPI
    Nanoseconds frozen_at_ = firmware::never;
};

class Bmi088Device final : public SpiImuDevice {
 public:
    explicit Bmi088Device(World world) : world_(std::move(world)) {
        reset_gyro(0);
        reset_accel(0);
    }

    void transfer(Nanoseconds at, const firmware::ImuTransfer& transfer,
                  std::span<std::uint8_t> received) override;
    UpdateTimes updates() const override;
    bool signals(Nanoseconds at) const override;
    UpdateTimes accel_updates() const override;
    bool accel_signals(Nanoseconds at) const override;
    std::span<const std::pair<Nanoseconds, Nanoseconds>> accel_reads() const override {
        return accel_reads_;
    }
    /// Of the accelerometer alone: the gyro keeps running.
    void brown_out(Nanoseconds at) override {
        reset_accel(at);
        accel_spi_ = true;
    }

 private:
    void reset_gyro(Nanoseconds at);
    void reset_accel(Nanoseconds at);
    void write(unsigned chip, unsigned address, std::uint8_t value, Nanoseconds at);
    std::uint8_t read_gyro(unsigned address, Nanoseconds at) const;
    std::uint8_t read_accel(unsigned address, Nanoseconds at) const;
    bool accel_on() const { return accel_[0x7C] == 0 && accel_[0x7D] == 0x04; }

    World world_;
    std::array<std::uint8_t, 128> gyro_{};
    std::array<std::uint8_t, 128> accel_{};
    Nanoseconds gyro_ready_ = 0;
    Nanoseconds accel_ready_ = 0;
    Nanoseconds accel_on_at_ = 0;
    Nanoseconds last_write_[2] = {-1'000'000'000, -1'000'000'000};
    bool accel_spi_ = false;  ///< it wakes up on I2C
    std::vector<std::pair<Nanoseconds, Nanoseconds>> accel_reads_;
};

}  // namespace versavis::devices

// SPDX-License-Identifier: BSD-3-Clause
// What a kind of IMU on the SPI bus needs: how it is set up, how a sample is read, and how it is
// checked.
#pragma once

#include "base/hal.hpp"
#include "wire/messages.hpp"

namespace versavis::firmware {

/// One register access while the part is set up.
struct SetupStep {
    enum class Action : std::uint8_t { write, expect };
    Action action;
    std::uint8_t chip;
    std::uint8_t address;
    std::uint16_t value;     ///< to write, or that a read must return
    std::uint32_t pause_us;  ///< before the next step
};

/// Steps from power-up to samples, in order.
class Setup {
 public:
    /// A BMI088 needs 18. If lower, the end of its set-up is missing; if higher, memory is wasted.
    static constexpr std::size_t capacity = 20;

    void write(std::uint8_t chip, std::uint8_t address, std::uint16_t value,
               std::uint32_t pause_us = 0) {
        add({SetupStep::Action::write, chip, address, value, pause_us});
    }
    void expect(std::uint8_t chip, std::uint8_t address, std::uint16_t value) {
        add({SetupStep::Action::expect, chip, address, value, 0});
    }

    std::size_t size() const { return size_; }
    const SetupStep& operator[](std::size_t index) const { return steps_[index]; }

 private:
    void add(const SetupStep& step) {
        if (size_ < capacity) steps_[size_++] = step;
    }

    std::size_t size_ = 0;
    SetupStep steps_[capacity];
};

/// What a part is set up for.
struct PartSettings {
    std::uint32_t rate_millihertz;  ///< one of its rates
    std::uint8_t filter;
    bool accel_ready;  ///< the data-ready line of its accelerometer is wired
};

/// Where the accelerometer's values are among the bytes of a sample's readings.
struct AccelBytes {
    std::uint8_t reading;
    std::uint8_t first;
    std::uint8_t end;
};

enum class Verdict : std::uint8_t {
    taken,   ///< the sample is filled, with flags for what is wrong
    unsure,  ///< one more reading is needed to decide
};

inline constexpr unsigned max_readings = 5;

class ImuPart {
 public:
    virtual wire::ImuKind kind() const = 0;
    /// What identifies the part, as reported by an `imu_ready` event.
    virtual std::uint16_t identity() const = 0;
    virtual std::uint32_t fastest_millihertz() const = 0;
    /// On the I2C bus; 0: it is not made for that.
    virtual std::uint32_t fastest_i2c_millihertz() const { return 0; }
    /// Of its accelerometer, if that has a clock and a data-ready line of its own; else 0.
    virtual std::uint32_t accel_millihertz() const { return 0; }
    virtual AccelBytes accel_bytes() const { return {}; }
    virtual std::uint8_t strongest_filter() const = 0;
    /// Its slowest rate not below `wanted_millihertz`, which is at least 1000, or its fastest.
    virtual std::uint32_t rate(std::uint32_t wanted_millihertz) const = 0;

    virtual void setup(const PartSettings& settings, Setup& setup) const = 0;
    virtual void access(const SetupStep& step, ImuTransfer& transfer) const = 0;
    /// The value of the register that `asked` read.
    virtual std::uint16_t answer(const ImuTransfer& asked, const ImuReply& reply) const = 0;

    /// Shortest time between two transfers.
    virtual Nanoseconds pause() const = 0;
    /// Transfers that make up a sample.
    virtual unsigned readings() const = 0;
    virtual void reading(unsigned index, ImuTransfer& transfer) const = 0;
    /// Fills the raw words and flags of `sample` from `count` replies.
    virtual Verdict parse(const ImuReply* replies, unsigned count,
                          wire::ImuSample& sample) const = 0;

 protected:
    ~ImuPart() = default;
};

/// The part of a kind; null: not a kind on the SPI bus.
const ImuPart* find_part(wire::ImuKind kind);

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// What both IMU ports have in common: numbers, failures and the events about them.
#pragma once

#include "base/channel_reports.hpp"
#include "base/grid.hpp"

namespace versavis::firmware {

class ImuPort {
 public:
    ImuPort(std::uint8_t port, ChannelReports& reports) : port_(port), reports_(reports) {}

    std::uint32_t errors() const { return errors_; }
    std::uint32_t restarts() const { return restarts_; }

 protected:
    ~ImuPort() = default;

    static constexpr Nanoseconds retry_interval = 1'000'000'000;
    static constexpr unsigned max_failures =
        20;  ///< failed checks in a row before it is set up again

    /// Samples that were due but were not read: their numbers will be missing.
    void miss(std::uint32_t samples = 1) {
        number_ += samples;
        overrun_ = overrun_ || samples > 0;
    }

    /// A reading failed its check and gives no sample. False: too many failed in a row.
    bool count_error() {
        ++errors_;
        return ++failures_ < max_failures;
    }

    /// Gives the sample its number and flags. False: too many failed in a row.
    bool finish(wire::ImuSample& sample) {
        sample.imu = port_;
        sample.number = number_++;
        if (overrun_) sample.flags |= wire::imu_overrun;
        overrun_ = false;
        if (repeats(sample)) sample.flags |= wire::imu_repeated;
        const bool failed = (sample.flags & wire::imu_check_failed) != 0;
        if (failed || (sample.flags & wire::imu_self_test_failed) != 0) ++errors_;
        failures_ = failed ? failures_ + 1 : 0;
        return failures_ < max_failures;
    }

    void report_event(wire::BoardEventKind kind, Nanoseconds at, std::int64_t value,
                      std::uint16_t detail = 0) {
        reports_.event(kind, port_, at, value, detail);
    }
    void report_failure(wire::BoardEventKind kind, Nanoseconds at, std::int64_t value,
                        std::uint16_t detail = 0) {
        ++restarts_;
        failures_ = 0;
        miss();  // at least one, until it is running again
        report_event(kind, at, value, detail);
    }

    std::uint8_t port_;

 private:
    /// The same words as in the sample before: it was not updated.
    bool repeats(const wire::ImuSample& sample) {
        bool same = true;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            same = same && gyro_before_[axis] == sample.gyro[axis] &&
                   accel_before_[axis] == sample.accel[axis];
            gyro_before_[axis] = sample.gyro[axis];
            accel_before_[axis] = sample.accel[axis];
        }
        return same;
    }

    ChannelReports& reports_;
    std::int32_t gyro_before_[3] = {};
    std::int32_t accel_before_[3] = {};
    std::uint32_t number_ = 0;
    std::uint32_t errors_ = 0;
    std::uint32_t restarts_ = 0;
    unsigned failures_ = 0;
    bool overrun_ = false;
};

}  // namespace versavis::firmware

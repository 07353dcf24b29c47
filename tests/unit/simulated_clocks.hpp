// SPDX-License-Identifier: BSD-3-Clause
// A machine's clocks in virtual time: reads cost time, and whoever reads may be preempted; the
// clock may be slewed and set, and the machine suspended.
#pragma once

#include <map>

#include "engine/clock/system_clocks.hpp"

namespace versavis::test {

class SimulatedClocks final : public clock::SystemClocks {
 public:
    static constexpr std::int64_t start_ns = 1'700'000'000'000'000'000;

    std::int64_t read_ns(clock::SystemClock clock) override {
        ++reads;
        if (const auto at = preemptions_.find(reads); at != preemptions_.end()) pass(at->second);
        pass(read_cost / 2);
        const std::int64_t now_ns = value_ns(clock);
        pass(read_cost / 2);
        return now_ns;
    }
    clock::KernelState kernel_state() override { return kernel; }
    std::uint32_t times_set() override {
        ++looks;
        return times_set_;
    }

    /// What the clock says, without reading it.
    std::int64_t value_ns(clock::SystemClock clock) const {
        switch (clock) {
            case clock::SystemClock::monotonic_raw: return raw_ns_;
            case clock::SystemClock::monotonic: return monotonic_ns_;
            case clock::SystemClock::boottime: return monotonic_ns_ + slept_ns_;
            case clock::SystemClock::realtime: return monotonic_ns_ + realtime_minus_monotonic_ns_;
            case clock::SystemClock::tai:
                return value_ns(clock::SystemClock::realtime) +
                       kernel.tai_offset_s * 1'000'000'000LL;
        }
        return 0;
    }

    void pass(Duration duration) {
        raw_ns_ += duration.ns;
        slewed_ppb_ns_ += duration.ns % 1'000'000 * slew_ppb;
        monotonic_ns_ += duration.ns + duration.ns / 1'000'000 * slew_ppb / 1'000;
        monotonic_ns_ += slewed_ppb_ns_ / 1'000'000'000;
        slewed_ppb_ns_ %= 1'000'000'000;
    }

    void step(Duration by, bool notify = true) {
        realtime_minus_monotonic_ns_ += by.ns;
        if (notify) notify_of_set();
    }
    void notify_of_set() { ++times_set_; }

    void suspend(Duration duration) {
        slept_ns_ += duration.ns;
        step(duration);
    }

    /// One second is counted twice in UTC; TAI goes on.
    void insert_leap_second() {
        kernel.tai_offset_s += 1;
        step(-seconds(1));
    }

    /// The n-th read from now on comes so much later.
    void preempt(int nth, Duration duration) { preemptions_[reads + nth] = duration; }

    Duration read_cost = nanoseconds(30);
    std::int64_t slew_ppb = 0;
    clock::KernelState kernel;
    int reads = 0;
    int looks = 0;  ///< calls of times_set()

 private:
    std::int64_t raw_ns_ = 5'000'000'000;
    std::int64_t monotonic_ns_ = 5'001'000'000;
    std::int64_t slewed_ppb_ns_ = 0;  ///< what is left of less than a nanosecond, times 10^9
    std::int64_t realtime_minus_monotonic_ns_ = start_ns;
    std::int64_t slept_ns_ = 0;
    std::uint32_t times_set_ = 0;
    std::map<int, Duration> preemptions_;  ///< by number of the read
};

}  // namespace versavis::test

// SPDX-License-Identifier: BSD-3-Clause
// Board time: microseconds of the timer since the state machines started.
#pragma once

#include "base/hal.hpp"
#include "clocks.hpp"
#include "registers.hpp"

namespace versavis::rp2040 {

using firmware::Nanoseconds;

class BoardClock final : public firmware::Clock64 {
 public:
    /// Returns in the first part of a microsecond, which becomes 0.
    void begin() {
        const std::uint32_t before = timer().low;
        while (timer().low == before) {
        }
        began_us_ = before + 1;
    }

    /// The state machines have just started.
    void count_cycles() {
        constexpr std::uint32_t enable_from_processor = 5;
        cycle_counter().reload = most_cycles - 1;
        cycle_counter().current = 0;
        cycle_counter().control = enable_from_processor;
    }
    /// Until a cycle that is not more than 67 ms off, but for a constant.
    std::int32_t cycles_until(std::uint32_t cycle) const {
        return static_cast<std::int32_t>((cycle_counter().current + cycle) << 8U) >> 8U;
    }

    // Where 64 bits take too long: what is left of them when the higher ones are cut off.

    std::uint32_t low_ns() const { return (timer().low - began_us_) * 1000U; }
    std::uint32_t low_cycles() const { return (timer().low - began_us_) * (1000U / cycle_ns); }
    static std::uint32_t cycle_of(Nanoseconds at) { return static_cast<std::uint32_t>(at >> 3U); }
    /// What has these lower bits and is nearest to `now`.
    static Nanoseconds from_low_ns(std::uint32_t low_ns, Nanoseconds now) {
        return now + static_cast<std::int32_t>(low_ns - static_cast<std::uint32_t>(now));
    }

    Nanoseconds now() override { return since_begin(count()); }

    /// Of a count of the timer that is not yet old, or not far ahead.
    Nanoseconds at(std::uint32_t timer_us) const {
        const std::uint64_t newest = count();
        const auto ahead = static_cast<std::int32_t>(timer_us - static_cast<std::uint32_t>(newest));
        return since_begin(newest + static_cast<std::uint64_t>(std::int64_t{ahead}));
    }

 private:
    Nanoseconds since_begin(std::uint64_t count_us) const {
        const std::uint64_t us = count_us - began_us_;
        // Times 1000: to multiply 64 bits takes the processor three times as long, so the compiler
        // must not see that it is one.
        std::uint64_t eight = us << 3U;
        __asm__("" : "+r"(eight));
        return static_cast<Nanoseconds>((us << 10U) - (eight << 1U) - eight);
    }

    static std::uint64_t count() {
        std::uint32_t high = timer().high;
        for (;;) {
            const std::uint32_t low = timer().low;
            const std::uint32_t again = timer().high;
            if (again == high) return std::uint64_t{high} << 32U | low;
            high = again;
        }
    }

    static constexpr std::uint32_t most_cycles = 1U << 24U;

    std::uint32_t began_us_ = 0;
};

}  // namespace versavis::rp2040

// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/system_clocks.hpp"

#include <sys/timerfd.h>
#include <sys/timex.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <ctime>

#include "posix/file_descriptor.hpp"

namespace versavis::clock {

namespace {

constexpr time_t never_s = time_t{1} << 33U;  // in the year 2242

clockid_t clock_id(SystemClock clock) {
    switch (clock) {
        case SystemClock::monotonic_raw: return CLOCK_MONOTONIC_RAW;
        case SystemClock::monotonic: return CLOCK_MONOTONIC;
        case SystemClock::boottime: return CLOCK_BOOTTIME;
        case SystemClock::realtime: return CLOCK_REALTIME;
        case SystemClock::tai: return CLOCK_TAI;
    }
    return CLOCK_MONOTONIC_RAW;
}

class KernelClocks final : public SystemClocks {
 public:
    KernelClocks() : timer_(::timerfd_create(CLOCK_REALTIME, TFD_NONBLOCK | TFD_CLOEXEC)) { arm(); }

    std::int64_t read_ns(SystemClock clock) override {
        timespec now{};
        clock_gettime(clock_id(clock), &now);
        return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
    }

    KernelState kernel_state() override {
        timex kernel{};
        KernelState state;
        if (adjtimex(&kernel) < 0) {  // a sandbox forbids it
            state.error = errno;
            state.tai_offset_s = tai_offset_by_clocks();
            return state;
        }
        state.synchronised = (kernel.status & STA_UNSYNC) == 0;
        state.max_error = microseconds(kernel.maxerror);
        state.tai_offset_s = kernel.tai;
        if ((kernel.status & STA_INS) != 0) state.leap_s = 1;
        if ((kernel.status & STA_DEL) != 0) state.leap_s = -1;
        return state;
    }

    std::uint32_t times_set() override {
        std::uint64_t expirations = 0;
        if (timer_ && ::read(timer_.get(), &expirations, sizeof expirations) < 0 &&
            errno == ECANCELED) {
            ++times_set_;
            arm();
        }
        return times_set_;
    }

 private:
    /// Whole seconds: what passes between the readings does not matter.
    std::int32_t tai_offset_by_clocks() {
        const std::int64_t ahead_ns = read_ns(SystemClock::tai) - read_ns(SystemClock::realtime);
        return static_cast<std::int32_t>((ahead_ns + 500'000'000) / 1'000'000'000);
    }

    /// A timer that never ends but is cancelled when the clock is set. Without one (the kernel is
    /// older than that, or no descriptor is left) steps still show where the clocks are compared.
    void arm() {
        itimerspec end{};
        end.it_value.tv_sec = never_s;
        const int flags = TFD_TIMER_ABSTIME | TFD_TIMER_CANCEL_ON_SET;
        if (timer_ && ::timerfd_settime(timer_.get(), flags, &end, nullptr) != 0 &&
            errno == ECANCELED)
            ++times_set_;  // again, since it was read
    }

    FileDescriptor timer_;
    std::atomic<std::uint32_t> times_set_{0};
};

}  // namespace

std::shared_ptr<SystemClocks> kernel_clocks() { return std::make_shared<KernelClocks>(); }

}  // namespace versavis::clock

// SPDX-License-Identifier: BSD-3-Clause
// Host time to the clock that the user chose for published stamps.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/clock/system_clocks.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

enum class OutputClockKind { realtime, tai, monotonic_raw };
const char* to_string(OutputClockKind kind);

/// Output clock against host clock at one moment, and in which span of continuous time that was.
struct OutputReading {
    HostTime at;
    Duration minus_host;   ///< output clock minus host clock
    Duration uncertainty;  ///< minus_host is not farther from the truth than that
    std::uint32_t steps =
        0;  ///< before this reading; readings of equal `steps` differ by slewing alone
};

/// Reads the output clock between two reads of the host clock, so that a preempted read cannot bend
/// the translation, and detects steps: CLOCK_MONOTONIC and the output clock are slewed alike, and
/// only steps separate them. Steps too small for this comparison are reported by the kernel a
/// little later. Not thread-safe; Translator calls it under its lock.
class OutputClock {
 public:
    /// Error: TAI was asked for, but the kernel does not know its offset from UTC. `force_tai`:
    /// then the kernel's CLOCK_TAI is taken as it is, equal to UTC.
    static Expected<OutputClock> create(OutputClockKind kind, bool force_tai = false,
                                        std::shared_ptr<SystemClocks> clocks = kernel_clocks());

    /// Output clock against host clock, now.
    OutputReading read();

    /// Output clock minus host clock, now.
    Duration offset() { return read().minus_host; }

    /// Steps of the output clock that were seen by read(), suspends of the host included.
    std::uint32_t steps() const { return steps_; }

    /// Suspends of the host that were seen: the host clock stood still, while the board's and the
    /// world's went on.
    std::uint32_t suspends() const { return suspends_; }

    OutputClockKind kind() const { return kind_; }
    KernelState kernel_state() const { return clocks_->kernel_state(); }

 private:
    struct BracketedReading {
        HostTime before;
        HostTime after;
        std::int64_t output_ns;
        std::int64_t monotonic_ns;

        Duration width() const { return after - before; }
    };
    /// Bounds of a difference of two clocks that were not read at the same time.
    struct Bounds {
        std::int64_t low_ns;
        std::int64_t high_ns;
    };

    OutputClock(OutputClockKind kind, std::shared_ptr<SystemClocks> clocks);

    HostTime read_host() { return {clocks_->read_ns(SystemClock::monotonic_raw)}; }
    BracketedReading read_bracketed();
    BracketedReading best_bracketed();
    Bounds slept();
    bool stepped_from_monotonic(const BracketedReading& reading);
    bool was_suspended();
    bool was_set(HostTime now, bool seen_step);
    void look_for_steps(HostTime now, bool seen_step);

    OutputClockKind kind_;
    std::shared_ptr<SystemClocks> clocks_;
    Bounds against_monotonic_{INT64_MIN / 2, INT64_MAX / 2};  ///< at first: anything
    Bounds slept_;
    std::uint32_t times_set_ = 0;
    HostTime set_is_known_until_;  ///< the kernel may still report a step that was seen already
    HostTime next_look_;
    std::uint32_t steps_ = 0;
    std::uint32_t suspends_ = 0;
};

}  // namespace versavis::clock

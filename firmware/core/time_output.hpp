// SPDX-License-Identifier: BSD-3-Clause
// The time for LiDARs and others: a pulse at each whole second of UTC, and sentences that name it.
#pragma once

#include "base/hal.hpp"
#include "grid_clock.hpp"
#include "nmea_writer.hpp"
#include "output_queue.hpp"

namespace versavis::firmware {

/// One time output. The host says where a second lies and repeats it; between its messages and for
/// the holdover after the last one, pulses go on at the pace it gave. A message that does not fit
/// the one before makes the output silent until two agree: no receiver gets a wrong second. While
/// the time is not known there are no pulses, and sentences without a time. Part of Board, called
/// from Board::poll() only.
class TimeOutput {
 public:
    TimeOutput(OutputQueue& outputs, ImuUart& uart) : outputs_(outputs), uart_(uart) {}

    /// Pulses leave at `output` from now on; the message is within its limits.
    void take(const wire::TimeOutput& message, unsigned output, Nanoseconds now);

    /// The time is no longer known.
    void doubt();

    /// Its output and its line belong to others from now on. Of one that has none, nothing.
    void release(Nanoseconds now);

    bool uses(unsigned output) const { return configured_ && output_ == output; }
    unsigned output() const { return output_; }
    std::uint32_t baud() const { return settings_.baud; }
    bool sends_sentences() const { return configured_ && settings_.baud != 0; }

    /// A pulse of `output` left late: nothing may name it.
    void late(unsigned output) {
        if (uses(output)) pulse_.on_time = false;
    }

    /// True: `event` says which pulse was sent.
    bool poll(Nanoseconds now, wire::Event& event);

    Nanoseconds next_wake() const;

 private:
    /// The newest one; of its instants, those that are still to come, else `never`.
    struct Pulse {
        std::int64_t utc_s = 0;
        Nanoseconds began = 0;
        Nanoseconds ends = never;
        Nanoseconds reported = never;
        bool on_time = false;
    };

    bool idle_level() const { return (settings_.flags & wire::time_pulse_inverted) != 0; }
    Nanoseconds pulse_time() const;
    void set_up(const wire::TimeOutput& message, unsigned output, Nanoseconds now);
    void follow(const wire::TimeOutput& message, Nanoseconds now);
    void distrust();
    void skip_to(Nanoseconds at);
    void begin_pulse(Nanoseconds now);
    void begin_sentences(Nanoseconds at, bool named);
    void send_sentence(Nanoseconds now);

    OutputQueue& outputs_;
    ImuUart& uart_;
    bool configured_ = false;
    bool heard_ = false;    ///< `line_` is of a message
    bool trusted_ = false;  ///< two in a row agreed
    bool named_ = false;    ///< the sentences under way name `pulse_`; else the time is not known
    unsigned output_ = 0;
    unsigned sentence_ = 0;  ///< the next one, by its bit
    wire::TimeOutput settings_{};
    GridLine line_;  ///< board time over UTC
    Nanoseconds holds_until_ = 0;
    std::int64_t next_second_ = 0;  ///< of UTC, of the next pulse
    Nanoseconds next_pulse_ = 0;
    Pulse pulse_;
    Nanoseconds send_at_ = never;   ///< the next sentence
    Nanoseconds next_unknown_ = 0;  ///< when sentences say again that the time is not known
};

}  // namespace versavis::firmware

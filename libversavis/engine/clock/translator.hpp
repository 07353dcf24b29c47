// SPDX-License-Identifier: BSD-3-Clause
// Board time to published stamps, for all threads: envelope filter, output clock and epoch in one
// place.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/output_clock.hpp"
#include "engine/clock/pps_reference.hpp"
#include "engine/clock/stream_witnesses.hpp"

namespace versavis::clock {

/// An instant in all the clocks that are published, and how good it is.
struct Stamp {
    OutputTime output;
    HostTime host;
    std::uint32_t sigma_ns = 0;
    std::uint32_t epoch = 0;
    ClockState state = ClockState::init;
    bool second_doubted = false;  ///< off by whole seconds, perhaps: see SecondConflict
};

/// Where a whole second of the output clock lies on the board's.
struct BoardSecond {
    BoardTime board;
    HostTime host;
    OutputTime output;
    double skew_ppm = 0;  ///< host clock against board clock
    Duration sigma;
    std::uint32_t epoch = 0;
    ClockState state = ClockState::init;
};

/// Where a subtracted asymmetry comes from.
enum class AsymmetrySource { none, stored, pps };
const char* to_string(AsymmetrySource source);

/// The clock's part of the status document.
struct ClockReport {
    ClockState state = ClockState::init;
    OutputClockKind output = OutputClockKind::realtime;
    Duration sigma;
    Duration bound;  ///< what the error cannot exceed, however unequal the link's directions are
    Duration residual;
    Duration innovation;  ///< by which the newest slot moved the estimate
    Duration since_contact;
    Duration round_trip;
    Duration smallest_round_trip;
    Duration output_minus_host;
    double skew_ppm = 0;
    double skew_sigma_ppm = 0;
    std::uint64_t exchanges = 0;
    std::uint64_t one_way_messages = 0;
    std::uint64_t slots = 0;
    std::uint64_t surprises = 0;
    std::uint64_t restarts = 0;
    std::uint32_t epoch = 0;
    std::uint32_t output_steps = 0;
    std::uint32_t host_suspends = 0;
    KernelState kernel;
    PpsReport pps;
    AsymmetrySource asymmetry_source = AsymmetrySource::none;
    Asymmetry asymmetry;
};

/// How far the estimate of the board's clock has come.
struct ClockContact {
    std::uint32_t life = 0;       ///< estimates before this one
    std::uint64_t exchanges = 0;  ///< of all estimates; those at once are one
    bool contradicted = false;    ///< the newest exchange and the estimate disagree: one is wrong
};

/// Output clock against host clock at one moment, and the epoch of stamps that are made by it.
struct OutputRelation {
    HostTime host;
    Duration minus_host;
    Duration uncertainty;
    std::uint32_t epoch = 0;
};

/// The only place that turns board time into stamps: estimate of the board's clock, PPS, output
/// clock and epochs together. Thread-safe: the thread of the link adds messages, any thread
/// translates.
class Translator {
 public:
    /// `first_epoch`: the number of the first one, before the board was met.
    explicit Translator(OutputClock output, PpsLabels labels = PpsLabels::off,
                        std::uint32_t first_epoch = 0,
                        SecondConflict on_conflict = SecondConflict::flag)
        : first_epoch_(first_epoch), output_(std::move(output)), pps_(labels, on_conflict) {}

    /// The board restarted: what was known about its clock is void, and a new epoch begins.
    void board_restarted();

    /// Starts a new epoch because later stamps may not be comparable with earlier ones.
    void begin_epoch();

    void add(const Exchange& exchange);
    void add(const OneWay& message);
    ClockContact contact() const;

    /// A message that its own stream confirms, and the time that it took, shows that the board's
    /// clock did not step.
    void clock_continues();

    /// A stream of messages that are compared with the exchanges, those of the other streams, and
    /// each other: see StreamWitnesses. `fits`: it agrees with those of its stream before it.
    std::size_t add_stream(Witness witness);
    void heard(std::size_t stream, const OneWay& message, bool fits);
    std::optional<Duration> departure(std::size_t stream) const;
    bool steers(std::size_t stream) const;
    std::optional<bool> confirms_others(std::size_t stream) const;

    /// The board saw a pulse of PPS, or a receiver says which second, ns since 1970, that pulse
    /// began. The latter returns by how many seconds labels and host differ, when that changes.
    void pps_pulse(BoardTime at);
    std::optional<std::int64_t> pps_label(BoardTime at, std::int64_t utc_ns);

    /// What an earlier measurement at this port said; none: nothing is known of this port.
    void use_asymmetry(const std::optional<Asymmetry>& stored);

    /// None before two exchanges agree.
    std::optional<Stamp> translate(BoardTime board);

    /// The first whole second of the output clock after `now`. None before two exchanges agree.
    std::optional<BoardSecond> next_second(HostTime now);

    /// Host time alone, without reading the output clock.
    std::optional<HostEstimate> to_host(BoardTime board) const;

    /// Stamp of an instant that was seen on the host clock, not by the board.
    Stamp translate(HostTime host, Duration sigma);

    OutputRelation output_now();

    ClockReport report();

 private:
    /// Epoch of stamps that are made by `output`.
    std::uint32_t epoch(const OutputReading& output) const {
        return first_epoch_ + clock_life() + jumps_ + output.steps;
    }
    std::uint32_t clock_life() const {
        return board_lives_ + static_cast<std::uint32_t>(filter_.restarts());
    }
    void correct_link();
    std::optional<OutputEstimate> by_pps(BoardTime board, OutputTime by_link);

    std::uint32_t first_epoch_;
    mutable std::mutex mutex_;
    EnvelopeFilter filter_;
    StreamWitnesses witnesses_;
    OutputClock output_;
    PpsReference pps_;
    bool pps_used_ = false;
    Duration pps_minus_link_;  ///< when it was used last
    BoardTime newest_;         ///< instant that was asked for in this life of the board
    AsymmetrySource asymmetry_source_ = AsymmetrySource::none;
    Asymmetry asymmetry_;
    std::uint32_t board_lives_ = 0;
    /// PPS took over from the link, or the other way, and they disagreed; or a stream was off.
    std::uint32_t jumps_ = 0;
};

}  // namespace versavis::clock

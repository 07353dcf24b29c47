// SPDX-License-Identifier: BSD-3-Clause
// Matches the edges of one exposure line to the triggers that were sent: one record for each
// trigger, whatever happens.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/channel_reports.hpp"

namespace versavis::firmware {

/// Matches the edges of an exposure line to the triggers that were sent, and reports one record for
/// each trigger, in order. Part of CameraChannel, called from Board::poll() only.
class ExposureTracker {
 public:
    ExposureTracker(std::uint8_t camera, ChannelReports& reports)
        : camera_(camera), reports_(reports) {}

    /// `patience`: how long after it was expected a start may still come.
    void configure(const wire::CameraConfiguration& configuration, Nanoseconds patience);

    bool full() const { return count_ == max_pending; }
    bool empty() const { return count_ == 0; }

    /// A trigger that was sent, or is set to leave; times increase.
    void add(const wire::Exposure& record, Nanoseconds expected);

    /// The trigger due at `asked` left at `left`.
    void moved(Nanoseconds asked, Nanoseconds left, bool late);

    /// Takes an edge of the exposure line; edges come in order. Returns the trigger of an exposure
    /// that it completed, with its duration; trigger 0: it completed none.
    struct Completed {
        std::uint64_t trigger;
        Nanoseconds duration;
    };
    Completed edge(Nanoseconds at, bool exposing);

    /// Edges were lost: an end that arrives now may not belong to the exposure whose start was
    /// seen.
    void edges_lost();

    /// Gives up on what did not happen; all edges before `settled` were passed on.
    void expire(Nanoseconds settled);

    /// Stops waiting for all of them.
    void give_up();

    /// When the newest exposure will have ended, as far as is known; the edges before `settled`
    /// are.
    Nanoseconds busy_until(Nanoseconds settled) const;

    /// Grid point of the newest trigger before `at`; 0: there was none.
    std::uint64_t tick_at(Nanoseconds at) const;

    /// When expire() has something to do next.
    Nanoseconds next_deadline() const;

 private:
    /// A trigger whose record is not complete.
    struct PendingExposure {
        wire::Exposure record;
        Nanoseconds expected;  ///< duration
    };
    static constexpr std::size_t max_pending = 4;

    bool has(wire::CameraFlag flag) const { return (configuration_.flags & flag) != 0; }
    bool started(const PendingExposure& exposure) const {
        return exposure.record.start_ns != wire::no_time;
    }
    Nanoseconds deadline(const PendingExposure& exposure) const;
    void start_edge(Nanoseconds at);
    Completed end_edge(Nanoseconds at);
    void predict_edges(PendingExposure& exposure) const;
    void finish_first(std::uint16_t flags);

    std::uint8_t camera_;
    ChannelReports& reports_;
    wire::CameraConfiguration configuration_{};
    Nanoseconds patience_ = 0;
    Nanoseconds period_ = 0;
    Nanoseconds last_end_ = -never;  ///< when the newest finished exposure ended, or was given up
    std::uint64_t last_tick_ = 0;    ///< of the newest finished record
    std::size_t count_ = 0;
    PendingExposure pending_[max_pending];  ///< only the first can have started
};

}  // namespace versavis::firmware

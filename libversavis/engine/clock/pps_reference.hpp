// SPDX-License-Identifier: BSD-3-Clause
// PPS as the judge of the link: names the seconds of its pulses, decides when its map is used, and
// measures what the link does unequally to its two directions.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/clock/asymmetry.hpp"
#include "engine/clock/estimate.hpp"
#include "engine/clock/output_clock.hpp"
#include "engine/clock/pps_map.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

/// Which source labels the second that a pulse begins.
enum class PpsLabels {
    off,   ///< pulses are not used
    host,  ///< the output clock, which the same source of time disciplines
    nmea,  ///< a receiver at the board's UART
};

/// What to do where a receiver's label differs from the host's clock by whole seconds. One of the
/// two does not know of a leap second, or of the difference between GPS time and UTC.
enum class SecondConflict {
    flag,      ///< the receiver's second is used, and stamps say that it is doubted
    receiver,  ///< it is right
    host,      ///< the host's clock is right, while it is disciplined
};

enum class PpsState { off, waiting, used, lost };
const char* to_string(PpsState state);

struct PpsReport {
    PpsState state = PpsState::off;
    Duration residual;  ///< newest pulse by link and host less its second
    std::uint64_t pulses = 0;
    std::uint64_t rejected = 0;          ///< that did not fit those before
    std::int64_t second_difference = 0;  ///< of the receiver's labels less the host's clock
};

/// Follows the PPS pulses, gives stamps by them while they are good, and measures the link's
/// asymmetry. Not thread-safe: Translator calls it under its lock.
class PpsReference {
 public:
    explicit PpsReference(PpsLabels labels = PpsLabels::off,
                          SecondConflict on_conflict = SecondConflict::flag)
        : labels_(labels), on_conflict_(on_conflict) {}

    /// The board saw a pulse. `by_link`: its instant as the messages have it; `output`: the output
    /// clock now; `disciplined`: the kernel reports that CLOCK_REALTIME is disciplined.
    void pulse(BoardTime at, const HostEstimate& by_link, const OutputReading& output,
               bool disciplined);

    /// A receiver says that the pulse at `at` began this second. The host's clock has a second
    /// opinion while it is disciplined, and otherwise only where the two differ by whole seconds
    /// so exactly that it is no accident.
    void label(BoardTime at, OutputTime second, const HostEstimate& by_link,
               const OutputReading& output, bool disciplined);

    /// Whole seconds by which labels and host differ, as several labels in a row agree; 0: they do
    /// not, or the host has no opinion.
    std::int64_t second_difference() const { return second_difference_; }

    /// Output times may be off by whole seconds.
    bool second_doubted() const {
        return second_difference_ != 0 && on_conflict_ == SecondConflict::flag;
    }

    /// By the pulses; `newest`: the latest instant that is known of. None: they are not used by
    /// then.
    std::optional<OutputEstimate> translate(BoardTime board, BoardTime newest) const;

    void board_restarted();

    /// The asymmetry that is left in `by_link`, after 32 pulses that the host's own clock named.
    std::optional<Asymmetry> left_in_link() const;
    /// `by_link` is corrected by what was measured: start over.
    void link_corrected();

    PpsReport report(BoardTime now) const;

 private:
    void compare(Duration by_host_less_label, bool disciplined);
    void add(BoardTime at, OutputTime second, Duration residual);
    void measure(Duration residual);

    PpsLabels labels_;
    SecondConflict on_conflict_;
    std::int64_t second_difference_ = 0;
    std::int64_t newest_difference_ = 0;  ///< by the newest label ...
    int labels_agree_ = 0;                ///< ... and so many in a row
    PpsMap map_;
    std::optional<BoardTime> trusted_at_;  ///< newest pulse that the map trusted
    Duration residual_;
    unsigned measured_ = 0;
    double mean_ns_ = 0;
    double spread_ns_ = 0;  ///< mean distance from the mean
};

}  // namespace versavis::clock

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

enum class PpsState { off, waiting, used, lost };
const char* to_string(PpsState state);

struct PpsReport {
    PpsState state = PpsState::off;
    Duration residual;  ///< newest pulse by link and host less its second
    std::uint64_t pulses = 0;
    std::uint64_t rejected = 0;  ///< that did not fit those before
};

/// Follows the PPS pulses, gives stamps by them while they are good, and measures the link's
/// asymmetry. Not thread-safe: Translator calls it under its lock.
class PpsReference {
 public:
    explicit PpsReference(PpsLabels labels = PpsLabels::off) : labels_(labels) {}

    /// The board saw a pulse. `by_link`: its instant as the messages have it; `output`: the output
    /// clock now; `disciplined`: the kernel reports that CLOCK_REALTIME is disciplined.
    void pulse(BoardTime at, const HostEstimate& by_link, const OutputReading& output,
               bool disciplined);

    /// A receiver says that the pulse at `at` began this second.
    void label(BoardTime at, OutputTime second, const HostEstimate& by_link,
               const OutputReading& output);

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
    void add(BoardTime at, OutputTime second, Duration residual);
    void measure(Duration residual);

    PpsLabels labels_;
    PpsMap map_;
    std::optional<BoardTime> trusted_at_;  ///< newest pulse that the map trusted
    Duration residual_;
    unsigned measured_ = 0;
    double mean_ns_ = 0;
    double spread_ns_ = 0;  ///< mean distance from the mean
};

}  // namespace versavis::clock

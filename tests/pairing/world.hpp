// SPDX-License-Identifier: BSD-3-Clause
// Camera, trigger board and USB link in virtual time, all that can fail of them, and the judge of
// what pairing makes of it.
#pragma once

#include <cstdint>
#include <map>
#include <queue>
#include <random>
#include <string>
#include <vector>

#include "engine/pairing/block_id.hpp"
#include "engine/pairing/pairing.hpp"
#include "engine/pairing/record_filter.hpp"

namespace versavis::test {

enum class FaultKind {
    trigger_ignored,
    frame_lost,
    last_packet_lost,
    leader_lost,
    frames_reordered,
    duplicate_id,
    id_wrap,
    id_restart,
    clock_jump,
    camera_reboot,
    board_reset,
    record_lost,
    record_late,
    usb_stall,
    stale_frame,
    cameras_swapped,
    board_time_step,       ///< by whole periods or not, in all that the board says, ...
    board_time_step_grid,  ///< ... and its grid follows
    lying_record,          ///< one number of one record is wrong
};
inline constexpr std::size_t fault_kinds = 19;
const char* to_string(FaultKind kind);

enum class WorldClock { good, drifting, absent };
const char* to_string(WorldClock clock);

struct WorldSettings {
    std::uint64_t seed = 1;
    double rate_hz = 20;
    WorldClock clock = WorldClock::good;
    bool clock_known_absent = true;  ///< the service was reported, or found out from the camera
    bool wide_ids = false;           ///< 64 bits, else 16
    std::uint64_t first_id = 1;
    bool strobe = true;              ///< the exposure line is wired
    bool ids_count_ignored = false;  ///< the camera numbers triggers that it ignores
    bool chunks = false;             ///< frames carry their exposure time, which varies
    pairing::Instant stamped = pairing::Instant::start;  ///< by the camera
    Duration readout_start;                              ///< the stamp is so much later than that
    pairing::Instant told_stamped = pairing::Instant::unknown;  ///< to pairing
    Duration exposure;        ///< 0: 2 ms or a third of the period, and it follows the light
    Duration other_exposure;  ///< from `switched_every` to the same number of pulses later ...
    std::uint64_t switched_every = 0;  ///< ... and so on; 0: never
    bool compensated = false;  ///< the board keeps the middles of exposures on its grid, not starts
    Duration readout = microseconds(2500);
    Duration jitter = microseconds(1500);  ///< of the arrival, either way
    double late_frames =
        0.005;  ///< share of frames that the host is slow to take, by 40 ms at most
    Duration record_delay = microseconds(500);  ///< of each record, on its way to the host
    double held_records = 0;  ///< share of records that the link holds up, by two periods at most
    double link_load = 0;     ///< time that a frame takes on the link, in periods; above 1 frames
                              ///< queue in the camera, and triggers are lost when three wait
    bool drops_after_exposure = false;  ///< ... not ignored, but exposed and then dropped
    Duration shortest_period;  ///< triggers that come sooner after one that was taken are ignored
    double ignored = 0;        ///< share of triggers that the camera ignores
    double doubled = 0;        ///< share of triggers that it answers with two frames
    std::map<std::uint64_t, FaultKind> faults;  ///< by the number of the pulse at which they happen
    std::uint64_t pulses = 300;
};

struct Verdict {
    std::uint64_t frames = 0;  ///< that arrived whole
    std::uint64_t published = 0;
    std::uint64_t wrong = 0;
    std::uint64_t withheld = 0;  ///< ... although it was whole
    std::uint64_t withheld_needlessly =
        0;                             ///< ... more than five frames after the last fault had ended
    std::uint64_t suspects_wrong = 0;  ///< guesses that are not the true exposure
    std::uint64_t lies_published = 0;  ///< with the right trigger, but another instant than the
                                       ///< camera stamped, although it was known which one that is
    std::uint64_t locks = 0;
    std::uint64_t slips = 0;
    pairing::Instant stamped = pairing::Instant::unknown;  ///< found out in the end
    std::uint64_t starts = 0;                              ///< after the first
    std::map<EventReason, std::uint64_t> frame_reasons;
    std::map<EventReason, std::uint64_t> exposure_reasons;
    Duration first_published;          ///< since the start was asked for
    std::vector<Duration> recoveries;  ///< from the end of an outage to the first published frame
    std::uint64_t longest_relock = 0;  ///< frames from a slip to the next published one
    pairing::State final_state = pairing::State::searching;
    Duration unproved_at_end;  ///< frames came for so long after the last that was published
};

/// Runs one world. The same settings lead to the same verdict.
Verdict run_world(const WorldSettings& settings);

}  // namespace versavis::test

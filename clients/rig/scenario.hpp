// SPDX-License-Identifier: BSD-3-Clause
// What is in the rig and what fails when, from a TOML file (docs/user/rig.md).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "gige_hostile.hpp"
#include "ptp_follower.hpp"
#include "skewed_clock.hpp"
#include "versavis/error.hpp"

namespace versavis::rig {

struct BoardScenario {
    std::string serial = "RIG0001";
    std::string image;  ///< of the firmware, to run on the emulated chip; empty: as a host process
    ClockErrors clock{5'000'000'000, 25.0, 0.002};
    double link_ms = 0;  ///< every byte takes so long, either way
    bool gnss = false;   ///< a receiver delivers time pulses and sentences, from CLOCK_REALTIME
    double sync_hz = 0;  ///< pulses of another board at the sync input; 0: none
    double sync_skew_ppm = 0;  ///< how much faster that board's clock runs than true time
};

/// How the rig moves: sums of sines that the seed draws. Without it, it nods.
struct MotionScenario {
    bool nods = true;
    std::vector<double> rate_rad_s{0.4, 0.4, 0.4};   ///< RMS rate of roll, pitch and yaw
    std::vector<double> acceleration_m_s2{0, 0, 0};  ///< RMS, along x, y and z of the world
    double lowest_hz = 0.1;
    double highest_hz = 2;
    unsigned tones = 12;  ///< of each of the six
};

/// The LED timing board: it counts rising edges of an output of the board.
struct LedScenario {
    bool present = false;
    unsigned output = 7;          ///< firmware::Output
    bool high_bit_first = false;  ///< of the count of strides, seen from the striding LEDs
    bool backward = false;        ///< the striding LEDs run towards the first LED
};

/// What a camera stamps: an instant of the exposure, or when its frame begins to leave.
enum class Stamped { start, middle, end, readout };

/// What its exposure line shows.
enum class LineShows { exposure, trigger, fixed, readout };

struct CameraScenario {
    std::string name;
    std::string address;    ///< loopback address that the camera answers on
    unsigned output = 0;    ///< of the board, that triggers it
    int input = -1;         ///< of the board, that its exposure line is wired to; -1: as the output
    int second_input = -1;  ///< that it is wired to as well; -1: none
    int aux_input = -1;     ///< auxiliary one that its line is wired to, where scheduled actions
                            ///< trigger it; -1: none
    LineShows line = LineShows::exposure;
    bool line_inverted = false;     ///< low while it exposes
    bool trigger_inverted = false;  ///< its trigger wire
    bool free_runs = false;         ///< whatever its TriggerMode says
    std::string serial;
    std::uint32_t width = 1920;
    std::uint32_t height = 1200;
    double exposure_us = 3000;
    double exposure_swing =
        0;  ///< auto exposure follows a brightness that varies by this fraction ...
    double exposure_swing_s = 7;  ///< ... with this period
    double trigger_latency_us = 20;
    Stamped stamps = Stamped::start;
    double line_rising_us = 0;       ///< how late its exposure line rises ...
    double line_falling_us = 0;      ///< ... and falls
    double readout_us = 2000;        ///< end of exposure to first packet
    double link_mbps = 1000;         ///< packets leave at this pace; 0: as fast as they can
    double packet_loss = 0;          ///< fraction
    double answer_ms = 0;            ///< each answer of the control channel takes so long
    bool extended_ids = false;       ///< block ids of 64 bits
    bool ids_count_ignored = false;  ///< an ignored trigger also takes a block id
    bool events = true;              ///< it has a message channel, for those of its exposures
    bool early_leader = false;       ///< a frame's leader is sent when its exposure begins
    double shortest_period_us = 0;   ///< triggers that come sooner are ignored
    double ignored = 0;              ///< share of triggers that it ignores, at random
    std::uint64_t double_every = 0;  ///< every n-th trigger that it takes makes two frames; 0: none
    double clock_rate = 1;           ///< ticks of its clock in a nanosecond; it says that it is one
    double light =
        0;  ///< brightness of the image per millisecond of exposure; 0: independent of it
    double focal_px = 0;      ///< of the pinhole that sees the moving world; 0: 0.8 x width
    unsigned blur_steps = 3;  ///< instants of the exposure whose mean the picture is
    double noise = 0;         ///< standard deviation of its pixels
    std::vector<double> imu_rotation_deg{0, 0, 0};  ///< rotation vector, from IMU to camera
    std::vector<double> leds{};  ///< centres of the outermost LEDs, x and y each; none: not in view
    double led_level = 160;      ///< brightness of an LED that is lit during the whole exposure
    double temperature_c = 45;
    bool auto_gain = false;       ///< frame n is taken with n mod 10 dB
    double ptp_lock_s = 0.5;      ///< until its clock follows PTP, once it is switched on
    double ptp_error_ns = 0;      ///< that it is then off its master ...
    double ptp_swing_ns = 100;    ///< ... and by how much that swings
    double action_jitter_us = 0;  ///< of the instant at which it takes a scheduled action
    Hostility hostility = Hostility::none;
    std::string model{};  ///< whose description it offers; empty: the rig's own
    ClockErrors clock{1'000'000'000, -40.0, 0};
};

enum class FaultKind {
    drop_frame,   ///< the exposure happens, no packet leaves
    drop_leader,  ///< the frame's first packet never leaves, not even when it is asked for again
                  ///< ...
    drop_last,    ///< ... nor its last ones
    half_frame,   ///< the frame ends in the middle, as if it were whole
    swap_frames,  ///< the frame leaves after the next one
    repeat_id,    ///< the frame has the number of the one before
    restart_ids,  ///< numbers start again
    jump_clock,   ///< the camera's clock steps by `seconds`, from this frame on
    change_size,  ///< from this frame on they have half the height
    stop_clock,   ///< the camera's clock stands still, since the frame before
    lose_ptp,     ///< the camera reports that its clock lost PTP, and then that it has it again; if
                  ///< it follows PTP, it hears no master for `seconds`
    ptp_master,   ///< the camera says for `seconds` that it is a PTP master, and drifts
    ptp_foreign,  ///< for `seconds` it follows another master, whose time is `delay_ms` ahead
    utc_stamps,   ///< the frame's stamp lacks what PTP's time is ahead of UTC
    double_frame,     ///< the camera exposes once more, right after, for the same trigger
    double_exposure,  ///< the camera doubles its ExposureTime by itself
    ignore_trigger,   ///< the camera does not expose
    camera_mute,      ///< no answer and no packet for `seconds`
    camera_reboot,    ///< mute for `seconds`, then all registers as after power-up
    lose_packets,     ///< a `share` of the packets never leaves, not even when asked for again
    block_large,      ///< no packet above 1500 bytes gets through
    cut_strobe,       ///< the exposure line shows nothing
    // Of the board, for `seconds`; `camera` names whose exposures count.
    board_reset,   ///< the board restarts with another nonce
    board_gone,    ///< it is unplugged
    board_mute,    ///< it neither reads nor writes
    late_records,  ///< what it writes arrives `delay_ms` late
    imu_missing,   ///< nobody drives the line of the IMU's answers, which reads as ones
    imu_noisy,     ///< bits of the IMU's bursts are wrong
    imu_stuck,     ///< no transfer of the IMU ends
};
constexpr std::size_t fault_kinds = static_cast<std::size_t>(FaultKind::imu_stuck) + 1;
constexpr bool of_board(FaultKind kind) { return kind >= FaultKind::board_reset; }

struct Fault {
    FaultKind kind = FaultKind::drop_frame;
    std::string camera;
    std::uint64_t at_exposure =
        0;  ///< happens with this exposure of the camera, counted since the rig's start
    std::uint64_t count = 1;  ///< this many exposures in a row
    double seconds = 1;       ///< negative for a clock that steps back
    double share = 0.5;
    double delay_ms = 600;
};

struct Scenario {
    std::uint64_t seed = 1;
    BoardScenario board;
    std::string imu = "imu0";
    PtpScenario ptp;
    MotionScenario motion;
    LedScenario leds;
    std::vector<CameraScenario> cameras;
    std::vector<Fault> faults;
};

/// Errors name line and column.
Expected<Scenario> load_scenario(const std::string& path);

}  // namespace versavis::rig

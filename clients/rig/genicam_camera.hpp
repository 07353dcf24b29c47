// SPDX-License-Identifier: BSD-3-Clause
// An emulated GenICam camera: trigger input, exposure line, clock, registers and frames. A
// transport connects it to the host.
#pragma once

#include <atomic>
#include <bit>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "camera_registers.hpp"
#include "camera_transport.hpp"
#include "camera_view.hpp"
#include "frame_queue.hpp"
#include "ground_truth.hpp"
#include "ptp_follower.hpp"
#include "scenario.hpp"

namespace versavis::rig {

/// Where a trigger pulse came from.
struct TriggerPulse {
    std::uint64_t board_life = 0;
    std::uint64_t trigger = 0;
    HostTime at;
};

/// When the exposure line is active.
struct LineActive {
    HostTime begin;
    HostTime end;
    bool inverted = false;  ///< by the camera: low meanwhile
    unsigned times = 1;     ///< that it is so, for exposures that follow each other ...
    Duration every{};       ///< ... after so long
};

/// What cameras and board share.
struct World {
    const Scenario& scenario;
    HostTime zero;
    Surroundings& surroundings;
    GroundTruth& truth;
};

class GenicamCamera {
 public:
    /// `transport` outlives the camera.
    GenicamCamera(const World& world, const CameraScenario& settings, const CameraFamily& family,
                  TransportMemory memory, CameraTransport& transport);
    GenicamCamera(const GenicamCamera&) = delete;
    GenicamCamera& operator=(const GenicamCamera&) = delete;

    // For the board. Callable from any thread.

    /// The trigger line changed; `level` as on the wire. Returns when the exposure line is active,
    /// if it exposes, and shows it.
    std::optional<LineActive> trigger_line(bool level, const TriggerPulse& pulse);
    /// Calls `afflict` at each fault of the board that begins with an exposure of this camera.
    void afflict_board(std::function<void(const Fault&)> afflict);
    /// Calls `show` with each exposure that a scheduled action makes, before it begins.
    void show_actions(std::function<void(const LineActive&)> show);
    const CameraScenario& settings() const { return settings_; }

    // For the transport.

    CameraRegisters& registers() { return registers_; }
    enum class Written { done, locked, no_such };
    /// As the host does: it may start or stop the acquisition, or trigger.
    Written write(std::uint32_t address, std::span<const std::uint8_t> bytes);
    void stop_acquisition();
    /// As if it were powered off and on.
    void restart();
    /// Exposes where the camera runs freely: to be called all the time. True: it has just rebooted,
    /// and its registers are as after power-up.
    bool poll(HostTime now);
    /// It neither hears nor answers.
    bool muted() const { return host_now().ns < muted_until_ns_.load(); }
    /// What its clock shows.
    std::uint64_t ticks(HostTime at) const;

    /// What it makes of a scheduled action.
    enum class Action { taken, no_time, queue_full, late };
    Action schedule(std::uint64_t ticks);
    /// poll() should be called more often.
    bool awaits_action();
    static constexpr std::uint32_t action_queue_size = 2;

 private:
    using Interval = std::pair<HostTime, HostTime>;
    void start_acquisition();
    void free_run(HostTime now);
    void take_actions(HostTime now);
    void suffer_ptp_faults(HostTime at);
    void latch_ptp();
    void latch_clock();
    std::optional<Interval> expose(HostTime trigger, const TriggerPulse* pulse);
    std::vector<Interval> take_trigger(const TriggerPulse& pulse);
    double exposures_to_make();
    std::optional<LineActive> shown(const std::vector<Interval>& exposures) const;
    bool starts_to_expose(HostTime trigger, const TriggerPulse* pulse);
    bool ignores(const TriggerPulse* pulse);
    bool exposes_by_itself() const;
    Duration exposure_at(HostTime at) const;
    const Fault* active_fault(FaultKind kind) const;
    void next_block_id();
    std::vector<std::uint8_t> chunks(Duration exposure, std::uint64_t block_id) const;
    void apply_outages();
    void report_ptp(HostTime at);
    void spoil(StreamFrame& frame) const;
    void send(TrueExposure exposure);
    void send_event(CameraEventId id, HostTime at, std::uint64_t block_id);

    CameraScenario settings_;
    std::vector<Fault> faults_;
    HostTime zero_;
    double ahead_of_utc_s_;
    GroundTruth& truth_;
    PtpFollower clock_;
    CameraFamily family_;
    std::endian chunk_order_;
    CameraRegisters registers_;
    CameraView view_;
    CameraTransport& transport_;

    std::mutex mutex_;  ///< guards what follows, down to afflict_board_
    bool acquiring_ = false;
    std::uint64_t block_id_ = 0;
    std::uint64_t camera_time_ns_ = 0;  ///< of the newest frame
    std::uint64_t exposures_ = 0;
    std::uint64_t triggers_taken_ = 0;
    std::mt19937_64 random_;  ///< draws the triggers that it ignores
    HostTime busy_until_;
    HostTime free_run_next_;
    std::deque<HostTime> actions_;  ///< scheduled
    std::function<void(const Fault&)> afflict_board_;
    std::function<void(const LineActive&)> show_action_;

    std::atomic<std::int64_t> muted_until_ns_{INT64_MIN};
    std::atomic<bool> reboots_{false};
    FrameQueue queue_;
};

}  // namespace versavis::rig

// SPDX-License-Identifier: BSD-3-Clause
// The life of one camera: opens, sets up and streams it, watches it, and begins anew when it fails.
#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/detached_tasks.hpp"
#include "base/repeat_limit.hpp"
#include "camera/auto_exposure.hpp"
#include "camera/bandwidth_plan.hpp"
#include "camera/camera_state.hpp"
#include "camera/description_sandbox.hpp"
#include "camera/device_locks.hpp"
#include "camera/gvcp.hpp"
#include "camera/preset_run.hpp"
#include "camera/retry.hpp"
#include "camera/sensor_features.hpp"
#include "pipeline/camera_pipeline.hpp"
#include "settings/camera_preset.hpp"
#include "settings/configuration.hpp"

struct _ArvCamera;  // NOLINT(bugprone-reserved-identifier): Aravis names it so
using ArvCamera = _ArvCamera;

namespace versavis::daemon {

struct CameraSetup;
class AravisNodeMap;
class FrameSource;
class PtpReader;

struct CameraReport {
    CameraState state = CameraState::absent;
    HostTime since;
    std::string hint;
    std::string vendor;
    std::string model;
    std::string serial;
    std::string preset;
    std::vector<StepResult> steps;  ///< of the preset
    std::uint64_t connections = 0;
    std::uint32_t packet_size = 0;
    ReceiveMode receive = ReceiveMode::automatic;  ///< in use; automatic: not GigE Vision
    BandwidthShare bandwidth;
    bool renumbers = false;  ///< its frames were numbered anew twice lately, and it was reopened
    bool stuck_ids = false;  ///< packets come, but no frame completes, time and again
    bool held = false;       ///< another program has control of it, or had a moment ago
    bool deaf = false;       ///< packets have come since the newest frame, and it is overdue
    Duration setting_up;     ///< for so long; 0: it is not
    std::string reopened;    ///< why it was last given up while it streamed, and opened anew
    std::string gain_feature;
    SensorState sensor;  ///< as its registers say
};

/// How far requests of Camera::change() are.
struct ChangeReport {
    std::uint64_t asked = 0;
    std::uint64_t done = 0;  ///< carried out or refused
    std::string refused;     ///< why the last of them was; empty: it was not
};

/// What a camera is asked for while the service runs; it has all of it at its next start.
struct CameraChange {
    CameraConfiguration configuration;
    bool enabled = true;   ///< false: it is let go, and left alone
    bool restart = false;  ///< even if nothing else requires it
};

/// What all cameras share.
struct CameraContext {
    CameraContext(ring::Place place, std::vector<CameraPreset> known_presets,
                  const std::filesystem::path& state)
        : rings(std::move(place)),
          presets(std::move(known_presets)),
          descriptions(own_program, state) {}

    ring::Place rings;
    std::vector<CameraPreset> presets;
    BandwidthPlan bandwidth;
    DescriptionSandbox descriptions;
    DeviceLocks claims;
    DetachedTasks patient;
    std::timed_mutex aravis;  ///< what Aravis cannot do in two threads: parsing, listing USB
};

/// Its control thread is the only one that calls Aravis's camera and device; frames come on
/// Aravis's stream thread.
class Camera {
 public:
    struct Hooks {
        std::function<void()> streaming;  ///< it can be triggered
        std::function<void()> lost;
        /// Will be set next, and hold after so many frames: the board must know before.
        std::function<void(Duration, unsigned delay_frames)> exposure;
    };

    Camera(const CameraConfiguration& configuration, CameraContext& environment,
           CameraPipeline& pipeline, Hooks hooks);
    ~Camera();
    Camera(const Camera&) = delete;
    Camera& operator=(const Camera&) = delete;

    void start();
    void request_stop();  ///< returns at once
    void stop();          ///< waits for the end

    /// After request_stop(). False: its device still keeps it waiting.
    bool ended_by(HostTime deadline);
    /// Takes effect in the camera's own time: exposure and gain while it streams, all else with a
    /// new session. The last request counts.
    void change(CameraChange change);
    ChangeReport changes() const;

    bool streaming() const { return streaming_; }
    CameraReport report() const;

 private:
    struct Health;  // of a camera that streams

    void run();
    bool adopt_change();
    void settle_change(const std::string& refused);
    bool refuse_change(const CameraProblem& problem);
    bool asked_to_end() const;
    bool change_live(AravisNodeMap& nodes);
    Expected<> set_live(AravisNodeMap& nodes, const std::string& feature, const std::string& value);
    CameraResult<> session();
    CameraResult<> set_up_and_stream(ArvCamera* camera, const std::atomic<bool>& control_lost);
    CameraResult<> stream(ArvCamera* camera, AravisNodeMap& nodes, const CameraSetup& setup,
                          const std::atomic<bool>& control_lost);
    Expected<std::unique_ptr<FrameSource>> receive(ArvCamera* camera, const AravisNodeMap& nodes,
                                                   const CameraSetup& setup);
    CameraResult<> watch(ArvCamera* camera, AravisNodeMap& nodes, FrameSource& frames,
                         PtpReader* ptp, const std::atomic<bool>& control_lost);
    void follow_ptp(PtpReader& ptp);
    CameraResult<> examine(FrameSource& frames, Health& health);
    void note_held();
    void explain(CameraProblem& ended);
    void wait_to_retry(CameraState why);
    bool answers(Duration patience) const;
    bool restarted(Health& health) const;
    void plan_bandwidth(ArvCamera* camera, AravisNodeMap& nodes, std::uint64_t payload);
    void do_housekeeping(ArvCamera* camera, AravisNodeMap& nodes);
    std::string changed_settings(const AravisNodeMap& nodes);
    void control_exposure(AravisNodeMap& nodes);
    void read_exposure(const AravisNodeMap& nodes);
    SensorState read_sensor(const AravisNodeMap& nodes);
    bool silent(HostTime began) const;
    bool mute() const;  ///< no frame comes
    bool has_triggers() const;
    void describe(const CameraSetup& setup);
    void lose();
    void set_state(CameraState state, const std::string& hint);
    void set_setting_up_since(HostTime since);
    bool pause(Duration duration);

    CameraConfiguration configuration_;
    CameraContext& environment_;
    CameraPipeline& pipeline_;
    Hooks hooks_;
    std::atomic<bool> streaming_{false};
    mutable std::mutex mutex_;
    std::condition_variable wake_;
    bool stop_ = false;
    bool ended_ = false;
    std::optional<CameraChange> change_;  ///< asked for, and not carried out yet
    ChangeReport changes_;
    CameraReport report_;
    HostTime setting_up_since_;  ///< 0: it is not being set up

    // Of the control thread.
    bool enabled_ = true;
    std::optional<CameraConfiguration> before_change_;  ///< until it is known whether that holds
    std::uint64_t adopted_ = 0;                         ///< number of that change
    std::unique_ptr<FrameMeter> meter_;
    std::unique_ptr<AutoExposure> exposure_;
    std::string exposure_feature_;
    SensorFeatures sensor_features_;
    std::vector<std::pair<std::string, std::string>>
        watched_;                        ///< features, and the values that they were set up with
    std::vector<std::string> refusals_;  ///< that were logged
    HostTime next_reading_;              ///< of the exposure
    HostTime next_ptp_status_;
    HostTime next_clock_reading_;
    HostTime exposure_holds_;  ///< frames that arrive from then on have the newest exposure
    Duration packet_delay_;
    Retry retry_;
    std::optional<NetworkDevice> device_;  ///< where it was last seen
    HostTime held_since_;                  ///< somebody else has control since; 0: nobody
    static constexpr std::int64_t never_ns = INT64_MIN / 2;
    RepeatLimit log_limit_;  ///< of states
    std::atomic<bool> clock_reading_wanted_{false};
    std::atomic<bool> deaf_{false};
    std::atomic<unsigned> deaf_streams_{0};                     ///< in a row
    std::atomic<std::int64_t> renumbered_ns_{never_ns};         ///< its frames were numbered anew
    std::atomic<std::int64_t> renumbered_before_ns_{never_ns};  ///< the same, the time before
    bool clock_stands_ = false;   ///< found out while it streamed last
    bool without_clock_ = false;  ///< for that reason
    bool no_image_ = false;       ///< its frames are of another kind, as it showed

    std::thread thread_;
};

}  // namespace versavis::daemon

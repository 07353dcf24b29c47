// SPDX-License-Identifier: BSD-3-Clause
// The life of one camera: opens, sets up and streams it, watches it, and begins anew when it fails.
#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "camera/auto_exposure.hpp"
#include "camera/bandwidth_plan.hpp"
#include "camera/camera_preset.hpp"
#include "camera/camera_state.hpp"
#include "configuration/configuration.hpp"
#include "stream/camera_pipeline.hpp"

struct _ArvCamera;  // NOLINT(bugprone-reserved-identifier): Aravis names it so
using ArvCamera = _ArvCamera;
struct _ArvDevice;  // NOLINT(bugprone-reserved-identifier)
using ArvDevice = _ArvDevice;

namespace versavis::daemon {

struct CameraSetup;
class AravisStream;

struct CameraReport {
    CameraState state = CameraState::absent;
    HostTime since;
    std::string hint;
    std::string vendor;
    std::string model;
    std::string serial;
    std::string preset;
    std::uint64_t connections = 0;
    std::uint32_t packet_size = 0;
    BandwidthShare bandwidth;
    double temperature_c = 0;  ///< 0: unknown
};

/// What all cameras share.
struct CameraEnvironment {
    std::filesystem::path ring_directory;
    std::vector<CameraPreset> presets;
    BandwidthPlan bandwidth;
};

/// Its control thread is the only one that calls Aravis's camera and device; frames come on
/// Aravis's stream thread.
class Camera {
 public:
    struct Hooks {
        std::function<void()> streaming;  ///< it can be triggered
        std::function<void()> lost;
        std::function<void(Duration)>
            exposure;  ///< will be set next: the board must know before it holds
    };

    Camera(const CameraConfiguration& configuration, CameraEnvironment& environment,
           CameraPipeline& pipeline, Hooks hooks);
    ~Camera();
    Camera(const Camera&) = delete;
    Camera& operator=(const Camera&) = delete;

    void start();
    void request_stop();  ///< returns at once
    void stop();          ///< waits for the end
    bool streaming() const { return streaming_; }
    CameraReport report() const;

 private:
    void run();
    CameraResult<> session();
    CameraResult<> stream(ArvCamera* camera, const CameraSetup& setup,
                          const std::atomic<bool>& control_lost);
    CameraResult<> watch(ArvCamera* camera, AravisStream& stream,
                         const std::atomic<bool>& control_lost);
    void plan_bandwidth(ArvCamera* camera, std::uint64_t payload);
    void do_housekeeping(ArvCamera* camera);
    void control_exposure(ArvDevice* device);
    bool silent(HostTime began) const;
    void describe(const CameraSetup& setup);
    void lose();
    void set_state(CameraState state, const std::string& hint);
    bool pause(Duration duration);

    CameraConfiguration configuration_;
    CameraEnvironment& environment_;
    CameraPipeline& pipeline_;
    Hooks hooks_;
    std::atomic<bool> streaming_{false};
    mutable std::mutex mutex_;
    std::condition_variable wake_;
    bool stop_ = false;
    CameraReport report_;

    // Of the control thread.
    std::unique_ptr<FrameMeter> meter_;
    std::unique_ptr<AutoExposure> exposure_;
    std::string exposure_feature_;
    HostTime exposure_holds_;  ///< frames that arrive from then on have the newest exposure
    Duration packet_delay_;

    std::thread thread_;
};

}  // namespace versavis::daemon

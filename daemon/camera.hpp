// SPDX-License-Identifier: BSD-3-Clause
// One camera through Aravis: opens, configures and streams it, and begins anew when it fails.
#pragma once

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "camera_pipeline.hpp"
#include "configuration.hpp"

struct _ArvCamera;  // NOLINT(bugprone-reserved-identifier): Aravis names it so
using ArvCamera = _ArvCamera;

namespace versavis::daemon {

enum class CameraState { absent, opening, streaming, silent, failed };
const char* to_string(CameraState state);

struct CameraReport {
    CameraState state = CameraState::absent;
    HostTime since;
    std::string hint;
    std::string model;
    std::string serial;
    std::uint64_t connections = 0;
    std::uint32_t packet_size = 0;
};

/// Its control thread is the only one that calls Aravis's camera and device; frames come on Aravis's stream
/// thread.
class Camera {
 public:
    struct Hooks {
        std::function<void()> streaming;  ///< it can be triggered
        std::function<void()> lost;
    };

    Camera(const CameraConfiguration& configuration, const std::filesystem::path& ring_directory,
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
    Expected<> session();
    Expected<> stream(ArvCamera* camera, const std::atomic<bool>& control_lost);
    void describe(ArvCamera* camera);
    void lose();
    void set_state(CameraState state, const std::string& hint);
    bool pause(Duration duration);

    CameraConfiguration configuration_;
    std::filesystem::path ring_directory_;
    CameraPipeline& pipeline_;
    Hooks hooks_;
    std::atomic<bool> streaming_{false};
    mutable std::mutex mutex_;
    std::condition_variable wake_;
    bool stop_ = false;
    CameraReport report_;
    std::thread thread_;
};

}  // namespace versavis::daemon

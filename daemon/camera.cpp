// SPDX-License-Identifier: BSD-3-Clause
#include "camera.hpp"

#include <chrono>

#include "aravis_camera.hpp"

namespace versavis::daemon {

namespace {

constexpr Duration first_retry = milliseconds(300);
constexpr Duration longest_retry = seconds(2);
constexpr Duration step = milliseconds(50);
constexpr std::uint64_t triggers_of_silence = 5;
constexpr Duration time_of_silence = seconds(2);

void on_control_lost(ArvDevice* /*device*/, ControlLost* lost) { *lost = true; }

}  // namespace

const char* to_string(CameraState state) {
    switch (state) {
        case CameraState::absent: return "absent";
        case CameraState::opening: return "opening";
        case CameraState::streaming: return "streaming";
        case CameraState::silent: return "silent";
        case CameraState::failed: return "failed";
    }
    return "unknown";
}

Camera::Camera(const CameraConfiguration& configuration, const std::filesystem::path& ring_directory,
               CameraPipeline& pipeline, Hooks hooks)
    : configuration_(configuration),
      ring_directory_(ring_directory),
      pipeline_(pipeline),
      hooks_(std::move(hooks)) {}

Camera::~Camera() { stop(); }

void Camera::start() {
    thread_ = std::thread([this] { run(); });
}

void Camera::request_stop() {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    wake_.notify_all();
}

void Camera::stop() {
    request_stop();
    if (thread_.joinable()) thread_.join();
}

CameraReport Camera::report() const {
    const std::lock_guard lock(mutex_);
    return report_;
}

void Camera::set_state(CameraState state, const std::string& hint) {
    const std::lock_guard lock(mutex_);
    if (report_.state != state || report_.hint != hint) {
        const bool good = state == CameraState::streaming || state == CameraState::opening;
        log(good ? LogLevel::info : LogLevel::warning, configuration_.name, "{}{}{}", to_string(state),
            hint.empty() ? "" : ": ", hint);
        report_.since = host_now();
    }
    report_.state = state;
    report_.hint = hint;
}

/// Waits, unless the camera is to stop. False: it is.
bool Camera::pause(Duration duration) {
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, std::chrono::nanoseconds(duration.ns), [this] { return stop_; });
    return !stop_;
}

void Camera::run() {
    Duration retry = first_retry;
    set_state(CameraState::opening, "");
    do {
        const HostTime begin = host_now();
        const auto ended = session();
        if (ended) return;
        const bool ran = host_now() - begin > longest_retry;
        retry = ran ? first_retry : std::min(retry * 2, longest_retry);
        set_state(CameraState::failed, ended.error().message());
    } while (pause(retry));
}

/// From opening the camera to its loss. A value: it was asked to stop.
Expected<> Camera::session() {
    ControlLost control_lost{false};  // outlives the camera, whose heartbeat thread sets it
    auto camera = open_camera(configuration_.device);
    if (!camera) return tl::unexpected(camera.error());
    if (!pause({})) return {};
    ArvDevice* device = arv_camera_get_device(camera->get());
    g_signal_connect(device, "control-lost", G_CALLBACK(on_control_lost), &control_lost);
    if (auto done = configure_camera(camera->get(), configuration_); !done) return done;
    describe(camera->get());
    return stream(camera->get(), control_lost);
}

void Camera::describe(ArvCamera* camera) {
    // Registers are read before the lock is taken: a mute camera blocks for seconds.
    const char* model = arv_camera_get_model_name(camera, nullptr);
    const char* serial = arv_camera_get_device_serial_number(camera, nullptr);
    const std::lock_guard lock(mutex_);
    report_.model = model != nullptr ? model : "";
    report_.serial = serial != nullptr ? serial : "";
}

/// The board and the status learn it before Aravis takes its time to let the camera go.
void Camera::lose() {
    streaming_ = false;
    hooks_.lost();
}

Expected<> Camera::stream(ArvCamera* camera, const std::atomic<bool>& control_lost) {
    const guint payload = arv_camera_get_payload(camera, nullptr);
    if (payload == 0) return failure(configuration_.name, "the camera does not say how large its frames are");
    if (auto done = pipeline_.prepare(ring_directory_, payload); !done) return done;
    pipeline_.reset();
    auto stream = AravisStream::create(camera, configuration_, pipeline_, payload);
    if (!stream) return tl::unexpected(stream.error());
    const bool gige = ARV_IS_GV_DEVICE(arv_camera_get_device(camera));
    const guint packet_size = gige ? arv_camera_gv_get_packet_size(camera, nullptr) : 0;
    GError* error = nullptr;
    arv_camera_start_acquisition(camera, &error);
    if (error != nullptr) {
        const std::string reason = error->message;
        g_clear_error(&error);
        return failure(configuration_.name, "does not start: " + reason);
    }
    {
        const std::lock_guard lock(mutex_);
        report_.packet_size = packet_size;
        ++report_.connections;
    }
    set_state(CameraState::streaming, "");
    streaming_ = true;
    hooks_.streaming();
    const HostTime began = host_now();
    while (pause((*stream)->needs_polling() ? Duration{} : step)) {
        if ((*stream)->needs_polling()) (*stream)->poll(step);
        const HostTime last_frame = std::max(pipeline_.report().last_frame, began);
        const bool silent = pipeline_.unanswered_triggers() > triggers_of_silence &&
                            host_now() - last_frame > time_of_silence;
        if (!control_lost && !silent) continue;
        lose();
        const auto lost =
            control_lost
                ? failure(configuration_.name, "the camera is gone", "check cable and power")
                : failure(configuration_.name, "triggers are sent but no frames come",
                          "check the trigger cable, TriggerSource and the network; it is opened anew");
        set_state(CameraState::silent, lost.value().message());
        return lost;
    }
    lose();
    arv_camera_stop_acquisition(camera, nullptr);
    return {};
}

}  // namespace versavis::daemon

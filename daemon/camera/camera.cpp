// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <fmt/format.h>
#include <gio/gio.h>

#include <chrono>
#include <cmath>

#include "camera/aravis_stream.hpp"
#include "camera/camera_discovery.hpp"
#include "camera/camera_setup.hpp"

namespace versavis::daemon {

namespace {

/// Before a camera that was lost is opened again; doubled each time, up to longest_retry. At half,
/// a camera that boots is asked more often; at twice, it is back 0.2 s later.
constexpr Duration first_retry = milliseconds(200);

/// At half, an absent camera costs twice the broadcasts; at twice, one that was plugged in is found
/// half a second later.
constexpr Duration longest_retry = milliseconds(500);

/// Between looks at a streaming camera. At half, an idle service wakes twice as often; at twice,
/// loss of control shows 20 ms later.
constexpr Duration step = milliseconds(20);

/// Between readings of what changes slowly. At half, twice the control packets; at twice, a shared
/// link is replanned three seconds later.
constexpr Duration housekeeping_interval = seconds(3);

/// A camera is silent that leaves so many triggers and so much time without a frame. At half, a
/// camera that skips some is opened anew; at twice, slow cameras are missed longer.
constexpr std::uint64_t triggers_of_silence = 5;
constexpr Duration time_of_silence = seconds(2);

/// The same for a camera without triggers, whose rate nobody knows. At half, one slower than 0.4 Hz
/// is opened anew for ever; at twice, a mute one is missed for ten seconds.
constexpr Duration time_of_free_silence = seconds(5);

void on_control_lost(ArvDevice* /*device*/, std::atomic<bool>* lost) { *lost = true; }

}  // namespace

Camera::Camera(const CameraConfiguration& configuration, CameraEnvironment& environment,
               CameraPipeline& pipeline, Hooks hooks)
    : configuration_(configuration),
      environment_(environment),
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
        const bool good = hint.empty();
        log(good ? LogLevel::info : LogLevel::warning, configuration_.name, "{}{}{}",
            to_string(state), good ? "" : ": ", hint);
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
        const std::uint64_t connections = report().connections;
        const auto ended = session();
        environment_.bandwidth.leave(configuration_.name);
        if (ended) return;
        retry =
            report().connections > connections ? first_retry : std::min(retry * 2, longest_retry);
        set_state(ended.error().state, ended.error().error.message());
    } while (pause(retry));
}

/// From opening the camera to its loss. A value: it was asked to stop.
CameraResult<> Camera::session() {
    std::atomic<bool> control_lost{false};  // outlives the camera, whose heartbeat thread sets it
    auto camera = open_camera(configuration_.device, [this] { return !pause({}); });
    if (!camera) return Unexpected(camera.error());
    if (!pause({})) return {};
    ArvDevice* device = arv_camera_get_device(camera->get());
    g_signal_connect(device, "control-lost", G_CALLBACK(on_control_lost), &control_lost);
    const auto setup = set_up_camera(camera->get(), configuration_, environment_.presets);
    if (!setup && control_lost)
        return problem(CameraState::silent,
                       {configuration_.device, "disappeared while it was being set up", ""});
    if (!setup) return problem(CameraState::misconfigured, setup.error());
    describe(*setup);
    return stream(camera->get(), *setup, control_lost);
}

void Camera::describe(const CameraSetup& setup) {
    const std::lock_guard lock(mutex_);
    report_.vendor = setup.vendor;
    report_.model = setup.model;
    report_.serial = setup.serial;
    report_.preset = setup.preset;
}

/// The board and the status learn it before Aravis takes its time to let the camera go.
void Camera::lose() {
    streaming_ = false;
    hooks_.lost();
}

CameraResult<> Camera::stream(ArvCamera* camera, const CameraSetup& setup,
                              const std::atomic<bool>& control_lost) {
    const auto failed = [](const Error& error) { return problem(CameraState::failed, error); };
    if (auto done = pipeline_.prepare(environment_.ring_directory, setup.payload, setup.has_clock);
        !done)
        return failed(done.error());
    ArvDevice* device = arv_camera_get_device(camera);
    const Duration exposure = fixed_exposure(device, setup);
    pipeline_.set_camera_exposure(exposure, host_now());
    if (configuration_.auto_exposure.enabled) {
        meter_ = std::make_unique<FrameMeter>(configuration_.auto_exposure.percentile);
        exposure_ = std::make_unique<AutoExposure>(configuration_.auto_exposure, exposure);
        exposure_feature_ = setup.exposure_feature;
    }
    auto stream = AravisStream::create(camera, configuration_, setup, pipeline_, meter_.get());
    if (!stream) return failed(stream.error());
    plan_bandwidth(camera, setup.payload);
    GlibError error;
    arv_camera_start_acquisition(camera, error.out());
    if (error.set()) return failed({configuration_.name, "does not start: " + error.text(), ""});
    {
        const std::lock_guard lock(mutex_);
        ++report_.connections;
    }
    set_state(CameraState::streaming, "");
    streaming_ = true;
    hooks_.streaming();
    auto ended = watch(camera, **stream, control_lost);
    lose();
    if (!ended) {
        set_state(ended.error().state, ended.error().error.message());
        return ended;
    }
    arv_camera_stop_acquisition(camera, nullptr);
    return {};
}

/// Cameras on one link are told how long to pause between packets.
void Camera::plan_bandwidth(ArvCamera* camera, std::uint64_t payload) {
    ArvDevice* device = arv_camera_get_device(camera);
    packet_delay_ = Duration{-1};  // what it was left with is unknown
    if (!ARV_IS_GV_DEVICE(device)) return;
    const guint packet_size = arv_camera_gv_get_packet_size(camera, nullptr);
    const Object<GInetAddress> own(G_INET_ADDRESS(g_object_ref(g_inet_socket_address_get_address(
        G_INET_SOCKET_ADDRESS(arv_gv_device_get_interface_address(ARV_GV_DEVICE(device)))))));
    std::uint32_t address = 0;
    std::memcpy(&address, g_inet_address_to_bytes(own.get()), sizeof address);
    BandwidthNeed need;
    need.link = interface_of(address);
    need.link_mbps =
        configuration_.link_mbps != 0 ? configuration_.link_mbps : link_speed_mbps(need.link);
    need.frame_size = payload;
    need.packet_size = packet_size;
    need.rate_hz = configuration_.rate_hz;
    environment_.bandwidth.join(configuration_.name, need);
    {
        const std::lock_guard lock(mutex_);
        report_.packet_size = packet_size;
    }
    do_housekeeping(camera);
}

bool Camera::silent(HostTime began) const {
    const Duration since = host_now() - std::max(pipeline_.report().last_sign, began);
    if (!pipeline_.triggered()) return since > time_of_free_silence;
    return pipeline_.unanswered_triggers() > triggers_of_silence && since > time_of_silence;
}

CameraResult<> Camera::watch(ArvCamera* camera, AravisStream& stream,
                             const std::atomic<bool>& control_lost) {
    const HostTime began = host_now();
    HostTime housekeeping = began;
    while (pause(stream.needs_polling() ? Duration{} : step)) {
        if (stream.needs_polling()) stream.poll(step);
        if (control_lost)
            return problem(CameraState::silent,
                           {configuration_.name, "the camera is gone", "check cable and power"});
        if (silent(began))
            return problem(
                CameraState::silent,
                {configuration_.name,
                 pipeline_.triggered() ? "triggers are sent but no frames come" : "no frames come",
                 "check the trigger cable, TriggerSource and the network; the camera is being "
                 "reopened"});
        if (exposure_) control_exposure(arv_camera_get_device(camera));
        if (host_now() < housekeeping) continue;
        housekeeping = host_now() + housekeeping_interval;
        do_housekeeping(camera);
    }
    return {};
}

/// What changes slowly: temperature, and the share of the link as other cameras come and go.
void Camera::do_housekeeping(ArvCamera* camera) {
    const bool network = ARV_IS_GV_DEVICE(arv_camera_get_device(camera));
    const BandwidthShare share = environment_.bandwidth.share(configuration_.name);
    if (network && share.packet_delay != packet_delay_) {
        arv_camera_gv_set_packet_delay(camera, share.packet_delay.ns, nullptr);
        packet_delay_ = share.packet_delay;
    }
    const double temperature =
        read_number(arv_camera_get_device(camera), "DeviceTemperature").value_or(0);
    std::string hint;
    if (!share.fits())
        hint = fmt::format(
            "the link carries {:.0f} Mbit/s but its cameras need {:.0f}: lower rate, size or "
            "number",
            share.link_mbps, share.link_needed_mbps);
    else if (temperature > configuration_.max_temperature_c)
        hint = fmt::format("the camera is at {:.0f} degrees: cool it, or raise 'max_temperature_c'",
                           temperature);
    else if (meter_ && !meter_->usable())
        hint =
            "auto exposure cannot meter this pixel format: use Mono or Bayer of 8 to 16 bits, "
            "unpacked";
    {
        const std::lock_guard lock(mutex_);
        report_.bandwidth = share;
        report_.temperature_c = temperature;
    }
    if (streaming_) set_state(CameraState::streaming, hint);
}

/// The board learns of an exposure before the camera does: it is on the way when the camera takes
/// it.
void Camera::control_exposure(ArvDevice* device) {
    const auto seen = meter_->newest(exposure_holds_);
    const auto wanted = seen ? exposure_->update(*seen) : std::nullopt;
    if (!wanted) return;
    hooks_.exposure(*wanted);
    pipeline_.set_camera_exposure(*wanted, host_now());
    GlibError error;
    arv_device_set_float_feature_value(device, exposure_feature_.c_str(),
                                       static_cast<double>(wanted->ns) * 1e-3, error.out());
    if (error.set()) {
        log(LogLevel::warning, configuration_.name, "exposure cannot be set: {}", error.text());
        pipeline_.set_camera_exposure({}, host_now());
    }
    const double period_ns = 1e9 / configuration_.rate_hz;
    exposure_holds_ =
        host_now() +
        Duration{std::llround(period_ns * (configuration_.auto_exposure.delay_frames + 2.0))};
}

}  // namespace versavis::daemon

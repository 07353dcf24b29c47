// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <fmt/format.h>
#include <gio/gio.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>

#include "base/thread_watch.hpp"
#include "camera/action_trigger.hpp"
#include "camera/aravis_stream.hpp"
#include "camera/camera_discovery.hpp"
#include "camera/camera_events.hpp"
#include "camera/camera_setup.hpp"
#include "camera/image_receiver.hpp"
#include "camera/ptp_reader.hpp"
#include "posix/thread.hpp"
#include "settings/receive_mode.hpp"

namespace versavis::daemon {

namespace {

/// A program that was killed keeps a camera until its heartbeat is missed, 3 s by default.
constexpr Duration lease_patience = seconds(5);

/// Finding and setting up takes a second, or ten when a large description is looked at for the
/// first time.
constexpr Duration set_up_patience = seconds(20);

/// From one look at whether a camera is there to the next.
constexpr Duration presence_interval = milliseconds(250);

/// Until a camera that leaves triggers unanswered is asked whether it restarted, and then between
/// questions.
constexpr Duration first_doubt = milliseconds(150);
constexpr std::uint64_t triggers_of_doubt = 3;
constexpr Duration doubt_interval = milliseconds(50);

/// Time of an answer to that.
constexpr Duration doubt_patience = milliseconds(30);

/// Time of an answer of one that sends no frames.
constexpr Duration silence_patience = milliseconds(500);

/// Packets come, but no frame for so long: the camera began to count anew, less than 100 back, and
/// Aravis takes its frames for late ones.
constexpr Duration time_of_deafness = milliseconds(300);

/// Streams in a row in which, after few frames or none, packets came and no frame completed: the
/// camera's block ids stand still. One such stream may also be a camera that restarts its ids
/// early.
constexpr unsigned deaf_streams_of_stuck_ids = 3;
constexpr std::uint64_t few_frames = 3;

/// Ids that began anew twice within so long do it for no reason of the host.
constexpr Duration renumbering_memory = seconds(30);

/// Between looks at a streaming camera.
constexpr Duration poll_interval = milliseconds(20);

/// Between questions for the state of a camera's PTP port. Half: twice the traffic. Twice: a camera
/// that lost its master is triggered for a second more; its frames are withheld all the same if its
/// clock departs.
constexpr Duration ptp_status_interval = milliseconds(500);

/// Between readings of a clock that no frame waits for.
constexpr Duration clock_reading_interval = milliseconds(100);

/// Between readings of what changes slowly.
constexpr Duration housekeeping_interval = seconds(3);

/// A camera is silent that leaves so many triggers and so much time without a frame.
constexpr std::uint64_t triggers_of_silence = 5;
constexpr Duration time_of_silence = seconds(2);

/// The same for a camera without triggers, whose rate nobody knows.
constexpr Duration time_of_free_silence = seconds(5);

/// For one answer: a camera may ask for 65 s with a pending acknowledge. A thread that does not run
/// for longer is stuck.
constexpr Duration longest_camera_block = seconds(90);

/// Of a camera that is to be left alone: shorter than that.
constexpr std::chrono::seconds camera_idle_step{5};

using Flag = std::shared_ptr<std::atomic<bool>>;

/// More than any camera takes.
constexpr double longest_exposure_us = 1e9;

/// A report of lost control takes microseconds, but a busy machine may interrupt it.
constexpr Duration longest_report = seconds(10);

using Features = std::vector<std::pair<std::string, std::string>>;

/// Those of `after` that are new or have another value; none: one of `before` is gone.
std::optional<Features> differing_features(const Features& before, const Features& after) {
    Features differing;
    for (const auto& feature : after)
        if (std::find(before.begin(), before.end(), feature) == before.end())
            differing.push_back(feature);
    for (const auto& [name, value] : before)
        if (std::none_of(after.begin(), after.end(),
                         [wanted = &name](const auto& it) { return it.first == *wanted; }))
            return std::nullopt;
    return differing;
}

void on_control_lost(ArvDevice* /*device*/, Flag* lost) { **lost = true; }
void forget(gpointer flag, GClosure* /*closure*/) { delete static_cast<Flag*>(flag); }

/// While the device's heartbeat thread reports a loss of control, it holds a reference. That must
/// not be the last one: the end of the device waits for this thread.
void release(ArvCamera* camera) {
    ArvDevice* device = arv_camera_get_device(camera);
    g_object_ref(device);
    g_object_unref(camera);
    const HostTime end = host_now() + longest_report;
    while (g_atomic_int_get(&G_OBJECT(device)->ref_count) > 1 && host_now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    g_object_unref(device);
}

}  // namespace

struct Camera::Health {
    HostTime began = host_now();
    std::uint64_t received = 0;  ///< complete frames when it began
    std::uint64_t taken = 0;
    std::uint64_t packets = 0;  ///< when the newest frame was taken
    HostTime taken_at = began;
    HostTime doubted;
    std::optional<GvcpClient> client;
};

Camera::Camera(const CameraConfiguration& configuration, CameraContext& environment,
               CameraPipeline& pipeline, Hooks hooks)
    : configuration_(configuration),
      environment_(environment),
      pipeline_(pipeline),
      hooks_(std::move(hooks)) {}

Camera::~Camera() { stop(); }

void Camera::start() {
    thread_ = start_thread("camera " + configuration_.name, [this] { run(); });
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

void Camera::change(CameraChange change) {
    const std::lock_guard lock(mutex_);
    // A start anew that nobody saw yet is still to come.
    change.restart = change.restart || (change_ && change_->restart);
    change_ = std::move(change);
    ++changes_.asked;
    wake_.notify_all();
}

ChangeReport Camera::changes() const {
    const std::lock_guard lock(mutex_);
    return changes_;
}

bool Camera::ended_by(HostTime deadline) {
    std::unique_lock lock(mutex_);
    const Duration left = deadline - host_now();
    return !thread_.joinable() ||
           wake_.wait_for(lock, std::chrono::nanoseconds(left.ns), [this] { return ended_; });
}

CameraReport Camera::report() const {
    const std::lock_guard lock(mutex_);
    CameraReport report = report_;
    report.stuck_ids = deaf_streams_ >= deaf_streams_of_stuck_ids;
    report.deaf = deaf_ || deaf_streams_ > 0;  // in this stream, or in the one just before
    report.renumbers = host_now().ns - renumbered_before_ns_ < renumbering_memory.ns;
    report.setting_up = setting_up_since_.ns != 0 ? host_now() - setting_up_since_ : Duration{};
    if (report.setting_up > set_up_patience) {
        report.state = CameraState::failed;
        report.hint = fmt::format(
            "{}: set-up has taken {} s so far: its control channel is slow, or its answers are "
            "incomplete; if that lasts, power it off and on",
            configuration_.device, report.setting_up.ns / seconds(1).ns);
    }
    return report;
}

void Camera::set_state(CameraState state, const std::string& hint) {
    const std::lock_guard lock(mutex_);
    if (report_.state != state || report_.hint != hint) {
        report_.since = host_now();
        const bool good = hint.empty();
        const std::string line = fmt::format("{}{}{}", to_string(state), good ? "" : ": ", hint);
        if (const auto passed = log_limit_.pass(line, report_.since))
            log_line(good ? LogLevel::info : LogLevel::warning, configuration_.name, *passed);
    }
    report_.state = state;
    report_.hint = hint;
}

/// Under the lock: the session is to end, at once or to begin anew. What may be possible while it
/// streams is left to watch().
bool Camera::asked_to_end() const { return stop_ || (change_ && !streaming_); }

/// Waits, unless the session is to end. False: it is.
bool Camera::pause(Duration duration) {
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, std::chrono::nanoseconds(duration.ns),
                   [this] { return asked_to_end() || clock_reading_wanted_.exchange(false); });
    return !asked_to_end();
}

void Camera::set_setting_up_since(HostTime since) {
    const std::lock_guard lock(mutex_);
    setting_up_since_ = since;
}

void Camera::run() {
    const auto watched =
        thread_watch().watch("camera " + configuration_.name, longest_camera_block);
    set_state(CameraState::opening, "");
    while (adopt_change()) {
        auto ended = session();
        set_setting_up_since({});
        environment_.bandwidth.leave(configuration_.name);
        if (ended || !pause({})) continue;
        if (refuse_change(ended.error())) continue;
        explain(ended.error());
        note_held();
        set_state(ended.error().state, ended.error().error.message());
        wait_to_retry(ended.error().state);
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    wake_.notify_all();
}

/// Before a session: takes what was asked for, and waits as long as the camera is to be left alone.
/// False: it is to stop.
bool Camera::adopt_change() {
    std::unique_lock lock(mutex_);
    while (!stop_ && (change_ || !enabled_)) {
        if (!change_) {
            wake_.wait_for(lock, camera_idle_step, [this] { return stop_ || change_; });
            continue;
        }
        before_change_ = std::exchange(configuration_, change_->configuration);
        enabled_ = change_->enabled;
        adopted_ = changes_.asked;
        change_.reset();
        retry_.restart();
        exposure_.reset();
        meter_.reset();
        lock.unlock();
        set_state(enabled_ ? CameraState::opening : CameraState::stopped, "");
        if (!enabled_) settle_change("");
        lock.lock();
    }
    return !stop_;
}

/// What was adopted is in force, or was refused for that reason.
void Camera::settle_change(const std::string& refused) {
    if (!before_change_) return;
    before_change_.reset();
    const std::lock_guard lock(mutex_);
    changes_.done = adopted_;
    changes_.refused = refused;
}

/// A session has failed. True: because of the change, which is taken back.
bool Camera::refuse_change(const CameraProblem& problem) {
    if (!before_change_ || problem.state != CameraState::misconfigured) {
        settle_change("");  // whatever it is, it is not the change
        return false;
    }
    const std::string refused = problem.error.message();
    log(LogLevel::warning, configuration_.name, "not changed: {}", refused);
    {
        const std::lock_guard lock(mutex_);
        configuration_ = *before_change_;
    }
    settle_change(refused);
    return true;
}

/// Sets an exposure or a gain while frames come. Error: the camera refuses it.
Expected<> Camera::set_live(AravisNodeMap& nodes, const std::string& feature,
                            const std::string& value) {
    if (feature != exposure_feature_) return nodes.set(feature, value);
    const unsigned delay_frames = configuration_.auto_exposure.delay_frames;
    const double us = std::clamp(std::strtod(value.c_str(), nullptr), 0.0, longest_exposure_us);
    const Duration wanted{std::llround(us * 1e3)};
    hooks_.exposure(wanted, delay_frames);
    pipeline_.set_camera_exposure(wanted, host_now());
    auto done = nodes.set(feature, value);
    const Duration actual = fixed_exposure(nodes, feature);  // rounded, or still as it was
    if (actual != wanted) hooks_.exposure(actual, delay_frames);
    pipeline_.set_camera_exposure(actual, host_now());
    return done;
}

/// What was asked for, if it is no more than another exposure or gain. False: the camera must begin
/// anew.
bool Camera::change_live(AravisNodeMap& nodes) {
    std::unique_lock lock(mutex_);
    if (!change_) return true;
    const CameraChange change = *change_;
    const std::uint64_t number = changes_.asked;
    lock.unlock();
    CameraConfiguration next = change.configuration;
    next.features = configuration_.features;
    if (!change.enabled || change.restart || !(next == configuration_)) return false;
    const auto differing =
        differing_features(configuration_.features, change.configuration.features);
    const auto live = [&](const auto& feature) {
        return (feature.first == exposure_feature_ && exposure_ == nullptr) ||
               feature.first == sensor_features_.gain;
    };
    if (!differing || !std::all_of(differing->begin(), differing->end(), live)) return false;
    std::string refused;
    for (const auto& [feature, value] : *differing)
        if (const auto done = set_live(nodes, feature, value); !done)
            refused = done.error().message();
    for (auto& [feature, value] : watched_)
        if (feature == exposure_feature_) value = nodes.read(feature);
    if (refused.empty()) configuration_.features = change.configuration.features;
    if (!refused.empty()) log(LogLevel::warning, configuration_.name, "not changed: {}", refused);
    lock.lock();
    if (changes_.asked == number) change_.reset();
    changes_.done = number;
    changes_.refused = refused;
    return true;
}

/// Control that is held need not be held by a program that runs, and a camera that was there a
/// moment ago may come back.
void Camera::explain(CameraProblem& ended) {
    if (ended.state == CameraState::absent && report_.connections > 0)
        ended.error = {configuration_.device, "it answered before, and does not any more",
                       "it may be restarting: if it does not return, check cable, power and name"};
    if (ended.state != CameraState::busy) {
        held_since_ = {};
        return;
    }
    if (held_since_.ns == 0) held_since_ = host_now();
    if (host_now() - held_since_ > lease_patience) return;
    ended = {CameraState::opening,
             {configuration_.device, "it is still locked, perhaps by a program that was killed",
              "the lock expires within seconds; the service keeps trying"}};
}

void Camera::note_held() {
    const std::lock_guard lock(mutex_);
    report_.held = held_since_.ns != 0;
}

/// Waits; not as long when the camera was gone and is back, or something is asked of it.
void Camera::wait_to_retry(CameraState why) {
    const bool held = held_since_.ns != 0;
    const HostTime until = host_now() + (held ? Retry::soon : retry_.after(why));
    for (bool gone = false; host_now() < until;) {
        if (!pause(std::min(until - host_now(), presence_interval))) return;
        if (!device_ || until - host_now() < presence_interval) continue;
        const bool there = answers(doubt_patience);
        if (there && gone) return retry_.restart();
        gone = !there;
    }
}

bool Camera::answers(Duration patience) const {
    return GvcpClient(device_->interface, device_->address)
        .read_register(gvcp_control_privilege, patience)
        .has_value();
}

/// From opening the camera to its loss. A value: it was asked to end.
CameraResult<> Camera::session() {
    const CameraOpening opening{environment_.descriptions, environment_.claims,
                                environment_.aravis};
    set_setting_up_since(host_now());
    auto opened = open_camera(configuration_.name, configuration_.device, opening,
                              [this] { return !pause({}); });
    if (!opened) return Unexpected(opened.error());
    device_ = opened->network;
    const auto lost = std::make_shared<std::atomic<bool>>(false);
    ArvCamera* camera = opened->camera.release();
    g_signal_connect_data(arv_camera_get_device(camera), "control-lost",
                          G_CALLBACK(on_control_lost), new Flag(lost), forget, GConnectFlags{});
    auto ended = pause({}) ? set_up_and_stream(camera, *lost) : CameraResult<>{};
    environment_.patient.run([camera] { release(camera); }, release_timeout);
    return ended;
}

CameraResult<> Camera::set_up_and_stream(ArvCamera* camera, const std::atomic<bool>& control_lost) {
    AravisNodeMap nodes(arv_camera_get_device(camera));
    CameraSetup setup;
    const auto done = set_up_camera(camera, nodes, configuration_, environment_.presets, setup);
    set_setting_up_since({});
    if (!done && control_lost)
        return problem(CameraState::silent,
                       {configuration_.device, "disappeared while it was being set up", ""});
    describe(setup);
    if (!done) return problem(CameraState::misconfigured, done.error());
    without_clock_ = clock_stands_;
    setup.has_clock = setup.has_clock && !without_clock_;
    return stream(camera, nodes, setup, control_lost);
}

void Camera::describe(const CameraSetup& setup) {
    std::vector<std::string> refusals;
    for (const StepResult& result : setup.steps)
        if (!result.needed &&
            (result.outcome == StepOutcome::refused || result.outcome == StepOutcome::differs))
            refusals.push_back(result.node() + ": " + result.reason);
    const std::lock_guard lock(mutex_);
    report_.vendor = setup.vendor;
    report_.model = setup.model;
    report_.serial = setup.serial;
    report_.preset = setup.preset;
    report_.gain_feature = setup.sensor.gain;
    report_.steps = setup.steps;
    if (refusals == refusals_) return;
    for (const std::string& refusal : refusals)
        log(LogLevel::info, configuration_.name, "not set, and not needed: {}", refusal);
    refusals_ = std::move(refusals);
}

/// The board and the status learn it before Aravis takes its time to let the camera go.
void Camera::lose() {
    streaming_ = false;
    if (pipeline_.by_ptp()) pipeline_.note_ptp({});
    hooks_.lost();
}

CameraResult<> Camera::stream(ArvCamera* camera, AravisNodeMap& nodes, const CameraSetup& setup,
                              const std::atomic<bool>& control_lost) {
    const auto failed = [](const Error& error) { return problem(CameraState::failed, error); };
    pipeline_.set_line_delays(setup.lines);
    if (auto done = pipeline_.prepare(environment_.rings, setup.payload, setup.has_clock,
                                      setup.stamp_instant);
        !done)
        return failed(done.error());
    watched_ = setup.watched;
    exposure_feature_ = setup.exposure_feature;
    sensor_features_ = setup.sensor;
    const Duration exposure = fixed_exposure(nodes, exposure_feature_);
    pipeline_.set_camera_exposure(exposure, {});  // it takes no frame yet
    if (configuration_.auto_exposure.enabled) {
        meter_ = std::make_unique<FrameMeter>(configuration_.auto_exposure.percentile);
        exposure_ = std::make_unique<AutoExposure>(configuration_.auto_exposure, exposure);
    }
    std::optional<PtpReader> ptp;
    if (pipeline_.by_ptp()) {
        if (!device_)
            return problem(CameraState::misconfigured,
                           {configuration_.name, "trigger = \"ptp\" needs a GigE Vision camera",
                            "trigger this camera by the board"});
        auto reader = PtpReader::create(nodes, configuration_.name);
        if (!reader) return problem(CameraState::misconfigured, reader.error());
        ptp.emplace(std::move(*reader));
    }
    auto frames = receive(camera, nodes, setup);
    if (!frames) return failed(frames.error());
    if (*frames == nullptr) return {};
    plan_bandwidth(camera, nodes, setup.payload);
    const auto events = device_ ? receive_events(nodes, device_->interface, device_->address,
                                                 [this](const auto& it) { pipeline_.add(it); })
                                : nullptr;
    GlibError error;
    arv_camera_start_acquisition(camera, error.out());
    if (error.set()) return failed({configuration_.name, "does not start: " + error.text(), ""});
    {
        const std::lock_guard lock(mutex_);
        ++report_.connections;
    }
    set_state(CameraState::streaming, "");
    streaming_ = true;
    settle_change("");
    hooks_.streaming();
    auto ended = [&]() -> CameraResult<> {
        const auto trigger =
            ptp ? ActionTrigger::create(device_->interface, device_->address, pipeline_) : nullptr;
        if (ptp && trigger == nullptr)
            return failed({configuration_.name, "there is no socket for its triggers",
                           "raise the limit of open files (LimitNOFILE)"});
        return watch(camera, nodes, **frames, ptp ? &*ptp : nullptr, control_lost);
    }();
    lose();
    if (!ended) {
        set_state(ended.error().state, ended.error().error.message());
        const std::lock_guard lock(mutex_);
        report_.reopened = ended.error().error.what;
        return ended;
    }
    g_object_ref(camera);  // which may be mute
    environment_.patient.run(
        [camera] {
            arv_camera_stop_acquisition(camera, nullptr);
            g_object_unref(camera);
        },
        release_timeout);
    return {};
}

/// Begins to receive: plain images by the packet socket, where that is chosen, all else by Aravis.
/// Null: it is to stop.
Expected<std::unique_ptr<FrameSource>> Camera::receive(ArvCamera* camera,
                                                       const AravisNodeMap& nodes,
                                                       const CameraSetup& setup) {
    ReceiveMode mode = ReceiveMode::automatic;
    if (arv_camera_is_gv_device(camera) != FALSE) {
        const bool plain =
            device_ && !setup.chunks && !no_image_ && nodes.read("ChunkModeActive") != "true";
        const auto chosen = choose_receive_mode(configuration_, packet_socket_allowed(), plain);
        if (!chosen) return Unexpected(chosen.error());
        mode = *chosen;
        if (!plain && configuration_.receive != ReceiveMode::socket)
            log(LogLevel::info, configuration_.name,
                "its frames carry more than plain images: they are received through a UDP socket");
        if (auto done = set_up_packets(camera, configuration_); !done)
            return Unexpected(done.error());
    }
    {
        const std::lock_guard lock(mutex_);
        report_.receive = mode;
    }
    if (mode == ReceiveMode::packet)
        return ImageReceiver::create(camera, *device_, configuration_, setup, pipeline_,
                                     meter_.get(), environment_.patient);
    Object<ArvChunkParser> chunks;
    if (setup.chunks) {
        const auto turn = lock(environment_.aravis, [this] { return !pause({}); });
        if (!turn.owns_lock()) return std::unique_ptr<FrameSource>();
        chunks.reset(arv_camera_create_chunk_parser(camera));
    }
    return AravisStream::create(camera, configuration_, setup, pipeline_, meter_.get(),
                                std::move(chunks), environment_.patient);
}

/// Cameras on one link are set to pause between packets.
void Camera::plan_bandwidth(ArvCamera* camera, AravisNodeMap& nodes, std::uint64_t payload) {
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
    do_housekeeping(camera, nodes);
}

bool Camera::silent(HostTime began) const {
    const Duration since = host_now() - std::max(pipeline_.report().last_sign, began);
    if (!has_triggers()) return since > time_of_free_silence;
    return pipeline_.unanswered_triggers() > triggers_of_silence && since > time_of_silence;
}

CameraResult<> Camera::watch(ArvCamera* camera, AravisNodeMap& nodes, FrameSource& frames,
                             PtpReader* ptp, const std::atomic<bool>& control_lost) {
    pipeline_.when_clock_reading_wanted([this] {
        clock_reading_wanted_ = true;
        wake_.notify_all();
    });
    Health health;
    health.received = pipeline_.report().received;
    if (device_) health.client.emplace(device_->interface, device_->address);
    HostTime housekeeping = health.began;
    while (pause(frames.needs_polling() ? Duration{} : poll_interval)) {
        if (frames.needs_polling()) frames.poll(poll_interval);
        if (control_lost)
            return problem(CameraState::silent,
                           {configuration_.name, "the camera is gone", "check cable and power"});
        if (!change_live(nodes)) return {};
        if (ptp != nullptr) follow_ptp(*ptp);
        if (auto good = examine(frames, health); !good) return good;
        if (exposure_) control_exposure(nodes);
        if (host_now() >= next_reading_ && pipeline_.wants_exposure_readings())
            read_exposure(nodes);
        if (host_now() < housekeeping) continue;
        housekeeping = host_now() + housekeeping_interval;
        do_housekeeping(camera, nodes);
    }
    return {};
}

bool Camera::has_triggers() const { return pipeline_.triggered() || pipeline_.by_ptp(); }

/// Each frame waits for a reading; without frames the clock is read all the same, so that triggers
/// can begin.
void Camera::follow_ptp(PtpReader& ptp) {
    const HostTime now = host_now();
    if (now >= next_ptp_status_) {
        next_ptp_status_ = now + ptp_status_interval;
        pipeline_.note_ptp(ptp.status().value_or(PtpStatus{}));
    }
    if (now < next_clock_reading_ && !pipeline_.wants_clock_reading()) return;
    next_clock_reading_ = now + clock_reading_interval;
    if (const auto reading = ptp.clock()) pipeline_.read_clock(*reading);
}

/// Whether what comes, or does not come, means that the camera must be opened anew.
CameraResult<> Camera::examine(FrameSource& frames, Health& health) {
    if (const std::string changed = frames.changed(); !changed.empty()) {
        const bool fitted = pipeline_.report().received > health.received;
        return problem(fitted ? CameraState::opening : CameraState::misconfigured,
                       {configuration_.name, changed,
                        fitted ? "the camera is being reopened"
                               : "set Width, Height and PixelFormat in [camera.features], or power "
                                 "it off and on"});
    }
    clock_stands_ = configuration_.camera_clock && frames.clock_frozen();
    if (clock_stands_)
        return problem(CameraState::opening, {configuration_.name, "its clock stands still",
                                              "the camera is being reopened without it"});
    if (frames.unsuited()) {
        no_image_ = true;
        return problem(CameraState::opening, {configuration_.name, "its frames are no plain images",
                                              "the camera is being reopened"});
    }
    if (restarted(health))
        return problem(CameraState::silent, {configuration_.name, "the camera has restarted", ""});
    if (frames.taken() != health.taken) {
        health.taken = frames.taken();
        health.taken_at = host_now();
        health.packets = frames.packets();
        if (health.taken > few_frames) deaf_streams_ = 0;
    }
    const bool silent = this->silent(health.began);
    const bool expected = !has_triggers() || pipeline_.unanswered_triggers() > triggers_of_silence;
    const bool missed = expected && host_now() - health.taken_at > time_of_deafness;
    deaf_ = frames.packets() > health.packets && missed;
    if (frames.packets() > health.packets && (silent || (health.taken > 0 && missed))) {
        ++deaf_streams_;
        if (health.taken > few_frames)
            renumbered_before_ns_ = renumbered_ns_.exchange(host_now().ns);
        return problem(CameraState::opening, {configuration_.name, "its frame numbers started over",
                                              "the camera is being reopened"});
    }
    if (!silent) return {};
    if (device_ && !answers(silence_patience))
        return problem(CameraState::silent,
                       {configuration_.name, "the camera does not answer",
                        "it may be restarting: if it does not return, check its cable and power"});
    return problem(
        CameraState::silent,
        {configuration_.name,
         has_triggers() ? "triggers are sent but no frames come" : "no frames come",
         pipeline_.by_ptp() ? "check TriggerSource and the network; the camera is being reopened"
                            : "check the trigger cable, TriggerSource and the network; the camera "
                              "is being reopened"});
}

/// Whether a camera that leaves triggers unanswered has forgotten that it is controlled.
bool Camera::restarted(Health& health) const {
    const HostTime now = host_now();
    const Duration silence = now - std::max(pipeline_.report().last_frame, health.began);
    if (!health.client || silence < first_doubt || now - health.doubted < doubt_interval)
        return false;
    if (has_triggers() && pipeline_.unanswered_triggers() < triggers_of_doubt) return false;
    health.doubted = now;
    const auto privilege = health.client->read_register(gvcp_control_privilege, doubt_patience);
    return privilege && (*privilege & gvcp_controlled) == 0;
}

bool Camera::mute() const {
    return host_now() - pipeline_.report().last_frame > period_of(configuration_) * 2;
}

/// What reads otherwise than it was set up, as a hint; empty: nothing does. A camera that is mute
/// would hold this thread for seconds with each reading: it is asked only while frames come, and
/// not again after one that fails.
std::string Camera::changed_settings(const AravisNodeMap& nodes) {
    std::string hint;
    if (mute()) return hint;
    for (const auto& [feature, value] : watched_) {
        const bool own = feature == exposure_feature_ && exposure_ != nullptr;
        const std::string now = own ? value : nodes.read(feature);
        if (now.empty()) return hint;
        if (same_value(now, value)) continue;
        hint = fmt::format(
            "{} changed from {} to {}, not by this service: close the program that set it, or "
            "power the camera off and on",
            feature, value, now);
    }
    return hint;
}

/// What changes slowly: temperature, and the share of the link as other cameras come and go.
void Camera::do_housekeeping(ArvCamera* camera, AravisNodeMap& nodes) {
    const bool network = ARV_IS_GV_DEVICE(arv_camera_get_device(camera));
    const BandwidthShare share = environment_.bandwidth.share(configuration_.name);
    if (network && share.packet_delay != packet_delay_) {
        arv_camera_gv_set_packet_delay(camera, share.packet_delay.ns, nullptr);
        packet_delay_ = share.packet_delay;
    }
    const SensorState sensor = read_sensor(nodes);
    std::string hint = changed_settings(nodes);
    if (!share.fits())
        hint = fmt::format(
            "the link carries {:.0f} Mbit/s but its cameras need {:.0f}: lower rate, size or "
            "number",
            share.link_mbps, share.link_needed_mbps);
    else if (sensor.temperature_c > configuration_.max_temperature_c)
        hint = fmt::format("the camera is at {:.0f} degrees: cool it, or raise 'max_temperature_c'",
                           sensor.temperature_c);
    else if (without_clock_)
        hint = "its clock stood still: it is paired without it; power the camera off and on";
    else if (pipeline_.report().ptp_lost && !pipeline_.by_ptp())
        hint =
            "its clock lost PTP, and its frames are paired as before: check the PTP master and the "
            "network";
    else if (meter_ && !meter_->usable())
        hint =
            "auto exposure cannot meter this pixel format: use Mono or Bayer of 8 to 16 bits, "
            "unpacked";
    {
        const std::lock_guard lock(mutex_);
        report_.bandwidth = share;
        report_.sensor = sensor;
    }
    if (streaming_) set_state(CameraState::streaming, hint);
}

/// A camera that is mute would hold this thread for seconds with each reading: what it said last is
/// kept.
SensorState Camera::read_sensor(const AravisNodeMap& nodes) {
    if (streaming_ && mute()) return report().sensor;
    const SensorState sensor = sensor_state(nodes, sensor_features_);
    pipeline_.set_sensor_state(sensor);
    return sensor;
}

/// The board learns of an exposure before the camera does: it is on the way when the camera takes
/// it.
void Camera::control_exposure(AravisNodeMap& nodes) {
    const auto seen = meter_->newest(exposure_holds_);
    const auto wanted = seen ? exposure_->update(*seen) : std::nullopt;
    if (!wanted) return;
    hooks_.exposure(*wanted, configuration_.auto_exposure.delay_frames);
    pipeline_.set_camera_exposure(*wanted, host_now());
    const std::string exposure_us = fmt::format("{}", static_cast<double>(wanted->ns) * 1e-3);
    if (const auto done = nodes.set(exposure_feature_, exposure_us); !done) {
        log(LogLevel::warning, configuration_.name, "exposure cannot be set: {}",
            done.error().message());
        pipeline_.set_camera_exposure({}, host_now());
    } else {
        read_exposure(nodes);  // the camera may round it
    }
    const double period_ns = 1e9 / configuration_.rate_hz;
    exposure_holds_ =
        host_now() +
        Duration{std::llround(period_ns * (configuration_.auto_exposure.delay_frames + 2.0))};
}

/// A camera that is mute would hold this thread for seconds: it is asked only while frames come.
void Camera::read_exposure(const AravisNodeMap& nodes) {
    next_reading_ = host_now() + exposure_reading_interval;
    if (exposure_feature_.empty() || mute()) return;
    const double us = nodes.read_number(exposure_feature_).value_or(0);
    pipeline_.read_exposure({std::llround(us * 1e3)}, host_now());
}

}  // namespace versavis::daemon

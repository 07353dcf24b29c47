// SPDX-License-Identifier: BSD-3-Clause
#include "service.hpp"

#include <algorithm>
#include <cstring>

#include "versavis/ring/path.hpp"

namespace versavis::daemon {

namespace {

constexpr Duration status_interval = milliseconds(500);
constexpr std::uint64_t status_size = 64 * 1024;
constexpr std::uint32_t status_slots = 8;
constexpr std::uint32_t imu_items = 16384;  // 16 s at 1 kHz
constexpr std::uint32_t event_items = 4096;
constexpr std::uint32_t clock_items =
    65536;  // 8 MiB: a minute of an IMU at 1 kHz, 5 of one at 200 Hz

EventKind event_kind(wire::EventKind kind) {
    switch (kind) {
        case wire::EventKind::trigger_skipped: return EventKind::trigger_skipped;
        case wire::EventKind::stray_edge: return EventKind::stray_edge;
        case wire::EventKind::output_late: return EventKind::output_late;
        case wire::EventKind::edge_overflow: return EventKind::edge_overflow;
        case wire::EventKind::pps: return EventKind::pps;
        case wire::EventKind::aux_pulse: return EventKind::aux_pulse;
        case wire::EventKind::sync_pulse: return EventKind::sync_pulse;
        case wire::EventKind::input_noisy: return EventKind::input_noisy;
        case wire::EventKind::illumination_limited: return EventKind::illumination_limited;
        case wire::EventKind::imu_ready: return EventKind::imu_ready;
        case wire::EventKind::imu_failed: return EventKind::imu_failed;
        case wire::EventKind::imu_silent: return EventKind::imu_silent;
        case wire::EventKind::utc_label: return EventKind::utc_label;
    }
    return {};
}

EventReason skip_reason(std::uint16_t detail) {
    switch (static_cast<wire::SkipReason>(detail)) {
        case wire::SkipReason::busy: return EventReason::camera_busy;
        case wire::SkipReason::late: return EventReason::too_late;
        case wire::SkipReason::full: return EventReason::queue_full;
    }
    return EventReason::none;
}

bool of_camera(wire::EventKind kind) {
    return kind == wire::EventKind::trigger_skipped || kind == wire::EventKind::stray_edge;
}

bool of_imu(wire::EventKind kind) {
    return kind == wire::EventKind::imu_ready || kind == wire::EventKind::imu_failed ||
           kind == wire::EventKind::imu_silent;
}

/// What is asked of a board whose firmware is too old for it, and what to do; empty: nothing.
std::string missing_capability(const Configuration& configuration, std::uint32_t capabilities) {
    if (configuration.clock.align && (capabilities & wire::capability_host_grid) == 0)
        return "its grid cannot be aligned by the host: update its firmware, or set align = false";
    if (configuration.ports.nmea && (capabilities & wire::capability_nmea) == 0)
        return "it does not read NMEA: update its firmware, or set nmea = false";
    return "";
}

}  // namespace

Expected<std::unique_ptr<Service>> Service::create(const Configuration& configuration) {
    auto output =
        clock::OutputClock::create(configuration.clock.output, configuration.clock.force_tai);
    if (!output) return Unexpected(output.error());
    auto directory = ring::OwnedDirectory::claim(instance_directory(configuration.instance));
    if (!directory) return Unexpected(directory.error());
    ring::Shape shape{"status", ring::StreamKind::status, status_slots, status_slots, status_size};
    auto status_ring = ring::Writer::create(directory->path(), shape);
    if (!status_ring) return Unexpected(status_ring.error());
    std::unique_ptr<Service> service(new Service(configuration, std::move(*directory),
                                                 std::move(*output), std::move(*status_ring)));
    if (auto made = service->make_parts(); !made) return Unexpected(made.error());
    return service;
}

Service::Service(const Configuration& configuration, ring::OwnedDirectory directory,
                 clock::OutputClock output, ring::Writer status_ring)
    : configuration_(configuration),
      directory_(std::move(directory)),
      translator_(std::move(output), configuration.clock.pps),
      status_ring_(std::move(status_ring)),
      asymmetries_(configuration.state_directory),
      alignment_(configuration.clock, board_configuration(configuration)),
      started_(host_now()) {}

Expected<> Service::make_parts() {
    environment_.ring_directory = directory_.path();
    const std::filesystem::path own_presets = configuration_.preset_directory;
    auto presets = load_presets(own_presets.empty() ? default_preset_directory() : own_presets);
    if (!presets) return Unexpected(presets.error());
    environment_.presets = std::move(*presets);
    auto event_ring =
        ring::Writer::create(directory_.path(), {"events", ring::StreamKind::events, event_items});
    if (!event_ring) return Unexpected(event_ring.error());
    events_ = std::make_unique<EventJournal>(std::move(*event_ring), translator_);
    auto clock_ring =
        ring::Writer::create(directory_.path(), {"clock", ring::StreamKind::clock, clock_items});
    if (!clock_ring) return Unexpected(clock_ring.error());
    clock_recorder_ = std::make_unique<ClockRecorder>(std::move(*clock_ring), translator_);
    for (const ImuConfiguration& imu : configuration_.imus) {
        auto ring =
            ring::Writer::create(directory_.path(), {imu.name, ring::StreamKind::imu, imu_items});
        if (!ring) return Unexpected(ring.error());
        imus_.push_back(std::make_unique<ImuPipeline>(imu, std::move(*ring), translator_));
    }
    for (const CameraConfiguration& camera : configuration_.cameras) add_camera(camera);
    BoardListener& self = *this;
    board_ = std::make_unique<BoardLink>([this] { return open_byte_stream(configuration_.board); },
                                         board_configuration(configuration_),
                                         configuration_.clock.exchange_rate_hz, translator_,
                                         *clock_recorder_, self);
    return {};
}

void Service::add_camera(const CameraConfiguration& configuration) {
    CameraUnit unit;
    unit.configuration = configuration;
    const auto index = static_cast<std::uint32_t>(cameras_.size());
    unit.pipeline = std::make_unique<CameraPipeline>(configuration, index, translator_, *events_);
    CameraPipeline* pipeline = unit.pipeline.get();
    Camera::Hooks hooks;
    hooks.streaming = [this, pipeline, index, name = configuration.name] {
        events_->add({EventKind::camera_connected, EventReason::none, index, name});
        if (pipeline->triggered()) start(*pipeline, pipeline->first_start());
    };
    hooks.lost = [this, pipeline, index, name = configuration.name,
                  master_name = configuration.master] {
        if (pipeline->triggered()) board_->stop_cameras(pipeline->board_mask());
        // A slave's start may have slowed its master down.
        const CameraUnit* master = find_camera(master_name);
        if (master != nullptr && master->camera->streaming())
            board_->start_cameras(master->pipeline->board_mask(), pairing::Start::steady);
        events_->add({EventKind::camera_lost, EventReason::none, index, name});
    };
    hooks.exposure = [this, pipeline, configuration](Duration exposure) {
        const std::uint64_t from =
            pipeline->newest_trigger() + 1 + configuration.auto_exposure.delay_frames;
        if (pipeline->triggered()) board_->announce_exposure(configuration.output, from, exposure);
    };
    unit.camera =
        std::make_unique<Camera>(configuration, environment_, *pipeline, std::move(hooks));
    cameras_.push_back(std::move(unit));
}

void Service::start() {
    const bool board_needed =
        !imus_.empty() || std::any_of(cameras_.begin(), cameras_.end(), [](const CameraUnit& unit) {
            return unit.pipeline->triggered();
        });
    // Before the cameras make their rings: readers of streams that are no longer configured learn
    // that they are gone.
    std::vector<std::string> configured;
    for (const CameraUnit& unit : cameras_) {
        configured.push_back(unit.configuration.name);
        configured.push_back(unit.configuration.name + evidence_suffix);
    }
    directory_.remove_stale(configured);
    if (board_needed) board_->start();
    for (CameraUnit& unit : cameras_) unit.camera->start();
}

Service::~Service() {
    for (CameraUnit& unit : cameras_)
        unit.camera->request_stop();  // all at once: each may take its time
    for (CameraUnit& unit : cameras_) unit.camera->stop();
    if (board_) board_->stop();
}

void Service::start(CameraPipeline& pipeline, pairing::Start how) {
    pipeline.start_requested(how, host_now());
    board_->start_cameras(pipeline.board_mask(), how);
}

void Service::start_camera(CameraUnit& unit, pairing::Start how) {
    start(*unit.pipeline, how);
    // Lost meanwhile: its own stop may have overtaken this start.
    if (!unit.camera->streaming()) board_->stop_cameras(unit.pipeline->board_mask());
}

const Service::CameraUnit* Service::find_camera(const std::string& name) const {
    for (const CameraUnit& unit : cameras_)
        if (unit.configuration.name == name) return &unit;
    return nullptr;
}

Service::CameraUnit* Service::camera_at(unsigned output) {
    for (CameraUnit& unit : cameras_)
        if (unit.pipeline->triggered() && unit.configuration.output == output) return &unit;
    return nullptr;
}

/// Before the clock is: no record of the old life may be translated by the new clock.
void Service::board_restarted() {
    for (auto& imu : imus_) imu->board_restarted();
    for (CameraUnit& unit : cameras_)
        if (unit.pipeline->triggered()) unit.pipeline->reset();
}

/// Before any camera starts: then its first exposure lies on the grid already.
void Service::board_synchronised() {
    use_asymmetry_of(board_->report().port);
    alignment_.begin();
    align_grid(host_now());
}

/// At the same port again, what was measured meanwhile stays, also where it could not be stored.
void Service::use_asymmetry_of(const std::string& port) {
    if (port == asymmetry_port_) return;
    const auto stored = asymmetries_.load(port);
    if (!stored) log(LogLevel::warning, "clock", "{}", stored.error().message());
    translator_.use_asymmetry(stored.value_or(std::nullopt));
    kept_asymmetry_ = translator_.report().asymmetry.offset;
    asymmetry_port_ = port;
}

void Service::align_grid(HostTime now) {
    if (!alignment_.wanted() || (board_->report().capabilities & wire::capability_host_grid) == 0)
        return;
    if (const auto message = alignment_.message(now, translator_)) board_->align_grid(*message);
}

/// What PPS measured outlives the service; it is written when it changed by more than it is worth.
void Service::keep_asymmetry(const clock::ClockReport& clock, const std::string& port) {
    if (clock.asymmetry_source != clock::AsymmetrySource::pps || port.empty() ||
        absolute(clock.asymmetry.offset - kept_asymmetry_) < clock.asymmetry.sigma)
        return;
    kept_asymmetry_ = clock.asymmetry.offset;
    const auto saved = asymmetries_.save(port, clock.asymmetry);
    if (!saved) log(LogLevel::warning, "clock", "{}", saved.error().message());
}

void Service::board_connected() {
    events_->add(
        {EventKind::board_connected, EventReason::none, 0, "board", board_->report().nonce});
    for (CameraUnit& unit : cameras_) {
        if (!unit.pipeline->triggered()) continue;
        unit.pipeline->reset();
        if (unit.camera->streaming()) start_camera(unit, unit.pipeline->first_start());
    }
}

void Service::board_lost() { events_->add({EventKind::board_lost, EventReason::none, 0, "board"}); }

void Service::exposure(const wire::Exposure& record) {
    CameraUnit* unit = camera_at(record.camera);
    if (unit == nullptr) return;
    unit->pipeline->add(record);
    if (!alignment_.wanted() || (record.flags & wire::exposure_measured) == 0) return;
    const auto stamp =
        translator_.translate(middle(BoardTime{record.start_ns}, BoardTime{record.end_ns}));
    if (stamp) alignment_.exposure(record, stamp->output, host_now());
}

void Service::imu_sample(const wire::ImuSample& sample) {
    for (auto& imu : imus_)
        if (imu->port() == sample.imu) imu->add(sample);
}

void Service::board_event(const wire::Event& event) {
    if (event.kind == wire::EventKind::pps) translator_.pps_pulse(BoardTime{event.time_ns});
    if (event.kind == wire::EventKind::utc_label)
        translator_.pps_label(BoardTime{event.time_ns}, event.value * 1'000'000'000);
    JournalEntry entry;
    entry.kind = event_kind(event.kind);
    if (entry.kind == EventKind{}) return;  // of a newer board
    entry.source = event.source;
    entry.source_name = "board";
    entry.value = event.value;
    entry.board_time = BoardTime{event.time_ns};
    if (event.kind == wire::EventKind::trigger_skipped) entry.reason = skip_reason(event.detail);
    if (of_camera(event.kind)) {
        const CameraUnit* unit = camera_at(event.source);
        entry.source = unit != nullptr ? static_cast<std::uint32_t>(unit - cameras_.data()) : 0U;
        if (unit != nullptr) entry.source_name = unit->configuration.name;
    } else if (of_imu(event.kind)) {
        for (auto& imu : imus_)
            if (imu->port() == event.source) entry.source_name = imu->report().name;
        const bool ready = event.kind == wire::EventKind::imu_ready;
        log(ready ? LogLevel::info : LogLevel::warning, entry.source_name, "{}: step {}, value {}",
            to_string(entry.kind), event.detail, event.value);
    }
    events_->add(entry);
}

void Service::tick() {
    const HostTime now = host_now();
    for (CameraUnit& unit : cameras_) {
        const auto how = unit.pipeline->advance(now);
        if (how && unit.camera->streaming() && board_->running()) start_camera(unit, *how);
    }
    if (board_->running()) align_grid(now);
    for (auto& imu : imus_) imu->heartbeat(now);
    events_->heartbeat(now);
    clock_recorder_->tick(now);
    status_ring_.heartbeat(now);
    if (now >= next_status_) publish_status(now);
}

std::vector<StreamStatus> Service::stream_status(HostTime now) {
    std::vector<StreamStatus> streams;
    const auto add = [&](const std::string& name, const char* kind, std::uint64_t items) {
        auto& [before, at] = last_items_[name];
        const double seconds = static_cast<double>((now - at).ns) * 1e-9;
        streams.push_back(
            {name, kind, items,
             at.ns == 0 ? 0 : static_cast<double>(items - std::min(items, before)) / seconds});
        before = items;
        at = now;
    };
    for (CameraUnit& unit : cameras_)
        add(unit.configuration.name, "frames", unit.pipeline->items());
    for (auto& imu : imus_) add(imu->report().name, "imu", imu->report().published);
    add("events", "events", events_->items());
    add("clock", "clock", clock_recorder_->items());
    add("status", "status", status_ring_.head());
    return streams;
}

void Service::publish_status(HostTime now) {
    next_status_ = now + status_interval;
    Status status;
    status.instance = configuration_.instance;
    status.started = started_;
    status.now = now;
    status.board_needed = !imus_.empty();
    status.board = board_->report();
    status.clock = translator_.report();
    keep_asymmetry(status.clock, status.board.port);
    status.grid = alignment_.report(now);
    if (status.board.state == BoardState::running && status.board.hint.empty())
        status.board.hint = missing_capability(configuration_, status.board.capabilities);
    for (CameraUnit& unit : cameras_) {
        status.board_needed = status.board_needed || unit.pipeline->triggered();
        const PipelineReport report = unit.pipeline->report();
        const Duration patience =
            seconds(1) + Duration{static_cast<std::int64_t>(3e9 / unit.configuration.rate_hz)};
        const bool stalled = unit.pipeline->triggered() && now - report.last_frame > patience;
        const bool unproved = unit.pipeline->triggered() && !stalled &&
                              now - report.last_proof > patience + seconds(5);
        status.cameras.push_back({unit.configuration.name, unit.pipeline->triggered(), stalled,
                                  unproved, unit.camera->report(), report});
    }
    for (auto& imu : imus_) status.imus.push_back(imu->report());
    status.streams = stream_status(now);
    health_ = daemon::health(status);
    const std::string document = to_json(status);
    const auto slot = status_ring_.acquire();
    if (!slot) return;
    const std::size_t size = std::min<std::size_t>(document.size(), status_ring_.slot_size());
    std::memcpy(status_ring_.slot_data(*slot), document.data(), size);
    const clock::Stamp stamp = translator_.translate(now, microseconds(1));
    status_ring_.publish(*slot, static_cast<std::uint32_t>(size), stamp.output, {});
}

}  // namespace versavis::daemon

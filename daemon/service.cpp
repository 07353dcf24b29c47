// SPDX-License-Identifier: BSD-3-Clause
#include "service.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <system_error>
#include <utility>

#include "base/log.hpp"
#include "base/state_directory.hpp"
#include "board/board_event.hpp"
#include "health/diagnosis.hpp"
#include "settings/board_configuration.hpp"
#include "settings/board_parts.hpp"
#include "settings/line_delays.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::daemon {

namespace {

/// Items that rings keep for readers that sleep. IMU, unless `history_s` says more or less: 16 s at
/// 1 kHz, 2 MiB. Events: 0.5 MiB. Clock: a minute with an IMU at 1 kHz, 8 MiB.
constexpr std::uint32_t imu_items = 16384;
constexpr std::uint32_t event_items = 4096;
constexpr std::uint32_t clock_items = 65536;

/// For cameras that are mute when the service is to end.
constexpr Duration stop_patience = seconds(1);

ring::Shape ring_of(const ImuConfiguration& imu) {
    ring::Shape shape{imu.name, ring::StreamKind::imu, imu_items};
    const auto samples = static_cast<std::uint32_t>(std::ceil(imu.rate_hz * imu.history_s));
    // The oldest items are about to be overwritten: the history is what lies before them.
    if (samples > 0) shape.descriptor_count = std::bit_ceil(samples + 1);
    return shape;
}

/// Of all rings: readers of these are handed over.
std::vector<std::string> ring_names(const Configuration& configuration) {
    std::vector<std::string> names{"status", "events", "clock"};
    if (configuration.ports.nmea) names.emplace_back(nmea_stream);
    for (const ImuConfiguration& imu : configuration.imus) names.push_back(imu.name);
    for (const CameraConfiguration& camera : configuration.cameras) {
        names.push_back(camera.name);
        names.push_back(camera.name + evidence_suffix);
    }
    return names;
}

/// With the latencies that the board must know.
Configuration for_board(Configuration configuration, const std::vector<CameraPreset>& presets) {
    for (CameraConfiguration& camera : configuration.cameras) use_named_preset(presets, camera);
    return configuration;
}

std::vector<std::string> names_of(const std::vector<TimeOutputConfiguration>& outputs) {
    std::vector<std::string> names;
    for (const TimeOutputConfiguration& output : outputs) names.push_back(output.name);
    return names;
}

ring::Place place_of(const ring::OwnedDirectory& directory, const Configuration& configuration) {
    return {directory.path(), configuration.memory.sealed};
}

}  // namespace

Expected<std::unique_ptr<Service>> Service::create(const Configuration& configuration) {
    auto output =
        clock::OutputClock::create(configuration.clock.output, configuration.clock.force_tai);
    if (!output) return Unexpected(output.error());
    auto directory = ring::OwnedDirectory::claim(instance_directory(configuration.instance));
    if (!directory) return Unexpected(directory.error());
    // First what is dead: its memory may be needed, and readers of streams that are no longer
    // configured learn that they are gone.
    directory->remove_stale(ring_names(configuration));
    auto status = StatusPublisher::create(place_of(*directory, configuration));
    if (!status) return Unexpected(status.error());
    std::unique_ptr<Service> service(
        new Service(configuration, std::move(*directory), std::move(*output), std::move(*status)));
    if (auto made = service->make_rings(); !made) return Unexpected(made.error());
    if (auto made = service->make_cameras(); !made) return Unexpected(made.error());
    return service;
}

Service::Service(const Configuration& configuration, ring::OwnedDirectory directory,
                 clock::OutputClock output, StatusPublisher status)
    : configuration_(configuration),
      time_output_names_(names_of(configuration.time_outputs)),
      directory_(std::move(directory)),
      translator_(std::move(output), configuration.clock.pps, directory_.epochs().first(),
                  configuration.clock.on_second_conflict),
      status_(std::move(status)),
      asymmetry_(configuration.state_directory, translator_),
      alignment_(configuration.clock, board_configuration(configuration)),
      time_announcer_(configuration.time_outputs),
      started_(host_now()) {}

Expected<> Service::make_rings() {
    const ring::Place place = place_of(directory_, configuration_);
    auto event_ring =
        ring::Writer::create(place, {"events", ring::StreamKind::events, event_items});
    if (!event_ring) return Unexpected(event_ring.error());
    events_ = std::make_unique<EventJournal>(std::move(*event_ring), translator_);
    auto clock_ring = ring::Writer::create(place, {"clock", ring::StreamKind::clock, clock_items});
    if (!clock_ring) return Unexpected(clock_ring.error());
    clock_recorder_ = std::make_unique<ClockRecorder>(std::move(*clock_ring), translator_);
    for (const ImuConfiguration& imu : configuration_.imus) {
        auto ring = ring::Writer::create(place, ring_of(imu));
        if (!ring) return Unexpected(ring.error());
        imus_.push_back(
            std::make_unique<ImuPipeline>(imu, std::move(*ring), translator_, *events_));
    }
    if (!configuration_.ports.nmea) return {};
    return nmea_.configure(place, configuration_.ports.nmea_baud);
}

Expected<> Service::make_cameras() {
    auto presets = load_presets(preset_directory(configuration_));
    if (!presets) return Unexpected(presets.error());
    BoardListener& self = *this;
    board_ = std::make_unique<BoardLink>(
        [board = configuration_.board] { return open_byte_stream(board); },
        for_board(configuration_, *presets), configuration_.clock.exchange_rate_hz, translator_,
        *clock_recorder_, self);
    cameras_ = std::make_unique<CameraGroup>(
        place_of(directory_, configuration_), std::move(*presets),
        state_directory(configuration_.state_directory), translator_, *events_, *board_);
    for (const CameraConfiguration& camera : configuration_.cameras) cameras_->add(camera);
    return {};
}

/// A sandbox may keep the kernel's state from this process.
void Service::report_hidden_clock() {
    const int error = translator_.report().kernel.error;
    if (error == 0) return;
    log(LogLevel::info, "clock",
        "whether the host's clock is disciplined cannot be read: {}; a container or the drop-in "
        "closed.conf may forbid it",
        std::generic_category().message(error));
}

void Service::start() {
    report_hidden_clock();
    const auto kept = make_state_directory(configuration_.state_directory);
    if (!kept) log(LogLevel::warning, "service", "{}", kept.error().message());
    if (board_needed()) board_->start();
    cameras_->start();
}

void Service::reconfigure(const Configuration& configuration) {
    set_log_level(configuration.log_level);
    changed_ = host_now();
    const Configuration before = for_board(configuration_, cameras_->presets());
    const Configuration after = for_board(configuration, cameras_->presets());
    const wire::Configuration old_board = board_configuration(before);
    const wire::Configuration new_board = board_configuration(after);
    if (configuration.ports.nmea)
        if (const auto made =
                nmea_.configure(place_of(directory_, configuration), configuration.ports.nmea_baud);
            !made)
            log(LogLevel::error, nmea_stream, "{}", made.error().message());
    configuration_ = configuration;
    // First the cameras: they are started as soon as the board has their settings.
    cameras_->reconfigure(configuration.cameras);
    if (std::memcmp(&old_board, &new_board, sizeof new_board) != 0 ||
        before.ports.follow_sync != after.ports.follow_sync) {
        alignment_.reconfigure(new_board);
        board_->reconfigure(after);
    }
}

void Service::ask(const std::string& camera, CameraWish wish) {
    changed_ = host_now();
    cameras_->ask(camera, wish);
}

ChangeReport Service::changes(const std::string& camera) const { return cameras_->changes(camera); }

bool Service::report_lidars(const std::vector<LidarReport>& reports) {
    return lidars_.add(reports, host_now());
}

bool Service::stop() {
    const bool ended = cameras_->stop(host_now() + stop_patience);
    board_->stop();
    return ended;
}

Service::~Service() {
    if (board_) board_->stop();
}

/// Before the clock is: no record of the old life may be translated by the new clock.
void Service::board_restarted() {
    grid_.forget();
    for (auto& imu : imus_) imu->board_restarted();
    nmea_.board_restarted();
    cameras_->board_restarted();
}

void Service::board_configured(const wire::ConfigurationAnswer& answer) {
    grid_.configured(answer);
}

/// Before any camera starts: then its first exposure lies on the grid already.
void Service::board_synchronised() {
    asymmetry_.use(board_->report().port);
    ticks_.grid_began(host_now());
    alignment_.begin();
    time_announcer_.begin();
    announce(host_now());
}

void Service::board_connected() {
    const std::uint32_t nonce = board_->report().nonce;
    events_->add({EventKind::board_connected, EventReason::none, 0, "board", nonce});
    cameras_->board_connected();
}

void Service::cameras_changed(std::uint8_t outputs, std::uint8_t other_rate) {
    ticks_.rate_changed(other_rate, host_now());
    alignment_.begin();  // what was measured at other rates says nothing
    cameras_->board_changed(outputs);
}

void Service::board_lost() { events_->add({EventKind::board_lost, EventReason::none, 0, "board"}); }

/// Where the seconds lie, to the board's grid and its time outputs.
void Service::announce(HostTime now) {
    const std::uint32_t capabilities = board_->report().capabilities;
    if (alignment_.wanted() && (capabilities & wire::capability_host_grid) != 0)
        if (const auto message = alignment_.message(now, translator_)) board_->align_grid(*message);
    if ((capabilities & wire::capability_time_output) == 0)
        time_announcer_.board_lacks_them();
    else
        for (const wire::TimeOutput& message : time_announcer_.messages(now, translator_))
            board_->announce_time(message);
}

void Service::exposure(const wire::Exposure& record, HostTime received) {
    wire::Exposure numbered = record;
    numbered.tick = ticks_.number(record.camera, record.tick);
    const auto stamp = cameras_->add(numbered, received, grid_.trigger(record.camera, record.tick));
    if (stamp) alignment_.exposure(record, stamp->output, received);
}

bool Service::imu_sample(const wire::ImuSample& sample, HostTime received) {
    for (auto& imu : imus_)
        if (imu->port() == sample.imu) return imu->add(sample, received);
    return false;
}

void Service::sentence(const wire::Sentence& sentence, HostTime received) {
    nmea_.add(sentence, received);
}

void Service::exchange_doubted(const Implausibility& doubt) {
    events_->add(
        {EventKind::message_doubted, doubt.reason, 0, "board", doubt.said, {}, doubt.expected});
}

/// A doubted event is reported, but nothing is made of its time.
void Service::board_event(const wire::Event& event, HostTime received) {
    const auto doubt = event_witness_.judge(event, received);
    if (!doubt) use_pps(event);
    if (!doubt) check_time_pulse(event, received);
    if (!doubt && event.kind == wire::BoardEventKind::aux_pulse)
        cameras_->auxiliary_pulse(event.source, BoardTime{event.time_ns});
    auto entry = journal_entry(event);
    if (!entry) return;
    if (doubt) {
        entry->suspect = true;
        entry->reason = doubt->reason;
        entry->expected = doubt->expected;
    }
    const EventSource source = source_of(event.kind);
    if (const auto count = skipped_triggers(event)) {
        cameras_->triggers_skipped(event.source, count);
        entry->value = static_cast<std::int64_t>(
            ticks_.number(event.source, static_cast<std::uint64_t>(event.value)));
    }
    if (event.kind == wire::BoardEventKind::stored) unkept_ = event.value == 0;
    if (const auto line = remark(event)) log(line->level, "board", "{}", line->text);
    if (source == EventSource::camera) cameras_->name_source(*entry);
    if (event.kind == wire::BoardEventKind::time_pulse && event.source < time_output_names_.size())
        entry->source_name = time_output_names_[event.source];
    if (source == EventSource::imu) {
        for (auto& imu : imus_)
            if (imu->port() == event.source) {
                const bool is_new = imu->note_state(event, host_now());
                const ImuReport report = imu->report();
                entry->source_name = report.name;
                if (is_new)
                    log(report.working ? LogLevel::info : LogLevel::warning, report.name, "{}",
                        report.working ? "it answers, and samples" : describe_failure(report));
            }
    }
    events_->add(*entry);
}

void Service::use_pps(const wire::Event& event) {
    if (event.kind == wire::BoardEventKind::pps) translator_.pps_pulse(BoardTime{event.time_ns});
    if (event.kind == wire::BoardEventKind::utc_label)
        if (const auto differ =
                translator_.pps_label(BoardTime{event.time_ns}, event.value * 1'000'000'000)) {
            events_->add({EventKind::seconds_differ, EventReason::none, 0, "board", *differ,
                          BoardTime{event.time_ns}});
            log(*differ == 0 ? LogLevel::info : LogLevel::warning, "clock",
                "the receiver's seconds less the host's: {}", *differ);
        }
}

void Service::check_time_pulse(const wire::Event& event, HostTime received) {
    if (event.kind != wire::BoardEventKind::time_pulse) return;
    if (const auto error = time_announcer_.sent(event, received, translator_))
        log(LogLevel::error, "board",
            "a time output sent the pulse of a second {} ns off it: it is silent for a while",
            error->ns);
}

void Service::tick() {
    const HostTime now = host_now();
    cameras_->tick(now);
    if (board_->running()) announce(now);
    for (auto& imu : imus_) imu->heartbeat(now);
    nmea_.heartbeat(now);
    events_->heartbeat(now);
    clock_recorder_->tick(now);
    directory_.epochs().keep(translator_.output_now().epoch);
    status_.heartbeat(now);
    if (status_.due(now)) status_.publish(collect_status(now), translator_);
}

void Service::report_output_step(const OutputStep& step) {
    const Duration by = step.after - step.before;
    log(LogLevel::warning, "clock",
        "the output clock stepped by {} ns, from {} to {} ns after the host's: a new epoch begins",
        by.ns, step.before.ns, step.after.ns);
    events_->add({EventKind::output_clock_stepped, EventReason::none, 0, "clock", by.ns});
}

/// Of the host's clock, where that names the seconds of PPS pulses.
void Service::report_discipline(const clock::KernelState& kernel) {
    if (std::exchange(host_disciplined_, kernel.synchronised) == kernel.synchronised) return;
    events_->add({EventKind::host_undisciplined, EventReason::none, 0, "clock",
                  kernel.synchronised ? 0 : 1});
    log(kernel.synchronised ? LogLevel::info : LogLevel::warning, "clock",
        "the host's clock, which names the seconds of PPS pulses, is {}disciplined",
        kernel.synchronised ? "" : (kernel.error == 0 ? "not " : "not known to be "));
}

Status Service::collect_status(HostTime now) {
    Status status;
    status.instance = configuration_.instance;
    status.release = VERSAVIS_VERSION;
    status.configuration = std::filesystem::absolute(configuration_.entry.place.path).string();
    status.started = started_;
    status.changed = changed_;
    status.now = now;
    status.board_needed = board_needed();
    status.board = board_->report();
    status.board.unkept = unkept_;
    if (status.board.state == BoardState::running && status.board.hint.empty())
        status.board.hint = missing_capability(configuration_, status.board.capabilities);
    status.clock = translator_.report();
    status.pps_labels = configuration_.clock.pps;
    if (status.pps_labels == clock::PpsLabels::host) report_discipline(status.clock.kernel);
    asymmetry_.keep(status.clock);
    if (const auto step = output_steps_.see(status.clock)) report_output_step(*step);
    status.grid = alignment_.report(now);
    for (TimeOutputReport& report : time_announcer_.report(now))
        status.time_outputs.push_back({std::move(report)});
    for (LidarReport& report : lidars_.report(now)) status.lidars.push_back({std::move(report)});
    status.cameras = cameras_->status();
    status.streams = cameras_->streams();
    status.ptp = cameras_->ptp();
    for (auto& imu : imus_) {
        status.imus.push_back({imu->report()});
        const ImuReport& report = status.imus.back().report;
        status.streams.push_back({report.name, "imu", report.published});
    }
    status.nmea = nmea_.report();
    if (status.nmea) status.streams.push_back({nmea_stream, "nmea", status.nmea->sentences});
    status.streams.push_back({"events", "events", events_->items()});
    status.streams.push_back({"clock", "clock", clock_recorder_->items()});
    return status;
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "camera_group.hpp"

#include <algorithm>

namespace versavis::daemon {

CameraGroup::CameraGroup(const ring::Place& rings, std::vector<CameraPreset> presets,
                         const std::filesystem::path& state_directory,
                         clock::Translator& translator, EventJournal& events, BoardLink& board)
    : environment_(rings, std::move(presets), state_directory),
      translator_(translator),
      events_(events),
      board_(board),
      ptp_(translator) {}

void CameraGroup::add(const CameraConfiguration& configuration) {
    const auto index = static_cast<std::uint32_t>(units_.size());
    Unit unit;
    unit.configuration = configuration;
    unit.pipeline =
        std::make_unique<CameraPipeline>(configuration, index, translator_, events_, &ptp_);
    unit.camera = std::make_unique<Camera>(configuration, environment_, *unit.pipeline,
                                           hooks(configuration, *unit.pipeline, index));
    units_.push_back(std::move(unit));
}

Camera::Hooks CameraGroup::hooks(const CameraConfiguration& configuration, CameraPipeline& pipeline,
                                 std::uint32_t index) {
    Camera::Hooks hooks;
    hooks.streaming = [this, &pipeline, index, name = configuration.name] {
        events_.add({EventKind::camera_connected, EventReason::none, index, name});
        if (pipeline.triggered()) start(pipeline, pipeline.first_start());
    };
    hooks.lost = [this, &pipeline, index, name = configuration.name,
                  master_name = configuration.master] {
        if (pipeline.triggered()) board_.stop_cameras(pipeline.board_mask());
        // A slave's start may have slowed its master down.
        const Unit* master = find(master_name);
        if (master != nullptr && master->camera->streaming())
            board_.start_cameras(master->pipeline->board_mask(), pairing::Start::steady);
        events_.add({EventKind::camera_lost, EventReason::none, index, name});
    };
    hooks.exposure = [this, &pipeline](Duration exposure, unsigned delay_frames) {
        if (pipeline.triggered())
            board_.announce_exposure(pipeline.output(),
                                     pipeline.newest_trigger() + 1 + delay_frames, exposure);
    };
    return hooks;
}

void CameraGroup::start() {
    for (const Unit& unit : units_) unit.camera->start();
}

void CameraGroup::reconfigure(const std::vector<CameraConfiguration>& configurations) {
    for (Unit& unit : units_) {
        const auto next = std::find_if(
            configurations.begin(), configurations.end(),
            [&](const CameraConfiguration& it) { return it.name == unit.configuration.name; });
        if (next == configurations.end() || *next == unit.configuration) continue;
        CameraConfiguration with_old_features = *next;
        with_old_features.features = unit.configuration.features;
        if (!(with_old_features == unit.configuration)) unit.pipeline->reconfigure(*next);
        unit.configuration = *next;
        unit.camera->change({*next, unit.enabled});
    }
}

void CameraGroup::ask(const std::string& camera, CameraWish wish) {
    for (Unit& unit : units_) {
        if (unit.configuration.name != camera) continue;
        unit.enabled = wish != CameraWish::stop;
        unit.camera->change({unit.configuration, unit.enabled, wish == CameraWish::restart});
    }
}

ChangeReport CameraGroup::changes(const std::string& camera) const {
    const Unit* unit = find(camera);
    return unit != nullptr ? unit->camera->changes() : ChangeReport{};
}

bool CameraGroup::stop(HostTime deadline) {
    for (const Unit& unit : units_) unit.camera->request_stop();  // each may take its time
    bool all = true;
    for (const Unit& unit : units_) all = unit.camera->ended_by(deadline) && all;
    return all && environment_.patient.unfinished() == 0;
}

void CameraGroup::start(CameraPipeline& pipeline, pairing::Start how) {
    pipeline.start_requested(how, host_now());
    board_.start_cameras(pipeline.board_mask(), how);
}

void CameraGroup::start_streaming(const Unit& unit, pairing::Start how) {
    start(*unit.pipeline, how);
    // Lost meanwhile: its own stop may have overtaken this start.
    if (!unit.camera->streaming()) board_.stop_cameras(unit.pipeline->board_mask());
}

void CameraGroup::tick(HostTime now) {
    for (const Unit& unit : units_) {
        const auto how = unit.pipeline->advance(now);
        if (how && unit.camera->streaming() && board_.running()) start_streaming(unit, *how);
    }
}

void CameraGroup::board_restarted() {
    for (const Unit& unit : units_)
        if (unit.pipeline->triggered()) unit.pipeline->reset();
}

void CameraGroup::board_connected() { board_changed(0xFF); }

void CameraGroup::board_changed(std::uint8_t outputs) {
    for (const Unit& unit : units_) {
        if (!unit.pipeline->triggered() || (outputs >> unit.pipeline->output() & 1U) == 0) continue;
        unit.pipeline->reset();
        if (unit.camera->streaming()) start_streaming(unit, unit.pipeline->first_start());
    }
}

std::optional<clock::Stamp> CameraGroup::add(const wire::Exposure& record, HostTime received,
                                             std::optional<BoardTime> expected) {
    const Unit* unit = at_output(record.camera);
    return unit != nullptr ? unit->pipeline->add(record, received, expected) : std::nullopt;
}

void CameraGroup::auxiliary_pulse(unsigned input, BoardTime at) {
    if (input > 1) return;  // the board has no such
    const std::string& name = pulse_input_names[wire::pulse_aux0 + input];
    for (const Unit& unit : units_)
        if (unit.pipeline->strobe_input() == name) unit.pipeline->line_rose(at);
}

void CameraGroup::triggers_skipped(unsigned output, std::uint64_t count) {
    if (const Unit* unit = at_output(output)) unit->pipeline->triggers_skipped(count);
}

void CameraGroup::name_source(JournalEntry& entry) const {
    const Unit* unit = at_output(entry.source);
    entry.source = unit != nullptr ? static_cast<std::uint32_t>(unit - units_.data()) : 0U;
    if (unit != nullptr) entry.source_name = unit->pipeline->name();
}

const CameraGroup::Unit* CameraGroup::find(const std::string& name) const {
    for (const Unit& unit : units_)
        if (unit.pipeline->name() == name) return &unit;
    return nullptr;
}

const CameraGroup::Unit* CameraGroup::at_output(unsigned output) const {
    for (const Unit& unit : units_)
        if (unit.pipeline->triggered() && unit.pipeline->output() == output) return &unit;
    return nullptr;
}

bool CameraGroup::any_needs_board() const {
    return std::any_of(units_.begin(), units_.end(), [](const Unit& unit) {
        return unit.pipeline->triggered() || !unit.pipeline->strobe_input().empty();
    });
}

std::optional<PtpReport> CameraGroup::ptp() {
    PtpReport report = ptp_.report();
    if (report.clocks.empty()) return std::nullopt;
    return report;
}

std::vector<CameraStatus> CameraGroup::status() const {
    std::vector<CameraStatus> cameras;
    for (const Unit& unit : units_)
        cameras.push_back({unit.configuration.name, unit.configuration, unit.camera->report(),
                           unit.pipeline->report()});
    return cameras;
}

std::vector<StreamStatus> CameraGroup::streams() const {
    std::vector<StreamStatus> streams;
    for (const Unit& unit : units_) {
        const std::string& name = unit.configuration.name;
        streams.push_back({name, "frames", unit.pipeline->items()});
        if (unit.pipeline->triggered())
            streams.push_back(
                {name + evidence_suffix, "evidence", unit.pipeline->evidence_items()});
    }
    return streams;
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "stream/camera_pipeline.hpp"

namespace versavis::daemon {

namespace {

/// Slots that hold published frames while all others wait for proof or are being received. At half,
/// a reader loses a frame while it copies it; at twice, fewer frames can wait for proof.
constexpr std::uint32_t slots_for_readers = 2;

/// Pulses by which the board's start pattern may last longer than its length says. At half, a
/// pattern could be asked for again before it ended; at twice, a lost start costs two pulses more.
constexpr int pattern_margin = 2;

pairing::Limits limits_of(const CameraConfiguration& configuration) {
    pairing::Limits limits;
    limits.latest_arrival = from_us(configuration.latest_arrival_ms * 1e3);
    limits.period = period_of(configuration);
    limits.pattern_duration = limits.period * (wire::start_pattern_length + pattern_margin);
    limits.frames_held = configuration.slots - configuration.buffers - slots_for_readers;
    limits.camera_clock = configuration.camera_clock;
    return limits;
}

}  // namespace

CameraPipeline::CameraPipeline(const CameraConfiguration& configuration, std::uint32_t index,
                               clock::Translator& translator, EventJournal& events)
    : configuration_(configuration),
      index_(index),
      translator_(translator),
      events_(events),
      frames_(configuration),
      evidence_(translator),
      completion_(configuration),
      check_(configuration),
      triggers_(configuration),
      limits_(limits_of(configuration)),
      pairing_(limits_, *this) {}

/// What pairing is told goes through here, so that the recording is complete.
void CameraPipeline::tell(const pairing::Evidence& evidence) {
    evidence_.record(evidence);
    pairing::apply(pairing_, evidence);
}

void CameraPipeline::begin_anew() {
    tell(pairing::Reset{});
    middles_.clear();  // of numbers that may come again
}

void CameraPipeline::count_refusal(EventReason reason) {
    const auto number = static_cast<std::size_t>(reason);
    if (number < report_.refused.size()) ++report_.refused[number];
}

Expected<> CameraPipeline::prepare(const std::filesystem::path& directory,
                                   std::uint64_t payload_size, bool has_clock) {
    const std::lock_guard lock(mutex_);
    if (triggered())
        if (auto opened = evidence_.open(directory, configuration_.name); !opened) return opened;
    begin_anew();
    limits_.camera_clock = configuration_.camera_clock && has_clock;
    pairing_.set_limits(limits_);
    tell(limits_);
    report_.last_proof = host_now();
    return frames_.prepare(directory, payload_size);
}

std::optional<std::uint32_t> CameraPipeline::acquire() {
    const std::lock_guard lock(mutex_);
    return frames_.acquire();
}

std::byte* CameraPipeline::slot_data(std::uint32_t slot) {
    const std::lock_guard lock(mutex_);
    return frames_.slot_data(slot);
}

void CameraPipeline::abandon(std::uint32_t slot, EventReason reason, std::uint64_t block_id) {
    const std::lock_guard lock(mutex_);
    frames_.abandon(slot);
    if (reason == EventReason::none) return;
    ++report_.incomplete;
    count_refusal(reason);
    report_.last_sign = host_now();
    triggers_.answered();
    if (triggered()) tell(pairing::Shortfall{block_id, reason});
    journal(EventKind::frame_without_trigger, reason, static_cast<std::int64_t>(block_id));
}

void CameraPipeline::add(const pairing::Arrival& arrival) {
    const std::lock_guard lock(mutex_);
    ++report_.received;
    report_.last_frame = report_.last_sign = arrival.arrived;
    if (arrival.camera_time.ns != 0 && arrival.camera_time == last_camera_time_)
        ++report_.clock_frozen;
    last_camera_time_ = arrival.camera_time;
    triggers_.answered();
    if (triggered()) return tell(arrival);
    ++report_.published;
    frames_.publish_arrived(arrival, translator_.translate(arrival.arrived, {}), false);
}

std::optional<clock::Stamp> CameraPipeline::add(const wire::Exposure& record) {
    const std::lock_guard lock(mutex_);
    ++report_.triggers;
    triggers_.recorded(record.trigger, host_now());
    report_.measured = measured(record);
    if (!report_.measured) ++report_.unmeasured;
    const bool started = record.start_ns != wire::no_time;
    report_.start_delay = {started ? record.start_ns - record.trigger_ns : 0};
    pairing::Exposure exposure = completion_.complete(record);
    const auto stamp = translator_.translate(middle(exposure.start, exposure.end));
    // A number that pairing holds already is a repeat: the record that came first counts.
    if (!stamp || !middles_.try_emplace(exposure.trigger, *stamp).second) {
        announce_unpaired(exposure, stamp ? EventReason::mismatch : EventReason::no_clock);
        return std::nullopt;
    }
    ExposureCompletion::place_on_host(exposure, record, stamp->host);
    report_.record_delay = host_now() - exposure.end_on_host;
    tell(exposure);
    return stamp;
}

void CameraPipeline::paired(const pairing::Arrival& arrival, const pairing::Exposure& exposure) {
    if (check_.contradicts(arrival, exposure)) {
        frame_unpaired(arrival, EventReason::wrong_exposure, &exposure);
    } else {
        report_.last_proof = arrival.arrived;
        ++report_.published;
        frames_.publish_proved(arrival, exposure, middles_.at(exposure.trigger));
    }
    // The newest used record may still be the guess for a suspect frame.
    middles_.erase(middles_.begin(), middles_.lower_bound(exposure.trigger));
}

void CameraPipeline::frame_unpaired(const pairing::Arrival& arrival, EventReason reason,
                                    const pairing::Exposure* guess) {
    ++report_.frames_without_trigger;
    count_refusal(reason);
    journal(EventKind::frame_without_trigger, reason, static_cast<std::int64_t>(arrival.block_id));
    if (configuration_.on_unproved == OnUnproved::withhold || reason == EventReason::out_of_order)
        return frames_.abandon(arrival.slot);
    publish_suspect(arrival, guess);
}

/// As well stamped as can be guessed: by the exposure that it may be of, else by its arrival.
void CameraPipeline::publish_suspect(const pairing::Arrival& arrival,
                                     const pairing::Exposure* guess) {
    ++report_.suspect;
    ++report_.published;
    const auto middle = guess != nullptr ? middles_.find(guess->trigger) : middles_.end();
    if (middle != middles_.end()) return frames_.publish_guessed(arrival, *guess, middle->second);
    frames_.publish_arrived(arrival, translator_.translate(arrival.arrived, {}), true);
}

void CameraPipeline::exposure_unpaired(const pairing::Exposure& exposure, EventReason reason) {
    middles_.erase(exposure.trigger);
    announce_unpaired(exposure, reason);
}

void CameraPipeline::announce_unpaired(const pairing::Exposure& exposure, EventReason reason) {
    ++report_.triggers_without_frame;
    journal(EventKind::trigger_without_frame, reason, static_cast<std::int64_t>(exposure.trigger),
            exposure.start);
}

void CameraPipeline::locked(const pairing::Exposure& first) {
    ++report_.locks;
    log(LogLevel::info, configuration_.name, "paired: frames are verified from trigger {} on",
        first.trigger);
    journal(EventKind::pairing_locked, EventReason::none, static_cast<std::int64_t>(first.trigger),
            first.start);
}

void CameraPipeline::slipped(const pairing::Arrival& at) {
    ++report_.slips;
    log(LogLevel::warning, configuration_.name,
        "pairing slipped at block {}: frames are withheld until it is proved again", at.block_id);
    journal(EventKind::pairing_slipped, EventReason::mismatch,
            static_cast<std::int64_t>(at.block_id));
}

void CameraPipeline::journal(EventKind kind, EventReason reason, std::int64_t value,
                             std::optional<BoardTime> at) {
    events_.add({kind, reason, index_, configuration_.name, value, at});
}

void CameraPipeline::reset() {
    const std::lock_guard lock(mutex_);
    begin_anew();
    triggers_.answered();
}

std::optional<pairing::Start> CameraPipeline::advance(HostTime now) {
    const std::lock_guard lock(mutex_);
    frames_.heartbeat(now);
    if (!triggered()) return std::nullopt;
    evidence_.heartbeat(now);
    if (pairing_.due(now)) tell(pairing::Advance{now});
    if (triggers_.overdue(now)) return pairing_.first_start();
    return pairing_.wanted_start(now);
}

pairing::Start CameraPipeline::first_start() {
    const std::lock_guard lock(mutex_);
    return pairing_.first_start();
}

void CameraPipeline::start_requested(pairing::Start start, HostTime now) {
    const std::lock_guard lock(mutex_);
    tell(pairing::StartRequest{start, now});
    triggers_.asked(now);
}

void CameraPipeline::starved(std::uint64_t frames) {
    const std::lock_guard lock(mutex_);
    report_.no_buffer += frames;
    for (std::uint64_t i = 0; i < frames && triggered(); ++i)
        tell(pairing::Shortfall{0, EventReason::no_buffer});
}

void CameraPipeline::set_camera_exposure(Duration exposure, HostTime since) {
    const std::lock_guard lock(mutex_);
    check_.set_camera_exposure(exposure, since);
    report_.told_exposure = exposure;
}

std::uint64_t CameraPipeline::newest_trigger() {
    const std::lock_guard lock(mutex_);
    return triggers_.newest();
}

std::uint64_t CameraPipeline::unanswered_triggers() {
    const std::lock_guard lock(mutex_);
    return triggers_.unanswered();
}

PipelineReport CameraPipeline::report() {
    const std::lock_guard lock(mutex_);
    report_.pairing = pairing_.state();
    report_.exposure = check_.measured();
    report_.camera_exposure = check_.told();
    report_.exposure_contradicted = check_.contradicted();
    return report_;
}

std::uint64_t CameraPipeline::items() {
    const std::lock_guard lock(mutex_);
    return frames_.items();
}

}  // namespace versavis::daemon

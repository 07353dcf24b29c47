// SPDX-License-Identifier: BSD-3-Clause
#include "stream/camera_pipeline.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::daemon {

namespace {

constexpr std::uint32_t descriptor_floor = 64;
constexpr std::uint32_t evidence_items = 16384;
constexpr std::uint32_t slots_for_readers = 2;
constexpr Duration exposure_tolerance = microseconds(200);
constexpr int exposure_tolerance_part = 20;
constexpr Duration exposure_settling = milliseconds(500);  // a new one takes a few frames to hold

std::uint32_t power_of_two(std::uint32_t at_least) {
    std::uint32_t value = descriptor_floor;
    while (value < at_least) value *= 2;
    return value;
}

Duration from_us(double us) { return {std::llround(us * 1e3)}; }

pairing::Limits limits_of(const CameraConfiguration& configuration) {
    pairing::Limits limits;
    limits.latest_arrival = from_us(configuration.latest_arrival_ms * 1e3);
    limits.period = from_us(1e6 / configuration.rate_hz);
    limits.pattern_duration = limits.period * (wire::start_pattern_length + 2);
    limits.frames_held = configuration.slots - configuration.buffers - slots_for_readers;
    limits.camera_clock = configuration.camera_clock;
    return limits;
}

/// False: start and end follow from the trigger, or from the exposure line of the master.
bool own_strobe(const wire::Exposure& record) {
    return (record.flags & (wire::exposure_predicted | wire::exposure_from_master)) == 0;
}

}  // namespace

CameraPipeline::CameraPipeline(const CameraConfiguration& configuration, std::uint32_t index,
                               clock::Translator& translator, EventJournal& events)
    : configuration_(configuration),
      index_(index),
      translator_(translator),
      events_(events),
      limits_(limits_of(configuration)),
      pairing_(limits_, *this),
      start_patience_(seconds(2) + from_us(5e6 / configuration.rate_hz)),
      last_exposure_(from_us(configuration.exposure_us)) {}

/// What pairing is told goes through here, so that the recording is complete.
void CameraPipeline::tell(const pairing::Evidence& evidence) {
    const clock::Stamp stamp = translator_.translate(host_now(), {});
    if (evidence_) evidence_->publish(stamp.output, pack(pairing::to_metadata(evidence)));
    pairing::apply(pairing_, evidence);
}

Expected<> CameraPipeline::prepare(const std::filesystem::path& directory,
                                   std::uint64_t payload_size, bool has_clock) {
    const std::lock_guard lock(mutex_);
    if (triggered() && !evidence_) {
        auto evidence = ring::Writer::create(
            directory,
            {configuration_.name + evidence_suffix, ring::StreamKind::evidence, evidence_items});
        if (!evidence) return Unexpected(evidence.error());
        evidence_.emplace(std::move(*evidence));
    }
    tell(pairing::Reset{});
    limits_.camera_clock = configuration_.camera_clock && has_clock;
    pairing_.set_limits(limits_);
    tell(limits_);
    report_.last_proof = host_now();
    if (ring_ && ring_->slot_size() >= payload_size) return {};
    ring::Shape shape;
    shape.name = configuration_.name;
    shape.kind = ring::StreamKind::frames;
    shape.slot_count = configuration_.slots;
    shape.slot_size = payload_size;
    shape.descriptor_count = power_of_two(2 * configuration_.slots);
    auto ring = ring::Writer::create(directory, shape);
    if (!ring) return Unexpected(ring.error());
    ring_.emplace(std::move(*ring));
    return {};
}

std::optional<std::uint32_t> CameraPipeline::acquire() {
    const std::lock_guard lock(mutex_);
    return ring_->acquire();
}

std::byte* CameraPipeline::slot_data(std::uint32_t slot) {
    const std::lock_guard lock(mutex_);
    return ring_->slot_data(slot);
}

void CameraPipeline::abandon(std::uint32_t slot, EventReason reason, std::uint64_t block_id) {
    const std::lock_guard lock(mutex_);
    ring_->abandon(slot);
    if (reason == EventReason::none) return;
    ++report_.incomplete;
    unanswered_ = 0;  // it does answer
    if (triggered()) tell(pairing::Shortfall{block_id, reason});
    journal(EventKind::frame_without_trigger, reason, static_cast<std::int64_t>(block_id));
}

void CameraPipeline::add(const pairing::Arrival& arrival) {
    const std::lock_guard lock(mutex_);
    ++report_.received;
    report_.last_frame = arrival.arrived;
    unanswered_ = 0;
    if (triggered())
        tell(arrival);
    else
        publish_free_run(arrival);
}

void CameraPipeline::add(const wire::Exposure& record) {
    const std::lock_guard lock(mutex_);
    ++report_.triggers;
    ++unanswered_;
    newest_trigger_ = record.trigger;
    last_trigger_ = host_now();
    pairing::Exposure exposure = complete(record);
    const bool end_seen = record.end_ns != wire::no_time && own_strobe(record);
    const auto earliest = translator_.to_host(end_seen ? exposure.end : exposure.start);
    if (!earliest) return exposure_unpaired(exposure, EventReason::no_clock);
    exposure.earliest_on_host = earliest->time;
    exposure.end_on_host =
        end_seen ? earliest->time : earliest->time + (exposure.end - exposure.start);
    tell(exposure);
}

/// Fills in what the board did not see, and says so by the kind of the stamp.
pairing::Exposure CameraPipeline::complete(const wire::Exposure& record) {
    pairing::Exposure exposure;
    exposure.trigger = record.trigger;
    exposure.tick = record.tick;
    const bool started = record.start_ns != wire::no_time;
    const bool ended = record.end_ns != wire::no_time;
    const bool strobe = own_strobe(record);
    exposure.exposed = started || !strobe;
    exposure.start = started ? BoardTime{record.start_ns}
                             : BoardTime{record.trigger_ns} + from_us(configuration_.latency_us);
    exposure.end = ended ? BoardTime{record.end_ns} : exposure.start + last_exposure_;
    report_.measured = started && ended;
    if (!report_.measured) ++report_.unmeasured;
    if (started && ended && strobe) {
        exposure.kind = StampKind::measured_middle;
        last_exposure_ = exposure.end - exposure.start;
    } else if (started && strobe) {
        // It lasted longer than the board was willing to wait: the middle is at least here.
        exposure.kind = StampKind::predicted_middle;
        exposure.end =
            exposure.start + std::max(last_exposure_, from_us(configuration_.max_exposure_us));
    } else {
        exposure.kind = StampKind::trigger_edge;
    }
    return exposure;
}

/// What the kind of stamp adds to the clock's error. An end that was not seen lies before the
/// arrival; no more is known.
Duration CameraPipeline::kind_sigma(const pairing::Exposure& exposure, Duration to_arrival) {
    if (exposure.kind == StampKind::measured_middle) return {};
    const Duration half = (exposure.end - exposure.start) / 2 + microseconds(100);
    return exposure.kind == StampKind::predicted_middle ? std::max(half, to_arrival) : half;
}

/// True when the exposure line shows something else than what the camera says that it exposes.
bool CameraPipeline::contradicted(const pairing::Arrival& arrival,
                                  const pairing::Exposure& exposure) {
    if (!configuration_.check_exposure || exposure.kind != StampKind::measured_middle) return false;
    const bool settled =
        exposure.earliest_on_host > camera_exposure_since_ + exposure_settling + limits_.period * 5;
    const Duration told = settled ? camera_exposure_ : Duration{};
    const Duration said = arrival.exposure.ns != 0 ? arrival.exposure : told;
    report_.exposure = exposure.end - exposure.start;
    report_.camera_exposure = said;
    const Duration tolerance = std::max(exposure_tolerance, said / exposure_tolerance_part);
    report_.exposure_contradicted = said.ns != 0 && absolute(said - report_.exposure) > tolerance;
    return report_.exposure_contradicted;
}

void CameraPipeline::paired(const pairing::Arrival& arrival, const pairing::Exposure& exposure) {
    if (contradicted(arrival, exposure))
        return frame_unpaired(arrival, EventReason::wrong_exposure, &exposure);
    const auto stamp = translator_.translate(middle(exposure.start, exposure.end));
    if (!stamp) return frame_unpaired(arrival, EventReason::no_clock, nullptr);
    report_.last_proof = arrival.arrived;
    publish_paired(arrival, exposure, *stamp, 0);
}

void CameraPipeline::publish_paired(const pairing::Arrival& arrival,
                                    const pairing::Exposure& exposure, const clock::Stamp& stamp,
                                    std::uint32_t flags) {
    const Duration kind = kind_sigma(exposure, arrival.arrived - stamp.host);
    const double sigma =
        std::hypot(static_cast<double>(stamp.sigma_ns), static_cast<double>(kind.ns));
    clock::Stamp widened = stamp;
    widened.sigma_ns = static_cast<std::uint32_t>(std::min<double>(sigma, sigma_unknown - 1));
    if ((flags & flag_suspect) != 0) widened.sigma_ns = sigma_unknown;
    FrameMetadata metadata{};
    metadata.trigger = exposure.trigger;
    metadata.tick = static_cast<std::uint32_t>(exposure.tick);
    metadata.board_time = middle(exposure.start, exposure.end);
    if (exposure.kind == StampKind::measured_middle)
        metadata.exposure = exposure.end - exposure.start;
    metadata.flags = static_cast<std::uint32_t>(exposure.kind) | flags;
    publish(arrival, widened, metadata);
}

void CameraPipeline::publish_free_run(const pairing::Arrival& arrival) {
    FrameMetadata metadata{};
    metadata.flags = static_cast<std::uint32_t>(StampKind::arrival);
    publish(arrival, translator_.translate(arrival.arrived, {}), metadata);
}

void CameraPipeline::publish(const pairing::Arrival& arrival, const clock::Stamp& stamp,
                             FrameMetadata metadata) {
    metadata.block_id = arrival.block_id;
    metadata.host_time = stamp.host;
    metadata.arrival = arrival.arrived;
    metadata.camera_time = arrival.camera_time;
    metadata.sigma_ns = triggered() ? stamp.sigma_ns : sigma_unknown;
    metadata.width = arrival.width;
    metadata.height = arrival.height;
    metadata.stride = arrival.stride;
    metadata.pixel_format = arrival.pixel_format;
    metadata.epoch = stamp.epoch;
    ++report_.published;
    const OutputTime time = guard_.guard(stamp, metadata.flags);
    ring_->publish(arrival.slot, arrival.size, time, pack(metadata));
}

void CameraPipeline::frame_unpaired(const pairing::Arrival& arrival, EventReason reason,
                                    const pairing::Exposure* guess) {
    ++report_.frames_without_trigger;
    journal(EventKind::frame_without_trigger, reason, static_cast<std::int64_t>(arrival.block_id));
    if (configuration_.on_unproved == OnUnproved::withhold || reason == EventReason::out_of_order)
        return ring_->abandon(arrival.slot);
    publish_suspect(arrival, guess);
}

/// As well stamped as can be guessed: by the exposure that it may be of, else by its arrival.
void CameraPipeline::publish_suspect(const pairing::Arrival& arrival,
                                     const pairing::Exposure* guess) {
    ++report_.suspect;
    const auto stamp =
        guess != nullptr ? translator_.translate(middle(guess->start, guess->end)) : std::nullopt;
    if (stamp) return publish_paired(arrival, *guess, *stamp, flag_suspect);
    FrameMetadata metadata{};
    metadata.flags = static_cast<std::uint32_t>(StampKind::arrival) | flag_suspect;
    clock::Stamp arrived = translator_.translate(arrival.arrived, {});
    arrived.sigma_ns = sigma_unknown;
    publish(arrival, arrived, metadata);
}

void CameraPipeline::exposure_unpaired(const pairing::Exposure& exposure, EventReason reason) {
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
    tell(pairing::Reset{});
    unanswered_ = 0;
}

std::optional<pairing::Start> CameraPipeline::advance(HostTime now) {
    const std::lock_guard lock(mutex_);
    if (ring_) ring_->heartbeat(now);
    if (!triggered()) return std::nullopt;
    if (evidence_) evidence_->heartbeat(now);
    if (pairing_.due(now)) tell(pairing::Advance{now});
    if (now - last_trigger_ > start_patience_) return pairing_.first_start();
    return pairing_.wanted_start(now);
}

pairing::Start CameraPipeline::first_start() {
    const std::lock_guard lock(mutex_);
    return pairing_.first_start();
}

void CameraPipeline::start_requested(pairing::Start start, HostTime now) {
    const std::lock_guard lock(mutex_);
    tell(pairing::StartRequest{start, now});
    last_trigger_ = now;
}

void CameraPipeline::starved(std::uint64_t frames) {
    const std::lock_guard lock(mutex_);
    report_.no_buffer += frames;
    for (std::uint64_t i = 0; i < frames && triggered(); ++i)
        tell(pairing::Shortfall{0, EventReason::no_buffer});
}

void CameraPipeline::set_camera_exposure(Duration exposure, HostTime since) {
    const std::lock_guard lock(mutex_);
    camera_exposure_ = exposure;
    camera_exposure_since_ = since;
}

std::uint64_t CameraPipeline::newest_trigger() {
    const std::lock_guard lock(mutex_);
    return newest_trigger_;
}

std::uint64_t CameraPipeline::unanswered_triggers() {
    const std::lock_guard lock(mutex_);
    return unanswered_;
}

PipelineReport CameraPipeline::report() {
    const std::lock_guard lock(mutex_);
    report_.pairing = pairing_.state();
    return report_;
}

std::uint64_t CameraPipeline::items() {
    const std::lock_guard lock(mutex_);
    return ring_ ? ring_->head() : 0;
}

}  // namespace versavis::daemon

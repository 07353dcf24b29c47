// SPDX-License-Identifier: BSD-3-Clause
#include "camera_pipeline.hpp"

#include <cmath>
#include <utility>

#include "engine/rounding.hpp"
#include "plausibility/arrival_check.hpp"
#include "settings/receive_mode.hpp"

namespace versavis::daemon {

namespace {

/// Slots that hold published frames while all others wait for proof or are being received.
constexpr std::uint32_t slots_for_readers = 2;

/// Pulses by which the board's start pattern may last longer than its length says.
constexpr int pattern_margin = 2;

pairing::RecordLimits record_limits_of(const CameraConfiguration& configuration) {
    return {period_of(configuration),           from_us(configuration.latency_us),
            from_us(configuration.exposure_us), from_us(configuration.max_exposure_us),
            configuration.grid_slew_ppm,        configuration.strobe != Strobe::none,
            !configuration.master.empty(),      configuration.grid_slew_ppm == 0};
}

pairing::Limits limits_of(const CameraConfiguration& configuration) {
    pairing::Limits limits;
    limits.latest_arrival =
        from_us(configuration.latest_arrival_ms * 1e3) + receive_lateness(configuration);
    limits.period = period_of(configuration);
    limits.pattern_duration = limits.period * (wire::start_pattern_length + pattern_margin);
    limits.frames_held = configuration.slots - configuration.buffers - slots_for_readers;
    limits.camera_clock = configuration.camera_clock;
    return limits;
}

/// What the line's own difference of edges adds is taken off.
/// As the camera's account corrects or completes it.
pairing::Exposure corrected(pairing::Exposure exposure, const ExposureVerdict& verdict) {
    const EdgeCorrection& correction = verdict.correction;
    exposure.start = exposure.start - correction.start;
    exposure.end = exposure.end - correction.end;
    exposure.delay = exposure.delay + correction.middle();
    exposure.delay_sigma = rounded(std::hypot(exposure.delay_sigma.ns, correction.sigma.ns));
    exposure.length_by_camera = verdict.confirmed;
    if (verdict.length.ns != 0) exposure.end = exposure.start + verdict.length;
    return exposure;
}

clock::Stamp moved(clock::Stamp stamp, Duration by) {
    stamp.host = stamp.host + by;
    stamp.output = stamp.output + by;
    return stamp;
}

}  // namespace

CameraPipeline::CameraPipeline(const CameraConfiguration& configuration, std::uint32_t index,
                               clock::Translator& translator, EventJournal& events, PtpClocks* ptp)
    : name_(configuration.name),
      triggered_(configuration.trigger == TriggerSource::board),
      output_(configuration.output),
      strobe_input_(configuration.strobe_input),
      index_(index),
      translator_(translator),
      events_(events),
      stream_(translator.add_stream(clock::Witness::grid)),
      clocks_(configuration.trigger == TriggerSource::ptp ? ptp : nullptr),
      clock_(clocks_ != nullptr ? clocks_->add(configuration.name) : 0),
      configuration_(configuration),
      frames_(configuration),
      evidence_(translator),
      record_limits_(record_limits_of(configuration)),
      filter_(record_limits_),
      completion_(configuration),
      check_(configuration),
      answers_(period_of(configuration)),
      chunk_exposures_(configuration.slots),
      triggers_(configuration),
      by_ptp_(configuration, limits_of(configuration).frames_held),
      strobe_(period_of(configuration), {}),
      limits_(limits_of(configuration)),
      pairing_(limits_, *this) {}

/// Line delays are the camera's, and stay until it is set up anew.
void CameraPipeline::reconfigure(const CameraConfiguration& configuration) {
    const std::lock_guard lock(mutex_);
    const LineDelays lines = completion_.line_delays();
    configuration_ = configuration;
    record_limits_ = record_limits_of(configuration);
    completion_ = ExposureCompletion(configuration);
    check_ = ExposureCheck(configuration);
    completion_.set_line_delays(lines);
    check_.set_line_delays(lines);
    answers_ = AnswerWatch(period_of(configuration));
    triggers_.expect(configuration);
    by_ptp_.reconfigure(configuration);
    settle_ptp();
    strobe_ = StrobeWitness(period_of(configuration), lines.start.sigma);
    const pairing::Limits before = std::exchange(limits_, limits_of(configuration));
    limits_.camera_clock = before.camera_clock && configuration.camera_clock;
    limits_.stamped = before.stamped;
    feed(record_limits_);
    forget_records();
    pairing_.set_limits(limits_);
    feed(limits_);
}

/// All that pairing and the filter of records get goes through here, so that the recording is
/// complete.
void CameraPipeline::feed(const pairing::Evidence& evidence) {
    evidence_.record(evidence);
    pairing::apply(filter_, evidence);
    pairing::apply(pairing_, evidence);
}

void CameraPipeline::restart_pairing() {
    feed(pairing::Reset{});
    middles_.clear();  // of numbers that may come again
}

/// Where the next record belongs is unknown, too.
void CameraPipeline::forget_records() {
    feed(pairing::Reset{true});
    middles_.clear();
}

/// Its clock does not count nanoseconds: arrivals alone say what exposures the frames are of.
void CameraPipeline::pair_without_clock() {
    limits_.camera_clock = false;
    event_lengths_ = {};  // by the same clock
    if (!triggered()) return;
    restart_pairing();
    pairing_.set_limits(limits_);
    feed(limits_);
    log_later(LogLevel::warning,
              fmt::format("its clock runs {:.4g} times as fast as it says: frames are "
                          "paired without it",
                          answers_.report().clock_rate));
}

void CameraPipeline::count_refusal(EventReason reason) {
    const auto number = static_cast<std::size_t>(reason);
    if (number < report_.refused.size()) ++report_.refused[number];
}

Expected<> CameraPipeline::prepare(const ring::Place& place, std::uint64_t payload_size,
                                   bool has_clock, pairing::Instant stamp_instant) {
    // Rings are made, and end, outside the lock that all threads wait for: that takes long. Only
    // the camera's thread does so, and what the ring before still waits for is published first.
    if (triggered() && !evidence_.recording()) {
        auto ring = EvidenceRecorder::make_ring(place, name_);
        if (!ring) return Unexpected(ring.error());
        const std::lock_guard lock(mutex_);
        evidence_.use(std::move(*ring));
    }
    {
        const std::lock_guard lock(mutex_);
        feed(record_limits_);
        restart_pairing();  // the board goes on, whatever the camera did
    }
    auto ring = frames_.make_ring(place, payload_size);
    if (!ring) return Unexpected(ring.error());
    std::optional<ring::Writer> before;
    const std::lock_guard lock(mutex_);
    if (*ring) before = frames_.use(std::move(**ring));
    limits_.camera_clock = configuration_.camera_clock && has_clock;
    limits_.stamped = stamp_instant;
    answers_.restart();
    by_ptp_.restart(stamp_instant);
    settle_ptp();
    pairing_.set_limits(limits_);
    feed(limits_);
    report_.last_proof = host_now();
    return {};
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
    if (triggered()) feed(pairing::Shortfall{block_id, reason});
    journal(EventKind::frame_without_trigger, reason, static_cast<std::int64_t>(block_id));
}

void CameraPipeline::add(const pairing::Arrival& arrival) {
    const std::lock_guard lock(mutex_);
    ++report_.received;
    report_.last_frame = report_.last_sign = arrival.arrived;
    triggers_.answered();
    answers_.arrived(arrival);
    if (limits_.camera_clock && answers_.report().clock_rate != 1) pair_without_clock();
    pairing::Arrival whole = completed(arrival);
    if (by_ptp()) return add_by_ptp(whole);
    if (triggered()) {
        chunk_exposures_[arrival.slot] = arrival.exposure;
        whole.exposure = check_.for_pairing(arrival.exposure);
        return feed(whole);
    }
    ++report_.published;
    frames_.publish_arrived(whole, translator_.translate(arrival.arrived, {}), false);
}

/// With what the camera's registers say where the frame does not.
pairing::Arrival CameraPipeline::completed(pairing::Arrival arrival) const {
    if (std::isnan(arrival.sensor.gain)) arrival.sensor.gain = sensor_.gain;
    if (std::isnan(arrival.sensor.temperature_c))
        arrival.sensor.temperature_c = sensor_.temperature_c;
    return arrival;
}

void CameraPipeline::set_sensor_state(const SensorState& state) {
    const std::lock_guard lock(mutex_);
    sensor_ = state;
}

std::optional<clock::Stamp> CameraPipeline::add(const wire::Exposure& record, HostTime received,
                                                std::optional<BoardTime> expected) {
    const std::lock_guard lock(mutex_);
    report_.last_record = received;
    if (const auto doubted = doubt(record, received, expected)) {
        count_rejected(record, *doubted);
        return std::nullopt;
    }
    ++report_.triggers;
    triggers_.recorded(record.trigger, received);
    report_.measured = measured(record);
    answers_.recorded(record);
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
    exposure.recorded = received;
    report_.record_delay = host_now() - exposure.end_on_host;
    feed(exposure);
    return stamp;
}

std::optional<Implausibility> CameraPipeline::doubt(const wire::Exposure& record, HostTime received,
                                                    std::optional<BoardTime> expected) {
    const clock::ClockContact contact = translator_.contact();
    follow_clock(contact.life);
    pairing::ReceivedRecord judged{record, check_.reported_at(received), contact.exchanges};
    judged.clock_contradicted = contact.contradicted;
    if (expected) judged.grid_ns = expected->ns;
    judged.promptness = Promptness::unknown;
    const auto arrival = arrival_delay(pairing::newest_instant(record), received, translator_);
    if (arrival) judged.promptness = delays_.of(arrival->delay, arrival->sigma);
    if (arrival && arrival->doubt) {
        judged.arrival = arrival->doubt->reason;
        judged.expected_ns = arrival->doubt->expected;
    }
    feed(judged);
    const pairing::RecordVerdict verdict = filter_.verdict();
    if (record.end_ns != wire::no_time && judged.arrival == EventReason::none)
        translator_.heard(stream_, {pairing::newest_instant(record), received}, !verdict.doubt);
    if (verdict.overturned) restart_pairing();
    if (verdict.step) adopt_step(record, *verdict.step);
    if (verdict.doubt) return verdict.doubt;
    if (!verdict.step && judged.promptness == Promptness::usual) translator_.clock_continues();
    if (arrival && record.end_ns != wire::no_time) delays_.learn(arrival->delay, received);
    return std::nullopt;
}

/// What is known of the board's time is void when the estimate of that time is.
void CameraPipeline::follow_clock(std::uint32_t life) {
    const auto before = std::exchange(clock_life_, life);
    if (!before || before == life) return;
    forget_records();
    delays_.forget();
}

void CameraPipeline::adopt_step(const wire::Exposure& record, const Implausibility& doubt) {
    restart_pairing();
    delays_.forget();
    events_.add({EventKind::stream_stepped, doubt.reason, index_, name_, doubt.said,
                 BoardTime{record.trigger_ns}, doubt.expected});
}

void CameraPipeline::count_rejected(const wire::Exposure& record, const Implausibility& doubt) {
    ++report_.records_doubted;
    const bool by_length = doubt.reason == EventReason::implausible_length;
    report_.doubted_exposure = {by_length ? record.end_ns - record.start_ns : 0};
    events_.add(
        {EventKind::message_doubted, doubt.reason, index_, name_, doubt.said, {}, doubt.expected});
    // Two accounts of one exposure: neither is believed.
    if (filter_.disputes_newest(record)) middles_.erase(record.trigger);
}

void CameraPipeline::triggers_skipped(std::uint64_t count) {
    const std::lock_guard lock(mutex_);
    feed(pairing::TriggersSkipped{count});
}

void CameraPipeline::paired(const pairing::Arrival& arrival, const pairing::Exposure& exposure) {
    const auto stamp = middles_.find(exposure.trigger);
    const ExposureVerdict verdict =
        check_.judge(arrival, account_of(arrival), exposure, report_.start_delay);
    note_chunk_lag();
    const pairing::Exposure shown = corrected(exposure, verdict);
    const Duration shift = middle(shown.start, shown.end) - middle(exposure.start, exposure.end);
    if (stamp == middles_.end()) {
        frame_unpaired(arrival, EventReason::mismatch, nullptr);
        announce_unpaired(exposure, EventReason::mismatch);
    } else if (verdict.contradicted) {
        frame_unpaired(arrival, EventReason::wrong_exposure, &exposure);
        announce_unpaired(exposure, EventReason::wrong_exposure);
    } else if (!frames_.publish_proved(arrival, shown, moved(stamp->second, shift))) {
        if (frames_.stuck()) translator_.begin_epoch();
        frame_unpaired(arrival, EventReason::went_back, nullptr);
        announce_unpaired(exposure, EventReason::went_back);
    } else {
        report_.last_proof = arrival.arrived;
        ++report_.published;
    }
    // The newest used record may still be the guess for a suspect frame.
    middles_.erase(std::exchange(last_used_, exposure.trigger));
}

FrameAccount CameraPipeline::account_of(const pairing::Arrival& arrival) const {
    return {chunk_exposures_[arrival.slot], event_lengths_.length(arrival.block_id)};
}

void CameraPipeline::add(const CameraEvent& event) {
    const std::lock_guard lock(mutex_);
    const bool times_count = answers_.report().clock_rate == 1;
    switch (event.kind) {
        case CameraEventKind::exposure_start:
            if (!times_count) return;
            return event_lengths_.started(event.block_id, event.at);
        case CameraEventKind::exposure_end:
            if (!times_count) return;
            return event_lengths_.ended(event.block_id, event.at);
        case CameraEventKind::trigger_missed: return note_missed_trigger();
        case CameraEventKind::ptp_lost: return note_ptp_event(true);
        case CameraEventKind::ptp_locked: return note_ptp_event(false);
    }
}

void CameraPipeline::note_missed_trigger() {
    ++report_.triggers_missed;
    if (std::exchange(missed_logged_, true)) return;
    log_later(LogLevel::warning,
              "the camera reports that it missed a trigger: exposure and readout may be "
              "longer than the period");
}

void CameraPipeline::note_ptp_event(bool lost) {
    if (std::exchange(report_.ptp_lost, lost) == lost) return;
    if (lost)
        log_later(LogLevel::warning, "the camera reports that its clock lost PTP");
    else
        log_later(LogLevel::info, "the camera reports that its clock follows PTP again");
}

CameraPipeline::PtpTurn CameraPipeline::next_ptp_trigger(HostTime now) {
    constexpr Duration idle = milliseconds(20);
    const auto ptp = clocks_->ready(clock_) ? clocks_->at(now) : std::nullopt;
    if (!ptp) return {std::nullopt, idle};
    const std::lock_guard lock(mutex_);
    const PtpTrigger trigger = by_ptp_.next(*ptp);
    const Duration early = trigger.at - *ptp - by_ptp_.lead();
    if (early.ns > 0) return {std::nullopt, std::min(early, idle)};
    by_ptp_.sent(trigger, now + (trigger.at - *ptp));
    ++report_.triggers;
    triggers_.recorded(trigger.number, now);
    return {trigger, {}};
}

void CameraPipeline::acknowledge(std::uint64_t trigger, std::uint16_t status) {
    const std::lock_guard lock(mutex_);
    if (status == 0) return by_ptp_.acknowledged(trigger);
    ++report_.actions_refused;
    report_.refusal = status;
}

void CameraPipeline::note_ptp(const PtpStatus& status) {
    clocks_->note(clock_, status);
    const std::lock_guard lock(mutex_);
    ptp_status_ = status;
    const std::string before = std::exchange(port_logged_, status.state);
    if (before != status.state && !status.state.empty())
        log_later(before == "Slave" ? LogLevel::warning : LogLevel::info,
                  fmt::format("its PTP port is {}", status.state));
    if (status.follows()) return;
    by_ptp_.lose_clock();
    settle_ptp();
}

void CameraPipeline::read_clock(const clock::ClockReading& reading) {
    const clock::Agreement agreement = clocks_->read(clock_, reading);
    const std::uint64_t steps = clocks_->steps();
    const std::lock_guard lock(mutex_);
    // Another camera may have found that PTP's time stepped.
    if (std::exchange(ptp_steps_, steps) != steps) by_ptp_.lose_clock();
    by_ptp_.read_clock(reading, agreement);
    settle_ptp();
}

void CameraPipeline::line_rose(BoardTime at) {
    const std::lock_guard lock(mutex_);
    const auto start = translator_.to_host(at - completion_.line_delays().start.delay);
    if (start) strobe_.rose(*start);
}

bool CameraPipeline::wants_clock_reading() {
    const std::lock_guard lock(mutex_);
    return by_ptp_.waiting();
}

void CameraPipeline::add_by_ptp(const pairing::Arrival& arrival) {
    const PtpFrames::Account length{event_lengths_.length(arrival.block_id), arrival.exposure};
    length_by_frame_ = length.event.ns != 0 || length.chunk.ns != 0;
    by_ptp_.add(arrival, length, clocks_->to_host(arrival.camera_time));
    settle_ptp();
    if (by_ptp_.waiting() && reading_wanted_) reading_wanted_();
}

void CameraPipeline::when_clock_reading_wanted(std::function<void()> callback) {
    const std::lock_guard lock(mutex_);
    reading_wanted_ = std::move(callback);
}

void CameraPipeline::settle_ptp() {
    for (const PtpVerdict& verdict : by_ptp_.take_verdicts())
        if (verdict.exposure)
            publish_by_ptp(verdict.arrival, *verdict.exposure);
        else
            frame_unpaired(verdict.arrival, verdict.reason, nullptr);
    for (const PtpTrigger& trigger : by_ptp_.take_missed()) {
        ++report_.triggers_without_frame;
        journal(EventKind::trigger_without_frame, EventReason::frame_missing,
                static_cast<std::int64_t>(trigger.number));
    }
}

void CameraPipeline::publish_by_ptp(const pairing::Arrival& arrival, const PtpExposure& exposure) {
    const Duration offset = ptp_status_.offset.value_or(Duration{});
    if (auto start = clocks_->to_host(exposure.start)) {
        start->bound = start->bound + rounded(clock::bound_sigmas *
                                              std::hypot(exposure.start_sigma.ns, offset.ns));
        strobe_.started(*start);
    }
    clocks_->contradict(clock_, strobe_.contradicts(arrival.arrived));
    if (clocks_->distrusted()) return frame_unpaired(arrival, EventReason::no_clock, nullptr);
    const auto middle = clocks_->translate(exposure.middle());
    if (!middle) return frame_unpaired(arrival, EventReason::no_clock, nullptr);
    if (!frames_.publish_by_ptp(arrival, exposure, *middle, offset)) {
        if (frames_.stuck()) translator_.begin_epoch();
        return frame_unpaired(arrival, EventReason::went_back, nullptr);
    }
    report_.last_proof = arrival.arrived;
    report_.camera_exposure = exposure.length;
    ++report_.published;
}

void CameraPipeline::log_later(LogLevel level, std::string text) {
    deferred_log_.push_back({level, std::move(text)});
}

void CameraPipeline::note_chunk_lag() {
    const ExposureSource before = std::exchange(report_.exposure_source, check_.source());
    if (before != ExposureSource::chunk || check_.source() != ExposureSource::chunk_before) return;
    log_later(LogLevel::warning,
              "the exposure time in a frame's data is that of the frame before: it is "
              "used as such, and sigma is larger while the exposure changes");
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
    log_later(LogLevel::info,
              fmt::format("paired: frames are verified from trigger {} on", first.trigger));
    journal(EventKind::pairing_locked, EventReason::none, static_cast<std::int64_t>(first.trigger),
            first.start);
}

void CameraPipeline::slipped(const pairing::Arrival& at) {
    ++report_.slips;
    log_later(
        LogLevel::warning,
        fmt::format("pairing slipped at block {}: frames are withheld until it is proved again",
                    at.block_id));
    journal(EventKind::pairing_slipped, EventReason::mismatch,
            static_cast<std::int64_t>(at.block_id));
}

void CameraPipeline::journal(EventKind kind, EventReason reason, std::int64_t value,
                             std::optional<BoardTime> at) {
    events_.add({kind, reason, index_, name_, value, at});
}

void CameraPipeline::reset() {
    const std::lock_guard lock(mutex_);
    forget_records();
    triggers_.answered();
}

std::optional<pairing::Start> CameraPipeline::advance(HostTime now) {
    std::vector<Line> lines;
    const auto wanted = [&] {
        const std::lock_guard lock(mutex_);
        lines.swap(deferred_log_);
        return advance_locked(now);
    }();
    for (const auto& [level, text] : lines) log(level, name_, "{}", text);
    return wanted;
}

std::optional<pairing::Start> CameraPipeline::advance_locked(HostTime now) {
    frames_.heartbeat(now);
    if (by_ptp()) {
        clocks_->contradict(clock_, strobe_.contradicts(now));
        by_ptp_.advance(now);
        settle_ptp();
    }
    if (!triggered()) return std::nullopt;
    evidence_.heartbeat(now);
    if (pairing_.due(now)) feed(pairing::Advance{now});
    if (triggers_.overdue(now)) return pairing_.first_start();
    return pairing_.wanted_start(now);
}

pairing::Start CameraPipeline::first_start() {
    const std::lock_guard lock(mutex_);
    return pairing_.first_start();
}

void CameraPipeline::start_requested(pairing::Start start, HostTime now) {
    const std::lock_guard lock(mutex_);
    feed(pairing::StartRequest{start, now});
    triggers_.asked(now);
}

void CameraPipeline::buffer_underrun(std::uint64_t frames) {
    const std::lock_guard lock(mutex_);
    report_.no_buffer += frames;
    for (std::uint64_t i = 0; i < frames && triggered(); ++i)
        feed(pairing::Shortfall{0, EventReason::no_buffer});
}

void CameraPipeline::set_camera_exposure(Duration exposure, HostTime since) {
    const std::lock_guard lock(mutex_);
    check_.set_camera_exposure(exposure, since);
    by_ptp_.set_exposure(exposure, since);
    report_.commanded_exposure = exposure;
}

void CameraPipeline::read_exposure(Duration exposure, HostTime at) {
    const std::lock_guard lock(mutex_);
    check_.read_exposure(exposure, at, report_.start_delay);
    by_ptp_.read_exposure(exposure, at);
}

bool CameraPipeline::wants_exposure_readings() {
    const std::lock_guard lock(mutex_);
    if (by_ptp()) return !length_by_frame_;
    return triggered() && check_.wants_readings();
}

void CameraPipeline::set_line_delays(const LineDelays& lines) {
    const std::lock_guard lock(mutex_);
    event_lengths_ = {};
    missed_logged_ = false;
    report_.ptp_lost = false;
    completion_.set_line_delays(lines);
    check_.set_line_delays(lines);
    strobe_ = StrobeWitness(period_of(configuration_), lines.start.sigma);
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
    report_.stamp_instant = pairing_.stamped();
    report_.records_late_by = pairing_.records_late_by();
    report_.exposure = check_.measured();
    if (!by_ptp()) report_.camera_exposure = check_.reported();
    report_.exposure_contradicted = check_.contradicted();
    if (by_ptp()) {
        report_.pairing = by_ptp_.proved() ? pairing::State::locked : pairing::State::searching;
        report_.stamp_instant = by_ptp_.stamped();
        report_.start_delay = by_ptp_.start_delay();
        if (!configuration_.strobe_input.empty()) report_.strobe = strobe_.report();
    }
    report_.lines = completion_.line_delays();
    report_.edges = check_.edges();
    report_.answers = answers_.report();
    return report_;
}

std::uint64_t CameraPipeline::items() {
    const std::lock_guard lock(mutex_);
    return frames_.items();
}

std::uint64_t CameraPipeline::evidence_items() {
    const std::lock_guard lock(mutex_);
    return evidence_.items();
}

}  // namespace versavis::daemon

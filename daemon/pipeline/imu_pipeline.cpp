// SPDX-License-Identifier: BSD-3-Clause
#include "imu_pipeline.hpp"

#include "plausibility/arrival_check.hpp"
#include "publish/total_sigma.hpp"

namespace versavis::daemon {

namespace {

/// A part keeps its rate within this part of the configured one.
constexpr std::int64_t rate_parts = 4;

/// Over lost samples a part's pace may wander by one part in so many.
constexpr std::int64_t wander_parts = 10'000;

/// Majority of samples that agree, after the clock or the board began anew, until one is published:
/// the first have no neighbours.
constexpr int samples_to_confirm = 32;

PulseHistory history(const ImuConfiguration& configuration) {
    const Duration period{static_cast<std::int64_t>(1e9 / configuration.rate_hz)};
    return {period, period / rate_parts, wander_parts};
}

/// The board tries a failed part once a second: so many equal failures make one more line.
constexpr std::uint64_t failures_per_line = 600;

/// A failure that did not come for so long is a new one.
constexpr Duration forgotten_after = seconds(60);

}  // namespace

ImuPipeline::ImuPipeline(const ImuConfiguration& configuration, ring::Writer ring,
                         clock::Translator& translator, EventJournal& events)
    : model_(*configuration.model),
      port_(configuration.port()),
      accel_ready_(configuration.accel_ready),
      filter_(configuration.filter_delay()),
      ring_(std::move(ring)),
      translator_(translator),
      events_(events),
      departures_(translator.add_stream(clock::Witness::own)),
      samples_(translator.add_stream(clock::Witness::none)),
      pulse_filter_(history(configuration), samples_to_confirm) {
    report_.name = configuration.name;
    report_.model = model_.name;
    report_.filter = filter_;
    report_.rate_hz = configuration.rate_hz;
}

void ImuPipeline::board_restarted() {
    const std::lock_guard lock(mutex_);
    restart();
}

void ImuPipeline::restart() {
    last_number_.reset();
    number_shift_ = 0;
    pulse_filter_.forget();
    delays_.forget();
}

bool ImuPipeline::note_state(const wire::Event& event, HostTime now) {
    const std::lock_guard lock(mutex_);
    ImuFailure& last = report_.failure;
    report_.working = event.kind == wire::BoardEventKind::imu_ready;
    if (report_.working) {
        pulse_filter_.forget();  // it was set up anew, and samples at instants of its own
        return last.times <= 1;
    }
    const bool again = last.kind == event.kind && last.step == event.detail &&
                       last.answer == event.value && now - last.last < forgotten_after;
    last = {event.kind, event.detail, event.value, again ? last.times + 1 : 1, now};
    return last.times % failures_per_line == 1;
}

bool ImuPipeline::add(const wire::ImuSample& sample, HostTime received) {
    const std::lock_guard lock(mutex_);
    if (const auto doubted = doubt(sample, received)) {
        ++report_.doubted;
        journal(EventKind::message_doubted, sample, *doubted);
        return false;
    }
    const auto stamp = translator_.translate(BoardTime{sample.time_ns} - filter_.delay);
    if (!stamp || !pulse_filter_.confirmed()) {
        ++report_.no_clock;
        return pulse_filter_.confirmed();
    }
    const std::uint64_t number = extended(sample.number);
    if (last_number_ && number > *last_number_) report_.lost += number - *last_number_ - 1;
    last_number_ = number;
    publish(sample, number, *stamp);
    return translator_.steers(departures_);
}

/// 32 bits on the wire are extended by the number before.
std::uint64_t ImuPipeline::extended(std::uint32_t number) const {
    if (!last_number_) return number;
    const auto step = static_cast<std::int32_t>(number + number_shift_ -
                                                static_cast<std::uint32_t>(*last_number_));
    return *last_number_ + static_cast<std::uint64_t>(std::int64_t{step});
}

/// The board counts from another number on: those that are published go on.
void ImuPipeline::adopt_number(std::uint32_t number) {
    if (!last_number_) return;
    const std::uint64_t next = extended(number);
    if (next <= *last_number_)
        number_shift_ += static_cast<std::uint32_t>(*last_number_ + 1 - next);
}

std::optional<Implausibility> ImuPipeline::doubt(const wire::ImuSample& sample, HostTime received) {
    // No line, no age.
    if ((sample.flags & wire::imu_accel_stamped) != 0 && !accel_ready_)
        return Implausibility{EventReason::implausible_flags, sample.flags, 0};
    const Pulse pulse{sample.number, BoardTime{sample.time_ns}};
    const clock::ClockContact contact = translator_.contact();
    const BoardTime departed = pulse.at + Duration{sample.departure_ns};
    if (std::exchange(clock_life_, contact.life) != contact.life) delays_.forget();
    const auto arrival = arrival_delay(departed, received, translator_);
    const auto impossible = arrival ? arrival->doubt : std::nullopt;
    // Among samples from the future, one that was delayed is possible. It must not pass because the
    // pace may have wandered since.
    const bool ahead = from_future_.mostly_early() && pulse_filter_.confirmed();
    const PulseHistory& believed = pulse_filter_.believed();
    const auto misfit = ahead ? believed.doubt_at_pace(pulse) : believed.doubt(pulse);
    // Also those that are impossible: the others alone would seem to be as prompt as usual.
    translator_.heard(departures_, {departed, received}, !misfit);
    translator_.heard(samples_, {pulse.at, received}, !misfit);
    const auto doubt =
        pulse_filter_.judge(pulse, contact.exchanges, ahead && !impossible ? misfit : impossible);
    const bool time_doubted = doubt && doubt->reason == EventReason::implausible_time;
    const Duration apart{time_doubted ? doubt->said - doubt->expected : 0};
    const Promptness promptness =
        arrival ? delays_.of(arrival->delay, arrival->sigma, tolerance_between(apart))
                : Promptness::unknown;
    if (doubt) {
        step_promptness_.doubted(promptness);
        const bool not_yet = impossible && impossible->reason == EventReason::not_yet;
        from_future_.doubted(not_yet ? Promptness::early : Promptness::usual);
        if (!arrival || impossible || contact.contradicted ||
            !may_adopt(promptness, *doubt, contact.exchanges))
            return doubt;
        pulse_filter_.adopt(pulse);
        delays_.forget();
        adopt_number(sample.number);
        journal(EventKind::stream_stepped, sample, *doubt);
    } else if (const auto by = departure()) {
        return Implausibility{EventReason::implausible_time, sample.time_ns,
                              sample.time_ns - by->ns};
    } else if (promptness == Promptness::usual) {
        translator_.clock_continues();
    }
    step_promptness_.believed();
    from_future_.believed();
    if (arrival) delays_.learn(arrival->delay, received);
    believed_life_ = clock_life_;
    return std::nullopt;
}

/// By how much the messages depart from the exchanges.
std::optional<Duration> ImuPipeline::departure() const {
    const auto by = translator_.departure(samples_);
    return by ? by : translator_.departure(departures_);
}

/// The board lost count, or the part samples at other instants than it did.
bool ImuPipeline::may_adopt(Promptness promptness, const Implausibility& doubt,
                            std::uint64_t exchanges) const {
    // The clock began anew, and all with it.
    if (clock_life_ != believed_life_) return pulse_filter_.stepped(exchanges);
    const auto samples = translator_.confirms_others(samples_);
    const auto departures = translator_.confirms_others(departures_);
    if (from_future_.mostly_early()) return false;  // however long they agree
    // Early though exchanges confirm them: the clock stepped, and the estimate does not know yet.
    const bool early = step_promptness_.mostly_early();
    if (samples && departures)
        return *samples && *departures && !early
                   ? pulse_filter_.stepped(exchanges)
                   : pulse_filter_.prevailed(exchanges, least_to_prevail);
    const bool confirmed = doubt.reason == EventReason::implausible_number
                               ? promptness == Promptness::usual
                               : arrival_confirms(promptness, {doubt.said - doubt.expected});
    return confirmed && !early
               ? pulse_filter_.stepped(exchanges)
               : pulse_filter_.prevailed(exchanges, step_promptness_.least_to_prevail());
}

void ImuPipeline::journal(EventKind kind, const wire::ImuSample& sample,
                          const Implausibility& doubt) {
    JournalEntry entry{kind, doubt.reason, port_, report_.name, doubt.said, {}, doubt.expected};
    if (kind == EventKind::stream_stepped) entry.board_time = BoardTime{sample.time_ns};
    events_.add(entry);
}

void ImuPipeline::publish(const wire::ImuSample& sample, std::uint64_t number,
                          const clock::Stamp& stamp) {
    const auto guarded = guard_.guard(stamp, total_sigma_ns(stamp.sigma_ns, filter_.sigma));
    if (!guarded) {
        ++report_.doubted;
        if (guard_.stuck()) translator_.begin_epoch();
        return journal(EventKind::message_doubted, sample,
                       {EventReason::went_back, sample.time_ns, 0});
    }
    ImuMetadata metadata = imu::to_si(model_, sample);
    metadata.board_time = {sample.time_ns};
    metadata.host_time = stamp.host;
    metadata.number = number;
    metadata.sigma_ns = guarded->sigma_ns;
    metadata.filter_delay = filter_.delay;
    metadata.epoch = stamp.epoch;
    metadata.flags |= guarded->flags;
    if ((metadata.flags & flag_sensor_error) != 0)
        ++report_.faulty;
    else
        report_.last_sample = stamp.host;
    if ((metadata.flags & flag_repeated) != 0) ++report_.repeated;
    ring_.publish(guarded->time, pack(metadata));
    ++report_.published;
}

void ImuPipeline::heartbeat(HostTime now) {
    const std::lock_guard lock(mutex_);
    ring_.heartbeat(now);
}

ImuReport ImuPipeline::report() {
    const std::lock_guard lock(mutex_);
    return report_;
}

}  // namespace versavis::daemon

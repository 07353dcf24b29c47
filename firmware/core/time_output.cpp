// SPDX-License-Identifier: BSD-3-Clause
#include "time_output.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds second = 1'000'000'000;
constexpr Nanoseconds ms = 1'000'000;

/// Messages agree within this. If lower, a noisy link silences the output; if higher, LiDARs lose
/// their lock: Hesai's take pulses for whole seconds within 50 us.
constexpr Nanoseconds agreement = 50'000;

/// A pulse is decided this long before it leaves. If lower, a slow poll leaves it out; if higher,
/// what the host says arrives too late for it.
constexpr Nanoseconds furthest = 1'200'000;
static_assert(furthest > OutputQueue::horizon);
/// If lower, a slow poll is late; if higher, it has nothing to do yet.
constexpr Nanoseconds wake_ahead = 700'000;
/// What is decided later than that may leave late, so it is left out.
constexpr Nanoseconds soonest = 400'000;

/// A sentence that is that late is left out: it must not be taken for that of the next pulse.
constexpr Nanoseconds latest_sentence = 50 * ms;

constexpr unsigned bits_a_character = 10;

}  // namespace

void TimeOutput::take(const wire::TimeOutput& message, unsigned output, Nanoseconds now) {
    set_up(message, output, now);
    if ((message.flags & wire::time_known) == 0) return doubt();
    follow(message, now);
}

void TimeOutput::doubt() {
    heard_ = false;
    distrust();
}

void TimeOutput::release(Nanoseconds now) {
    if (!configured_) return;
    outputs_.rest(output_, false, now + OutputQueue::horizon);
    if (settings_.baud != 0 && (settings_.flags & wire::time_serial_inverted) != 0)
        uart_.invert_transmitter(false);
    settings_ = {};
    configured_ = heard_ = trusted_ = false;
    pulse_ = {};
    send_at_ = never;
}

void TimeOutput::set_up(const wire::TimeOutput& message, unsigned output, Nanoseconds now) {
    const wire::TimeOutput before = settings_;
    settings_ = message;
    const unsigned changed = configured_ ? unsigned{before.flags} ^ message.flags : ~0U;
    if (!uses(output) || (changed & wire::time_pulse_inverted) != 0) {
        if (configured_) outputs_.rest(output_, false, now + OutputQueue::horizon);
        outputs_.rest(output, idle_level(), now + OutputQueue::horizon);
        pulse_ = {};
    }
    if (message.baud != 0 &&
        (before.baud != message.baud || (changed & wire::time_serial_inverted) != 0)) {
        uart_.set_baud(message.baud);
        uart_.invert_transmitter((message.flags & wire::time_serial_inverted) != 0);
    }
    output_ = output;
    configured_ = true;
}

void TimeOutput::follow(const wire::TimeOutput& message, Nanoseconds now) {
    const std::int64_t utc_ns = message.utc_s * second;
    const Nanoseconds off = line_.board_time(utc_ns) - message.board_ns;
    const bool agrees = heard_ && off <= agreement && -off <= agreement;
    const bool was_trusted = trusted_;
    line_ = GridLine(message.board_ns, utc_ns, message.pace_ppb);
    heard_ = true;
    holds_until_ = now + message.holdover_s * second;
    if (!agrees) return distrust();
    trusted_ = true;
    if (was_trusted)
        next_pulse_ = pulse_time();
    else
        skip_to(now + furthest);
}

/// What is on its way still leaves, but nothing names it.
void TimeOutput::distrust() {
    trusted_ = false;
    pulse_.on_time = false;
}

Nanoseconds TimeOutput::pulse_time() const {
    return line_.board_time(next_second_ * second) + settings_.delay_ns;
}

/// To the first pulse from `at` on.
void TimeOutput::skip_to(Nanoseconds at) {
    next_second_ = line_.grid_time(at - settings_.delay_ns) / second;
    while ((next_pulse_ = pulse_time()) < at) ++next_second_;
}

bool TimeOutput::poll(Nanoseconds now, wire::Event& event) {
    if (!configured_) return false;
    if (now >= holds_until_) heard_ = false;
    if (trusted_ && !heard_) distrust();
    if (pulse_.ends <= now + furthest && pulse_.ends != never) {
        outputs_.set(pulse_.ends, output_, idle_level(), settings_.pulse_ns);
        pulse_.ends = never;
    }
    if (trusted_ && next_pulse_ <= now + furthest) begin_pulse(now);
    if (!trusted_ && settings_.baud != 0 && send_at_ == never && now >= next_unknown_) {
        next_unknown_ = now + second;
        begin_sentences(now, false);
    }
    if (now >= send_at_) send_sentence(now);
    if (now < pulse_.reported) return false;
    pulse_.reported = never;
    event.kind = wire::BoardEventKind::time_pulse;
    event.source = settings_.index;
    event.time_ns = pulse_.began;
    event.value = pulse_.utc_s;
    return pulse_.on_time;
}

void TimeOutput::begin_pulse(Nanoseconds now) {
    if (next_pulse_ < now + soonest || pulse_.ends != never || !outputs_.has_room(output_))
        return skip_to(now + furthest);
    const Nanoseconds begins =
        outputs_.set(next_pulse_, output_, !idle_level(), OutputQueue::shortest_pause);
    pulse_ = {next_second_, begins, begins + settings_.pulse_ns, begins + furthest,
              !outputs_.is_late(next_pulse_, begins)};
    if (settings_.baud != 0) begin_sentences(begins + settings_.sentence_delay_ms * ms, true);
    ++next_second_;
    next_pulse_ = pulse_time();
}

void TimeOutput::begin_sentences(Nanoseconds at, bool named) {
    send_at_ = at;
    named_ = named;
    sentence_ = 0;
}

/// One at a time: the port's line has room for two.
void TimeOutput::send_sentence(Nanoseconds now) {
    while (sentence_ < wire::time_sentence_count && (settings_.sentences >> sentence_ & 1U) == 0)
        ++sentence_;
    const bool in_time = !named_ || (pulse_.on_time && now < send_at_ + latest_sentence);
    if (sentence_ == wire::time_sentence_count || !in_time) {
        send_at_ = never;
        return;
    }
    char line[longest_sentence];
    const std::size_t size =
        write_sentence(static_cast<wire::TimeSentence>(1U << sentence_), settings_.talker,
                       named_ ? &pulse_.utc_s : nullptr, line);
    uart_.write(reinterpret_cast<const std::uint8_t*>(line), size);
    ++sentence_;
    const auto bits = static_cast<Nanoseconds>(size * bits_a_character);
    send_at_ = now + bits * second / settings_.baud;
}

Nanoseconds TimeOutput::next_wake() const {
    if (!configured_) return never;
    Nanoseconds wake = send_at_;
    const auto sooner = [&wake](Nanoseconds at) { wake = at < wake ? at : wake; };
    if (pulse_.ends != never) sooner(pulse_.ends - wake_ahead);
    sooner(pulse_.reported);
    if (trusted_) {
        sooner(next_pulse_ - wake_ahead);
        sooner(holds_until_);
    } else if (settings_.baud != 0 && send_at_ == never) {
        sooner(next_unknown_);
    }
    return wake;
}

}  // namespace versavis::firmware

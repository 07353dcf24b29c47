// SPDX-License-Identifier: BSD-3-Clause
#include "board/time_announcer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/rounding.hpp"
#include "wire/limits.hpp"

namespace versavis::daemon {

namespace {

namespace limits = wire::limits;

/// Between messages.
constexpr Duration interval = seconds(1);

/// With a worse clock the time is not known: Hesai's LiDARs lose their lock at 50 us from one pulse
/// to the next.
constexpr Duration largest_sigma = microseconds(50);

/// After a step of the output clock, a new board, or a wrong pulse. If lower, LiDARs see two times
/// at once; if higher, they wait longer.
constexpr Duration settling = seconds(3);

/// A pulse may be so far off its second, beside six sigma of the clock: the board rounds to 8 ns,
/// and the estimate moved since it was announced.
constexpr Duration pulse_tolerance = microseconds(50);
constexpr int tolerated_sigmas = 6;

/// Without a pulse for so long, or so long after the time became known, the output is silent.
constexpr Duration silence = milliseconds(2500);
constexpr Duration start_patience = seconds(5);

/// Before and after the end of a day with a leap second, when the same second may have two names.
constexpr std::int64_t near_leap_s = 3;
constexpr std::int64_t day_s = 86'400;

wire::TimeOutput settings_of(const TimeOutputConfiguration& output, std::size_t index) {
    wire::TimeOutput settings{};
    settings.index = static_cast<std::uint8_t>(index);
    settings.output = output.output;
    settings.pulse_ns = static_cast<std::uint32_t>(std::llround(output.pulse_ms * 1e6));
    settings.delay_ns = static_cast<std::int32_t>(std::llround(output.delay_us * 1e3));
    settings.holdover_s = static_cast<std::uint16_t>(output.holdover_s);
    if (output.pulse_inverted) settings.flags |= wire::time_pulse_inverted;
    if (output.sentences.empty()) return settings;
    settings.baud = output.baud;
    settings.sentence_delay_ms = static_cast<std::uint16_t>(std::llround(output.sentence_delay_ms));
    std::copy_n(output.talker.begin(), sizeof settings.talker, settings.talker);
    if (output.inverts_serial()) settings.flags |= wire::time_serial_inverted;
    for (std::size_t i = 0; i < time_sentence_names.size(); ++i)
        if (std::count(output.sentences.begin(), output.sentences.end(), time_sentence_names[i]) !=
            0)
            settings.sentences = static_cast<std::uint8_t>(settings.sentences | 1U << i);
    return settings;
}

/// TAI minus UTC of a clock's seconds.
std::int64_t leap_seconds(const clock::ClockReport& clock) {
    return clock.output == clock::OutputClockKind::tai ? clock.kernel.tai_offset_s : 0;
}

}  // namespace

const char* to_string(TimeOutputState state) {
    switch (state) {
        case TimeOutputState::waiting: return "waiting";
        case TimeOutputState::silent: return "silent";
        case TimeOutputState::sending: return "sending";
        case TimeOutputState::wrong: return "wrong";
    }
    return "waiting";
}

TimeAnnouncer::TimeAnnouncer(const std::vector<TimeOutputConfiguration>& outputs) {
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        Output output{settings_of(outputs[i], i), {}, {}, {}, {}};
        output.report.name = outputs[i].name;
        outputs_.push_back(std::move(output));
    }
}

void TimeAnnouncer::begin() {
    const std::lock_guard lock(mutex_);
    next_ = {};
    begins_ = true;
    epoch_.reset();
}

/// Empty: `second` is known; else why it is not.
std::string TimeAnnouncer::find_second(HostTime now, clock::Translator& translator,
                                       Second& second) {
    const auto found = translator.next_second(now);
    if (!found) return "the board's clock is not known yet";
    second.at = *found;
    if (epoch_ != found->epoch) {
        epoch_ = found->epoch;
        settled_ = now + settling;
    }
    if (found->state != clock::ClockState::locked)
        return fmt::format("the estimate of the board's clock is not locked ({})",
                           clock::to_string(found->state));
    if (found->sigma > largest_sigma)
        return fmt::format("the board's clock is known to {} us only; {} us are needed",
                           found->sigma.ns / 1000, largest_sigma.ns / 1000);
    if (const auto stamp = translator.translate(found->board); stamp && stamp->second_doubted)
        return "host and GNSS receiver disagree by whole seconds: see the clock's hint";
    if (now < settled_) return "the output clock was just set, or the board has just connected";
    const clock::ClockReport clock = translator.report();
    second.utc_s = found->output.ns / 1'000'000'000 - leap_seconds(clock);
    if (second.utc_s < limits::first_utc_s || second.utc_s > limits::last_utc_s)
        return "the host's clock is not between the years 2000 and 2099: set it";
    const std::int64_t in_day = second.utc_s % day_s;
    if (clock.kernel.leap_s != 0) second.to_leap_s = day_s - near_leap_s - in_day;
    if (second.to_leap_s <= 0 || (clock.kernel.leap_s != 0 && in_day < near_leap_s))
        return "a leap second is near";
    const auto pace = pace_.add(*found);
    if (!pace) return "board and output clock differ by more than 500 ppm";
    second.pace_ppb = *pace;
    return "";
}

void TimeAnnouncer::board_lacks_them() {
    const std::lock_guard lock(mutex_);
    unknown_ = "the board's firmware has no time outputs: update it with 'versavis flash'";
}

std::vector<wire::TimeOutput> TimeAnnouncer::messages(HostTime now, clock::Translator& translator) {
    const std::lock_guard lock(mutex_);
    std::vector<wire::TimeOutput> all;
    if (std::exchange(begins_, false))
        for (std::size_t unused = outputs_.size(); unused < wire::time_output_count; ++unused)
            all.emplace_back().index = static_cast<std::uint8_t>(unused);
    // The output clock is read each time: a step of it must reach the board before its next pulse.
    const bool stepped = epoch_ && *epoch_ != translator.output_now().epoch;
    if (outputs_.empty() || (now < next_ && !stepped)) return all;
    next_ = now + interval;
    Second second;
    const bool was_known = unknown_.empty();
    unknown_ = find_second(now, translator, second);
    if (unknown_.empty() && !was_known) {
        known_since_ = now;
        known_from_ = second.at.board;
    }
    for (const Output& output : outputs_) {
        wire::TimeOutput message = output.settings;
        if (unknown_.empty()) {
            message.flags |= wire::time_known;
            message.board_ns = second.at.board.ns;
            message.utc_s = second.utc_s;
            message.pace_ppb = second.pace_ppb;
            message.holdover_s = static_cast<std::uint16_t>(
                std::min<std::int64_t>(message.holdover_s, second.to_leap_s));
        }
        all.push_back(message);
    }
    return all;
}

std::optional<Duration> TimeAnnouncer::sent(const wire::Event& event, HostTime now,
                                            clock::Translator& translator) {
    const std::lock_guard lock(mutex_);
    if (event.source >= outputs_.size()) return std::nullopt;
    Output& output = outputs_[event.source];
    ++output.report.pulses;
    output.report.utc_s = event.value;
    output.reported = now;
    const BoardTime second{event.time_ns - output.settings.delay_ns};
    if (!unknown_.empty() || second < known_from_) return std::nullopt;
    const auto stamp = translator.translate(second);
    if (!stamp || stamp->epoch != epoch_) return std::nullopt;
    const std::int64_t output_s = event.value + leap_seconds(translator.report());
    const Duration error{stamp->output.ns - output_s * 1'000'000'000};
    output.report.error = error;
    const Duration tolerance =
        pulse_tolerance + Duration{std::int64_t{stamp->sigma_ns} * tolerated_sigmas};
    if (absolute(error) <= tolerance) return std::nullopt;
    output.wrong = now;
    output.wrong_by = error;
    settled_ = now + settling;
    next_ = {};
    return error;
}

std::vector<TimeOutputReport> TimeAnnouncer::report(HostTime now) const {
    const std::lock_guard lock(mutex_);
    std::vector<TimeOutputReport> all;
    for (const Output& output : outputs_) {
        TimeOutputReport& report = all.emplace_back(output.report);
        const bool pulses = output.reported.ns != 0 && now - output.reported < silence;
        if (output.wrong.ns != 0 && now - output.wrong < settling + start_patience) {
            report.state = TimeOutputState::wrong;
            report.hint = fmt::format("a pulse was {:.1f} us off its second",
                                      static_cast<double>(output.wrong_by.ns) * 1e-3);
        } else if (!unknown_.empty()) {
            report.state = TimeOutputState::waiting;
            report.hint = unknown_;
        } else if (pulses) {
            report.state = TimeOutputState::sending;
        } else {
            report.state = now - known_since_ < start_patience ? TimeOutputState::waiting
                                                               : TimeOutputState::silent;
            report.hint = report.state == TimeOutputState::waiting
                              ? "the board takes two messages that agree"
                              : "the board reports no pulses: see its messages in the log";
        }
    }
    return all;
}

}  // namespace versavis::daemon

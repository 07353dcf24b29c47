// SPDX-License-Identifier: BSD-3-Clause
// What the board does with its time outputs.
#include "board.hpp"
#include "port_settings.hpp"
#include "wire/limits.hpp"

namespace versavis::firmware {

namespace {

namespace limits = wire::limits;

template <class Number>
bool within(Number value, Number minimum, Number maximum) {
    return value >= minimum && value <= maximum;
}

bool is_talker(char character) {
    return within(character, 'A', 'Z') || within(character, '0', '9');
}

/// All sentences have ended long before the next pulse.
bool sentences_fit(const wire::TimeOutput& message) {
    if (message.sentences == 0 || message.sentences >> wire::time_sentence_count != 0) return false;
    std::uint32_t count = 0;
    for (unsigned i = 0; i < wire::time_sentence_count; ++i) count += message.sentences >> i & 1U;
    return message.sentence_delay_ms + limits::sentences_last_ms(count, message.baud) <=
           limits::last_sentence_ms;
}

/// Whether `output` serves something else in this configuration.
bool is_taken(const wire::Configuration& configuration, unsigned output) {
    const wire::PortConfiguration& ports = configuration.ports;
    if (output < camera_count && (configuration.cameras[output].flags & wire::camera_enabled) != 0)
        return true;
    if (output == output_sync && ports.sync_rate_uhz != 0) return true;
    if (ports.test == wire::test_none) return false;
    return output ==
           (ports.test == wire::test_rate ? output_of(ports.test_output) : unsigned{output_test});
}

/// Whether the line can send sentences in this configuration.
bool has_line(const wire::Configuration& configuration, std::uint32_t baud) {
    if (configuration.imus[1].kind != wire::ImuKind::none) return false;
    const wire::PortConfiguration& ports = configuration.ports;
    return (ports.options & wire::port_nmea) == 0 || nmea_baud(ports) == baud;
}

std::uint32_t present_bit(unsigned output) {
    if (output == output_sync) return wire::present_sync_output;
    return output == output_test ? wire::present_test_output : wire::present_camera0 << output;
}

}  // namespace

bool Board::possible(const wire::TimeOutput& message, Nanoseconds now) const {
    if (message.index >= wire::time_output_count || message.output > wire::test_at_sync)
        return false;
    const unsigned output = output_of(message.output);
    const TimeOutput& other = time_outputs_[1 - message.index];
    if ((hal_.facts.present & present_bit(output)) == 0 || is_taken(configuration_, output) ||
        other.uses(output))
        return false;
    if (message.baud != 0 &&
        (!within(message.baud, limits::slowest_time_baud, limits::fastest_time_baud) ||
         (hal_.facts.present & wire::present_uart) == 0 || other.sends_sentences() ||
         !has_line(configuration_, message.baud) || !sentences_fit(message) ||
         !is_talker(message.talker[0]) || !is_talker(message.talker[1])))
        return false;
    const bool time_possible =
        within(message.board_ns, now - limits::time_reach_ns, now + limits::time_reach_ns) &&
        within(message.utc_s, limits::first_utc_s, limits::last_utc_s) &&
        within(message.pace_ppb, -wire::align_largest_pace_ppb, wire::align_largest_pace_ppb);
    return (time_possible || (message.flags & wire::time_known) == 0) &&
           within(message.delay_ns, -limits::longest_time_delay_ns,
                  limits::longest_time_delay_ns) &&
           within(message.pulse_ns, limits::shortest_time_pulse_ns,
                  limits::longest_time_pulse_ns) &&
           within<std::uint32_t>(message.holdover_s, 1, limits::longest_holdover_s);
}

void Board::take(const wire::TimeOutput& message) {
    const Nanoseconds now = hal_.clock.now();
    if (message.index < wire::time_output_count && message.pulse_ns == 0)
        return time_outputs_[message.index].release(now);
    if (possible(message, now))
        return time_outputs_[message.index].take(message, output_of(message.output), now);
    if (message.index < wire::time_output_count) time_outputs_[message.index].doubt();
    ignore(wire::Log{wire::LogLevel::warning, "time_output is out of range or taken: ignored"});
}

bool Board::is_time_output(unsigned output) const {
    for (const TimeOutput& each : time_outputs_)
        if (each.uses(output)) return true;
    return false;
}

/// Those whose output or line the new configuration needs.
void Board::release_time_outputs(const wire::Configuration& configuration, Nanoseconds now) {
    for (TimeOutput& each : time_outputs_)
        if (is_taken(configuration, each.output()) ||
            (each.sends_sentences() && !has_line(configuration, each.baud())))
            each.release(now);
}

void Board::poll_time_outputs(Nanoseconds now) {
    for (TimeOutput& each : time_outputs_) {
        wire::Event sent{};
        if (each.poll(now, sent)) event(sent.kind, sent.source, sent.time_ns, sent.value, 0);
    }
}

}  // namespace versavis::firmware

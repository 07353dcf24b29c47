// SPDX-License-Identifier: BSD-3-Clause
#include "time_output_check.hpp"

#include <fmt/ranges.h>

#include <cctype>

namespace versavis::daemon {

namespace {

/// What uses an output, in words; empty: nothing.
std::string user_of(const Configuration& configuration, const TimeOutputConfiguration& output) {
    const PortConfiguration& ports = configuration.ports;
    if (output.output >= wire::test_at_camera0 && output.output < wire::test_at_sync)
        if (const CameraConfiguration* camera =
                find_camera_at(configuration, output.output - wire::test_at_camera0))
            return at_line(camera->entry, output.entry);
    if (output.output == wire::test_at_sync && ports.sync_rate_hz != 0)
        return "'sync_rate_hz' of [ports]";
    if (output.output == wire::test_at_test && !ports.test.empty()) return "'test' of [ports]";
    if (ports.test_rate_hz != 0 && output.output == ports.test_output)
        return "'test_rate_hz' of [ports]";
    return "";
}

void check_output(const Configuration& configuration, const TimeOutputConfiguration& output,
                  Findings& findings) {
    if (const std::string user = user_of(configuration, output); !user.empty())
        findings.add(
            output.entry, "output",
            fmt::format("the output '{}' is already used by {}", output_name(output.output), user),
            "choose another output");
}

void check_line(const Configuration& configuration, const TimeOutputConfiguration& output,
                Findings& findings) {
    const PortConfiguration& ports = configuration.ports;
    if (find_imu_at(configuration, 1) != nullptr)
        findings.add(output.entry, "sentences", "sentences need the UART, which the vn100 uses",
                     "set sentences = [], or remove the IMU");
    if (ports.nmea && ports.nmea_baud != output.baud)
        findings.add(
            output.entry, "baud",
            fmt::format("the GNSS receiver on the same UART has {} baud ('nmea_baud')",
                        ports.nmea_baud),
            fmt::format("set baud = {}, or the receiver to {}", ports.nmea_baud, output.baud));
}

void check_words(const TimeOutputConfiguration& output, Findings& findings) {
    for (const std::string& sentence : output.sentences)
        if (!contains(time_sentence_names, sentence))
            findings.add(output.entry, "sentences",
                         fmt::format("'{}' is not a sentence", clipped(sentence)),
                         fmt::format("use any of: {}", fmt::join(time_sentence_names, ", ")));
    const auto allowed = [](unsigned char c) {
        return std::isupper(c) != 0 || std::isdigit(c) != 0;
    };
    if (output.talker.size() != 2 ||
        !std::all_of(output.talker.begin(), output.talker.end(), allowed))
        findings.add(output.entry, "talker",
                     fmt::format("'{}' is not a talker", clipped(output.talker)),
                     "use two capital letters or digits, such as \"GP\" or \"GN\"");
}

void check_pulse(const TimeOutputConfiguration& output, Findings& findings) {
    const TimeOutputModel& model = *output.model;
    findings.limit(output.entry, "pulse_ms", output.pulse_ms, model.longest_pulse_ms,
                   fmt::format("the maximum of {}", model.name), "lower it");
    if (output.pulse_ms < model.shortest_pulse_ms)
        findings.add(output.entry, "pulse_ms",
                     fmt::format("'pulse_ms' is {:g} ms, but must be at least {:g} ms (the minimum "
                                 "of {})",
                                 output.pulse_ms, model.shortest_pulse_ms, model.name),
                     "raise it", TomlRange{model.shortest_pulse_ms, std::nullopt});
}

void check_sentences(const TimeOutputConfiguration& output, Findings& findings) {
    const TimeOutputModel& model = *output.model;
    for (const std::string& sentence : output.sentences)
        if (!model.sentences.empty() && !contains(model.sentences, sentence))
            findings.add(output.entry, "sentences",
                         fmt::format("{} does not read {}", model.name, clipped(sentence)),
                         fmt::format("use {}", fmt::join(model.sentences, " or ")));
    if (!model.bauds.empty() &&
        std::find(model.bauds.begin(), model.bauds.end(), output.baud) == model.bauds.end())
        findings.add(output.entry, "baud",
                     fmt::format("{} does not read {} baud", model.name, output.baud),
                     fmt::format("use {}", fmt::join(model.bauds, " or ")));
    const double begin = output.sentence_delay_ms;
    const auto count = static_cast<std::uint32_t>(output.sentences.size());
    const double end = begin + wire::limits::sentences_last_ms(count, output.baud);
    if (const double earliest = output.pulse_ms + model.pause_ms.value_or(0);
        model.pause_ms && begin < earliest)
        findings.add(
            output.entry, "sentence_delay_ms",
            fmt::format("'sentence_delay_ms' is {:g} ms, but {} wants the sentence {:g} ms "
                        "after the end of the pulse ('pulse_ms')",
                        begin, model.name, *model.pause_ms),
            fmt::format("raise it to {:g}, or lower 'pulse_ms'", earliest),
            TomlRange{earliest, std::nullopt});
    findings.limit(output.entry, "sentence_delay_ms", begin, model.latest_begin_ms,
                   fmt::format("the latest begin that {} reads", model.name), "lower it");
    if (end > model.latest_end_ms)
        findings.add(output.entry, "sentence_delay_ms",
                     fmt::format("the last sentence ends {:g} ms after the pulse, but must end "
                                 "within {:g} ms",
                                 end, model.latest_end_ms),
                     "lower it, send fewer sentences, or raise 'baud'");
}

void check_together(const Configuration& configuration, Findings& findings) {
    const auto& outputs = configuration.time_outputs;
    for (std::size_t i = wire::time_output_count; i < outputs.size(); ++i)
        findings.add(outputs[i].entry, "name",
                     fmt::format("the board has {} time outputs", wire::time_output_count),
                     "connect several LiDARs to one of them");
    find_repeated(
        outputs, [](const auto& a, const auto& b) { return a.output == b.output; },
        [&](const auto& first, const auto& second) {
            findings.add(
                second.entry, "output",
                fmt::format("the output '{}' is already used by {}", output_name(second.output),
                            at_line(first.entry, second.entry)),
                "choose another output, or connect both LiDARs to that one");
        });
    find_repeated(
        outputs,
        [](const auto& a, const auto& b) { return !a.sentences.empty() && !b.sentences.empty(); },
        [&](const auto& first, const auto& second) {
            findings.add(second.entry, "sentences",
                         fmt::format("the board has one serial line, already used by {}",
                                     at_line(first.entry, second.entry)),
                         "set sentences = []: both LiDARs can listen to that line");
        });
}

}  // namespace

void check_time_outputs(const Configuration& configuration, Findings& findings) {
    check_together(configuration, findings);
    for (const TimeOutputConfiguration& output : configuration.time_outputs) {
        if (configuration.clock.output == clock::OutputClockKind::monotonic_raw)
            findings.add(output.entry, "name",
                         "a time output needs UTC, which CLOCK_MONOTONIC_RAW is not",
                         "set output = \"realtime\" or \"tai\" in [clock]");
        check_output(configuration, output, findings);
        check_words(output, findings);
        check_pulse(output, findings);
        if (output.sentences.empty()) continue;
        check_line(configuration, output, findings);
        check_sentences(output, findings);
    }
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "check/wiring.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "settings/line_delays.hpp"

namespace versavis::daemon {

namespace {

/// Frames or edges below this part of the pulses are no answer to them, but accidents.
constexpr double least_answered = 0.2;

/// Frames of a camera that nothing triggers, until it is believed to run freely: one may have been
/// under way.
constexpr std::size_t frames_of_a_free_run = 3;

/// What a length or a delay may differ by and still be the same: sensors quantise to lines.
constexpr Duration line_time = microseconds(40);
constexpr double relative_tolerance = 0.03;

constexpr Duration noticeable_edge = microseconds(60);

/// A start that is later than the latency by more than this has a cause in the camera.
constexpr Duration late_start = microseconds(500);

bool is_answer(std::size_t count, std::size_t pulses) {
    return count >= 3 && static_cast<double>(count) >= least_answered * static_cast<double>(pulses);
}

/// What followed the pulses of one run at one input.
struct LineAnswer {
    std::size_t pulses = 0;
    std::size_t seen = 0;             ///< pulses that an edge followed, or more
    std::size_t answered = 0;         ///< two, or more
    std::size_t bounced = 0;          ///< more
    std::size_t begins_exposing = 0;  ///< the first edge was one that begins an exposure
    Duration delay;                   ///< of the first edge: median
    Duration length;                  ///< to the second: median
    Duration delay_spread;
    Duration seen_spread;  ///< of the delays of those that were seen

    bool follows() const {
        return answered >= 3 &&
               static_cast<double>(answered) >= least_answered * static_cast<double>(pulses);
    }
    bool inverted() const { return begins_exposing * 2 < answered; }
};

Duration median(std::vector<Duration> values) {
    if (values.empty()) return {};
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Between a tenth and nine tenths of the values.
Duration spread(std::vector<Duration> values) {
    if (values.empty()) return {};
    std::sort(values.begin(), values.end());
    return values[values.size() * 9 / 10] - values[values.size() / 10];
}

bool alike(Duration a, Duration b) {
    const auto larger = static_cast<double>(std::max(absolute(a).ns, absolute(b).ns));
    return absolute(a - b).ns <= line_time.ns + std::llround(larger * relative_tolerance);
}

LineAnswer answer_of(const PulseRun& run, unsigned input) {
    LineAnswer answer;
    answer.pulses = run.pulses.size();
    std::vector<Duration> seen;
    std::vector<Duration> delays;
    std::vector<Duration> lengths;
    const std::vector<LineEdge>& edges = run.inputs[input];
    auto edge = edges.begin();
    for (std::size_t k = 0; k < run.pulses.size(); ++k) {
        const bool last = k + 1 == run.pulses.size();
        while (edge != edges.end() && edge->at < run.pulses[k]) ++edge;
        const auto end = last ? edges.end() : std::find_if(edge, edges.end(), [&](const auto& e) {
            return e.at >= run.pulses[k + 1];
        });
        const auto count = end - edge;
        if (count >= 1) seen.push_back(edge->at - run.pulses[k]);
        if (count >= 2) {
            ++answer.answered;
            if (count > 2) ++answer.bounced;
            if (edge->exposing) ++answer.begins_exposing;
            delays.push_back(edge->at - run.pulses[k]);
            lengths.push_back((end - 1)->at - edge->at);
        }
        edge = end;
    }
    answer.seen = seen.size();
    answer.seen_spread = spread(seen);
    answer.delay = median(delays);
    answer.length = median(lengths);
    answer.delay_spread = spread(delays);
    return answer;
}

std::string us(Duration value) {
    const double us = static_cast<double>(value.ns) * 1e-3;
    return std::abs(us) >= 1000 ? fmt::format("{:.2f} ms", us * 1e-3)
                                : fmt::format("{:.0f} us", us);
}

/// Judges one camera.
class Judge {
 public:
    Judge(const std::vector<WiredCamera>& cameras, const std::vector<PulseRun>& runs,
          std::size_t index)
        : cameras_(cameras), runs_(runs), index_(index), camera_(cameras[index]) {}

    CameraWiring judge() {
        if (runs_freely()) return done();
        if (!delivers(camera_.output)) {
            name_missing_trigger();
            return done();
        }
        name_other_triggers();
        judge_frames();
        judge_line();
        return done();
    }

 private:
    const PulseRun* run(std::optional<unsigned> output, unsigned nth = 0) const {
        for (const PulseRun& run : runs_)
            if (run.output == output && !run.working && nth-- == 0) return &run;
        return nullptr;
    }

    const PulseRun* working_run() const {
        for (const PulseRun& run : runs_)
            if (run.working && run.output == camera_.output) return &run;
        return nullptr;
    }

    /// The camera sends frames when pulses leave at this output.
    bool delivers(unsigned output, std::size_t camera) const {
        for (unsigned nth = 0; const PulseRun* at = run(output, nth); ++nth)
            if (is_answer(at->frames[camera].arrived, at->pulses.size())) return true;
        return false;
    }
    bool delivers(unsigned output) const { return delivers(output, index_); }

    bool follows(unsigned output, unsigned input) const {
        const PulseRun* at = run(output);
        return at != nullptr && answer_of(*at, input).follows();
    }

    /// As far as the board reports: of an input whose output sends no pulses, one edge in 100 ms.
    bool shows(unsigned output, unsigned input) const {
        const PulseRun* at = run(output);
        if (at == nullptr) return false;
        const LineAnswer answer = answer_of(*at, input);
        return is_answer(answer.seen, answer.pulses) &&
               answer.seen_spread < at->exposures[index_] + slowest_edge;
    }

    /// Another camera that these pulses trigger has its exposure line there.
    bool explained(unsigned output, unsigned input) const {
        for (std::size_t other = 0; other < cameras_.size(); ++other)
            if (other != index_ && cameras_[other].output == input && delivers(output, other))
                return true;
        return false;
    }

    std::string owner(unsigned output) const {
        for (const WiredCamera& other : cameras_)
            if (other.output == output && other.name != camera_.name) return other.name;
        return "";
    }

    void report(const char* code, std::string text) {
        result_.findings.push_back({code, std::move(text)});
    }

    CameraWiring done() {
        result_.name = camera_.name;
        result_.right = result_.findings.empty();
        if (result_.right) describe();
        return result_;
    }

    bool runs_freely() {
        const PulseRun* idle = run(std::nullopt);
        if (idle == nullptr || idle->frames[index_].arrived < frames_of_a_free_run) return false;
        report(
            "free_run",
            fmt::format("it sends frames without a trigger ({} while no pulse left): TriggerMode "
                        "is off, or something else triggers it",
                        idle->frames[index_].arrived));
        return true;
    }

    void name_missing_trigger() {
        for (unsigned output = 0; output < wire::camera_count; ++output) {
            if (output == camera_.output || !delivers(output)) continue;
            return name_wrong_output(output);
        }
        if (const auto input = exposes_at()) {
            return report(
                "no_frames",
                fmt::format("it exposes with the pulses of output {} (input {} shows it), "
                            "but no frame arrives: check its network or USB cable, the "
                            "packet size, and the firewall",
                            camera_.output, *input));
        }
        report("no_trigger",
               fmt::format("no output triggers it: check that its trigger cable is on output {} "
                           "and has a common ground, that its level suits the input, and "
                           "TriggerSource{}",
                           camera_.output,
                           camera_.strobe ? ""
                                          : "; it has no exposure line, so it may also expose, and "
                                            "no frame arrive: check its network or USB cable"));
    }

    void name_wrong_output(unsigned output) {
        const std::string other = owner(output);
        if (explained(output, output)) {
            report("shared_trigger",
                   fmt::format("its trigger cable is on output {}, as that of {}: move it to {}",
                               output, other, camera_.output));
        } else if (camera_.strobe && follows(output, output)) {
            return report(
                "wrong_port",
                fmt::format(
                    "its trigger and exposure cables are at {}, not {}: {}", output, camera_.output,
                    other.empty() ? fmt::format("move them, or set output = {}", output)
                                  : fmt::format("swap 'device' or the cables with {}", other)));
        } else {
            report(
                "wrong_output",
                fmt::format("its trigger cable is on output {}, not {}: {}", output, camera_.output,
                            other.empty() ? "move it" : "swap it with that of " + other));
        }
        if (camera_.strobe && !shows(output, camera_.output)) name_missing_line(output);
    }

    /// The input whose length follows the camera's exposure, with the pulses of its output.
    std::optional<unsigned> exposes_at() const {
        const PulseRun* first = run(camera_.output);
        const PulseRun* second = run(camera_.output, 1);
        if (first == nullptr || second == nullptr) return std::nullopt;
        for (unsigned input = 0; input < wire::camera_count; ++input) {
            const LineAnswer a = answer_of(*first, input);
            const LineAnswer b = answer_of(*second, input);
            if (!a.follows() || !b.follows() || explained(camera_.output, input)) continue;
            if (alike(b.length - a.length, second->exposures[index_] - first->exposures[index_]))
                return input;
        }
        return std::nullopt;
    }

    void name_other_triggers() {
        for (unsigned output = 0; output < wire::camera_count; ++output) {
            if (output == camera_.output || !delivers(output)) continue;
            report("two_outputs",
                   fmt::format("output {} triggers it, too: its trigger input is connected to both "
                               "outputs, or to the exposure line of a camera at output {}",
                               output, output));
        }
    }

    void judge_frames() {
        const PulseRun* at = run(camera_.output);
        const std::size_t frames = at->frames[index_].arrived;
        const std::size_t pulses = at->pulses.size();
        if (frames * 2 > pulses * 3)
            return report(
                "frames_for_each",
                fmt::format("{} frames arrive for {} pulses: AcquisitionBurstFrameCount is "
                            "not 1, or its trigger line bounces",
                            frames, pulses));
        if (at->frames[index_].incomplete > 1)
            return report(
                "incomplete",
                fmt::format("packets are missing in {} of {} frames: check its cable, and "
                            "set 'packet_size' to what the network passes",
                            at->frames[index_].incomplete, frames));
        if (missing(*at) > 1)
            return report(
                "lost", fmt::format("{} of {} frames arrive even at an exposure of {}: its readout "
                                    "is longer than the period, the pulses are too short or too "
                                    "weak for its input, or frames are lost on the link",
                                    frames, pulses, us(at->exposures[index_])));
        const PulseRun* working = working_run();
        if (working == nullptr) return;
        // The board takes the pauses on an inverted line for exposures, and waits for their end.
        const bool inverted = camera_.strobe && answer_of(*at, camera_.output).inverted();
        if (missing(*working) + (inverted ? 0 : working->skipped) <= 1) return;
        report(
            "overlap",
            fmt::format("at the configured rate it takes {} of {} triggers, with an exposure of "
                        "{}: exposure and readout need longer than the period; lower 'rate_hz', "
                        "shorten ExposureTime, or set TriggerOverlap to ReadOut",
                        working->frames[index_].arrived, working->pulses.size() + working->skipped,
                        us(working->exposures[index_])));
    }

    std::size_t missing(const PulseRun& at) const {
        return at.pulses.size() - std::min(at.pulses.size(), at.frames[index_].arrived);
    }

    void judge_line() {
        const PulseRun* first = run(camera_.output);
        const PulseRun* second = run(camera_.output, 1);
        if (second == nullptr) return;
        const LineAnswer a = answer_of(*first, camera_.output);
        const LineAnswer b = answer_of(*second, camera_.output);
        if (!camera_.strobe) {
            if (a.follows())
                report(
                    "strobe_unused",
                    fmt::format("the configuration has strobe = \"none\", but input {} shows its "
                                "exposures: remove that key",
                                camera_.output));
            return;
        }
        if (!a.follows() || !b.follows()) return name_missing_line(camera_.output);
        name_other_inputs();
        if (a.bounced * 10 > a.answered)
            report("bounces",
                   fmt::format("input {} changes more than twice in {} of {} exposures: check the "
                               "ground and the pull-up, or raise 'glitch_us'",
                               camera_.output, a.bounced, a.answered));
        if (a.inverted())
            report("exposure_inverted",
                   fmt::format("input {} has the other level while it exposes: change 'strobe' to "
                               "the other of \"active_high\" and \"active_low\", or LineInverter",
                               camera_.output));
        if (judge_lengths(*first, *second, a, b)) judge_delays(*first, *second, a, b);
    }

    void name_missing_line(unsigned output) {
        for (unsigned input = 0; input < wire::camera_count; ++input) {
            if (input == camera_.output || !shows(output, input) || explained(output, input))
                continue;
            const std::string other = owner(input);
            return report(
                "wrong_input",
                fmt::format("its exposure line is at input {}, not {}: {}", input, camera_.output,
                            other.empty() ? "move it" : "swap it with that of " + other));
        }
        report(
            "no_exposure_line",
            fmt::format("frames arrive, but input {} shows no exposure: check the cable and its "
                        "ground, whether the output needs a pull-up, and LineMode and LineSource",
                        camera_.output));
    }

    void name_other_inputs() {
        for (unsigned input = 0; input < wire::camera_count; ++input) {
            if (input == camera_.output || !shows(camera_.output, input) ||
                explained(camera_.output, input))
                continue;
            report("lines_joined",
                   fmt::format("its exposures also show at input {}: the two inputs are connected",
                               input));
        }
    }

    /// False: it is not the exposure that the line shows.
    bool judge_lengths(const PulseRun& first, const PulseRun& second, const LineAnswer& a,
                       const LineAnswer& b) {
        const Duration longer = b.length - a.length;
        const Duration exposure = first.exposures[index_];
        const bool by_pulse = alike(exposure, first.width);
        if (!by_pulse && alike(a.length, first.width) && alike(b.length, second.width)) {
            report(
                "shows_trigger",
                fmt::format("input {} shows the trigger pulses, not the exposures: it is connected "
                            "to the trigger output, or LineSource is the trigger line",
                            camera_.output));
            return false;
        }
        if (alike(second.exposures[index_], exposure)) return true;  // it cannot be set
        if (alike(longer, {})) {
            report(
                "fixed_length",
                fmt::format("input {} is active for {} whatever the exposure is: set LineSource to "
                            "ExposureActive, and StrobeDuration to 0",
                            camera_.output, us(a.length)));
            return false;
        }
        if (!alike(longer, second.exposures[index_] - exposure)) {
            report(
                "other_signal",
                fmt::format("input {} is active for {} at an exposure of {}, and for {} at {}: it "
                            "does not show the exposure; set LineSource to ExposureActive",
                            camera_.output, us(a.length), us(exposure), us(b.length),
                            us(second.exposures[index_])));
            return false;
        }
        const Duration beyond = a.length - exposure;
        if (absolute(beyond) < noticeable_edge) return true;
        if (absolute(beyond) <= slowest_edge) {
            report("slow_edge",
                   fmt::format(
                       "input {} is active for {} {} than the exposure: an edge is slow; use "
                       "a stronger pull-up, or state the delays as 'strobe_rising_us' and "
                       "'strobe_falling_us'",
                       camera_.output, us(absolute(beyond)), beyond.ns > 0 ? "longer" : "shorter"));
            return true;
        }
        report("readout",
               fmt::format("input {} is active for {} {} than the exposure: it shows frame or "
                           "readout; set LineSource to ExposureActive",
                           camera_.output, us(absolute(beyond)),
                           beyond.ns > 0 ? "longer" : "shorter"));
        return true;
    }

    void judge_delays(const PulseRun& first, const PulseRun& second, const LineAnswer& a,
                      const LineAnswer& b) {
        const Duration wider = second.width - first.width;
        if (absolute(wider) > line_time * 2 && alike(b.delay - a.delay, wider))
            return report(
                "trigger_edge",
                fmt::format("it exposes when the pulse at output {} ends: change "
                            "TriggerActivation, or 'trigger_inverted' if its input inverts",
                            camera_.output));
        if (a.delay - camera_.latency > late_start)
            return report(
                "late_start",
                fmt::format("it exposes {} after its trigger, and 'latency_us' is {:.0f}: "
                            "set TriggerDelay to 0, or state the latency",
                            us(a.delay), static_cast<double>(camera_.latency.ns) * 1e-3));
        if (a.delay_spread > late_start)
            report("jitter", fmt::format("it exposes {} to {} after its trigger: something in "
                                         "between is no wire",
                                         us(a.delay), us(a.delay + a.delay_spread)));
    }

    void describe() {
        const PulseRun* at = run(camera_.output);
        const LineAnswer line = answer_of(*at, camera_.output);
        std::string text = fmt::format("triggered by output {}, {} of {} frames", camera_.output,
                                       at->frames[index_].arrived, at->pulses.size());
        if (camera_.strobe)
            text += fmt::format(", exposure at input {} {} after the trigger, {} long at {}",
                                camera_.output, us(line.delay), us(line.length),
                                us(at->exposures[index_]));
        report("right", std::move(text));
    }

    const std::vector<WiredCamera>& cameras_;
    const std::vector<PulseRun>& runs_;
    std::size_t index_;
    const WiredCamera& camera_;
    CameraWiring result_;
};

}  // namespace

std::vector<CameraWiring> judge_wiring(const std::vector<WiredCamera>& cameras,
                                       const std::vector<PulseRun>& runs) {
    std::vector<CameraWiring> wirings;
    for (std::size_t i = 0; i < cameras.size(); ++i)
        wirings.push_back(Judge(cameras, runs, i).judge());
    return wirings;
}

}  // namespace versavis::daemon

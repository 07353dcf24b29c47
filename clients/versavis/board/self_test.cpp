// SPDX-License-Identifier: BSD-3-Clause
#include "board/self_test.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

namespace versavis::client {

namespace {

/// What is sent: a wire passes it on whatever drives it, and the board's filters let it pass.
constexpr Duration pulse_period = milliseconds(10);
constexpr Duration pulse_width = milliseconds(1);
constexpr std::uint32_t pulse_rate_millihertz = 100'000;

/// Exposures are slower: cameras are.
constexpr Duration exposure_period = milliseconds(20);
constexpr std::uint32_t exposure_rate_uhz = 50'000'000;

/// Pulses that are looked at.
constexpr std::size_t pulse_count = 20;

/// Until so many have come, or none will.
constexpr Duration collect_patience = milliseconds(800);

constexpr std::array output_names{"test", "trigger0", "trigger1", "trigger2", "trigger3", "sync"};
constexpr std::array input_names{"pps", "aux0", "aux1", "sync_input"};
static_assert(input_names.size() == wire::pulse_input_count);

std::string exposure_name(unsigned camera) { return fmt::format("exposure{}", camera); }

/// Bit of wire::Present of what test pulses can leave at; by wire::TestOutput.
std::uint32_t part_of(unsigned output) {
    if (output == wire::test_at_test) return wire::present_test_output;
    if (output == wire::test_at_sync) return wire::present_sync_output;
    return wire::present_camera0 << (output - wire::test_at_camera0);
}

/// Of an event; none: it is of no pulse input.
std::optional<unsigned> input_of(const wire::Event& event) {
    switch (event.kind) {
        case wire::BoardEventKind::pps: return wire::pulse_pps;
        case wire::BoardEventKind::aux_pulse: return wire::pulse_aux0 + unsigned{event.source & 1U};
        case wire::BoardEventKind::sync_pulse: return wire::pulse_sync;
        default: return std::nullopt;
    }
}

using EdgesByInput = std::array<std::vector<std::int64_t>, wire::pulse_input_count>;

class Tester {
 public:
    Tester(const SelfTestSettings& settings, TestBoard& board)
        : settings_(settings), board_(board) {}

    Expected<> run() {
        auto done = test_outputs();
        // Whatever was found, its outputs rest.
        auto rested = board_.configure({});
        return done ? rested : done;
    }

    std::vector<TestedLine> lines;

 private:
    Expected<> test_outputs() {
        for (unsigned output = 0; output < output_names.size(); ++output) {
            settings_.progress("testing", output, output_names.size());
            if (!board_.has(part_of(output))) continue;
            if (settings_.stop()) return failure("self-test", "stopped");
            const std::size_t before = lines.size();
            if (auto done = test_pulses(output); !done) return done;
            const bool trigger =
                output >= wire::test_at_camera0 && output < wire::test_at_camera0 + 4U;
            if (trigger)
                if (auto done = test_exposures(output - wire::test_at_camera0); !done) return done;
            if (lines.size() == before) lines.push_back({output_names[output], "", {}});
        }
        return {};
    }

    /// By the events of the pulse inputs. They report one kind of edge at a time; pulses begin at
    /// multiples of the period, so that the other kind can be seen later.
    Expected<> test_pulses(unsigned output) {
        const SentPulses sent{pulse_period, pulse_width, pulse_count};
        auto rising = collect_pulses(output, false);
        if (!rising) return Unexpected(rising.error());
        const bool heard = std::any_of(rising->begin(), rising->end(),
                                       [&](const auto& edges) { return hears(sent, edges); });
        if (!heard) return {};
        auto falling = collect_pulses(output, true);
        if (!falling) return Unexpected(falling.error());
        for (unsigned input = 0; input < input_names.size(); ++input) {
            const LoopFinding finding = check_loop(sent, {(*rising)[input], (*falling)[input]});
            if (finding.result != LoopResult::open)
                lines.push_back({output_names[output], input_names[input], finding});
        }
        return {};
    }

    Expected<EdgesByInput> collect_pulses(unsigned output, bool falling) {
        wire::Configuration configuration{};
        configuration.ports.inputs =
            static_cast<std::uint8_t>(board_.present() / wire::present_pulse0 & 0x0FU);
        configuration.ports.falling = falling ? configuration.ports.inputs : std::uint8_t{0};
        configuration.ports.test = wire::test_rate;
        configuration.ports.test_rate_millihertz = pulse_rate_millihertz;
        configuration.ports.test_output = static_cast<std::uint8_t>(output);
        configuration.ports.pulse_ns = static_cast<std::uint32_t>(pulse_width.ns);
        if (auto done = board_.configure(configuration); !done) return Unexpected(done.error());
        EdgesByInput edges;
        const auto enough = [&](const wire::Packet& packet) {
            wire::Event event{};
            if (!packet.read(event)) return false;
            const auto input = input_of(event);
            // Those of the configuration before may still come, and the end of a pulse that it cut.
            if (!input || event.time_ns < board_.configured_ns() + pulse_period.ns) return false;
            edges[*input].push_back(event.time_ns);
            return edges[*input].size() > pulse_count;
        };
        if (auto heard = board_.link().listen(enough, collect_patience); !heard)
            return Unexpected(heard.error());
        return edges;
    }

    /// By the records of a camera whose trigger is wired to its exposure line.
    Expected<> test_exposures(unsigned camera) {
        wire::Configuration configuration{};
        wire::CameraConfiguration& tested = configuration.cameras[camera];
        tested.flags = wire::camera_enabled;
        tested.rate_uhz = exposure_rate_uhz;
        tested.pulse_ns = static_cast<std::uint32_t>(pulse_width.ns);
        tested.exposure_ns = pulse_width.ns;
        tested.max_exposure_ns = exposure_period.ns / 2;
        if (auto done = board_.configure(configuration); !done) return done;
        const auto mask = static_cast<std::uint8_t>(1U << camera);
        if (auto sent = board_.link().send(wire::Start{mask, 0, {}}); !sent) return sent;
        SeenEdges edges;
        std::optional<std::int64_t> first;  // trigger: pulses begin at whole periods from it
        const auto enough = [&](const wire::Packet& packet) {
            wire::Exposure record{};
            if (!packet.read(record) || record.camera != camera ||
                record.trigger_ns < board_.configured_ns())
                return false;
            if (!first) first = record.trigger_ns;
            if (record.start_ns != wire::no_time)
                edges.rising_ns.push_back(record.start_ns - *first);
            if (record.end_ns != wire::no_time) edges.falling_ns.push_back(record.end_ns - *first);
            return std::min(edges.rising_ns.size(), edges.falling_ns.size()) >= pulse_count;
        };
        if (auto heard = board_.link().listen(enough, collect_patience); !heard)
            return Unexpected(heard.error());
        const LoopFinding finding = check_loop({exposure_period, pulse_width, pulse_count}, edges);
        if (finding.result != LoopResult::open)
            lines.push_back(
                {output_names[wire::test_at_camera0 + camera], exposure_name(camera), finding});
        return {};
    }

    const SelfTestSettings& settings_;
    TestBoard& board_;
};

struct Wire {
    std::string output;
    std::string input;
};

Expected<std::vector<Wire>> parse(const std::vector<std::string>& texts) {
    std::vector<Wire> wires;
    for (const std::string& text : texts) {
        const auto equals = text.find('=');
        const Wire wire{text.substr(0, equals),
                        equals == std::string::npos ? "" : text.substr(equals + 1)};
        const bool output = std::count(output_names.begin(), output_names.end(), wire.output) != 0;
        const bool pulse = std::count(input_names.begin(), input_names.end(), wire.input) != 0;
        const bool exposure = wire.output.rfind("trigger", 0) == 0 &&
                              wire.input == "exposure" + wire.output.substr(7);
        if (!output || !(pulse || exposure))
            return failure("--wire " + text, "is no output and input",
                           "write test, sync or trigger0 to trigger3, '=', and pps, aux0, aux1 or "
                           "sync_input; or trigger0=exposure0, and so on");
        wires.push_back(wire);
    }
    return wires;
}

/// A wire that was asked for and is not there is a failure.
void demand(std::vector<TestedLine>& lines, const std::vector<Wire>& wires) {
    for (const Wire& wire : wires) {
        const auto there = [&](const TestedLine& line) {
            return line.output == wire.output && line.input == wire.input;
        };
        if (std::any_of(lines.begin(), lines.end(), there)) continue;
        LoopFinding missing;
        missing.result = LoopResult::failed;
        missing.hint = "no pulse arrived: check the wire, its driver and its receiver";
        // In place of the remark that the output is open.
        std::erase_if(lines, [&](const TestedLine& line) {
            return line.output == wire.output && line.input.empty();
        });
        lines.push_back({wire.output, wire.input, missing});
    }
}

bool passed(const std::vector<TestedLine>& lines) {
    bool any = false;
    for (const TestedLine& line : lines) {
        if (line.finding.result == LoopResult::failed) return false;
        any = any || line.finding.result == LoopResult::ok;
    }
    return any;
}

const char* to_string(LoopResult result) {
    switch (result) {
        case LoopResult::open: return "open";
        case LoopResult::ok: return "ok";
        case LoopResult::failed: return "failed";
    }
    return "failed";
}

std::string line_text(const TestedLine& line) {
    const LoopFinding& finding = line.finding;
    if (finding.result == LoopResult::open)
        return fmt::format("{:<8} open    no input sees it: not wired?\n", line.output);
    std::string text =
        fmt::format("{:<8} {:<7} at {}", line.output, to_string(finding.result), line.input);
    if (finding.period.ns > 0)
        text += fmt::format(": period {:.3f} ms, width {:.1f} us",
                            static_cast<double>(finding.period.ns) * 1e-6,
                            static_cast<double>(finding.width.ns) * 1e-3);
    return text + (finding.hint.empty() ? "" : "; " + finding.hint) + "\n";
}

nlohmann::json line_json(const TestedLine& line) {
    const bool measured = line.finding.period.ns > 0;
    nlohmann::json json{{"output", line.output}, {"result", to_string(line.finding.result)},
                        {"input", nullptr},      {"period_ns", nullptr},
                        {"width_ns", nullptr},   {"hint", line.finding.hint}};
    if (!line.input.empty()) json["input"] = line.input;
    if (measured) {
        json["period_ns"] = line.finding.period.ns;
        json["width_ns"] = line.finding.width.ns;
    }
    return json;
}

}  // namespace

Expected<SelfTest> self_test(const SelfTestSettings& settings, TestBoard& board) {
    const auto wires = parse(settings.wires);
    if (!wires) return Unexpected(wires.error());
    Tester tester(settings, board);
    if (auto done = tester.run(); !done) return Unexpected(done.error());
    const device::Greeting& greeting = board.greeting();
    SelfTest test{greeting.serial(), greeting.firmware(), std::move(tester.lines)};
    demand(test.lines, *wires);
    test.passed = passed(test.lines);
    return test;
}

Expected<SelfTest> self_test(const SelfTestSettings& settings) {
    if (auto wires = parse(settings.wires); !wires) return Unexpected(wires.error());
    auto board = TestBoard::open(settings.board, settings.instance);
    if (!board) return Unexpected(board.error());
    return self_test(settings, *board);
}

std::string lines_text(const SelfTest& test) {
    std::string text;
    for (const TestedLine& line : test.lines) text += line_text(line);
    return text;
}

std::string to_text(const SelfTest& test, bool json) {
    if (json) {
        nlohmann::json lines = nlohmann::json::array();
        for (const TestedLine& line : test.lines) lines.push_back(line_json(line));
        return nlohmann::json{{"serial", test.serial},
                              {"firmware", test.firmware},
                              {"passed", test.passed},
                              {"lines", lines}}
                   .dump() +
               "\n";
    }
    std::string out = fmt::format("board {}, {}\n", test.serial, test.firmware);
    out += lines_text(test);
    const bool wired = std::any_of(test.lines.begin(), test.lines.end(),
                                   [](const TestedLine& line) { return !line.input.empty(); });
    if (!wired) out += "nothing was tested: wire outputs to inputs (man versavis-board)\n";
    return out;
}

}  // namespace versavis::client

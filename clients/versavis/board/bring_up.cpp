// SPDX-License-Identifier: BSD-3-Clause
#include "board/bring_up.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "engine/board/board_words.hpp"

namespace versavis::client {

namespace {

enum StepNumber { supply, rest, triggers, test_output, sync_output, light, loops, step_count };

constexpr std::array<BringUpStep, step_count> steps{
    {{"supply", "USB only", "36 and 40, against 38", "3.2 to 3.4 V at 36; 4.5 to 5.5 V at 40"},
     {"rest", "USB only", "25, 26, 27, 29, 31, 32, 34", "below 0.1 V"},
     {"triggers", "USB only", "25, 26, 27, 29", "20.000 ms, high for 1000.0 us, all at once"},
     {"test output", "USB only", "32", "1.000 ms, high for 100.0 us"},
     {"sync output", "USB only", "31", "1.000 ms, high for 100.0 us"},
     {"light", "USB only", "34 and 25",
      "34 rises 100.0 us before 25, and falls within 0.2 us of it"},
     {"loops", "pins 25-19, 26-20, 27-21, 29-22, 32-15, 31-17", "", "each loop is ok"}}};

constexpr std::uint32_t camera_pulse_ns = 1'000'000;
constexpr std::uint32_t slow_rate_uhz = 50'000'000;
constexpr std::uint32_t fast_pulse_ns = 100'000;
constexpr std::uint32_t fast_rate_millihertz = 1'000'000;
constexpr std::uint32_t light_lead_ns = 100'000;

/// For a report, which comes once a second.
constexpr Duration report_patience = milliseconds(1500);

void add_cameras(wire::Configuration& configuration, std::uint8_t mask) {
    for (unsigned i = 0; i < wire::camera_count; ++i) {
        if ((mask >> i & 1U) == 0) continue;
        wire::CameraConfiguration& camera = configuration.cameras[i];
        camera.flags = wire::camera_enabled | wire::camera_no_strobe;
        camera.rate_uhz = slow_rate_uhz;
        camera.pulse_ns = camera_pulse_ns;
        camera.exposure_ns = camera_pulse_ns;
        camera.max_exposure_ns = 2 * camera_pulse_ns;
    }
}

void add_pulses(wire::Configuration& configuration, wire::TestOutput output) {
    configuration.ports.test = wire::test_rate;
    configuration.ports.test_rate_millihertz = fast_rate_millihertz;
    configuration.ports.test_output = output;
    configuration.ports.pulse_ns = fast_pulse_ns;
}

/// What the board has of the four.
std::uint8_t cameras_of(const TestBoard& board) {
    return static_cast<std::uint8_t>(board.present() / wire::present_camera0 & 0x0FU);
}

/// The cameras that run in this step.
std::uint8_t cameras_of(StepNumber number, const TestBoard& board) {
    if (number == triggers) return cameras_of(board);
    return number == light ? 1 : 0;
}

wire::Configuration configuration_of(StepNumber number, const TestBoard& board) {
    wire::Configuration configuration{};
    add_cameras(configuration, cameras_of(number, board));
    if (number == test_output) add_pulses(configuration, wire::test_at_test);
    if (number == sync_output) add_pulses(configuration, wire::test_at_sync);
    if (number == light) {
        configuration.illumination.cameras = 1;
        configuration.illumination.lead_ns = light_lead_ns;
        configuration.illumination.max_on_ns = 10 * camera_pulse_ns;
        configuration.illumination.duty_ppm = 1'000'000;
    }
    return configuration;
}

bool possible(StepNumber number, const TestBoard& board) {
    switch (number) {
        case triggers: return cameras_of(board) != 0;
        case test_output: return board.has(wire::present_test_output);
        case sync_output: return board.has(wire::present_sync_output);
        case light: return board.has(wire::present_light) && board.has(wire::present_camera0);
        default: return true;
    }
}

/// What the board reports of itself while its outputs do what they should.
Expected<> judge(TestBoard& board, BringUpResult& result) {
    wire::Health health{};
    const auto heard = board.link().listen(
        [&](const wire::Packet& packet) {
            return packet.read(health) && health.board_time_ns > board.configured_ns();
        },
        report_patience);
    if (!heard) return Unexpected(heard.error());
    if (!*heard) return failure("bring-up", "the board does not report", "versavis board reset");
    result.finding =
        fmt::format("started by {}, test of its stamps {}, {} late outputs, {} edges lost",
                    board::to_string(health.reset_cause), board::to_string(health.stamp_test),
                    health.late_outputs, health.lost_edges);
    result.failed = health.stamp_test == wire::StampTest::failed || health.late_outputs != 0;
    return {};
}

/// A wire for each signal that this board has.
std::vector<std::string> wires_of(const TestBoard& board) {
    std::vector<std::string> wires;
    for (unsigned i = 0; i < wire::camera_count; ++i)
        if (board.has(wire::present_camera0 << i))
            wires.push_back(fmt::format("trigger{}=exposure{}", i, i));
    if (board.has(wire::present_test_output) && board.has(wire::present_pulse0 << wire::pulse_aux0))
        wires.emplace_back("test=aux0");
    if (board.has(wire::present_sync_output) && board.has(wire::present_pulse0 << wire::pulse_sync))
        wires.emplace_back("sync=sync_input");
    return wires;
}

Expected<> test_loops(const BringUpSettings& settings, TestBoard& board, BringUpResult& result) {
    SelfTestSettings loops;
    loops.wires = wires_of(board);
    loops.stop = settings.stop;
    const auto test = self_test(loops, board);
    if (!test) return Unexpected(test.error());
    result.failed = !test->passed;
    result.finding = lines_text(*test);
    return {};
}

Expected<> run(const BringUpSettings& settings, TestBoard& board, StepNumber number,
               BringUpResult& result) {
    if (settings.stop()) return failure("bring-up", "stopped");
    settings.prepare(steps[number]);
    if (number == loops) return test_loops(settings, board, result);
    if (auto done = board.configure(configuration_of(number, board)); !done) return done;
    if (const std::uint8_t cameras = cameras_of(number, board); cameras != 0)
        if (auto sent = board.link().send(wire::Start{cameras, 0, {}}); !sent) return sent;
    result.as_expected = settings.look(steps[number]);
    return judge(board, result);
}

Expected<> run_all(const BringUpSettings& settings, TestBoard& board, BringUp& done) {
    for (unsigned i = 0; i < steps.size(); ++i) {
        const auto number = static_cast<StepNumber>(i);
        if (!possible(number, board)) continue;
        BringUpResult& result = done.results.emplace_back();
        result.step = &steps[i];
        if (auto ran = run(settings, board, number, result); !ran) return ran;
    }
    return {};
}

const char* verdict(const BringUpResult& result) {
    if (result.failed) return "failed";
    if (!result.as_expected) return result.step == &steps[loops] ? "ok" : "not looked at";
    return *result.as_expected ? "ok" : "differs";
}

}  // namespace

std::span<const BringUpStep> bring_up_steps() { return steps; }

bool BringUp::passed() const {
    return std::none_of(results.begin(), results.end(), [](const BringUpResult& result) {
        return result.failed || !result.as_expected.value_or(true);
    });
}

Expected<BringUp> bring_up(const BringUpSettings& settings) {
    auto board = TestBoard::open(settings.board, settings.instance);
    if (!board) return Unexpected(board.error());
    BringUp done{board->greeting().serial(), board->greeting().firmware(), {}};
    auto ran = run_all(settings, *board, done);
    auto rested = board->configure({});  // whatever was found
    if (!ran) return Unexpected(ran.error());
    if (!rested) return Unexpected(rested.error());
    return done;
}

std::string to_text(const BringUp& done, bool json) {
    if (json) {
        nlohmann::json results = nlohmann::json::array();
        for (const BringUpResult& result : done.results)
            results.push_back({{"step", result.step->name},
                               {"expected", result.step->expect},
                               {"result", verdict(result)},
                               {"finding", result.finding}});
        return nlohmann::json{{"serial", done.serial},
                              {"firmware", done.firmware},
                              {"passed", done.passed()},
                              {"steps", results}}
                   .dump() +
               "\n";
    }
    std::string out = fmt::format("board {}, {}\n", done.serial, done.firmware);
    for (const BringUpResult& result : done.results)
        out +=
            fmt::format("{:<12} {:<13} {}\n", result.step->name, verdict(result), result.finding);
    return out;
}

}  // namespace versavis::client

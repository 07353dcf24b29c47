// SPDX-License-Identifier: BSD-3-Clause
// `versavis board` through the real libusb, on a simulated bus with the true firmware behind it.
// Run under umockdev-wrapper.
#include <umockdev.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "../support/process.hpp"
#include "../support/stack.hpp"
#include "../support/temporary_directory.hpp"
#include "board/bring_up.hpp"
#include "looped_board.hpp"
#include "simulated_pico.hpp"
#include "usb_bridge.hpp"

using namespace versavis;
using namespace versavis::test;
using Catch::Contains;

namespace {

constexpr auto pps = static_cast<std::uint8_t>(firmware::input_pulse + unsigned{wire::pulse_pps});
constexpr auto aux0 = static_cast<std::uint8_t>(firmware::input_pulse + unsigned{wire::pulse_aux0});
constexpr auto sync_input =
    static_cast<std::uint8_t>(firmware::input_pulse + unsigned{wire::pulse_sync});

/// A bus and the tool.
struct BoardBench {
    /// Its exit code; `said` is what it printed.
    int board(const std::vector<std::string>& arguments) {
        std::vector<std::string> command{program("versavis"), "--instance", "no-such-service",
                                         "board"};
        command.insert(command.end(), arguments.begin(), arguments.end());
        return run(command, directory.path() / "log", &said);
    }

    GObjectPtr<UMockdevTestbed> testbed{umockdev_testbed_new()};
    TemporaryDirectory directory;
    std::string said;
};

/// The line of a self-test's JSON for this output and input.
nlohmann::json line(const nlohmann::json& test, const std::string& output,
                    const nlohmann::json& input) {
    for (const auto& found : test["lines"])
        if (found["output"] == output && found["input"] == input) return found;
    return nlohmann::json::object();
}

/// All wires that the bring-up asks for.
const std::vector<LoopWire> all_loops{
    {firmware::pin_test, aux0}, {firmware::pin_sync, sync_input}, {0, 0}, {1, 1}, {2, 2}, {3, 3}};

/// When this pin changed to this level, in what came after the first `from` changes.
std::vector<std::int64_t> edges_of(const std::vector<OutputChange>& changes, std::size_t from,
                                   unsigned pin, bool level) {
    std::vector<std::int64_t> edges;
    for (std::size_t i = from; i < changes.size(); ++i) {
        const auto is = [&](std::size_t k) { return (changes[k].pins >> pin & 1U) != 0; };
        if (is(i) == level && is(i) != (i > 0 && is(i - 1))) edges.push_back(changes[i].at);
    }
    return edges;
}

}  // namespace

TEST_CASE("board: info shows version, parts and counters, in words and in JSON") {
    BoardBench bench;
    const LoopedBoard board(bench.testbed.get(), "LOOP0001", {});
    CHECK(bench.board({"info"}) == 0);
    CHECK_THAT(bench.said, Contains("LOOP0001 at usb:1-1") && Contains("firmware versavis ") &&
                               Contains("started by power_on") && Contains("camera0, camera1") &&
                               Contains("late outputs 0"));
    CHECK(bench.board({"info", "--json"}) == 0);
    const auto info = nlohmann::json::parse(bench.said);
    CHECK(info["source"] == "usb");
    CHECK(info["state"] == "running");
    CHECK(info["serial"] == "LOOP0001");
    CHECK(info["nonce"] == 1);
    CHECK(info["protocol"] ==
          std::to_string(wire::protocol_major) + "." + std::to_string(wire::protocol_minor));
    CHECK(info["present"][0] == "camera0");
    CHECK(info["late_outputs"] == 0);
    CHECK(info["pps"] == "none");
}

TEST_CASE("board: info of a boot loader says what can be done with it") {
    BoardBench bench;
    const SimulatedPico pico(bench.testbed.get(), {"PICO0001", "1-1", ""});
    CHECK(bench.board({"info"}) == 0);
    CHECK_THAT(bench.said, Contains("usb:1-1, in its boot loader") && Contains("versavis flash"));
    CHECK(bench.board({"info", "--json"}) == 0);
    CHECK(nlohmann::json::parse(bench.said)["state"] == "boot_loader");
    CHECK(bench.board({"selftest"}) == 69);
    CHECK_THAT(bench.said, Contains("is in its boot loader") && Contains("versavis flash"));
}

TEST_CASE("board: reset begins a new life, and starts what the boot loader has") {
    BoardBench bench;
    {
        const LoopedBoard board(bench.testbed.get(), "LOOP0001", {});
        CHECK(bench.board({"reset", "--json"}) == 0);
        CHECK(nlohmann::json::parse(bench.said)["nonce"] == 2);
        CHECK(board.reboots() == 1);
        CHECK(bench.board({"info"}) == 0);
        CHECK_THAT(bench.said, Contains("started by software"));
    }
    SimulatedPico pico(bench.testbed.get(), {"PICO0001"});
    pico.plug(true);
    CHECK(bench.board({"reset"}) == 0);
    CHECK_THAT(bench.said, Contains("PICO0001 at usb:1-1 was reset and runs versavis 0.0.1"));
}

TEST_CASE("board: without a board, each command says what to do") {
    BoardBench bench;
    for (const char* command : {"info", "reset", "selftest"}) {
        CHECK(bench.board({command}) == 69);
        CHECK_THAT(bench.said, Contains("no board") && Contains("plug it in"));
    }
}

TEST_CASE("usb: a board that the service has says what it is; it is not reset or tested") {
    BoardBench bench;
    Stack stack({"boardbusy", 33, 1, 20, "", "", "", 320, 240, "usb"});
    stack.start_rig();
    UsbBridge bridge(bench.testbed.get(), stack.socket_path(), "RIG0001");
    stack.start_service();
    const auto status = stack.wait_for_status(healthy);
    CHECK(status["board"]["firmware_outdated"] == false);
    std::string said;
    CHECK(stack.tool({"board", "info", "--json"}, &said) == 0);
    const auto info = nlohmann::json::parse(said);
    CHECK(info["source"] == "service");
    CHECK(info["serial"] == "RIG0001");
    CHECK(info["nonce"] == status["board"]["nonce"]);
    CHECK(info["port"] == "usb:1-1");
    CHECK(stack.tool({"board", "info"}, &said) == 0);
    CHECK_THAT(said, Contains("as reported by the service") && Contains("late outputs"));
    for (const char* command : {"reset", "selftest"}) {
        CHECK(stack.tool({"board", command}, &said) == 69);
        CHECK_THAT(said, Contains("the service 'boardbusy'"));
    }
    CHECK(stack.wait_for_status(healthy)["board"]["connections"] == 1);
    CHECK(stack.service().terminate() == 0);
}

TEST_CASE("board: the self-test measures what wires join, and leaves the outputs at rest") {
    BoardBench bench;
    const LoopedBoard board(bench.testbed.get(), "LOOP0001",
                            {{firmware::pin_test, aux0},
                             {firmware::pin_sync, sync_input},
                             {1, 1, 300, 700},  // trigger 1 to exposure line 1
                             {2, pps}});
    CHECK(bench.board(
              {"selftest", "--json", "--wire", "test=aux0", "--wire", "trigger1=exposure1"}) == 0);
    const auto test = nlohmann::json::parse(bench.said);
    CHECK(test["passed"] == true);
    CHECK(test["serial"] == "LOOP0001");
    for (const auto& [output, input, period_ns, width_ns] :
         std::vector<std::tuple<std::string, std::string, int, int>>{
             {"test", "aux0", 10'000'000, 1'000'000},
             {"sync", "sync_input", 10'000'000, 1'000'000},
             {"trigger1", "exposure1", 20'000'000, 1'000'400},
             {"trigger2", "pps", 10'000'000, 1'000'000}}) {
        INFO(output << ": " << bench.said);
        const auto found = line(test, output, input);
        REQUIRE_FALSE(found.empty());
        CHECK(found["result"] == "ok");
        // The first exposures move by half of what the line adds to them.
        CHECK(std::abs(found["period_ns"].get<int>() - period_ns) <= 100);
        CHECK(found["width_ns"] == width_ns);
    }
    for (const char* output : {"trigger0", "trigger3"})
        CHECK(line(test, output, nullptr)["result"] == "open");
    CHECK(test["lines"].size() == 6);
    CHECK(bench.board({"selftest"}) == 0);
    CHECK_THAT(bench.said,
               Contains("test     ok      at aux0: period 10.000 ms, width 1000.0 us") &&
                   Contains("trigger0 open"));
    const std::size_t changes = board.output_changes().size();
    CHECK(changes > 0);
    CHECK(bench.board({"info"}) == 0);  // which takes the board's time until its next report
    CHECK(board.output_changes().size() == changes);
}

TEST_CASE("board: the self-test finds lines that are loaded, and wires that are not there") {
    BoardBench bench;
    const LoopedBoard board(bench.testbed.get(), "LOOP0001",
                            {{firmware::pin_test, aux0, 0, 60'000}, {0, 0, 30'000, 30'000}});
    CHECK(bench.board({"selftest", "--wire", "sync=sync_input"}) == 1);
    CHECK_THAT(bench.said,
               Contains("test     failed  at aux0: period 10.000 ms, width 1060.0 us") &&
                   Contains("pull-up and load") && Contains("trigger0 failed  at exposure0") &&
                   Contains("pulses begin 30.0 us after") &&
                   Contains("sync     failed  at sync_input; no pulse arrived"));
    CHECK(bench.board({"selftest", "--wire", "sync=exposure0"}) == 69);
    CHECK_THAT(bench.said, Contains("--wire sync=exposure0") && Contains("is no output and input"));
}

TEST_CASE("board: a self-test of a board without wires does not pass") {
    BoardBench bench;
    const LoopedBoard board(bench.testbed.get(), "LOOP0001", {});
    CHECK(bench.board({"selftest"}) == 1);
    CHECK_THAT(bench.said, Contains("nothing was tested") && Contains("man versavis-board"));
}

TEST_CASE("board: the bring-up sends in each step what its row in the manual says") {
    const GObjectPtr<UMockdevTestbed> testbed{umockdev_testbed_new()};
    const LoopedBoard board(testbed.get(), "LOOP0001", all_loops);
    std::map<std::string, std::vector<OutputChange>> sent;
    client::BringUpSettings settings;
    settings.look = [&](const client::BringUpStep& step) {
        const std::size_t before = board.output_changes().size();
        const std::string name = step.name;
        if (name != "supply" && name != "rest") board.wait_for_changes(before + 60);
        auto changes = board.output_changes();
        sent[name] = {changes.begin() + static_cast<std::ptrdiff_t>(before), changes.end()};
        return true;
    };
    const auto done = client::bring_up(settings);
    INFO((done ? client::to_text(*done, false) : done.error().message()));
    REQUIRE(done);
    CHECK(done->passed());
    const auto check = [&](const char* step, unsigned pin, std::int64_t period_ns,
                           std::int64_t width_ns) {
        INFO(step << ", output " << pin);
        auto rises = edges_of(sent[step], 1, pin, true);
        auto falls = edges_of(sent[step], 1, pin, false);
        REQUIRE(rises.size() > 5);
        rises.erase(rises.begin());  // which the change of configuration may have cut
        for (std::size_t i = 1; i < rises.size(); ++i) CHECK(rises[i] - rises[i - 1] == period_ns);
        std::erase_if(falls, [&](std::int64_t at) { return at < rises.front(); });
        for (std::size_t i = 0; i < falls.size(); ++i) CHECK(falls[i] - rises[i] == width_ns);
    };
    for (unsigned camera = 0; camera < 4; ++camera)
        check("triggers", camera, 20'000'000, 1'000'000);
    CHECK(edges_of(sent["triggers"], 1, 0, true) == edges_of(sent["triggers"], 1, 3, true));
    check("test output", firmware::pin_test, 1'000'000, 100'000);
    check("sync output", firmware::pin_sync, 1'000'000, 100'000);
    check("light", 0, 20'000'000, 1'000'000);
    check("light", firmware::pin_light, 20'000'000, 1'100'000);
    CHECK(sent["rest"].empty());

    std::ifstream file(VERSAVIS_SOURCE_DIR "/docs/user/board.md");
    const std::string manual{std::istreambuf_iterator<char>(file), {}};
    for (const client::BringUpStep& step : client::bring_up_steps())
        CHECK_THAT(manual, Contains(std::string("| ") + step.name + " | " + step.connect + " | " +
                                    step.where + " | " + step.expect + " |"));
}

TEST_CASE("board: a bring-up that nobody looks at tests the loops") {
    BoardBench bench;
    {
        const LoopedBoard board(bench.testbed.get(), "LOOP0001", all_loops);
        const int code = bench.board({"selftest", "--bringup", "--json"});
        INFO(bench.said);
        REQUIRE(code == 0);
        const auto json = nlohmann::json::parse(bench.said.substr(bench.said.find("{\"")));
        CHECK(json["passed"] == true);
        CHECK(json["steps"].size() == 7);
        CHECK(json["steps"][2]["result"] == "not looked at");
        CHECK(json["steps"][6]["result"] == "ok");
    }
    const LoopedBoard board(bench.testbed.get(), "LOOP0002", {});
    CHECK(bench.board({"selftest", "--bringup"}) == 1);
    CHECK_THAT(bench.said, Contains("measure: pins 25, 26, 27, 29") && Contains("not looked at") &&
                               Contains("failed  at exposure0; no pulse arrived"));
}

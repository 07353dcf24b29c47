// SPDX-License-Identifier: BSD-3-Clause
// What can be wrong, made so in the rig, one after the other: what the status says of it, and
// whether all is well again when it ends.
#include <atomic>
#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <functional>
#include <mutex>
#include <set>
#include <thread>

#include "../support/process.hpp"
#include "../support/stack.hpp"

using namespace versavis;
using namespace versavis::test;
using nlohmann::json;

namespace {

constexpr int degraded = 1;
constexpr int starting = 2;
constexpr int not_running = 69;

/// Who else is there, and what happens besides the rig's own faults.
enum class Scene {
    usual,
    no_rig,     ///< neither board nor cameras
    stranger,   ///< another program has the camera
    restarted,  ///< the service was killed and is started again
    swapped,    ///< two cameras, each with the other's trigger cable
};

struct Case {
    const char* name;
    const char* device;      ///< whose fault is looked at
    const char* fault;       ///< its word
    const char* hint;        ///< what the hint must contain
    bool ends = false;       ///< then all is well again
    const char* broken{};    ///< [[fault]] of the rig, without its camera
    const char* camera{};    ///< keys of the rig's cameras
    const char* settings{};  ///< keys of the service's cameras
    const char* imu{};       ///< keys of the service's IMU
    const char* address{};   ///< of the service's cameras
    Scene scene = Scene::usual;
    int exit_code = degraded;
};

/// Faults that end last four seconds (at 20 Hz, eighty exposures), or longer where the status names
/// them only part of the time: it explains what the service sees between two attempts, too.
const std::vector<Case> cases{
    {"packets are lost now and then", "cam0", "packet_loss", "of the last", true,
     "kind = 'lose_packets'\nshare = 0.05\ncount = 80"},
    {"half of the packets are lost", "cam0", "packet_loss", "lost packets", true,
     "kind = 'lose_packets'\ncount = 160"},
    {"all packets are lost", "cam0", "no_frames", "network", true,
     "kind = 'lose_packets'\nshare = 1\ncount = 80"},
    {"large packets do not pass", "cam0", "packet_size", "MTU", true,
     "kind = 'block_large'\ncount = 80"},
    {"frames never leave the camera", "cam0", "no_frames", "have no frame", true,
     "kind = 'drop_frame'\ncount = 80"},
    {"frames are cut", "cam0", "camera_misconfigured", "announced were", true,
     "kind = 'half_frame'\ncount = 12"},
    {"records come late", "cam0", "late_records", "ms after the exposure", true,
     "kind = 'late_records'\nseconds = 4"},
    {"records come later from now on", "cam0", "late_records", "later than before", true,
     "kind = 'late_records'\nseconds = 1000\ndelay_ms = 45"},
    {"the control channel is slow", "cam0", "starting", "a slow control channel longer", false, "",
     "answer_ms = 300"},
    {"triggers are ignored, and no line shows it", "cam0", "triggers_ignored", "% of triggers",
     false, "", "ignored = 0.2", "strobe = 'none'"},
    {"the exposure is longer than the period", "cam0", "exposure_too_long", "60000 us", false, "",
     "exposure_us = 60000"},
    {"the rate is above what the camera can", "cam0", "rate_too_high", "every 2nd trigger", false,
     "", "shortest_period_us = 80000"},
    {"a free camera is slower than configured", "cam0", "rate_too_high", "of 20 Hz", false, "",
     "shortest_period_us = 80000", "trigger = 'free'"},
    {"every frame of a free camera is incomplete", "cam0", "packet_size", "packet_size = 1500",
     true, "kind = 'block_large'\ncount = 80", "", "trigger = 'free'"},
    {"the camera is absent", "cam0", "camera_absent", "no camera answers to this name", false, "",
     "", "", "", "127.0.99.99"},
    {"the camera is in another network", "cam0", "camera_unreachable", "in the subnet of", false,
     "", "", "", "", "203.0.113.9"},
    {"another program has the camera", "cam0", "camera_busy", "another program", false, "", "", "",
     "", nullptr, Scene::stranger},
    {"the service was killed and holds its own camera", "cam0", "camera_lease", "still locked",
     true, "", "", "", "", nullptr, Scene::restarted, starting},
    {"the camera lacks a feature", "cam0", "camera_misconfigured", "PixelFormat", false, "", "",
     "[camera.features]\nPixelFormat = 'Mono12'"},
    {"the camera is mute", "cam0", "camera_absent", "cable, power", true,
     "kind = 'camera_mute'\nseconds = 8"},
    {"the camera reboots slowly", "cam0", "camera_absent", "cable, power", true,
     "kind = 'camera_reboot'\nseconds = 8"},
    {"the exposure line is inverted", "cam0", "strobe_inverted", "active_high", false, "", "",
     "strobe = 'active_low'"},
    {"the exposure line is taken for inverted", "cam0", "strobe_inverted", "change 'strobe'", false,
     "", "exposure_us = 12000", "strobe = 'active_low'"},
    {"the exposure line is cut", "cam0", "strobe_missing", "exposure line", true,
     "kind = 'cut_strobe'\ncount = 80"},
    {"the trigger cable is cut", "cam0", "no_exposure", "output 0", true,
     "kind = 'ignore_trigger'\ncount = 200"},
    {"trigger cables are swapped", "cam1", "unproved", "swapped", false, "", "", "", "", nullptr,
     Scene::swapped},
    {"unproved frames are published as suspect", "cam0", "unproved", "do not follow", false, "", "",
     "on_unproved = 'flag'", "", nullptr, Scene::swapped},
    {"the board is gone", "board", "board_gone", "board", true, "kind = 'board_gone'\nseconds = 4"},
    {"the board is gone, says the camera", "cam0", "board_gone", "no triggers: the board is gone",
     true, "kind = 'board_gone'\nseconds = 4"},
    {"the board is gone, says the IMU", "imu0", "board_gone", "no samples", true,
     "kind = 'board_gone'\nseconds = 4"},
    {"the board falls silent", "board", "board_silent", "silent for", true,
     "kind = 'board_mute'\nseconds = 4"},
    {"the board falls silent, says the clock", "clock", "board_silent", "board's hint", true,
     "kind = 'board_mute'\nseconds = 10"},
    {"nothing is there", "board", "board_gone", "board", false, "", "", "", "", nullptr,
     Scene::no_rig},
    {"the IMU is unplugged", "imu0", "imu_missing", "no part answers", true,
     "kind = 'imu_missing'\nseconds = 5"},
    {"another IMU is plugged in", "imu0", "imu_wrong", "a part other than", false, "", "", "",
     "model = 'adis16460'"},
    {"the IMU is silent", "imu0", "imu_silent", "sends nothing", true,
     "kind = 'imu_stuck'\nseconds = 5"},
    {"the IMU's cable is noisy", "imu0", "imu_faulty", "failed their check", true,
     "kind = 'imu_noisy'\nseconds = 10"},
};

constexpr unsigned at_a_time = 4;
constexpr unsigned first_subnet = 100;
constexpr int begins_at = 60;  ///< exposure of cam0: all is well by then

StackSettings settings_of(const Case& c, unsigned number) {
    const auto text = [](const char* words) { return std::string(words != nullptr ? words : ""); };
    StackSettings settings{"fault" + std::to_string(number),
                           first_subnet + number,
                           1,
                           20,
                           text(c.camera),
                           "",
                           text(c.settings)};
    if (!text(c.broken).empty())
        settings.faults =
            "[[fault]]\ncamera = \"cam0\"\nat_exposure = " + std::to_string(begins_at) + "\n" +
            c.broken + "\n";
    settings.imu_extra = text(c.imu);
    settings.devices.assign(settings.cameras, text(c.address));
    settings.swapped = c.scene == Scene::swapped;
    if (settings.swapped) settings.cameras = 2;
    return settings;
}

const json* device_of(const json& status, const std::string& name) {
    if (name == "board" || name == "clock") return &status[name];
    for (const char* kind : {"cameras", "imus"})
        for (const json& device : status[kind])
            if (device["name"] == name) return &device;
    return nullptr;
}

/// Asks `versavis status` until it says so; empty, or the last that it said instead.
std::string wait_until(const Stack& stack, const std::function<bool(int, const json&)>& said,
                       Duration timeout) {
    const HostTime deadline = host_now() + timeout;
    std::string output;
    int code = 0;
    while (host_now() < deadline) {
        code = stack.tool({"status", "--json"}, &output);
        const json status = json::parse(output, nullptr, false);
        if (status.is_object() && said(code, status)) return "";
        const timespec pause{0, 100'000'000};
        nanosleep(&pause, nullptr);
    }
    return "exit code " + std::to_string(code) + "\n" + output;
}

bool well(int code, const json& /*status*/) { return code == 0; }

/// Empty, or what was not as expected.
std::string run(const Case& c, unsigned number) {
    const StackSettings settings = settings_of(c, number);
    StackSettings others = settings;
    others.name += "-stranger";
    Stack stranger(others);
    Stack stack(settings);
    if (c.scene == Scene::stranger) {
        stranger.start_rig();
        stranger.start_service();
        stranger.wait_for_status(
            [](const json& s) { return s["cameras"][0]["state"] == "streaming"; });
    } else if (c.scene != Scene::no_rig) {
        stack.start_rig();
    }
    stack.start_service();
    if (c.scene == Scene::restarted) {
        if (const std::string wrong = wait_until(stack, well, seconds(30)); !wrong.empty())
            return "never well before: " + wrong;
        stack.kill_service();
        stack.start_service();
    }
    const auto as_expected = [&](int code, const json& status) {
        const json* device = device_of(status, c.device);
        return device != nullptr && code == c.exit_code && (*device)["fault"] == c.fault &&
               (*device)["hint"].get<std::string>().find(c.hint) != std::string::npos &&
               (*device)["since_ns"].get<std::int64_t>() <= status["host_time_ns"];
    };
    if (const std::string wrong = wait_until(stack, as_expected, seconds(30)); !wrong.empty())
        return "not reported: " + wrong;
    if (!c.ends) return "";
    const std::string wrong = wait_until(stack, well, seconds(30));
    return wrong.empty() ? "" : "never well again: " + wrong;
}

std::string run_and_catch(const Case& c, unsigned number) {
    try {
        return run(c, number);
    } catch (const std::exception& problem) {
        return problem.what();
    }
}

}  // namespace

TEST_CASE("faults: each is reported with its cause and its cure, and is forgotten when it ends") {
    std::atomic<std::size_t> next{0};
    std::mutex mutex;
    std::vector<std::string> wrong;
    const auto work = [&] {
        for (std::size_t i = next++; i < cases.size(); i = next++) {
            const std::string problem = run_and_catch(cases[i], static_cast<unsigned>(i));
            if (problem.empty()) continue;
            const std::lock_guard lock(mutex);
            wrong.push_back(std::string(cases[i].name) + ": " + problem);
        }
    };
    std::vector<std::thread> workers;
    for (unsigned i = 0; i < at_a_time; ++i) workers.emplace_back(work);
    for (std::thread& worker : workers) worker.join();
    for (const std::string& problem : wrong) FAIL_CHECK(problem);
    CHECK(cases.size() >= 25);
}

TEST_CASE("faults: the manual has those of this table, and of those without a rig no more") {
    // These need what the rig has not, or pass too fast; the rules have tests of their own.
    std::set<std::string> words{
        "starting",           "wrong_size",       "camera_silent",  "board_refuses",
        "too_slow",           "clock_unknown",    "clock_holdover", "clock_step",
        "camera_failed",      "link_full",        "no_buffer",      "no_triggers",
        "wrong_exposure",     "line_delays",      "imu_failed",     "block_ids",
        "camera_clock",       "double_frames",    "board_stamps",   "seconds_differ",
        "host_undisciplined", "time_unknown",     "time_silent",    "time_wrong",
        "ptp_master",         "ptp_lost",         "ptp_other_time", "ptp_refused",
        "ptp_stamps",         "ptp_contradicted", "ptp_unread",     "lidar_not_following",
        "lidar_unproved"};
    for (const Case& c : cases) words.insert(c.fault);
    std::set<std::string> rows;
    std::ifstream manual(VERSAVIS_SOURCE_DIR "/docs/user/troubleshooting.md");
    for (std::string line; std::getline(manual, line);)
        if (line.starts_with("| `")) rows.insert(line.substr(3, line.find('`', 3) - 3));
    CHECK(rows == words);
}

TEST_CASE("faults: a service that was killed is said to be dead at once") {
    Stack stack({"killed-service", first_subnet + 99, 1, 20, "", "", ""});
    stack.start_service();
    stack.wait_for_status([](const json& /*status*/) { return true; });
    stack.kill_service();
    const HostTime killed = host_now();
    std::string output;
    while (stack.tool({"status"}, &output) != not_running)
        REQUIRE(host_now() - killed < seconds(20));
    CHECK_THAT(output, Catch::Contains("died"));
}

TEST_CASE("faults: who reads the stream of an absent camera learns that it is absent") {
    StackSettings settings{"noring", first_subnet + 98, 1, 20, "", "", ""};
    settings.devices = {"127.0.99.98"};
    Stack stack(settings);
    stack.start_service();
    stack.wait_for_status([](const json& s) { return s["cameras"][0]["state"] == "absent"; });
    std::string output;
    CHECK(stack.tool({"tail", "cam0"}, &output) == 69);
    CHECK_THAT(output,
               Catch::Contains("absent") && Catch::Contains("no camera answers to this name"));
    CHECK(stack.tool({"snapshot", "cam0", "-o", stack.log_path("x.png")}, &output) == 69);
    CHECK_THAT(output, Catch::Contains("absent"));
    CHECK(stack.tool({"tail", "cam7"}, &output) == 69);
    CHECK_THAT(output, Catch::Contains("no such stream"));
}

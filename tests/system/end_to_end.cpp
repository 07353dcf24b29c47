// SPDX-License-Identifier: BSD-3-Clause
// Rig, service and readers as processes, over the real protocols, compared with the rig's ground
// truth.
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "../support/judged.hpp"
#include "../support/look.hpp"
#include "../support/stack.hpp"
#include "judge.hpp"
#include "versavis/set_reader.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

rig::Verdict judge_running(const Stack& stack, double seconds) {
    const rig::Verdict verdict = judged(stack, seconds);
    INFO(rig::to_table(verdict));
    if (!verdict.ok) WARN("it is not ok");  // with the table
    for (const auto& [name, stream] : verdict.streams) {
        CHECK(stream.wrong_pairs == 0);
        CHECK(stream.items > 0);
    }
    return verdict;
}

/// Reads until `condition` is true of an item; throws when none arrives in time.
template <class S, class Condition>
auto read_until(S& stream, Condition condition, Duration timeout = seconds(30)) {
    const HostTime deadline = host_now() + timeout;
    while (host_now() < deadline) {
        auto item = test::look(stream.next(milliseconds(200)));
        if (condition(item)) return item;
    }
    throw std::runtime_error("no such item arrived in time");
}

const auto is_item = [](const auto& item) { return item.found == test::Found::item; };

}  // namespace

TEST_CASE("end to end: two cameras and an IMU, every stamp belongs to its item") {
    Stack stack({"e2e", 10, 2, 20, "exposure_us = 4000\nexposure_swing = 0.5\nexposure_swing_s = 3",
                 "", ""});
    stack.start_rig();
    stack.start_service();
    const rig::Verdict verdict = judge_running(stack, 8);
    CHECK(verdict.ok);
    for (const auto& name : {"cam0", "cam1"}) {
        CHECK(verdict.streams.at(name).lost == 0);
        CHECK(verdict.streams.at(name).rate_hz == Approx(20).margin(0.2));
    }
    CHECK(verdict.streams.at("imu0").rate_hz == Approx(200).margin(2));

    const auto status = stack.wait_for_status(healthy);
    CHECK(status["board"]["lost_packets"] == 0);
    std::string output;
    CHECK(stack.tool({"status"}, &output) == 0);
    CHECK_THAT(output, Catch::Contains("pairing locked"));
    CHECK(stack.tool({"list"}, &output) == 0);
    for (const auto* name : {"cam0", "cam1", "imu0", "events", "status"})
        CHECK_THAT(output, Catch::Contains(name));
    CHECK(stack.tool({"tail", "cam0", "-n", "3", "--json"}, &output) == 0);
    CHECK_THAT(output, Catch::Contains("\"kind\":\"measured\""));
    CHECK(stack.tool({"tail", "imu0", "-n", "3"}, &output) == 0);
    CHECK_THAT(output, Catch::Contains("gyro_rad_s"));
    const std::string image = stack.log_path("image.png");
    CHECK(stack.tool({"snapshot", "cam0", "-o", image}, &output) == 0);
    std::ifstream png(image, std::ios::binary);
    std::string magic(8, '\0');
    png.read(magic.data(), 8);
    CHECK(magic == "\x89PNG\r\n\x1a\n");

    // A reader in another language, written from the document.
    CHECK(run({"python3", VERSAVIS_SOURCE_DIR "/tests/system/read_ring.py",
               stream_path("e2e", "cam0").string(), "5"},
              stack.log_path("python.log"), &output) == 0);
    CHECK_THAT(output, Catch::Contains("320 x 240") && Catch::Contains("0.0 dB, 45.0 C"));

    CHECK(stack.service().terminate() == 0);
    CHECK_THAT(stack.service().output(), !Catch::Contains("CRITICAL"));
    CHECK(stack.tool({"status"}, &output) == 69);
    CHECK_FALSE(std::filesystem::exists(stream_path("e2e", "cam0")));
}

// The tag has it wait for the firmware's image.
TEST_CASE("end to end: the firmware as it is flashed stamps like the native board", "[emulator]") {
    StackSettings settings{"chip", 97, 2, 20, "exposure_us = 4000", "", ""};
    settings.board = "rp2040";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const rig::Verdict verdict = judge_running(stack, 6);
    CHECK(verdict.ok);
    for (const auto& name : {"cam0", "cam1"})
        CHECK(verdict.streams.at(name).rate_hz == Approx(20).margin(0.5));
    CHECK(verdict.streams.at("imu0").rate_hz == Approx(200).margin(5));
    const auto status = stack.wait_for_status(healthy);
    CHECK(status["board"]["lost_packets"] == 0);
}

TEST_CASE("end to end: the emulated board restarts, and its stamps are right again", "[emulator]") {
    StackSettings settings{"chipreset", 98, 1, 20, "", "", ""};
    settings.board = "rp2040";
    settings.faults = "[[fault]]\nkind = \"board_reset\"\ncamera = \"cam0\"\nat_exposure = 40\n";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(
        [](const auto& status) { return status["board"]["connections"] == 2 && healthy(status); });
    CHECK(judge_running(stack, 3).ok);
}

TEST_CASE("end to end: an image that does not start is reported by its name", "[emulator]") {
    Stack stack({"noimage", 99, 1, 20, "", "", ""});
    const std::string image = GENERATE(VERSAVIS_SOURCE_DIR "/README.md", "/nowhere/versavis.uf2");
    std::string output;
    CHECK(run({program("versavis-rig"), "run", stack.scenario_path(), "--socket",
               stack.socket_path(), "--board", "rp2040", "--image", image},
              stack.log_path("image.log"), &output) == 69);
    CHECK_THAT(output, Catch::Contains("versavis-rig: " + image) &&
                           (Catch::Contains("no such file") || Catch::Contains("boot2")));
}

TEST_CASE("end to end: a slave is exposed by its master, and its stamps are its own") {
    StackSettings settings{"slave", 29, 2, 20, "exposure_us = 4000", "", ""};
    settings.slave_extra = "master = \"cam0\"";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const rig::Verdict verdict = judge_running(stack, 6);
    for (const auto& name : {"cam0", "cam1"})
        CHECK(verdict.streams.at(name).rate_hz == Approx(20).margin(2));
    stack.wait_for_status(healthy);
}

TEST_CASE(
    "end to end: a slow exposure line and a filter are taken off, unknown ones are admitted") {
    const bool known = GENERATE(true, false);
    StackSettings settings{"delays", 73, 1, 20, "line_rising_us = 90\nline_falling_us = 10",
                           "",       ""};
    settings.imu_extra = std::string("filter = 4\ndata_ready = ") + (known ? "true\n" : "false\n");
    settings.lines = known ? "strobe_rising_us = [90, 1]\nstrobe_falling_us = [10, 1]\n" : "";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const rig::Verdict verdict = judge_running(stack, 5);
    CHECK(verdict.ok);
    if (known) CHECK(verdict.streams.at("cam0").error_p50_ns < 30'000);
    if (known) CHECK(verdict.streams.at("imu0").error_p50_ns < 30'000);
    const auto status = stack.wait_for_status(
        [](const auto& s) { return s["cameras"][0]["edge_difference_ns"].is_number(); });
    const auto& camera = status["cameras"][0];
    CHECK(camera["line"] == "Line1");
    CHECK(camera["line_delay_source"] == (known ? "configuration" : "unknown"));
    CHECK(camera["line_delay_start_ns"] == (known ? 90'000 : 0));
    CHECK(camera["line_delay_sigma_ns"] == (known ? 1'000 : 40'000));
    CHECK(camera["edge_difference_ns"].get<double>() == Approx(-80'000).margin(5'000));
    CHECK(camera["exposure_ns"].get<double>() ==
          Approx(known ? 3'000'000 : 2'920'000).margin(5'000));
    CHECK(camera["hint"] == "");
    // Paced by itself, the part averages four samples; else what is read is half a sample old.
    const double parts = known ? 15 + 1.5 : 15 + 0.5;
    CHECK(status["imus"][0]["filter_delay_ns"].get<double>() ==
          Approx(parts / 819.2 * 1e9 + 606'000).margin(1'000));
}

TEST_CASE("end to end: records that a slow link delays cost no start") {
    Stack stack({"slowlink", 34, 1, 50, "", "[board]\nlink_ms = 30\n", ""});
    stack.start_rig();
    stack.start_service();
    const auto status =
        stack.wait_for_status([](const auto& s) { return s["cameras"][0]["pairing"] == "locked"; });
    // One pattern proves it: a slow start would have come after two of them.
    CHECK(status["cameras"][0]["frames_received"] < 60);
    CHECK(judged(stack, 3).streams.at("cam0").wrong_pairs == 0);
}

TEST_CASE("end to end: an exposure line of the wrong polarity is named as such") {
    Stack stack({"polarity", 74, 1, 20, "", "", "strobe = \"active_low\""});
    stack.start_rig();
    stack.start_service();
    const auto status = stack.wait_for_status([](const auto& s) {
        return s["cameras"][0]["hint"].template get<std::string>().find("polarity is wrong") !=
               std::string::npos;
    });
    CHECK_THAT(status["cameras"][0]["hint"].get<std::string>(),
               Catch::Contains("Line1") && Catch::Contains("\"active_high\""));
}

TEST_CASE("end to end: both cameras' frames of one tick carry the same time") {
    Stack stack({"sync", 11, 2, 25, "exposure_us = 2000", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    auto left = wait_for_stream<FrameStream>("cam0", "sync");
    auto right = wait_for_stream<FrameStream>("cam1", "sync");
    auto a = read_until(left, is_item);
    auto b = read_until(right, is_item);
    while (a.data.tick() != b.data.tick())
        if (a.data.tick() < b.data.tick())
            a = read_until(left, is_item);
        else
            b = read_until(right, is_item);
    CHECK(absolute(a.data.board_time - b.data.board_time) <= microseconds(1));
}

TEST_CASE("end to end: a reader that is killed disturbs nobody, and comes back") {
    Stack stack({"reader", 12, 1, 50, "", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    for (int round = 0; round < 3; ++round) {
        Process reader({program("versavis"), "--instance", "reader", "tail", "cam0"},
                       stack.log_path("reader.log"));
        REQUIRE(reader.wait_for_output("trigger=", seconds(10)));
        reader.signal(SIGKILL);
        CHECK(reader.wait(seconds(10)) == 128 + SIGKILL);
    }
    CHECK(judge_running(stack, 2).ok);
}

TEST_CASE("end to end: the service is killed and started again while a reader waits") {
    Stack stack({"killed", 13, 1, 20, "", "", ""});
    stack.start_rig();
    stack.start_service();
    auto stream = wait_for_stream<FrameStream>("cam0", "killed");
    read_until(stream, is_item);
    stack.kill_service();
    read_until(stream, [](const auto& item) { return item.found == test::Found::gone; });
    std::string output;
    CHECK(stack.tool({"status"}, &output) == 69);
    CHECK_THAT(output, Catch::Contains("service has died"));
    stack.start_service();
    read_until(stream, [](const auto& item) { return item.found == test::Found::restarted; });
    const auto frame = read_until(stream, is_item);
    CHECK(frame.data.stamp_kind() == StampKind::measured_middle);
    CHECK(judge_running(stack, 2).ok);
}

TEST_CASE(
    "end to end: a camera that stops answering is named, the other goes on, and it comes back") {
    Stack stack(
        {"mute", 14, 2, 20, "",
         "[[fault]]\nkind = \"camera_mute\"\ncamera = \"cam1\"\nat_exposure = 60\nseconds = 4\n",
         ""});
    stack.start_rig();
    stack.start_service();
    const auto broken = stack.wait_for_status([](const auto& s) {
        return s["cameras"][1]["state"] == "silent" || s["cameras"][1]["state"] == "failed";
    });
    CHECK(broken["health"] == "degraded");
    CHECK(broken["cameras"][0]["state"] == "streaming");
    CHECK(broken["cameras"][0]["pairing"] == "locked");
    CHECK(broken["cameras"][1]["hint"].template get<std::string>().size() > 10);
    std::string output;
    CHECK(stack.tool({"status"}, &output) == 1);
    const auto again = stack.wait_for_status(healthy, seconds(60));
    CHECK(again["cameras"][1]["connections"] >= 2);
    CHECK(again["cameras"][0]["connections"] == 1);
    judge_running(stack, 2);
}

TEST_CASE("end to end: a camera that reboots is set up anew") {
    Stack stack(
        {"reboot", 15, 1, 20, "",
         "[[fault]]\nkind = \"camera_reboot\"\ncamera = \"cam0\"\nat_exposure = 60\nseconds = 1\n",
         ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status([](const auto& s) { return s["cameras"][0]["connections"] >= 2; },
                          seconds(60));
    stack.wait_for_status(healthy, seconds(60));
    judge_running(stack, 2);
}

TEST_CASE("end to end: a board that resets begins a new epoch") {
    Stack stack({"reset", 16, 2, 20, "",
                 "[[fault]]\nkind = \"board_reset\"\ncamera = \"cam0\"\nat_exposure = 60\n", ""});
    stack.start_rig();
    stack.start_service();
    auto stream = wait_for_stream<FrameStream>("cam0", "reset");
    const auto first = read_until(stream, is_item);
    const auto later = read_until(stream, [&](const auto& item) {
        return is_item(item) && item.data.epoch != first.data.epoch;
    });
    CHECK(later.data.epoch == first.data.epoch + 1);
    CHECK(first.time.precedes(later.time));
    const auto status = stack.wait_for_status(healthy);
    CHECK(status["board"]["connections"] == 2);
    CHECK(status["cameras"][0]["connections"] == 1);
    judge_running(stack, 2);
}

TEST_CASE("end to end: lost frames and ignored triggers are records, and shift nothing") {
    Stack stack(
        {"faults", 17, 1, 20, "",
         "[[fault]]\nkind = \"drop_frame\"\ncamera = \"cam0\"\nat_exposure = 40\ncount = 2\n"
         "[[fault]]\nkind = \"ignore_trigger\"\ncamera = \"cam0\"\nat_exposure = 50\n",
         ""});
    stack.start_rig();
    stack.start_service();
    auto events = wait_for_stream<EventStream>("events", stack.instance());
    std::map<std::string, int> reasons;
    while (reasons["frame_missing"] < 2 || reasons["trigger_ignored"] < 1) {
        const auto item = read_until(events, [](const auto& e) {
            return is_item(e) && e.data.kind == EventKind::trigger_without_frame;
        });
        CHECK(std::string(item.data.source_name) == "cam0");
        ++reasons[to_string(item.data.reason)];
    }
    CHECK(judge_running(stack, 2).ok);
    const auto status = stack.wait_for_status(healthy);
    CHECK(status["cameras"][0]["slips"] == 0);
    CHECK(status["cameras"][0]["locks"] == 1);
}

TEST_CASE(
    "end to end: an exposure that outlasts what the board waits for is predicted, says so, and is "
    "not called "
    "healthy") {
    Stack stack({"overlong", 23, 1, 10, "exposure_us = 60000", "", "max_exposure_us = 40000.0"});
    stack.start_rig();
    stack.start_service();
    const auto status = stack.wait_for_status([](const auto& s) {
        return s["cameras"][0]["pairing"] == "locked" && s["health"] == "degraded";
    });
    CHECK_THAT(status["cameras"][0]["hint"].template get<std::string>(),
               Catch::Contains("max_exposure_us"));
    auto stream = wait_for_stream<FrameStream>("cam0", "overlong");
    const auto frame = read_until(stream, is_item);
    CHECK(frame.data.stamp_kind() == StampKind::predicted_middle);
    CHECK(frame.data.sigma_ns > 15'000'000);
    judge_running(stack, 2);
}

TEST_CASE("end to end: stamps in another output clock") {
    Stack stack({"raw", 24, 1, 20, "", "", ""});
    {
        std::ofstream file(stack.configuration_path(), std::ios::app);
        file << "[clock]\noutput = \"monotonic_raw\"\n";
    }
    stack.start_rig();
    stack.start_service();
    CHECK(judge_running(stack, 2).ok);
    auto stream = wait_for_stream<FrameStream>("cam0", "raw");
    const auto frame = read_until(stream, is_item);
    CHECK(frame.time.ns == frame.data.host_time.ns);
}

TEST_CASE("end to end: frames of an aligned board lie at whole seconds of the output clock") {
    StackSettings settings{"aligned", 71, 2, 20, "exposure_us = 3000", "", ""};
    settings.extras = {"", "phase_us = 10000"};
    Stack stack(settings);
    {
        std::ofstream file(stack.configuration_path(), std::ios::app);
        file << "[clock]\nalign = true\nmax_slew_ppm = 200\n";
    }
    stack.start_rig();
    stack.start_service();
    const auto aligned = [](const auto& s) {
        return healthy(s) && s["clock"]["grid_aligned"] == true;
    };
    stack.wait_for_status(aligned);
    for (const unsigned camera : {0U, 1U}) {
        auto stream = wait_for_stream<FrameStream>("cam" + std::to_string(camera), "aligned");
        for (int i = 0; i < 60; ++i) {
            const auto frame = read_until(stream, is_item);
            const double past_ms =
                static_cast<double>(frame.time.ns % 1'000'000'000) * 1e-6 - camera * 10.0;
            REQUIRE(std::abs(std::remainder(past_ms, 50.0)) < 0.2);
        }
    }
    const auto status = stack.wait_for_status(aligned);
    CHECK(std::abs(status["clock"]["grid_error_ns"].get<double>()) < 100'000);
    CHECK(status["board"]["hint"] == "");
    CHECK(judge_running(stack, 2).ok);
}

TEST_CASE("end to end: frames of two services on one grid come as sets") {
    Stack front({"front", 75, 1, 20, "exposure_us = 3000", "", ""});
    Stack rear({"rear", 76, 1, 20, "exposure_us = 6000", "", ""});
    for (Stack* stack : {&front, &rear}) {
        std::ofstream file(stack->configuration_path(), std::ios::app);
        file << "[clock]\nalign = true\nmax_slew_ppm = 200\n";
        file.close();
        stack->start_rig();
        stack->start_service();
    }
    for (Stack* stack : {&front, &rear})
        stack->wait_for_status(
            [](const auto& s) { return healthy(s) && s["clock"]["grid_aligned"] == true; });
    SetOptions options;
    options.imu = "front/imu0";
    options.wait = seconds(30);
    auto sets = SetReader::open({"front/cam0", "rear/cam0"}, options);
    REQUIRE(sets);
    for (int complete = 0; complete < 40;) {
        const auto set = sets->next(seconds(30));
        REQUIRE(set);
        CHECK(set->complete());
        CHECK(set->spread < microseconds(200));
        CHECK_FALSE(set->frames[0]->time.since(set->frames[1]->time));
        if (complete++ > 0) CHECK(set->imu.samples.size() >= 8);
    }
    CHECK(judge_running(front, 2).ok);
    CHECK(judge_running(rear, 2).ok);
}

TEST_CASE("end to end: cameras of a board that follows another expose with its pulses") {
    constexpr double skew = 40e-6;  // of the other board
    StackSettings settings{
        "sync", 73, 2, 20, "exposure_us = 3000", "[board]\nsync_hz = 2\nsync_skew_ppm = 40\n", ""};
    settings.extras = {"", "phase_us = 10000"};
    settings.imu_extra = "[ports]\ninputs = [\"sync\"]\nfollow_sync = true\nsync_rate_hz = 2\n";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const auto followed = [](const auto& s) {
        return healthy(s) && s["board"]["sync"] == "followed";
    };
    CHECK(stack.wait_for_status(followed)["board"]["hint"] == "");
    auto events = wait_for_stream<EventStream>("events", stack.instance());
    const auto pulse = read_until(
        events, [](const auto& e) { return is_item(e) && e.data.kind == EventKind::sync_pulse; });
    for (const unsigned camera : {0U, 1U}) {
        auto stream = wait_for_stream<FrameStream>("cam" + std::to_string(camera), "sync");
        for (int i = 0; i < 60; ++i) {
            const auto frame = read_until(stream, is_item);
            const double since_ms = static_cast<double>(frame.time.ns - pulse.time.ns) * 1e-6;
            REQUIRE(std::abs(std::remainder(since_ms * (1 + skew) - camera * 10.0, 50.0)) < 0.1);
        }
    }
    CHECK(stack.wait_for_status(followed)["board"]["late_outputs"] == 0);
    CHECK(judge_running(stack, 2).ok);
}

TEST_CASE("end to end: a board whose sync pulses do not come says so, and waits") {
    Stack stack({"nosync", 74, 1, 20, "", "", ""});
    const std::string follow = "follow_sync = true\n";
    {
        std::ofstream file(stack.configuration_path(), std::ios::app);
        file << "[ports]\ninputs = [\"sync\"]\n" << follow;
    }
    stack.start_rig();
    stack.start_service();
    const auto status = stack.wait_for_status([](const auto& s) {
        return s["board"]["sync"] == "awaited" && s["cameras"][0]["state"] == "streaming";
    });
    CHECK_THAT(status["board"]["hint"].template get<std::string>(),
               Catch::Contains("sync input: if none come, check the cable"));
    CHECK(status["health"] != "ok");
    CHECK(status["cameras"][0]["frames_received"] == 0);
    const auto size = std::filesystem::file_size(stack.configuration_path());
    std::filesystem::resize_file(stack.configuration_path(), size - follow.size());
    stack.service().signal(SIGHUP);
    CHECK(stack.wait_for_status(healthy)["board"]["sync"] == "none");
    CHECK(judge_running(stack, 2).ok);
}

TEST_CASE("end to end: a GNSS receiver at the board names its pulses, which lie at those seconds") {
    Stack stack({"gnss", 72, 1, 20, "", "[board]\ngnss = true\n", ""});
    {
        std::ofstream file(stack.configuration_path(), std::ios::app);
        file << "[ports]\ninputs = [\"pps\"]\nnmea = true\n[clock]\npps = \"nmea\"\n";
    }
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    auto events = wait_for_stream<EventStream>("events", stack.instance());
    std::int64_t last = 0;
    for (int i = 0; i < 4; ++i) {
        const auto label = read_until(events, [](const auto& e) {
            return is_item(e) && e.data.kind == EventKind::utc_label;
        });
        if (i > 0) CHECK(label.data.value == last + 1);
        last = label.data.value;
        CHECK(absolute(label.time.output() - OutputTime{last * 1'000'000'000}) < milliseconds(1));
    }
    // From the fourth on they make the stamps.
    const auto status =
        stack.wait_for_status([](const auto& s) { return s["clock"]["pps"] == "used"; });
    CHECK(status["clock"]["pps_rejected"] == 0);
    CHECK(std::abs(status["clock"]["pps_residual_ns"].get<double>()) < 1e6);
    const auto pulse = read_until(
        events, [](const auto& e) { return is_item(e) && e.data.kind == EventKind::pps; });
    const std::int64_t past = pulse.time.ns % 1'000'000'000;
    CHECK(std::min(past, 1'000'000'000 - past) < 5'000);
    CHECK(judge_running(stack, 2).ok);
}

TEST_CASE("end to end: a host that names the seconds of PPS says when nothing disciplines it") {
    StackSettings settings{"hostpps", 35, 1, 20, "", "[board]\ngnss = true\n", ""};
    settings.imu_extra = "[clock]\npps = \"host\"\n[ports]\ninputs = [\"pps\"]\n";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    // Whether something does is up to the machine that runs this test.
    const auto clock = stack.wait_for_status([](const auto& s) {
        return s["clock"]["state"] == "locked" &&
               (s["clock"]["pps"] == "used" || s["health"] == "degraded");
    })["clock"];
    const bool disciplined = clock["host_synchronised"];
    CHECK(clock["fault"] == (disciplined ? "" : "host_undisciplined"));
    CHECK(clock["pps"] == (disciplined ? "used" : "waiting"));
    auto events = EventStream::open("events", {{Position::oldest}, stack.instance()});
    REQUIRE(events);
    std::vector<std::int64_t> values;
    for (auto item = look(events->next({})); is_item(item); item = look(events->next({})))
        if (item.data.kind == EventKind::host_undisciplined) values.push_back(item.data.value);
    CHECK(values == (disciplined ? std::vector<std::int64_t>{} : std::vector<std::int64_t>{1}));
}

TEST_CASE("end to end: packets that get lost are asked for again") {
    const std::string receive = GENERATE("socket", "auto");
    Stack stack({"loss", 18, 1, 20, "packet_loss = 0.02", "", "receive = '" + receive + "'"});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    CHECK(judge_running(stack, 4).ok);
    const auto camera = stack.wait_for_status(healthy)["cameras"][0];
    CHECK(camera["frames_incomplete"] == 0);
}

TEST_CASE("end to end: without a board the service says so and waits, it also stops then") {
    Stack stack({"lonely", 19, 1, 20, "", "", ""});
    stack.start_service();
    const auto status =
        stack.wait_for_status([](const auto& s) { return s["health"] == "degraded"; });
    CHECK(status["board"]["state"] == "absent");
    CHECK_THAT(status["board"]["hint"].template get<std::string>(),
               Catch::Contains("is the board's process"));
    CHECK_THAT(status["cameras"][0]["hint"].template get<std::string>(),
               Catch::Contains("no camera answers to this name"));
    CHECK(
        stack.service().wait_for_output("error: service: health: degraded: board: ", seconds(20)));
    CHECK(stack.service().terminate() == 0);
}

TEST_CASE("end to end: the service manager is notified of readiness, life, health and the end") {
    Stack stack({"notify", 25, 1, 20, "", "", ""});
    const std::string path = stack.log_path("notify");
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    REQUIRE(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
    stack.start_rig();
    stack.start_service();
    unsetenv("NOTIFY_SOCKET");
    std::string received;
    const auto wait_for = [&](const std::string& text) {
        const timeval limit{20, 0};
        ::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
        char buffer[256];
        while (received.find(text) == std::string::npos) {
            const ssize_t size = ::recv(socket, buffer, sizeof buffer, 0);
            if (size <= 0) return false;
            received.append(buffer, static_cast<std::size_t>(size)) += '\n';
        }
        return true;
    };
    CHECK(wait_for("READY=1"));
    CHECK(wait_for("WATCHDOG=1"));
    CHECK(wait_for("STATUS=ok"));
    stack.service().signal(SIGTERM);
    CHECK(wait_for("STOPPING=1"));
    CHECK(stack.service().wait(seconds(20)) == 0);
    ::close(socket);
}

TEST_CASE("end to end: memory is locked where the limit allows it, else nothing starts") {
    Stack stack({"locked", 62, 1, 20, "", "", "[memory]\nlock = true\n"});
    std::string output;
    CHECK(run({"prlimit", "--memlock=65536", "setpriv", "--bounding-set=-ipc_lock",
               program("versavisd"), "--config", stack.configuration_path()},
              stack.log_path("refused.log"), &output) == 69);
    CHECK_THAT(output, Catch::Contains("(limit: 64 KiB); LimitMEMLOCK=infinity in the unit"));
    stack.start_service();
    std::ifstream status(fmt::format("/proc/{}/status", stack.service().pid()));
    std::string name;
    std::uint64_t locked_kib = 0;
    while (status >> name && name != "VmLck:") status.ignore(1000, '\n');
    status >> locked_kib;
    CHECK(locked_kib > 8192);  // the clock's ring alone has that
}

TEST_CASE("end to end: one service per instance") {
    Stack stack({"twice", 20, 1, 20, "", "", ""});
    stack.start_service();
    std::string output;
    CHECK(run({program("versavisd"), "--config", stack.configuration_path()},
              stack.log_path("second.log"), &output) == 69);
    CHECK_THAT(output, Catch::Contains("another versavisd serves this instance"));
}

TEST_CASE("end to end: a bad configuration ends with 78 and its place, a good one is said to be") {
    Stack stack({"config", 21, 1, 20, "", "", "rate = 3\n"});
    std::string output;
    CHECK(run({program("versavisd"), "--config", stack.configuration_path()},
              stack.log_path("bad.log"), &output) == 78);
    CHECK_THAT(output,
               Catch::Contains("versavis.toml:15:1: unknown key 'rate'; did you mean 'rate_hz'?"));
    CHECK(run({program("versavisd"), "--check-config", "--json", "--config",
               stack.configuration_path()},
              stack.log_path("bad.json"), &output) == 78);
    CHECK(nlohmann::json::parse(output)["problems"][0]["line"] == 15);
    Stack good({"config2", 21, 1, 20, "", "", ""});
    const std::vector<std::string> check{program("versavisd"), "--check-config", "--config",
                                         good.configuration_path()};
    CHECK(run(check, good.log_path("ok.log"), &output) == 0);
    const std::string folder = good.configuration_path() + ".d";
    std::filesystem::create_directory(folder);
    std::ofstream(folder + "/10.toml") << "log_level = \"debug\"\n";
    CHECK(run(check, good.log_path("two.log"), &output) == 0);
    CHECK_THAT(output, Catch::Contains(": ok\nwith " + folder + "/10.toml\n"));
    CHECK(run({program("versavisd"), "--keys", "--json"}, good.log_path("keys"), &output) == 0);
    CHECK(nlohmann::json::parse(output)[0]["key"] == "instance");
    CHECK(run({program("versavisd"), "--json"}, good.log_path("usage.log"), &output) == 64);
    CHECK(run({program("versavisd"), "--nonsense"}, good.log_path("usage.log"), &output) == 64);
}

TEST_CASE("end to end: a camera without a trigger line is stamped on arrival, and says so") {
    // Aravis's own independent camera emulator: it has no line output and no external trigger.
    const TemporaryDirectory directory;
    Process camera({"arv-fake-gv-camera-0.8", "-i", "127.0.0.1", "-s", "FREE1"},
                   (directory.path() / "camera.log").string());
    const std::string path =
        directory.write("versavis.toml",
                        "instance = \"free\"\n[[camera]]\nname = \"cam0\"\ndevice = \"127.0.0.1\"\n"
                        "trigger = \"free\"\npacket_size = 1400\n");
    Process service({program("versavisd"), "--config", path},
                    (directory.path() / "service.log").string());
    auto stream = wait_for_stream<FrameStream>("cam0", "free", seconds(30));
    for (int i = 0; i < 5; ++i) {
        const auto frame = read_until(stream, is_item);
        CHECK(frame.data.stamp_kind() == StampKind::arrival);
        CHECK(frame.data.sigma_ns == sigma_unknown);
        CHECK(frame.data.trigger == 0);
        CHECK(frame.data.width * frame.data.height == frame.payload.size());
        CHECK(frame.data.arrival == frame.data.host_time);
    }
    CHECK(service.terminate() == 0);
}

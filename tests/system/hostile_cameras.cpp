// SPDX-License-Identifier: BSD-3-Clause
// Cameras that lie, hang or break, beside one that does not: the service lives, stays small, ends
// when it is asked to, and says which camera is wrong.
#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>

#include "../support/look.hpp"
#include "../support/process.hpp"
#include "../support/stack.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

struct Hostile {
    std::string kind;
    unsigned subnet;
    std::string state;
    std::string hint;
};

/// So that a failure names its row.
std::ostream& operator<<(std::ostream& out, const Hostile& hostile) { return out << hostile.kind; }

/// Far below what a watchdog or an administrator would wait, far above what a busy machine adds.
constexpr Duration soon = seconds(8);

/// Most memory that the process ever had, MiB.
double peak_memory(const Process& process) {
    std::ifstream file("/proc/" + std::to_string(process.pid()) + "/status");
    for (std::string word; file >> word;)
        if (double kib = 0; word == "VmHWM:" && file >> kib) return kib / 1024;
    return -1;
}

bool streams(const nlohmann::json& camera) {
    return camera["state"] == "streaming" && camera["pairing"] == "locked";
}

/// Keys of a second camera's fault.
std::string hostile_fault(const std::string& kind, int at, const std::string& more = "") {
    return "[[fault]]\nkind = \"" + kind +
           "\"\ncamera = \"cam0\"\nat_exposure = " + std::to_string(at) + "\n" + more + "\n";
}

/// How long it takes from the signal to the end of the process.
Duration time_to_end(Process& process) {
    const HostTime asked = host_now();
    CHECK(process.terminate(seconds(10)) == 0);
    return host_now() - asked;
}

HostTime since(const Stack& stack, const std::string& text) {
    INFO(text);
    REQUIRE(const_cast<Stack&>(stack).service().wait_for_output(text, seconds(20)));
    return host_now();
}

}  // namespace

TEST_CASE("hostile cameras: none ends, stalls or bloats the service, and the others stream") {
    const auto hostile = GENERATE(values<Hostile>({
        {"value_loop", 140, "failed", "leads back to itself"},
        {"formula_loop", 141, "failed", "leads back to itself"},
        {"offset_loop", 142, "failed", "leads back to itself"},
        {"many_paths", 143, "failed", "too many steps"},
        {"size_64_bit", 144, "failed", "bytes"},
        {"size_2_gib", 145, "failed", "2147483648 bytes"},
        {"zip_bomb", 146, "failed", "unzips to 2097152000 bytes"},
        {"truncated", 147, "failed", "cut off"},
        {"long_register", 148, "failed", "0x10000000000"},
        {"local_file", 149, "failed", "not in the camera"},
        {"huge_frames", 150, "misconfigured", "1099511627776 bytes"},
        {"no_numbers", 151, "misconfigured", "how large its frames are"},
        {"pending", 152, "opening", ""},
        {"pending_at_all", 153, "failed", "does not deliver its memory"},
    }));
    CAPTURE(hostile);
    StackSettings settings{
        "hostile" + std::to_string(hostile.subnet), hostile.subnet, 2, 20, "", "", ""};
    settings.scenarios = {"", "hostile = \"" + hostile.kind + "\""};
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const auto reported = [&](const auto& s) {
        return s["cameras"][1]["state"] == hostile.state &&
               s["cameras"][1]["hint"].template get<std::string>().find(hostile.hint) !=
                   std::string::npos;
    };
    auto status = stack.wait_for_status(
        [&](const auto& s) { return streams(s["cameras"][0]) && reported(s); });
    const auto before = status["cameras"][0]["frames_published"].get<std::uint64_t>();
    stack.wait_for_status([&](const auto& s) {  // the other one goes on
        return reported(s) && s["cameras"][0]["frames_published"] >= before + 20;
    });
    CHECK(peak_memory(stack.service()) < 256);
    CHECK(time_to_end(stack.service()) < soon);
}

TEST_CASE("hostile cameras: one that turns mute while it streams does not hold up the end") {
    Stack stack({"mute", 154, 1, 20, "", hostile_fault("camera_mute", 40, "seconds = 1000"), ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status([](const auto& s) { return streams(s["cameras"][0]); });
    stack.wait_for_status([](const auto& s) { return s["cameras"][0]["state"] != "streaming"; });
    CHECK(time_to_end(stack.service()) < soon);
}

TEST_CASE("hostile cameras: the end comes in time also right after one turned mute") {
    Stack stack({"muter", 155, 1, 20, "", hostile_fault("camera_mute", 40, "seconds = 1000"), ""});
    stack.start_rig();
    stack.start_service();
    // A busy host may miss some of its 40 frames.
    stack.wait_for_status([](const auto& s) {
        const auto& camera = s["cameras"][0];
        const auto received = camera["frames_received"].template get<int>();
        return received >= 38 ||
               (received > 0 && (camera["state"] == "silent" || camera["state"] == "absent"));
    });
    CHECK(time_to_end(stack.service()) < soon);
}

TEST_CASE("hostile cameras: a good description is looked at once, and known in the next life") {
    Stack stack({"known", 156, 1, 20, "", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    stack.service().terminate();
    std::ifstream file(stack.log_path("descriptions"));
    std::string header;
    std::string hash;
    REQUIRE(std::getline(file, header));
    REQUIRE(std::getline(file, hash));
    CHECK(hash.size() == 64 + 4);
}

TEST_CASE("hostile cameras: a change of size while streaming is followed at once") {
    StackSettings settings{
        "resized", 157, 1, 20, "", hostile_fault("change_size", 60, "count = 100000"), ""};
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const HostTime changed = since(stack, "frames are 320 x 120 pixels in 38400 bytes");
    stack.wait_for_status([](const auto& s) {
        return streams(s["cameras"][0]) && s["cameras"][0]["connections"] == 2;
    });
    CHECK(host_now() - changed < soon);
    stack.wait_for_status([](const auto& s) { return s["cameras"][0]["hint"] == ""; });
}

TEST_CASE("hostile cameras: one whose numbers begin again a little back is reopened at once") {
    Stack stack({"renumbered", 158, 1, 20, "", hostile_fault("restart_ids", 60), ""});
    stack.start_rig();
    stack.start_service();
    const HostTime found = since(stack, "its frame numbers started over");
    stack.wait_for_status([](const auto& s) {
        return streams(s["cameras"][0]) && s["cameras"][0]["connections"] == 2;
    });
    CHECK(host_now() - found < soon);
}

TEST_CASE("hostile cameras: one whose clock stands still is paired without it") {
    Stack stack({"stopped", 159, 1, 20, "", hostile_fault("stop_clock", 60, "count = 100000"), ""});
    stack.start_rig();
    stack.start_service();
    since(stack, "its clock stands still");
    stack.wait_for_status([](const auto& s) {
        return streams(s["cameras"][0]) && s["cameras"][0]["connections"] == 2 &&
               s["cameras"][0]["hint"].template get<std::string>().find("clock") !=
                   std::string::npos;
    });
}

TEST_CASE(
    "hostile cameras: an absent one slows neither the first frame of another nor its return") {
    StackSettings settings{
        "absent", 160, 2, 20, "", hostile_fault("camera_reboot", 60, "seconds = 0.3"), ""};
    settings.absent = 1;
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const HostTime started = host_now();
    auto frames = wait_for_stream<FrameStream>("cam0", stack.instance());
    REQUIRE(test::look(frames.next(seconds(5))).found == test::Found::item);
    CHECK(host_now() - started < soon);
    const HostTime gone = since(stack, "has restarted");
    stack.wait_for_status([](const auto& s) {
        return streams(s["cameras"][0]) && s["cameras"][0]["connections"] == 2;
    });
    CHECK(host_now() - gone < soon);
}

TEST_CASE("hostile cameras: what a killed service left behind is waited for, and not blamed") {
    Stack stack({"left-behind", 162, 1, 20, "", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    stack.kill_service();
    const HostTime killed = host_now();
    stack.start_service();
    stack.wait_for_status([&](const auto& s) { return s["started_ns"] > killed.ns && healthy(s); });
    CHECK_THAT(stack.service().output(), Catch::Contains("it is still locked"));
    CHECK_THAT(stack.service().output(), !Catch::Contains("close that program"));
}

TEST_CASE("hostile cameras: a value out of range is refused before it is written") {
    StackSettings settings{"range", 163, 1, 20, "", "", ""};
    settings.camera_extra = "[camera.features]\nGain = 90\n";
    Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const auto status = stack.wait_for_status(
        [](const auto& s) { return s["cameras"][0]["state"] == "misconfigured"; });
    CHECK_THAT(status["cameras"][0]["hint"].get<std::string>(),
               Catch::Contains("feature Gain") && Catch::Contains("'90' is out of range") &&
                   Catch::Contains("0 to 48"));
}

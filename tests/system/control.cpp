// SPDX-License-Identifier: BSD-3-Clause
// A service that runs is changed: no stamp is wrong meanwhile, and what is not meant goes on.
#include <signal.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <fstream>
#include <thread>

#include "../support/judged.hpp"
#include "../support/look.hpp"
#include "../support/stack.hpp"
#include "versavis/set_reader.hpp"

using namespace versavis;
using namespace versavis::test;

namespace {

std::string tool_output(const Stack& stack, const std::vector<std::string>& arguments, int code) {
    std::string output;
    INFO(arguments.front());
    CHECK(stack.tool(arguments, &output) == code);
    return output;
}

nlohmann::json delivering(Stack& stack, unsigned camera, double rate_hz) {
    return stack.wait_for_status([&](const auto& status) {
        return healthy(status) && status["cameras"][camera]["configured_hz"] == rate_hz;
    });
}

void judge(Stack& stack, const char* when) {
    const rig::Verdict verdict = judged(stack, 3);
    INFO(when << ":\n" << rig::to_table(verdict));
    CHECK(verdict.ok);
}

/// A set that came after the service was last changed; none: there is none in time.
std::optional<FrameSet> new_set(SetReader& sets) {
    const HostTime begin = host_now();
    while (host_now() < begin + seconds(10)) {
        auto made = sets.next(seconds(1));
        if (made && made->frames.front() && made->frames.front()->data.host_time > begin)
            return std::move(*made);
    }
    return std::nullopt;
}

constexpr int refused = 65;

/// Reads a camera's frames on a thread of its own, and counts triggers of which there is none.
class Companion {
 public:
    Companion(const Stack& stack, const std::string& camera)
        : frames_(wait_for_stream<FrameStream>(camera, stack.instance())),
          thread_([this] { read(); }) {}
    ~Companion() { end(); }
    void end() {
        stop_ = true;
        if (thread_.joinable()) thread_.join();
    }
    unsigned frames = 0;
    unsigned gaps = 0;

 private:
    void read() {
        std::optional<std::uint64_t> newest;
        while (!stop_) {
            const auto item = look(frames_.next(milliseconds(100)));
            if (item.found != Found::item) continue;
            const std::uint64_t tick = item.data.tick();
            if (newest && tick != *newest + 1) ++gaps;
            newest = tick;
            ++frames;
        }
    }

    FrameStream frames_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace

TEST_CASE("control: exposure changes while frames come, rates while others go on") {
    Stack stack({"control", 95, 2, 20, "exposure_us = 4000", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);

    tool_output(stack, {"set", "cam0", "ExposureTime=2000"}, 0);
    auto status = stack.wait_for_status([](const auto& s) {
        return healthy(s) &&
               std::abs(s["cameras"][0]["exposure_ns"].template get<double>() - 2e6) < 1e4;
    });
    CHECK(status["cameras"][0]["connections"] == 1);  // it was not opened anew
    judge(stack, "after another exposure");

    using Catch::Contains;
    CHECK_THAT(tool_output(stack, {"set", "cam0", "ExposureTime=7"}, refused),
               Contains("ExposureTime") && Contains("allowed"));  // by the camera
    CHECK_THAT(tool_output(stack, {"set", "cam0", "ExposureTime=1e12"}, refused),
               Contains("ExposureTime") && Contains("must be at most"));
    CHECK_THAT(tool_output(stack, {"set", "cam0", "NoSuchFeature=1"}, refused),
               Contains("NoSuchFeature"));
    CHECK_THAT(tool_output(stack, {"set", "cam0", "output=3"}, refused), Contains("restart"));
    status = stack.wait_for_status(healthy);
    CHECK(std::abs(status["cameras"][0]["exposure_ns"].get<double>() - 2e6) < 1e4);

    Companion cam1(stack, "cam1");
    tool_output(stack, {"set", "cam0", "rate_hz=30"}, 0);
    delivering(stack, 0, 30);
    judge(stack, "after another rate");
    // It is judged by the new rate, also where that is lower.
    tool_output(stack, {"set", "cam0", "rate_hz=12"}, 0);
    status = delivering(stack, 0, 12);
    cam1.end();
    CHECK(cam1.frames > 40);
    CHECK(cam1.gaps == 0);
    CHECK(status["board"]["connections"] == 1);
    CHECK(status["cameras"][1]["connections"] == 1);
    // At the rate of another one it belongs to its sets again, for which both pause.
    tool_output(stack, {"set", "cam0", "rate_hz=20"}, 0);
    status = delivering(stack, 0, 20);
    CHECK(status["board"]["connections"] == 2);
    judge(stack, "after the first rate");
}

TEST_CASE("control: a camera stops and starts, and the file is read again") {
    Stack stack({"startstop", 96, 2, 20, "exposure_us = 4000", "", ""});
    stack.start_rig();
    stack.start_service();
    stack.wait_for_status(healthy);
    SetOptions options;
    options.instance = stack.instance();
    options.partial = true;
    auto sets = SetReader::open({"cam0", "cam1"}, options);
    REQUIRE(sets);
    tool_output(stack, {"stop", "cam1"}, 0);
    auto status = stack.wait_for_status(
        [](const auto& s) { return healthy(s) && s["cameras"][1]["state"] == "stopped"; });
    CHECK_THAT(status["cameras"][1]["hint"].get<std::string>(),
               Catch::Contains("versavis start cam1"));
    const auto received = status["cameras"][1]["frames_received"];
    const std::uint64_t before = status["cameras"][0]["frames_published"];
    status = stack.wait_for_status([&](const auto& s) {
        return s["cameras"][0]["frames_published"].template get<std::uint64_t>() > before + 20;
    });
    CHECK(status["cameras"][1]["frames_received"] == received);

    // What the file says of it holds when it starts.
    std::ifstream file(stack.configuration_path());
    const std::string text(std::istreambuf_iterator<char>(file), {});
    std::string next = text;
    for (std::size_t at = 0; (at = next.find("rate_hz = 20", at)) != std::string::npos;)
        next.replace(at, 12, "rate_hz = 25");
    std::ofstream(stack.configuration_path()) << next << "[memory]\nsealed = false\n";
    const auto before_reload = new_set(*sets);
    REQUIRE(before_reload);
    const std::uint64_t left_out = sets->report().left_out;
    const std::string output = tool_output(stack, {"reload"}, 0);
    CHECK_THAT(output, Catch::Contains("camera.cam1.rate_hz") && Catch::Contains("memory.sealed"));
    CHECK(delivering(stack, 0, 25)["board"]["connections"] == 1);
    const auto after_reload = new_set(*sets);
    REQUIRE(after_reload);
    CHECK(after_reload->tick > before_reload->tick);
    CHECK(after_reload->time.epoch == before_reload->time.epoch);
    CHECK(sets->report().left_out == left_out);  // although the board's ticks are fewer
    tool_output(stack, {"start", "cam1"}, 0);
    delivering(stack, 1, 25);
    judge(stack, "after the start");

    std::ofstream(stack.configuration_path()) << text << "[memory\n";
    stack.service().signal(SIGHUP);
    CHECK(stack.service().wait_for_output("not reloaded", seconds(10)));
    CHECK(healthy(stack.wait_for_status(healthy)));
    CHECK(stack.service().terminate() == 0);
}

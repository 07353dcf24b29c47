// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "../support/stack.hpp"
#include "judge.hpp"
#include "metric.hpp"

namespace versavis::bench {

namespace {

constexpr double seconds_each = 20;
constexpr double frame_gb = 1920.0 * 1200.0 * 1e-9;

/// User and system time of a running process, all threads.
double cpu_seconds(pid_t pid) {
    std::ifstream file(fmt::format("/proc/{}/stat", pid));
    std::stringstream text;
    text << file.rdbuf();
    std::string line = text.str().substr(text.str().rfind(')') + 2);
    std::istringstream fields(line);
    std::string field;
    double ticks = 0;
    for (int number = 3; number <= 15 && fields >> field; ++number)
        if (number >= 14) ticks += std::stod(field);
    return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

double aravis_cpu_per_gb(test::Stack& stack) {
    rusage before{};
    rusage after{};
    std::string output;
    getrusage(RUSAGE_CHILDREN, &before);
    test::run({"arv-camera-test-0.8", "-n", "127.0.40.2", "--duration",
               std::to_string(static_cast<int>(seconds_each)), "--no-packet-socket", "-i", "9000", "-a"},
              stack.log_path("aravis.log"), &output);
    getrusage(RUSAGE_CHILDREN, &after);
    const auto seconds = [](const rusage& usage) {
        return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
               static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e-6;
    };
    const auto at = output.find("n_completed_buffers    = ");
    const double frames = at == std::string::npos ? 0 : std::stod(output.substr(at + 25));
    if (frames < seconds_each) throw std::runtime_error("arv-camera-test received nothing:\n" + output);
    return (seconds(after) - seconds(before)) / (frames * frame_gb);
}

}  // namespace

/// Both receive by sockets with packets of 9000 bytes. The service also pairs, reads an IMU and publishes.
std::vector<Metric> bench_end_to_end() {
    test::Stack stack({"bench", 40, 2, 20, "", "", "", 1920, 1200});
    stack.start_rig();
    const double aravis = aravis_cpu_per_gb(stack);
    stack.start_service();
    stack.wait_for_status([](const auto& status) { return status["health"] == "ok"; });
    const pid_t pid = stack.service().pid();
    const double before = cpu_seconds(pid);
    rig::JudgeSettings settings;
    settings.instance = stack.instance();
    settings.truth_path = stack.truth_path();
    settings.seconds = seconds_each;
    const HostTime begin = host_now();
    const auto verdict = rig::judge(stack.scenario(), settings);
    const double elapsed = static_cast<double>((host_now() - begin).ns) * 1e-9;
    const double cpu = cpu_seconds(pid) - before;
    if (!verdict) throw std::runtime_error(verdict.error().message());
    double wrong = 0;
    double lost = 0;
    double p99_us = 0;
    double rate = 0;
    for (const auto& [name, stream] : verdict->streams) {
        wrong += static_cast<double>(stream.wrong_pairs);
        p99_us = std::max(p99_us, stream.error_p99_ns * 1e-3);
        if (name == stack.scenario().imu) continue;
        lost += static_cast<double>(stream.lost);
        rate += stream.rate_hz;
    }
    return {{"wrong_pairs", wrong, "items", 0},
            {"frames_lost", lost, "frames", 0},
            {"stamp_error_p99", p99_us, "us", 100},
            {"cpu_per_gb_to_arv_camera_test", cpu / (rate * elapsed * frame_gb) / aravis, "ratio", 1.15}};
}

}  // namespace versavis::bench

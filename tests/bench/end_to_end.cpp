// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <stdexcept>

#include "../support/stack.hpp"
#include "cpu_time.hpp"
#include "judge.hpp"
#include "metric.hpp"

namespace versavis::bench {

namespace {

constexpr double seconds_each = 20;

}  // namespace

/// Both receive by sockets with packets of 9000 bytes. The service also pairs, reads an IMU and
/// publishes.
std::vector<Metric> bench_end_to_end() {
    test::Stack stack({"bench", 40, 2, 20, "", "", "", 1920, 1200});
    stack.start_rig();
    const double aravis = aravis_cpu_per_gb(stack, seconds_each);
    stack.start_service();
    stack.wait_for_status([](const auto& status) { return status["health"] == "ok"; });
    const pid_t pid = stack.service().pid();
    const double before = cpu_seconds(pid);
    const HostTime begin = host_now();
    const auto verdict = rig::judge(stack.scenario(), stack.judging(seconds_each));
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
            {"cpu_per_gb_to_arv_camera_test", cpu / (rate * elapsed * frame_gb) / aravis, "ratio",
             1.15}};
}

}  // namespace versavis::bench

// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "../support/look.hpp"
#include "../support/stack.hpp"
#include "metric.hpp"
#include "scene.hpp"
#include "true_times.hpp"
#include "versavis/stream.hpp"

namespace versavis::bench {

namespace {

/// The p95 of so many is the second longest. At half, it is the longest; at twice, the bench takes
/// four minutes.
constexpr unsigned reboots = 20;

/// From one reboot to the next: 2 s, so that all is well again. At half, the hundredth-worst
/// recovery meets the next reboot; at twice, the bench takes longer.
constexpr unsigned exposures_between = 40;

/// How long a rebooting camera says nothing.
constexpr Duration camera_boots = milliseconds(300);

std::uint64_t exposure_of(unsigned reboot) { return (reboot + 1ULL) * exposures_between; }

std::string faults(const std::string& kind) {
    std::string text;
    for (unsigned i = 0; i < reboots; ++i)
        text +=
            fmt::format("[[fault]]\nkind = '{}'\ncamera = 'cam0'\nat_exposure = {}\nseconds = {}\n",
                        kind, exposure_of(i), static_cast<double>(camera_boots.ns) * 1e-9);
    return text;
}

/// When a waiting reader had each frame, until all reboots are over.
TimesBySerial read_frames(const test::Stack& stack) {
    auto stream = test::wait_for_stream<FrameStream>("cam0", stack.instance());
    TimesBySerial arrivals;
    while (arrivals.empty() || arrivals.rbegin()->first <= exposure_of(reboots - 1)) {
        const auto item = test::look(stream.next(seconds(20)));
        if (item.found == test::Found::nothing) throw std::runtime_error("cam0 did not come back");
        if (item.found == test::Found::item)
            arrivals[rig::FrameMark::serial_in(item.payload.data(), item.payload.size())] =
                host_now();
    }
    return arrivals;
}

/// From the end of the outage to the next verified frame, with another camera absent; ms.
double recovery_p95_ms(const std::string& kind, unsigned subnet, Duration outage) {
    test::StackSettings settings{"bench" + kind, subnet, 3, 20, "", faults(kind), ""};
    settings.absent = 1;
    test::Stack stack(settings);
    stack.start_rig();
    stack.start_service();
    const TimesBySerial arrivals = read_frames(stack);
    const TimesBySerial exposures = true_times(stack.truth_path(), "cam0", "exposure", "start_ns");
    std::vector<Duration> recoveries;
    for (unsigned i = 0; i < reboots; ++i)
        recoveries.push_back(arrivals.upper_bound(exposure_of(i))->second -
                             (exposures.at(exposure_of(i)) + outage));
    std::sort(recoveries.begin(), recoveries.end());
    return static_cast<double>(recoveries[reboots * 95 / 100 - 1].ns) * 1e-6;
}

}  // namespace

std::vector<Metric> bench_recovery() {
    return {{"camera_reboot_recovery_p95", recovery_p95_ms("camera_reboot", 43, camera_boots), "ms",
             1000},
            {"board_reset_recovery_p95", recovery_p95_ms("board_reset", 44, {}), "ms", 1000}};
}

}  // namespace versavis::bench

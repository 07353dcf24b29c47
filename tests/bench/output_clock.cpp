// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/output_clock.hpp"

#include <algorithm>
#include <stdexcept>

#include "metric.hpp"

namespace versavis::bench {

namespace {

constexpr int calls = 100'000;
constexpr int rounds = 21;

/// Median of the rounds, so that another process in between does not count.
template <class Call>
double ns_per_call(Call call) {
    std::vector<double> costs;
    for (int round = 0; round < rounds; ++round) {
        const HostTime begin = host_now();
        for (int i = 0; i < calls; ++i) call();
        costs.push_back(static_cast<double>((host_now() - begin).ns) / calls);
    }
    std::nth_element(costs.begin(), costs.begin() + rounds / 2, costs.end());
    return costs[rounds / 2];
}

clock::OutputClock make_clock(clock::OutputClockKind kind) {
    auto made = clock::OutputClock::create(kind);
    if (!made) throw std::runtime_error(made.error().message());
    return std::move(*made);
}

}  // namespace

std::vector<Metric> bench_output_clock() {
    clock::OutputClock realtime = make_clock(clock::OutputClockKind::realtime);
    clock::OutputClock raw = make_clock(clock::OutputClockKind::monotonic_raw);
    std::int64_t sum = 0;  // so that no call is left out
    const double read = ns_per_call([&] { sum += host_now().ns; });
    const double offset = ns_per_call([&] { sum += realtime.offset().ns; });
    const double raw_offset = ns_per_call([&] { sum += raw.offset().ns; });
    if (sum == 0) throw std::runtime_error("the host clock stands still");
    return {{"output_clock_offset", offset, "ns", 500},
            {"output_clock_offset_to_clock_reading", offset / read, "ratio", 5},
            {"output_clock_offset_monotonic_raw", raw_offset, "ns", 200}};
}

}  // namespace versavis::bench

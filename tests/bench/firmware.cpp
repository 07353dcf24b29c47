// SPDX-License-Identifier: BSD-3-Clause
// What the firmware's core takes on the chip: cycles of each poll, stack and memory, by loads that
// were recorded here and run again in the emulator.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <stdexcept>

#include "loads.hpp"
#include "metric.hpp"
#include "replay.hpp"

namespace versavis::bench {

namespace {

using emulator::FunctionCost;
using emulator::Lived;
using emulator::Load;
using emulator::Replayed;
using firmware::Nanoseconds;

constexpr double clock_hz = 125e6;  // PIO then divides a second into steps of exactly 8 ns
constexpr double kibibyte = 1024;

// What leaves the processor to the port, and to what comes later.
constexpr double idle_poll_goal = 1'500;
constexpr double imu_sample_goal = 6'500;
// At 125 MHz 0.4 ms: a trigger is committed 1 ms ahead.
constexpr double worst_poll_goal = 50'000;
constexpr double cpu_goal_percent = 8;
constexpr double stack_goal = 1'536;
constexpr double image_goal_kib = 42;
constexpr double static_goal_kib = 64;

constexpr std::size_t profiled_functions = 20;

struct Measured {
    Lived& lived;
    Replayed replayed;
};

std::vector<double> measured_polls(const Measured& measured) {
    std::vector<double> cycles;
    const auto& polls = measured.lived.recorder.polls();
    for (std::size_t i = 0; i < polls.size(); ++i)
        if (polls[i].measured) cycles.push_back(measured.replayed.polls[i]);
    if (cycles.empty()) throw std::runtime_error("a load has no poll to measure");
    std::sort(cycles.begin(), cycles.end());
    return cycles;
}

double sum(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum;
}

/// From a sample's data-ready edge until its packet is handed to the link: cycles of all polls in
/// between, in the middle of the samples.
double imu_sample_cycles(const Measured& measured) {
    const auto& polls = measured.lived.recorder.polls();
    std::vector<double> cycles;
    for (const wire::ImuSample& sample : measured.lived.samples) {
        const Nanoseconds handed = sample.time_ns + sample.departure_ns;
        const auto before = [](const auto& poll, Nanoseconds at) { return poll.at < at; };
        auto poll = std::lower_bound(polls.begin(), polls.end(), sample.time_ns, before);
        double all = 0;
        for (; poll != polls.end() && poll->at <= handed; ++poll)
            all += measured.replayed.polls[static_cast<std::size_t>(poll - polls.begin())];
        if (poll != polls.end() && poll->measured) cycles.push_back(all);
    }
    if (cycles.empty()) throw std::runtime_error("no sample was measured");
    std::sort(cycles.begin(), cycles.end());
    return cycles[cycles.size() / 2];
}

void print_functions(const char* by, std::vector<FunctionCost> functions, double all,
                     double (*cost)(const FunctionCost&)) {
    std::sort(functions.begin(), functions.end(),
              [cost](const auto& a, const auto& b) { return cost(a) > cost(b); });
    functions.resize(std::min(functions.size(), profiled_functions));
    fmt::print("  {}:\n", by);
    for (const FunctionCost& function : functions)
        if (cost(function) > 0)
            fmt::print("  {:6.2f} % {:>12.0f} cycles {:>8.0f} calls  {}\n",
                       100 * cost(function) / all, cost(function), function.calls, function.name);
}

void print_profile(const Load& load, const Measured& measured) {
    const double all = sum(measured_polls(measured));
    fmt::print("profile of {} ({}): {:.0f} cycles; deepest in {}, {} bytes\n", load.name, load.what,
               all, measured.replayed.deepest, measured.replayed.stack);
    const auto& functions = measured.replayed.profile;
    print_functions("own instructions", functions, all, [](const auto& f) { return f.self; });
    print_functions("with what they call", functions, all, [](const auto& f) { return f.total; });
}

void add_load(const Load& load, const Measured& measured, std::vector<Metric>& metrics) {
    const std::vector<double> polls = measured_polls(measured);
    const auto add = [&](const char* what, double value, const char* unit,
                         std::optional<double> goal = {}) {
        metrics.push_back({fmt::format("firmware_{}_{}", load.name, what), value, unit, goal});
    };
    const auto goal_of = [&load](const char* name, double goal) {
        return std::string(load.name) == name ? std::optional(goal) : std::nullopt;
    };
    add("poll_median", polls[polls.size() / 2], "cycles", goal_of("idle", idle_poll_goal));
    add("poll_worst", polls.back(), "cycles");
    if (!load.steady) return;
    const double seconds = static_cast<double>(load.measured_for) * 1e-9;
    add("poll_rate", static_cast<double>(polls.size()) / seconds, "1/s");
    add("cpu", 100 * sum(polls) / (seconds * clock_hz), "%", goal_of("adis", cpu_goal_percent));
}

}  // namespace

std::vector<Metric> bench_firmware(bool with_profile) {
    std::vector<Metric> metrics;
    double imu_sample = 0;
    double worst = 0;
    double stack = 0;
    Replayed last;
    for (const Load& load : emulator::loads()) {
        const auto lived = emulator::live(load, load.measured_for);
        const Measured measured{*lived, emulator::replay(lived->recorder.words(), with_profile)};
        last = measured.replayed;
        if (with_profile) print_profile(load, measured);
        add_load(load, measured, metrics);
        if (std::string(load.name) == "adis_alone") imu_sample = imu_sample_cycles(measured);
        worst = std::max<double>(worst, *std::max_element(last.polls.begin(), last.polls.end()));
        stack = std::max<double>(stack, last.stack);
    }
    metrics.push_back({"firmware_imu_sample", imu_sample, "cycles", imu_sample_goal});
    metrics.push_back({"firmware_poll_worst", worst, "cycles", worst_poll_goal});
    metrics.push_back({"firmware_stack", stack, "bytes", stack_goal});
    metrics.push_back({"firmware_image", last.core / kibibyte, "KiB", image_goal_kib});
    metrics.push_back({"firmware_library", last.library / kibibyte, "KiB", {}});
    metrics.push_back({"firmware_static_memory", last.board / kibibyte, "KiB", static_goal_kib});
    return metrics;
}

}  // namespace versavis::bench

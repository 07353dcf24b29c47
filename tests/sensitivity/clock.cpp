// SPDX-License-Identifier: BSD-3-Clause
// sensitivity_clock: the clock's estimators in a few simulated worlds with fixed seeds. Prints its
// figures as JSON.
#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/smoother.hpp"
#include "figures.hpp"
#include "troubles.hpp"

using namespace versavis;
using namespace versavis::clock_world;
using clock::EnvelopeFilter;
using test::Figures;

namespace {

constexpr unsigned seeds_steady = 4;
constexpr unsigned seeds_of_holdover = 12;
constexpr unsigned seeds_of_start = 20;
constexpr unsigned seeds_of_trouble = 60;

void append(Figures& figures, const std::string& name, Score score) {
    figures.emplace_back(name + "_p99", score.p99_us());
    figures.emplace_back(name + "_nees", score.nees());
}

Score run_jittery(unsigned seeds) {
    Settings settings;
    settings.exchange_hz = 1;
    settings.link = [](Random&) { return visible_jitter(); };
    return score<EnvelopeFilter>(settings, seeds);
}

Score run_usb(unsigned seeds, double imu_hz) {
    Settings settings;
    settings.imu_hz = imu_hz;
    return score<EnvelopeFilter>(settings, seeds);
}

Score run_loaded(unsigned seeds) {
    Settings settings;
    settings.length = seconds(440);
    settings.link = [](Random& random) {
        return usb_full_speed({.load = {{seconds(400).ns}, {seconds(430).ns}}}, random);
    };
    return score<EnvelopeFilter>(settings, seeds, {seconds(400).ns});
}

Score run_holdover(unsigned seeds) {
    Settings settings;
    settings.length = seconds(420);
    settings.silence = {{seconds(400).ns}, {seconds(430).ns}};
    Score result;
    for (settings.seed = 1; settings.seed <= seeds; ++settings.seed) {
        const World world(settings);
        Observer<EnvelopeFilter> observer(world);
        observer.observe({settings.silence.begin + seconds(5), {settings.length.ns}},
                         milliseconds(100), result);
    }
    return result;
}

Score run_start(unsigned seeds) {
    Settings settings;
    settings.length = seconds(20);
    Score result;
    for (settings.seed = 1; settings.seed <= seeds; ++settings.seed) {
        const World world(settings);
        Observer<EnvelopeFilter> observer(world);
        observer.observe({world.deliveries().front().at + seconds(1), {settings.length.ns}},
                         milliseconds(100), result);
    }
    return result;
}

Score run_smoother(unsigned seeds) {
    Settings settings;
    settings.imu_hz = 200;
    settings.length = seconds(300);
    Score result;
    for (settings.seed = 1; settings.seed <= seeds; ++settings.seed) {
        const World world(settings);
        const clock::Smoother smoother(messages_of(world));
        for (TrueTime t{seconds(1).ns}; t.ns < seconds(299).ns; t = t + milliseconds(100)) {
            const clock::HostEstimate estimate = smoother.translate(world.board(t));
            result.add(estimate.time - world.host(t), estimate);
        }
    }
    return result;
}

unsigned off_after_trouble(unsigned seeds) {
    unsigned off = 0;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        const World world(troubled(seed));
        Observer<EnvelopeFilter> observer(world);
        off += instants_off(world, observer) > 0 ? 1 : 0;
    }
    return off;
}

}  // namespace

int main(int argc, char** argv) {
    const unsigned effort = test::effort_of(argc, argv);
    Figures figures;
    append(figures, "jittery", run_jittery(2 * seeds_steady * effort));
    append(figures, "usb", run_usb(seeds_steady * effort, 0));
    append(figures, "imu", run_usb(seeds_steady * effort, 200));
    append(figures, "loaded", run_loaded(seeds_of_holdover * effort));
    append(figures, "silent", run_holdover(seeds_of_holdover * effort));
    append(figures, "start", run_start(seeds_of_start * effort));
    append(figures, "smooth", run_smoother(seeds_steady * effort));
    figures.emplace_back("off", off_after_trouble(seeds_of_trouble * effort));
    test::print_json(figures);
}

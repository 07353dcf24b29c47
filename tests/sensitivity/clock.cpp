// SPDX-License-Identifier: BSD-3-Clause
// sensitivity_clock: the clock's estimators in a few simulated worlds with fixed seeds. Prints its
// figures as JSON.
#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/pps_reference.hpp"
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

class Report {
 public:
    void add(const std::string& name, Score score) {
        figures_.emplace_back(name + "_p99", score.p99_us());
        figures_.emplace_back(name + "_nees", score.nees());
        beyond_bound_ += score.beyond_bound();
        ++scores_;
    }

    /// `off`: worlds that ended off.
    Figures figures(double pps_p99, unsigned off) const {
        Figures figures = figures_;
        figures.emplace_back("pps_p99", pps_p99);
        figures.emplace_back("beyond", 100 * beyond_bound_ / scores_);
        figures.emplace_back("off", off);
        return figures;
    }

 private:
    Figures figures_;
    double beyond_bound_ = 0;
    int scores_ = 0;
};

Score run_jittery(unsigned seeds) {
    Settings settings;
    settings.exchange_hz = 1;
    settings.link = [](Random&) { return visible_jitter(); };
    return score<EnvelopeFilter>(settings, seeds);
}

Score run_usb(unsigned seeds) { return score<EnvelopeFilter>({}, seeds); }

/// With an IMU, whose samples are messages for the clock, too, and a host that is busy for a while.
Score run_imu(unsigned seeds) {
    Settings settings;
    settings.imu_hz = 200;
    settings.length = seconds(440);
    settings.link = [](Random& random) {
        return usb_full_speed({.load = {{seconds(400).ns}, {seconds(430).ns}}}, random);
    };
    return score<EnvelopeFilter>(settings, seeds, {seconds(200).ns});
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

/// Pulses once a second, one in twenty of them off by more than any receiver.
double pps_p99_us(unsigned seeds) {
    Settings settings;
    settings.length = seconds(120);
    Score result;
    for (settings.seed = 1; settings.seed <= seeds; ++settings.seed) {
        const World world(settings);
        Observer<EnvelopeFilter> observer(world);
        clock::PpsReference pps(clock::PpsLabels::host);
        Random random(settings.seed);
        std::normal_distribution<> jitter(0, 30);
        for (int i = 20; i < 120; ++i) {
            const TrueTime second{seconds(i).ns};
            const Duration off{std::llround(jitter(random)) + (i % 20 == 7 ? 5000 : 0)};
            pps.pulse(world.board(second) + off, observer.estimate(second), {}, true);
            const TrueTime later = second + milliseconds(700);
            if (const auto stamp = pps.translate(world.board(later), world.board(later)))
                result.add(stamp->time - OutputTime{world.host(later).ns}, {});
        }
    }
    return result.p99_us();
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
    Report report;
    report.add("jittery", run_jittery(2 * seeds_steady * effort));
    report.add("usb", run_usb(seeds_steady * effort));
    report.add("imu", run_imu(seeds_of_holdover * effort));
    report.add("silent", run_holdover(seeds_of_holdover * effort));
    report.add("start", run_start(seeds_of_start * effort));
    report.add("smooth", run_smoother(seeds_steady * effort));
    test::print_json(report.figures(pps_p99_us(seeds_steady * effort),
                                    off_after_trouble(seeds_of_trouble * effort)));
}

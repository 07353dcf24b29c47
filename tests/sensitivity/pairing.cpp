// SPDX-License-Identifier: BSD-3-Clause
// sensitivity_pairing: a short campaign with fixed seeds. Prints its figures as JSON.
#include <algorithm>

#include "campaign.hpp"
#include "figures.hpp"

using versavis::milliseconds;
using namespace versavis::test;

namespace {

constexpr std::uint64_t faults_with_clock = 1200;
constexpr std::uint64_t faults_without_clock = 800;
constexpr std::uint64_t seeds_of_drifting = 1'000'000;
constexpr unsigned queues = 2;
constexpr unsigned harsh_seeds = 60;

void append(Totals& totals, const Totals& more) {
    totals.frames += more.frames;
    totals.wrong += more.wrong;
    totals.withheld_needlessly += more.withheld_needlessly;
    totals.not_locked += more.not_locked;
    totals.first_published.insert(totals.first_published.end(), more.first_published.begin(),
                                  more.first_published.end());
    totals.recoveries.insert(totals.recoveries.end(), more.recoveries.begin(),
                             more.recoveries.end());
}

/// Links that carry a little less than the camera sends: frames queue until one is dropped.
Totals run_queues(unsigned seeds) {
    Totals totals;
    for (unsigned seed = 1; seed <= seeds; ++seed)
        for (const WorldClock clock : {WorldClock::drifting, WorldClock::absent})
            for (const bool strobe : {false, true})
                for (const bool dropped : {false, true})
                    for (const bool counted : {false, true}) {
                        WorldSettings settings;
                        settings.seed = seed;
                        settings.clock = clock;
                        settings.strobe = strobe;
                        settings.drops_after_exposure = dropped;
                        settings.ids_count_ignored = counted;
                        settings.link_load = seed % 2 == 0 ? 1.003 : 1.01;
                        settings.pulses = 1500;
                        totals.add(settings, run_world(settings));
                    }
    return totals;
}

/// Faults close together, on a host and a link that make arrivals nearly useless.
Totals run_harsh(unsigned seeds) {
    constexpr FaultKind kinds[] = {FaultKind::trigger_ignored, FaultKind::frame_lost,
                                   FaultKind::duplicate_id,    FaultKind::id_restart,
                                   FaultKind::clock_jump,      FaultKind::record_lost};
    Totals totals;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed)
        for (const WorldClock clock : {WorldClock::good, WorldClock::absent}) {
            std::mt19937_64 random(seed);
            WorldSettings settings;
            settings.seed = seed;
            settings.clock = clock;
            settings.strobe = seed % 2 != 0;
            settings.ids_count_ignored = seed / 2 % 2 != 0;
            settings.readout = milliseconds(30);
            settings.jitter = milliseconds(5 + 5 * static_cast<std::int64_t>(seed % 4));
            settings.late_frames = 0.05;
            for (std::uint64_t pulse = 40; pulse < 600; pulse += 1 + random() % 40)
                settings.faults[pulse] = kinds[random() % std::size(kinds)];
            settings.pulses = 700;
            totals.add(settings, run_world(settings));
        }
    return totals;
}

/// Frames of neither camera may ever be published.
Totals run_swapped(unsigned seeds) {
    Totals totals;
    for (unsigned seed = 1; seed <= seeds; ++seed)
        for (const WorldClock clock : {WorldClock::good, WorldClock::absent}) {
            WorldSettings settings;
            settings.seed = seed;
            settings.clock = clock;
            settings.faults = {{1, FaultKind::cameras_swapped}};
            settings.pulses = 600;
            totals.add(settings, run_world(settings));
        }
    return totals;
}

double percent(std::uint64_t part, std::uint64_t whole) {
    return 100 * static_cast<double>(part) / static_cast<double>(std::max<std::uint64_t>(whole, 1));
}

double in_seconds(versavis::Duration duration) { return static_cast<double>(duration.ns) * 1e-9; }

}  // namespace

int main(int argc, char** argv) {
    const unsigned effort = effort_of(argc, argv);
    Totals with = run_random(faults_with_clock * effort, 1, WorldClock::good);
    append(with, run_random(faults_with_clock * effort, seeds_of_drifting, WorldClock::drifting));
    const Totals without = run_random(faults_without_clock * effort, 1, WorldClock::absent);
    const Totals queued = run_queues(queues * effort);
    const Totals harsh = run_harsh(harsh_seeds * effort);
    const Totals swapped = run_swapped(2 * effort);
    print_json({{"wrong", with.wrong + without.wrong + queued.wrong + harsh.wrong + swapped.wrong},
                {"needless", percent(with.withheld_needlessly, with.frames)},
                {"first", in_seconds(quantile(with.first_published, 1))},
                {"again", in_seconds(quantile(with.recoveries, 0.99))},
                {"needless_no_clock", percent(without.withheld_needlessly, without.frames)},
                {"first_no_clock", in_seconds(quantile(without.first_published, 1))},
                {"again_no_clock", in_seconds(quantile(without.recoveries, 0.99))},
                {"withheld_of_queues", percent(queued.withheld, queued.frames)},
                {"withheld_when_harsh", percent(harsh.withheld, harsh.frames)},
                {"not_locked", with.not_locked + without.not_locked}});
}

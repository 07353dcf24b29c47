// SPDX-License-Identifier: BSD-3-Clause
// PPS at the board, whose seconds a disciplined host names, over a link that is slower to the host.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/pps_reference.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE("clock 018: PPS measures what the link does unequally, and stamps better than it") {
    static constexpr Duration longer = microseconds(120);
    Settings settings;
    settings.length = seconds(200);
    settings.link = [](Random& random) {
        return usb_full_speed({.longer_to_host = longer}, random);
    };
    Score by_pulses;
    Score afterwards;
    for (settings.seed = 1; settings.seed <= 6; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        clock::PpsReference pps(clock::PpsLabels::host);
        Random random(settings.seed);
        std::normal_distribution<> jitter(0, 30);
        for (TrueTime second{seconds(20).ns}; second < TrueTime{seconds(100).ns};
             second = second + seconds(1)) {
            const BoardTime seen = world.board(second) + Duration{std::llround(jitter(random))};
            // The output clock equals the host's, which shows whole seconds when the pulses come.
            clock::HostEstimate by_link = observer.estimate(second);
            by_link.time = by_link.time + observer.at(second).presumed_asymmetry();
            pps.pulse(seen, by_link, {}, true);
            const BoardTime later = world.board(second + milliseconds(700));
            if (const auto stamp = pps.translate(later, later)) {
                clock::HostEstimate estimate;
                estimate.sigma = stamp->sigma;
                estimate.bound = seconds(1);
                by_pulses.add(stamp->time - OutputTime{world.host(second + milliseconds(700)).ns},
                              estimate);
            }
        }
        const auto measured = pps.left_in_link();
        REQUIRE(measured);
        CHECK(absolute(measured->offset - longer / 2) < measured->sigma * 4);
        CHECK(measured->sigma < microseconds(8));
        observer.at({seconds(100).ns}).set_asymmetry(measured);
        observer.observe({{seconds(101).ns}, {seconds(200).ns}}, milliseconds(100), afterwards);
    }
    CHECK(by_pulses.p99_us() < 0.3);
    CHECK(by_pulses.nees() < 2);
    CHECK(afterwards.p99_us() < 16);
}

// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

TEST_CASE("021-sync-chain: two boards with crystals of their own expose together, and stay so") {
    const double ppm = GENERATE(-60.0, 35.0);
    Scenario first(1);
    Scenario second_board(2);
    const auto on_second = [ppm](Nanoseconds at) {
        return at + static_cast<Nanoseconds>(static_cast<double>(at) * ppm * 1e-6);
    };
    for (Scenario* world : {&first, &second_board}) {
        world->add_camera(0);
        world->add_camera(1, {}, 50'000'000);
        world->configuration.ports.sync_rate_uhz = 1'000'000;
        world->configuration.ports.pulse_ns = 100'000;
    }
    second_board.configuration.ports.inputs = 1U << wire::pulse_sync;
    second_board.connect();
    REQUIRE(second_board.configure());
    second_board.start(3, wire::start_on_sync);
    second_board.run(100 * ms);
    CHECK(second_board.camera(0).pulses().empty());  // it waits
    REQUIRE(first.begin());
    std::size_t passed_on = 0;
    while (first.now() < 120 * second) {
        first.run(500 * us);
        for (; passed_on < first.rises(firmware::pin_sync).size(); ++passed_on) {
            const Nanoseconds at =
                std::max(on_second(first.rises(firmware::pin_sync)[passed_on]), second_board.now());
            second_board.board().schedule_edge(
                {at, firmware::input_pulse + unsigned{wire::pulse_sync}, true});
            second_board.board().schedule_edge(
                {at + 50 * us, firmware::input_pulse + unsigned{wire::pulse_sync}, false});
        }
        const Nanoseconds target = on_second(first.now());
        if (target > second_board.now() + ms) second_board.run(target - ms - second_board.now());
    }
    CHECK(second_board.inbox().events_of(wire::BoardEventKind::sync_pulse).size() >= 118);
    std::size_t together = 0;
    for (const unsigned camera : {0U, 1U}) {
        const auto& theirs = first.camera(camera).pulses();
        for (const TruePulse& pulse : second_board.camera(camera).pulses()) {
            const auto nearest =
                std::min_element(theirs.begin(), theirs.end(), [&](const auto& a, const auto& b) {
                    return std::abs(on_second(a.start) - pulse.start) <
                           std::abs(on_second(b.start) - pulse.start);
                });
            if (pulse.start < 8 * second || pulse.start > 119 * second)
                continue;  // it learns the pace first
            REQUIRE(std::abs(on_second(nearest->start) - pulse.start) <= 100 + first.rounding());
            ++together;
        }
    }
    CHECK(together > 7000);
}

// SPDX-License-Identifier: BSD-3-Clause
// One direction is slower, always: stamps cannot show it, so the bound must hold it.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

TEST_CASE(
    "clock 010: what stamps cannot show is within the bound, and what was measured is taken off") {
    static constexpr Duration longer = microseconds(120);
    Settings settings;
    settings.length = seconds(200);
    settings.link = [](Random& random) {
        return usb_full_speed({.longer_to_host = longer}, random);
    };
    Score as_it_is;
    Score corrected;
    for (settings.seed = 1; settings.seed <= 8; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        const Span settled{{seconds(100).ns}, {seconds(200).ns}};
        observer.observe(settled, milliseconds(100), as_it_is);
        Observer<clock::EnvelopeFilter> informed(world);
        // The bus itself is about 3 us slower to the host.
        informed.at({}).set_asymmetry(clock::Asymmetry{longer / 2, nanoseconds(1500)});
        informed.observe(settled, milliseconds(100), corrected);
    }
    CHECK(as_it_is.quantile_us(0.01) > 40);
    CHECK(as_it_is.beyond_bound() == 0);
    CHECK(corrected.p99_us() <= 16);
    check_honest(corrected);
}

TEST_CASE("clock 010: delays that spread unequally make no error") {
    // Up to a millisecond to the board, an eighth of it to the host.
    Settings settings;
    settings.length = seconds(300);
    Score result;
    double mean_us = 0;
    int count = 0;
    for (settings.seed = 1; settings.seed <= 8; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        for (TrueTime t{seconds(100).ns}; t.ns < seconds(300).ns; t = t + seconds(1), ++count)
            mean_us += static_cast<double>(observer.error(t).ns) * 1e-3;
    }
    CHECK(std::abs(mean_us / count) < 4);
}

// SPDX-License-Identifier: BSD-3-Clause
// The core on the chip's instruction set; what it costs there is measured by `./dev bench
// firmware`.
#include "replay.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

#include "loads.hpp"

using namespace versavis;
using namespace versavis::emulator;
using scenario::ms;

TEST_CASE("replay: on the chip's instruction set the core asks for what it asks for here") {
    const std::string name = GENERATE("configuration", "edge_ring", "vn100");
    const auto lived = live(load(name), 50 * ms);
    const Replayed replayed = replay(lived->recorder.words());
    CHECK(replayed.polls.size() == lived->recorder.polls().size());
    CHECK(*std::min_element(replayed.polls.begin(), replayed.polls.end()) > 0);
}

TEST_CASE("replay: cycles are the same each time") {
    const auto recording = live(load("long_start"), 0)->recorder.words();
    const Replayed once = replay(recording);
    CHECK(replay(recording).polls == once.polls);
    CHECK(replay(recording, true).polls == once.polls);
}

TEST_CASE("replay: a profile accounts for each cycle once") {
    const auto lived = live(load("long_start"), 0);
    const Replayed replayed = replay(lived->recorder.words(), true);
    double measured = 0;
    for (std::size_t i = 0; i < replayed.polls.size(); ++i)
        if (lived->recorder.polls()[i].measured) measured += replayed.polls[i];
    double self = 0;
    double poll = 0;
    for (const FunctionCost& function : replayed.profile) {
        self += function.self;
        if (function.name == "versavis::firmware::Board::poll()") poll = function.total;
    }
    CHECK(self == measured);
    CHECK(poll == measured);
}

TEST_CASE("replay: a call that differs is reported, with both calls") {
    const auto lived = live(load("long_start"), 0);
    auto recording = lived->recorder.words();
    // At the end stand what the last poll wanted, in two words, and that no poll follows, with the
    // number of words before it.
    recording[recording.size() - 4] ^= 1U;
    const std::string where =
        "of poll " + std::to_string(lived->recorder.polls().size()) + ", differs";
    CHECK_THROWS_WITH(replay(recording), Catch::Contains("recorded: poll(") &&
                                             Catch::Contains("replayed: poll(") &&
                                             Catch::Contains(where));
}

TEST_CASE("replay: a core that goes on when the recording ends, or ends before it, is reported") {
    auto recording = live(load("long_start"), 0)->recorder.words();
    auto longer = recording;
    longer.back() = firmware::replay::poll_again;
    CHECK_THROWS_WITH(replay(longer), Catch::Contains("follows the recording's end"));
    recording.resize(recording.size() - 1);
    CHECK_THROWS_WITH(replay(recording), Catch::Contains("the recording was cut"));
}

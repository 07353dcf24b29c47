// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/pulse_history.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

PulseHistory after(std::uint32_t pulses, std::uint32_t first = 0) {
    PulseHistory history(milliseconds(5), milliseconds(1), 500);
    for (std::uint32_t i = 0; i < pulses; ++i)
        history.learn({first + i, BoardTime{} + milliseconds(5) * i});
    return history;
}

EventReason reason(const std::optional<Implausibility>& found) {
    return found ? found->reason : EventReason::none;
}

}  // namespace

TEST_CASE("pulse_history: times follow from numbers, over 32 bits and over gaps") {
    const PulseHistory history = after(50, 0xFFFFFFF0);
    const auto at = [](std::int64_t i) { return BoardTime{} + milliseconds(5) * i; };
    const auto number = [](std::uint32_t i) { return 0xFFFFFFF0 + i; };
    CHECK_FALSE(history.doubt({number(50), at(50)}));
    CHECK_FALSE(history.doubt({number(90), at(90)}));
    CHECK(reason(history.doubt({number(50), at(51)})) == EventReason::implausible_time);
    CHECK(reason(history.doubt({number(51), at(50)})) == EventReason::implausible_time);
    CHECK(reason(history.doubt({number(49), at(50)})) == EventReason::implausible_number);
    CHECK(reason(history.doubt({number(48), at(48)})) == EventReason::implausible_number);
    CHECK(history.doubt({number(50), at(50) + microseconds(50)})->expected == at(50).ns);
}

TEST_CASE("pulse_history: while the pace is hardly known, a gap is no room for another number") {
    const PulseHistory history = after(3);
    CHECK_FALSE(history.doubt({60, BoardTime{} + milliseconds(5) * 60}));
    CHECK(history.doubt({60, BoardTime{} + milliseconds(5) * 61}));
    CHECK(history.doubt({60, BoardTime{} + milliseconds(5) * 59}));
}

TEST_CASE("pulse_history: no number and no time overflows") {
    const PulseHistory history = after(50);
    for (const std::uint32_t number : {50U, 0U, 0x7FFFFFFFU, 0x80000000U, 0xFFFFFFFFU})
        for (const std::int64_t ns : {std::int64_t{0}, std::int64_t{1} << 60})
            CHECK(history.doubt({number, BoardTime{ns}}));
}

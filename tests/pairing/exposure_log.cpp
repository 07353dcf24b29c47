// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/exposure_log.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::pairing;

namespace {

Exposure exposure(std::uint64_t trigger, std::int64_t start_ms, bool exposed = true) {
    Exposure exposure;
    exposure.trigger = trigger;
    exposure.start = BoardTime{start_ms * 1'000'000};
    exposure.end = exposure.start + milliseconds(2);
    exposure.end_on_host = HostTime{exposure.end.ns + 5'000'000'000};
    exposure.exposed = exposed;
    return exposure;
}

}  // namespace

TEST_CASE("exposure_log: the nearest within the tolerance, on either timeline") {
    ExposureLog log(milliseconds(50));
    CHECK(log.near(Instant::start, 0, 1'000'000'000) == nullptr);
    for (int i = 0; i < 5; ++i) log.add(exposure(static_cast<std::uint64_t>(i) + 1, 50 * i));
    CHECK(log.near(Instant::start, 101'000'000, 5'000'000)->exposure.trigger == 3);
    CHECK(log.near(Instant::start, 124'000'000, 100'000'000)->exposure.trigger == 3);
    CHECK(log.near(Instant::start, 126'000'000, 100'000'000)->exposure.trigger == 4);
    CHECK(log.near(Instant::start, 125'000'000, 10'000'000) == nullptr);
    CHECK(log.near(Instant::start, -3'000'000, 5'000'000)->exposure.trigger == 1);
    CHECK(log.near(Instant::arrival, 5'102'500'000, 5'000'000)->exposure.trigger == 3);
}

TEST_CASE("exposure_log: records that are missing") {
    ExposureLog log(milliseconds(50));
    log.add(exposure(1, 0));
    log.add(exposure(3, 100, false));
    CHECK(log.lost_near(Instant::start, 50'000'000, 0));
    CHECK_FALSE(log.lost_near(Instant::start, 150'000'000, 0));  // nothing is known of later ones
    CHECK_FALSE(log.lost_near(Instant::start, -50'000'000, 0));
    CHECK(log.back().recorded == 2);
    CHECK(log.back().silent == 1);
    log.pop_front();
    CHECK(log.lost_near(Instant::start, 50'000'000, 1));
    CHECK_FALSE(log.lost_near(Instant::start, 50'000'000, 2));
}

TEST_CASE("exposure_log: late records were held up when they come together with a prompt one") {
    ExposureLog log(milliseconds(50));
    const auto add = [&](std::uint64_t trigger, std::int64_t recorded_ms, bool prompt) {
        Exposure made = exposure(trigger, static_cast<std::int64_t>(trigger) * 50);
        made.recorded = HostTime{recorded_ms * 1'000'000};
        log.add(made, prompt);
    };
    add(1, 60, true);
    add(2, 200, false);
    add(3, 201, false);
    CHECK_FALSE(log[2].prompt);
    add(4, 210, true);
    CHECK((log[1].prompt && log[2].prompt));
    // As far apart as their exposures: of a board whose time was set back, and forward again.
    add(5, 310, false);
    add(6, 360, false);
    add(7, 410, true);
    CHECK_FALSE((log[4].prompt || log[5].prompt));
}

TEST_CASE("exposure_log: gaps are as small as the closest exposures, at most the period") {
    ExposureLog log(milliseconds(50));
    CHECK(log.smallest_gap_ns() == 50'000'000);
    log.add(exposure(1, 0));
    log.add(exposure(2, 1000));
    CHECK(log.smallest_gap_ns() == 50'000'000);
    log.add(exposure(3, 1040));
    CHECK(log.smallest_gap_ns() == 40'000'000);
}

TEST_CASE("exposure_log: an end that nobody saw is likelier after as long as last time") {
    ExposureLog log(milliseconds(50));
    for (int i = 0; i < 5; ++i) {
        Exposure next = exposure(static_cast<std::uint64_t>(i) + 1, 50 * i);
        if (i == 2) {  // reported as late as it may be, three periods on
            next.kind = StampKind::predicted_middle;
            next.end = next.start + milliseconds(150);
            next.end_on_host = HostTime{next.end.ns + 5'000'000'000};
        }
        log.add(next);
    }
    for (int i = 0; i < 5; ++i) {
        const std::int64_t end_ns = (50 * i + 2) * 1'000'000LL;
        for (const auto& [instant, at_ns] : {std::pair(Instant::end, end_ns),
                                             std::pair(Instant::arrival, end_ns + 5'000'000'000)}) {
            const Record* record = log.near(instant, at_ns, 5'000'000);
            REQUIRE(record != nullptr);
            CHECK(record->exposure.trigger == static_cast<std::uint64_t>(i) + 1);
        }
    }
}

TEST_CASE("exposure_log: an exposure that outlasts the next ones is found by its end") {
    ExposureLog log(milliseconds(50));
    for (int i = 0; i < 5; ++i) {
        Exposure next = exposure(static_cast<std::uint64_t>(i) + 1, 50 * i);
        if (i == 1) {
            next.end = next.start + milliseconds(130);
            next.end_on_host = HostTime{next.end.ns + 5'000'000'000};
        }
        log.add(next);
    }
    CHECK(log.near(Instant::end, 180'000'000, 5'000'000)->exposure.trigger == 2);
    CHECK(log.near(Instant::arrival, 5'180'000'000, 5'000'000)->exposure.trigger == 2);
    CHECK(log.near(Instant::arrival, 5'102'000'000, 5'000'000)->exposure.trigger == 3);
}

TEST_CASE("exposure_log: near means within the tolerance, to the nanosecond, at either side") {
    ExposureLog log(milliseconds(50));
    for (int i = 0; i < 3; ++i) log.add(exposure(static_cast<std::uint64_t>(i) + 1, 50 * i));
    for (const auto& [instant, at_ns] : {std::pair{Instant::start, 50'000'000LL},
                                         {Instant::middle, 51'000'000LL},
                                         {Instant::end, 52'000'000LL},
                                         {Instant::arrival, 5'052'000'000LL}}) {
        CHECK(log[1].instant_ns(instant) == at_ns);
        for (const int side : {-1, 1}) {
            CHECK(log.near(instant, at_ns + side * 1'000, 1'000) == &log[1]);
            CHECK(log.near(instant, at_ns + side * 1'001, 1'000) == nullptr);
        }
        CHECK(log.near(instant, at_ns, 0) == &log[1]);
        // Of two that are as far away, the later.
        CHECK(log.near(instant, at_ns + 25'000'000, 25'000'000) == &log[2]);
    }
}

TEST_CASE("exposure_log: a record is found by its number while it is kept") {
    ExposureLog log(milliseconds(50));
    CHECK(log.empty());
    for (std::uint64_t i = 1; i <= 3; ++i) log.add(exposure(i, static_cast<std::int64_t>(i) * 50));
    CHECK(log.size() == 3);
    CHECK(log.find(2) == &log[1]);
    CHECK(log.find(4) == nullptr);
    CHECK(log.pop_front().exposure.trigger == 1);
    CHECK(log.find(1) == nullptr);
    CHECK(log.front().exposure.trigger == 2);
    CHECK(log.back().exposure.trigger == 3);
    CHECK(log.back().recorded == 3);
    CHECK(log.back().silent == 0);
    CHECK_FALSE(log.back().used);
}

TEST_CASE("exposure_log: held up together means within three quarters of a period") {
    for (const auto& [apart_us, prompt] : {std::pair{37'499, true}, {37'500, false}}) {
        ExposureLog log(milliseconds(50));
        Exposure late = exposure(1, 50);
        late.recorded = HostTime{1'000'000'000};
        log.add(late, false);
        Exposure next = exposure(2, 100);
        next.recorded = late.recorded + microseconds(apart_us);
        log.add(next, true);
        CHECK(log[0].prompt == prompt);
    }
}

TEST_CASE("exposure_log: the first exposure that lies behind shows whether one is lost") {
    ExposureLog log(milliseconds(50));
    for (const std::uint64_t trigger : {5U, 6U, 8U})
        log.add(exposure(trigger, static_cast<std::int64_t>(trigger) * 50));
    CHECK(log.lost_near(Instant::start, 350'000'000, 4));
    CHECK_FALSE(log.lost_near(Instant::start, 299'999'999, 4));
    CHECK(log.lost_near(Instant::start, 300'000'000, 4));
    CHECK_FALSE(log.lost_near(Instant::start, 400'000'000, 4));
    CHECK(log.lost_near(Instant::start, 200'000'000, 3));
    CHECK_FALSE(log.lost_near(Instant::start, 200'000'000, 4));
    CHECK_FALSE(log.lost_near(Instant::start, 200'000'000, 0));
}

TEST_CASE(
    "exposure_log: what was measured once stands in for an end that nobody saw, for no other") {
    ExposureLog log(milliseconds(50));
    Exposure one = exposure(1, 0);
    one.kind = StampKind::predicted_middle;
    one.end = one.start + milliseconds(9);
    log.add(one);
    CHECK(log.back().end == one.end);  // nothing was measured so far
    log.add(exposure(2, 50));
    Exposure edge = exposure(3, 100);
    edge.kind = StampKind::trigger_edge;
    edge.end = edge.start + milliseconds(9);
    log.add(edge);
    CHECK(log.back().end == edge.end);
    one.trigger = 4;
    log.add(one);
    CHECK(log.back().end == one.start + milliseconds(2));
    CHECK(log.back().prompt);
}

TEST_CASE("exposure_log: a close pair counts while both are here, and so does a long exposure") {
    ExposureLog log(milliseconds(50));
    Exposure length = exposure(1, 0);
    length.end = length.start + milliseconds(30);
    log.add(length);
    log.add(exposure(2, 10));
    log.add(exposure(3, 60));
    CHECK(log.smallest_gap_ns() == 10'000'000);
    const Record* found = log.near(Instant::end, 30'000'000, 1'000'000);
    REQUIRE(found != nullptr);
    CHECK(found->exposure.trigger == 1);
    log.pop_front();
    CHECK(log.smallest_gap_ns() == 50'000'000);
}

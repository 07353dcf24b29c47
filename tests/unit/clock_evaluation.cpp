// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/clock_evaluation.hpp"

#include <catch2/catch.hpp>
#include <random>

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;

namespace {

constexpr std::int64_t evaluated_behind = 5'000'000'000;
constexpr std::int64_t output_ahead = 1'700'000'000'250'000'000;

BoardTime board_at(std::int64_t host) { return {host - evaluated_behind + host / 50'000}; }

/// Exchanges at 10 Hz with a board that runs 20 ppm fast, and a pulse at each whole second of an
/// output clock that is `off` of them.
RecordedClocks clocks(int seconds_long, Duration off, bool pulses) {
    std::mt19937_64 random(7);
    std::exponential_distribution<double> delay(1 / 100e3);
    RecordedClocks all;
    BoardLife life;
    life.nonce = 3;
    const std::int64_t begin = 10'000'000'000;
    for (int i = 0; i < seconds_long * 10; ++i) {
        const std::int64_t sent = begin + i * 100'000'000LL;
        const std::int64_t there = sent + 60'000 + static_cast<std::int64_t>(delay(random));
        const std::int64_t arrived =
            there + 20'000 + 60'000 + static_cast<std::int64_t>(delay(random));
        life.stamps.messages.push_back(
            {{arrived},
             clock::Exchange{{sent}, board_at(there), board_at(there + 20'000), {arrived}}});
        ++life.exchanges;
    }
    for (int s = 0; s <= seconds_long; ++s) {
        const std::int64_t host = begin + s * 1'000'000'000LL;
        all.outputs.push_back({1, {host}, {output_ahead}, {200}});
        // 0.75 s later, the output clock shows a whole second.
        const std::int64_t pulse = host + 750'000'000 - off.ns;
        if (pulses && s < seconds_long)
            all.pulses.push_back(
                {board_at(pulse), {pulse}, {pulse + output_ahead}, microseconds(5)});
    }
    all.lives.push_back(std::move(life));
    return all;
}

}  // namespace

TEST_CASE("clock_evaluation: errors by messages, without PPS") {
    const auto found = evaluate_clock(clocks(120, {}, false));
    REQUIRE(found);
    CHECK(found->exchanges == 1200);
    CHECK(found->duration_s == Approx(120).margin(0.2));
    CHECK(found->skew_ppm == Approx(-20).margin(0.5));
    CHECK(found->residual.rms > 10e3);
    CHECK(found->live.count > 900);
    CHECK(found->live.rms < 10e3);
    CHECK(found->live.nees < 3);
    CHECK(found->innovation.rms < found->residual.rms);
    CHECK(found->pps_link.count == 0);
    CHECK_THAT(found->notes.back(), Contains("without PPS"));
    CHECK(to_json(*found)["pps_by_messages"].is_null());
    CHECK_THAT(to_text(*found), Contains("innovation"));
}

TEST_CASE("clock_evaluation: PPS shows the true error") {
    const Duration off = GENERATE(microseconds(0), microseconds(-300), microseconds(40));
    const auto found = evaluate_clock(clocks(120, off, true));
    REQUIRE(found);
    CHECK(found->pps_published.count == 120);
    CHECK(found->pps_published.mean == Approx(-static_cast<double>(off.ns)).margin(1));
    CHECK(found->pps_link.count > 90);
    CHECK(found->pps_link.mean == Approx(-static_cast<double>(off.ns)).margin(8e3));
    CHECK(found->pps_smoothed.mean == Approx(-static_cast<double>(off.ns)).margin(8e3));
    CHECK_THAT(to_text(*found), Contains("by messages alone, smoothed"));
}

TEST_CASE("clock_evaluation: pulses of another life of the board are not translated by this one") {
    RecordedClocks twice = clocks(120, {}, true);
    // The board restarts: its clock shows again what it showed before.
    for (int s = 0; s < 60; ++s) {
        const std::int64_t host = 140'350'000'000 + s * 1'000'000'000LL;
        twice.pulses.push_back({board_at(30'000'000'000 + s * 1'000'000'000LL),
                                {host},
                                {host + output_ahead},
                                microseconds(5)});
    }
    const auto found = evaluate_clock(twice);
    REQUIRE(found);
    CHECK(found->pps_link.count < 105);
    CHECK(found->pps_link.most < 50e3);
    CHECK(found->pps_smoothed.most < 50e3);
}

TEST_CASE("clock_evaluation: exchanges that ended before they began show nothing") {
    RecordedClocks wrong = clocks(60, {}, true);
    for (TimedMessage& message : wrong.lives[0].stamps.messages) {
        auto& exchange = std::get<clock::Exchange>(message.message);
        std::swap(exchange.sent, exchange.arrived);
    }
    const auto found = evaluate_clock(wrong);
    REQUIRE_FALSE(found);
    CHECK_THAT(found.error().message(), Contains("none has a positive round trip"));
}

TEST_CASE("clock_evaluation: nothing to judge is reported") {
    CHECK_FALSE(evaluate_clock({}));
    const auto brief = evaluate_clock(clocks(5, {}, false));
    REQUIRE_FALSE(brief);
    CHECK_THAT(brief.error().message(), Contains("record a minute"));
    RecordedClocks twice = clocks(60, {}, false);
    twice.lives.push_back(clocks(30, {}, false).lives[0]);
    const auto found = evaluate_clock(twice);
    REQUIRE(found);
    CHECK(found->exchanges == 600);
    CHECK_THAT(found->notes.front(), Contains("longest of 2 runs"));
}

TEST_CASE("clock_evaluation: the output clock between its readings, and not across epochs") {
    const std::vector<clock::RecordedOutput> outputs{{1, {1'000'000'000}, {100}, {}},
                                                     {1, {2'000'000'000}, {200}, {}},
                                                     {2, {3'000'000'000}, {900}, {}}};
    CHECK_FALSE(output_minus_host(outputs, {999'999'999}));
    CHECK(output_minus_host(outputs, {1'500'000'000})->ns == 150);
    CHECK(output_minus_host(outputs, {2'900'000'000})->ns == 200);
    CHECK(output_minus_host(outputs, {3'500'000'000})->ns == 900);
    CHECK_FALSE(output_minus_host(outputs, {5'500'000'000}));
    CHECK_FALSE(output_minus_host({}, {0}));
}

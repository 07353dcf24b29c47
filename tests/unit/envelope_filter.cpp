// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/envelope_filter.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

using namespace versavis;
using namespace versavis::clock;

namespace {

/// A board whose clock is off by a constant skew, behind a link of random delays; all in exact
/// virtual time.
class SimulatedLink {
 public:
    SimulatedLink(double skew_ppm, std::uint64_t seed) : skew_ppm_(skew_ppm), random_(seed) {}

    BoardTime board(HostTime host) const {
        return {offset_ + host.ns + std::llround(static_cast<double>(host.ns) * skew_ppm_ * 1e-6)};
    }

    /// Shortest delay 50 us in each direction, exponential tail, now and then several milliseconds.
    Duration delay() {
        const double tail = std::exponential_distribution<>(1.0 / 40e3)(random_);
        const bool burst = std::uniform_real_distribution<>(0, 1)(random_) < 0.02;
        return {50'000 + std::llround(tail) + (burst ? 5'000'000 : 0)};
    }

    Exchange exchange(HostTime at) {
        const HostTime received = at + delay();
        const HostTime answered = received + microseconds(10);
        return {at, board(received), board(answered), answered + delay()};
    }

    void jump(Duration by) { offset_ += by.ns; }

 private:
    std::int64_t offset_ = 123'456'789'000;
    double skew_ppm_;
    std::mt19937_64 random_;
};

double error_ns(const EnvelopeFilter& filter, const SimulatedLink& link, HostTime host) {
    return static_cast<double>((filter.translate(link.board(host)).time - host).ns);
}

}  // namespace

TEST_CASE("envelope_filter: nothing is known before the first exchange, and bounded after it") {
    EnvelopeFilter filter;
    CHECK_FALSE(filter.initialised());
    CHECK(filter.translate({5}).state == ClockState::init);
    SimulatedLink link(30, 1);
    const Exchange exchange = link.exchange(HostTime{1'000'000'000});
    filter.add(exchange);
    CHECK(filter.initialised());
    CHECK(std::abs(error_ns(filter, link, exchange.arrived)) <=
          static_cast<double>(filter.last_round_trip().ns) / 2);
    CHECK(filter.translate(exchange.answered).state == ClockState::converging);
    CHECK_FALSE(filter.confirmed());
    filter.add(link.exchange(HostTime{1'100'000'000}));
    CHECK(filter.confirmed());
    CHECK(filter.restarts() == 0);
}

TEST_CASE("envelope_filter: a first exchange that lies is not believed when the next contradicts") {
    EnvelopeFilter filter;
    SimulatedLink link(30, 1);
    Exchange lie = link.exchange(HostTime{1'000'000'000});
    const Duration shift = GENERATE(milliseconds(5), -milliseconds(5));
    lie.received = lie.received + shift;
    lie.answered = lie.answered + shift;
    filter.add(lie);
    filter.add(link.exchange(HostTime{1'100'000'000}));
    CHECK_FALSE(filter.confirmed());
    filter.add(link.exchange(HostTime{1'200'000'000}));
    CHECK(filter.confirmed());
    CHECK(std::abs(error_ns(filter, link, HostTime{1'200'000'000})) < 1e6);
}

TEST_CASE("envelope_filter: follows skewed clocks through delays with heavy tails") {
    const double skew = GENERATE(-100.0, 0.0, 40.0);
    const std::uint64_t seed = GENERATE(1U, 2U, 3U);
    EnvelopeFilter filter;
    SimulatedLink link(skew, seed);
    std::vector<double> errors;
    for (HostTime t{1'000'000'000}; t.ns < 120'000'000'000; t = t + milliseconds(100)) {
        filter.add(link.exchange(t));
        if (t.ns > 10'000'000'000) errors.push_back(std::abs(error_ns(filter, link, t)));
    }
    std::sort(errors.begin(), errors.end());
    CHECK(errors[errors.size() * 99 / 100] < 20e3);
    CHECK(filter.skew_ppm() == Approx(-skew).margin(0.5));
    const auto now = filter.translate(filter.last_contact());
    CHECK(now.state == ClockState::locked);
    CHECK(now.sigma < microseconds(40));
    CHECK(filter.restarts() == 0);
}

TEST_CASE("envelope_filter: sigma grows without contact, and says so") {
    EnvelopeFilter filter;
    SimulatedLink link(20, 4);
    for (HostTime t{0}; t.ns < 20'000'000'000; t = t + milliseconds(100))
        filter.add(link.exchange(t));
    const BoardTime last = filter.last_contact();
    const auto at_once = filter.translate(last);
    const auto after_10_s = filter.translate(last + seconds(10));
    const auto after_60_s = filter.translate(last + seconds(60));
    CHECK(after_10_s.state == ClockState::holdover);
    CHECK(at_once.sigma < after_10_s.sigma);
    CHECK(after_10_s.sigma < after_60_s.sigma);
    CHECK(std::abs(error_ns(filter, link, HostTime{80'000'000'000})) <
          5.0 * static_cast<double>(after_60_s.sigma.ns));
}

TEST_CASE("envelope_filter: a step of the board's clock does not lock it out") {
    EnvelopeFilter filter;
    SimulatedLink link(20, 5);
    HostTime t{0};
    for (; t.ns < 30'000'000'000; t = t + milliseconds(100)) filter.add(link.exchange(t));
    link.jump(GENERATE(milliseconds(3), -milliseconds(700)));
    const HostTime stepped = t;
    for (; t < stepped + seconds(60); t = t + milliseconds(100)) filter.add(link.exchange(t));
    CHECK(std::abs(error_ns(filter, link, t)) < 100e3);
    CHECK(filter.restarts() >= 1);
}

TEST_CASE("envelope_filter: exchanges at once that contradict it count as one") {
    EnvelopeFilter filter;
    SimulatedLink link(20, 5);
    HostTime t{0};
    for (; t.ns < 30'000'000'000; t = t + milliseconds(100)) filter.add(link.exchange(t));
    const std::uint64_t before = filter.comparisons();
    SimulatedLink liar = link;
    liar.jump(milliseconds(18));
    for (int i = 0; i < 4; ++i) filter.add(liar.exchange(t + milliseconds(i)));
    CHECK(filter.restarts() == 0);
    CHECK(filter.comparisons() == before + 1);
    for (int i = 0; i < 10; ++i) filter.add(link.exchange(t + milliseconds(100) * i));
    CHECK(std::abs(error_ns(filter, link, t)) < 100e3);
}

TEST_CASE("envelope_filter: an exchange that took no time is not believed") {
    EnvelopeFilter filter;
    filter.add(Exchange{{1000}, {500}, {2500}, {1500}});
    CHECK_FALSE(filter.initialised());
}

TEST_CASE("envelope_filter: a slow link locks, too, with a bound that owns up to its asymmetry") {
    EnvelopeFilter filter;
    constexpr Duration one_way = milliseconds(1);
    for (HostTime t{0}; t.ns < 30'000'000'000; t = t + milliseconds(100)) {
        const BoardTime received{t.ns + one_way.ns};
        filter.add(Exchange{t, received, received,
                            t + one_way * 2 + nanoseconds(t.ns / 1'000'000 % 7 * 10'000)});
    }
    const auto now = filter.translate(filter.last_contact());
    CHECK(now.state == ClockState::locked);
    CHECK(now.bound >= one_way);
    CHECK(now.sigma >= microseconds(30));
}

TEST_CASE("envelope_filter: whoever begins an exchange, it says the same") {
    EnvelopeFilter host_began;
    EnvelopeFilter board_began;
    SimulatedLink link(20, 6);
    for (HostTime t{1'000'000'000}; t.ns < 20'000'000'000; t = t + milliseconds(100)) {
        const Exchange exchange = link.exchange(t);
        host_began.add(exchange);
        // The board asks just before, and the host answers at once.
        const HostTime asked = t - link.delay();
        board_began.add(Exchange{t, exchange.received, link.board(asked), t});
    }
    for (EnvelopeFilter* filter : {&host_began, &board_began})
        CHECK(std::abs(error_ns(*filter, link, HostTime{20'000'000'000})) < 20e3);
}

TEST_CASE("envelope_filter: one-way messages alone say nothing, with exchanges they say more") {
    EnvelopeFilter alone;
    alone.add(OneWay{{1'000'000}, {2'000'000}});
    CHECK_FALSE(alone.initialised());

    EnvelopeFilter exchanges;
    EnvelopeFilter both;
    SimulatedLink link(20, 7);
    for (HostTime t{1'000'000'000}; t.ns < 60'000'000'000; t = t + milliseconds(5)) {
        both.add(OneWay{link.board(t), t + link.delay()});
        if (t.ns % 1'000'000'000 != 0) continue;
        const Exchange exchange = link.exchange(t);
        exchanges.add(exchange);
        both.add(exchange);
    }
    const BoardTime now = link.board(HostTime{60'000'000'000});
    CHECK(both.translate(now).sigma < exchanges.translate(now).sigma);
    CHECK(both.skew_sigma_ppm() < exchanges.skew_sigma_ppm());
    CHECK(both.one_way_messages() == 11'799);  // all but the one before the first exchange
}

TEST_CASE("envelope_filter: stamps that count from 1970 are as good as others") {
    constexpr Duration epoch{1'800'000'000'000'000'000};
    EnvelopeFilter filter;
    SimulatedLink link(20, 9);
    for (HostTime t{1'000'000'000}; t.ns < 20'000'000'000; t = t + milliseconds(100)) {
        const Exchange exchange = link.exchange(t);
        filter.add(Exchange{exchange.sent + epoch, exchange.received, exchange.answered,
                            exchange.arrived + epoch});
    }
    const HostTime now{20'000'000'000};
    CHECK(absolute(filter.translate(link.board(now)).time - (now + epoch)) < microseconds(20));
}

TEST_CASE("envelope_filter: absurd stamps are left out") {
    EnvelopeFilter filter;
    constexpr std::int64_t extremes[] = {INT64_MIN, INT64_MIN / 2, -1,       0,
                                         1,         INT64_MAX / 2, INT64_MAX};
    for (const std::int64_t a : extremes)
        for (const std::int64_t b : extremes)
            for (const std::int64_t c : extremes)
                for (const std::int64_t d : extremes) {
                    filter.add(Exchange{{a}, {b}, {c}, {d}});
                    filter.add(OneWay{{b}, {c}});
                    const HostEstimate estimate = filter.translate({d});
                    REQUIRE(std::min(estimate.sigma, estimate.bound) >= Duration{});
                }
    SimulatedLink link(0, 8);
    for (HostTime t{1'000'000'000}; t.ns < 10'000'000'000; t = t + milliseconds(100))
        filter.add(link.exchange(t));
    CHECK(std::abs(error_ns(filter, link, HostTime{10'000'000'000})) < 100e3);
}

TEST_CASE("envelope_filter: a message from years ahead is not explained by the error of years") {
    const SimulatedLink link(20, 1);
    EnvelopeFilter filter;
    const auto host = [](int i) { return HostTime{} + milliseconds(1000 + i); };
    for (int i = 0; i < 4; ++i) filter.add(SimulatedLink(20, 1).exchange(host(i)));
    const Duration ahead{std::int64_t{1} << GENERATE(30, 40, 53, 58)};
    filter.add(OneWay{link.board(host(5)) + ahead, host(5) + microseconds(60)});
    CHECK(filter.one_way_messages() == 0);
    CHECK(absolute(filter.translate(link.board(host(6))).time - host(6)) < microseconds(200));
}

TEST_CASE("envelope_filter: a measured asymmetry takes the place of the presumed one") {
    // To the host delays thin out towards 50 us, to the board they break off there.
    EnvelopeFilter filter;
    std::mt19937_64 random(4);
    std::lognormal_distribution<> wake_up(std::log(30e3), 0.5);
    std::uniform_real_distribution<> frame(0, 1e6);
    HostTime at{1'000'000'000};
    for (int i = 0; i < 5000; ++i, at = at + milliseconds(100)) {
        const HostTime received = at + microseconds(50) + Duration{std::llround(frame(random))};
        const HostTime arrived =
            received + microseconds(50) + Duration{std::llround(wake_up(random))};
        filter.add(Exchange{at, {received.ns}, {received.ns}, arrived});
    }
    const Duration presumed = filter.presumed_asymmetry();
    CHECK(presumed > microseconds(1));
    CHECK(presumed <= microseconds(10));
    const HostTime before = filter.translate({at.ns}).time;
    filter.set_asymmetry(Asymmetry{microseconds(3), microseconds(1)});
    CHECK(filter.presumed_asymmetry() == Duration{});
    CHECK(filter.translate({at.ns}).time == before + presumed - microseconds(3));
}

TEST_CASE("envelope_filter: exchanges against streams that go on must last longer than the truth") {
    EnvelopeFilter filter;
    SimulatedLink link(30, 5);
    HostTime now{1'000'000'000};
    const int agreed = GENERATE(60, 300, 2000);
    for (int i = 0; i < agreed; ++i) filter.add(link.exchange(now = now + milliseconds(100)));
    const std::uint64_t before = filter.restarts();
    link.jump(GENERATE(milliseconds(5), -milliseconds(5)));
    const bool witnessed = GENERATE(true, false);
    int contradicting = 0;
    while (filter.restarts() == before && contradicting < 5000) {
        if (witnessed) filter.clock_continues();
        filter.add(link.exchange(now = now + milliseconds(100)));
        ++contradicting;
    }
    // Some fit by chance: a fiftieth of all delays is longer than the step.
    const int lasting = std::clamp(2 * agreed, 30, 1200);
    CHECK(contradicting >= (witnessed ? lasting - 20 : 3));
    CHECK(contradicting <= (witnessed ? 2 * lasting : 5));
}

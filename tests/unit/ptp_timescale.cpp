// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/ptp_timescale.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace versavis;
using namespace versavis::clock;

namespace {

/// PTP's time runs at a rate of its own; a camera's is that, and what it is off. Readings take as
/// long as on a network with a busy host now and then, and the latch falls anywhere within.
class Network {
 public:
    explicit Network(std::uint64_t seed) : random_(seed) {}

    CameraTime ptp(HostTime host) const {
        const double elapsed = static_cast<double>(host.ns);
        return CameraTime{1'795'000'000'000'000'000 + host.ns + std::llround(elapsed * skew) +
                          step.ns};
    }

    ClockReading read(Duration off = {}) {
        now = now + milliseconds(37);
        const auto way = [&] {
            const double tail = std::exponential_distribution(1.0)(random_);
            const bool busy = random_() % 20 == 0;
            return microseconds(60) + Duration{std::llround(tail * (busy ? 3e6 : 20e3))};
        };
        const HostTime latched = now + way();
        return {now, ptp(latched) + off, latched + way()};
    }

    HostTime now{1'000'000'000};
    Duration step;
    static constexpr double skew = 23e-6;

 private:
    std::mt19937_64 random_;
};

void settle(Network& network, PtpTimescale& timescale, std::size_t clock, int readings = 60) {
    for (int i = 0; i < readings; ++i) timescale.add(clock, network.read());
}

Duration error(const Network& network, const PtpTimescale& timescale, HostTime at) {
    return timescale.to_host(network.ptp(at))->time - at;
}

}  // namespace

TEST_CASE("ptp_timescale: nothing is known before two readings agree") {
    Network network(1);
    PtpTimescale timescale;
    const std::size_t clock = timescale.add_clock();
    CHECK_FALSE(timescale.to_host({5}));
    CHECK_FALSE(timescale.at({5}));
    CHECK(timescale.add(clock, network.read()) == Agreement::unknown);
    CHECK_FALSE(timescale.to_host({5}));
    timescale.add(clock, network.read());
    CHECK(timescale.to_host({5}));
}

TEST_CASE("ptp_timescale: the estimate is as good as it says") {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        Network network(seed);
        PtpTimescale timescale;
        const std::size_t clock = timescale.add_clock();
        settle(network, timescale, clock);
        for (int i = 0; i < 200; ++i) {
            const ClockReading reading = network.read();
            const Agreement agreement = timescale.add(clock, reading);
            REQUIRE(agreement != Agreement::differs);
            REQUIRE((agreement == Agreement::agrees) ==
                    (reading.width() <= PtpTimescale::widest_reading));
            const auto estimate = timescale.to_host(network.ptp(network.now));
            REQUIRE(absolute(estimate->time - network.now) < estimate->sigma * 6);
            REQUIRE(estimate->sigma < microseconds(60));
            const CameraTime inverse = *timescale.at(network.now);
            REQUIRE(absolute(timescale.to_host(inverse)->time - network.now).ns <= 2);
        }
        CHECK(timescale.steps() == 0);
    }
}

TEST_CASE("ptp_timescale: a clock that contradicts another that agrees is the wrong one") {
    for (const Duration off : {milliseconds(1), milliseconds(-1), seconds(37), seconds(-3600)}) {
        Network network(3);
        PtpTimescale timescale;
        const std::size_t good = timescale.add_clock();
        const std::size_t bad = timescale.add_clock();
        for (int i = 0; i < 60; ++i) {
            timescale.add(good, network.read());
            timescale.add(bad, network.read());
        }
        int found = 0;
        for (int i = 0; i < 500; ++i) {
            REQUIRE(timescale.add(good, network.read()) != Agreement::differs);
            const ClockReading reading = network.read(off);
            const Agreement agreement = timescale.add(bad, reading);
            if (reading.width() < milliseconds(1)) REQUIRE(agreement == Agreement::differs);
            found += agreement == Agreement::differs ? 1 : 0;
            REQUIRE(absolute(error(network, timescale, network.now)) < microseconds(100));
        }
        CHECK(found > 400);
        CHECK(timescale.steps() == 0);
    }
}

TEST_CASE("ptp_timescale: where all step, the estimate begins anew, and none agrees meanwhile") {
    for (const Duration step : {milliseconds(9), milliseconds(-9), seconds(37), seconds(-37)}) {
        Network network(5);
        PtpTimescale timescale;
        const std::size_t one = timescale.add_clock();
        const std::size_t other = timescale.add_clock();
        settle(network, timescale, one);
        settle(network, timescale, other);
        network.step = step;
        int until_known = 0;
        for (; timescale.steps() == 0 || !timescale.to_host({1}); ++until_known) {
            REQUIRE(until_known < 200);
            const std::size_t clock = until_known % 2 == 0 ? one : other;
            REQUIRE(timescale.add(clock, network.read()) != Agreement::agrees);
        }
        settle(network, timescale, one);
        CHECK(timescale.add(other, network.read()) != Agreement::differs);
        CHECK(absolute(error(network, timescale, network.now)) < microseconds(100));
        CHECK(timescale.steps() == 1);
    }
}

TEST_CASE("ptp_timescale: of two that differ from the start, one leads, and nothing steps") {
    Network network(8);
    PtpTimescale timescale;
    const std::size_t one = timescale.add_clock();
    const std::size_t other = timescale.add_clock();
    for (int i = 0; i < 50; ++i) {
        timescale.add(one, network.read());
        timescale.add(other, network.read(seconds(9)));
    }
    CHECK(timescale.steps() == 0);
    CHECK(timescale.add(one, network.read()) != Agreement::differs);
    CHECK(timescale.add(other, network.read(seconds(9))) == Agreement::differs);
    timescale.forget(one);
    network.now = network.now + seconds(5);
    for (int i = 0; i < 50; ++i) timescale.add(other, network.read(seconds(9)));
    CHECK(timescale.steps() == 1);
}

TEST_CASE("ptp_timescale: a clock that was forgotten is no witness") {
    Network network(6);
    PtpTimescale timescale;
    const std::size_t gone = timescale.add_clock();
    const std::size_t left = timescale.add_clock();
    settle(network, timescale, gone);
    settle(network, timescale, left);
    timescale.add(gone, network.read());
    timescale.forget(gone);
    network.step = seconds(1);
    for (int i = 0; i < 20; ++i) timescale.add(left, network.read());
    CHECK(timescale.steps() == 1);
}

TEST_CASE("ptp_timescale: readings that end before they begin tell nothing") {
    Network network(7);
    PtpTimescale timescale;
    const std::size_t clock = timescale.add_clock();
    settle(network, timescale, clock);
    ClockReading reading = network.read();
    std::swap(reading.before, reading.after);
    CHECK(timescale.add(clock, reading) == Agreement::unknown);
    CHECK(timescale.add(clock, {{}, {INT64_MAX}, {1}}) != Agreement::agrees);
    settle(network, timescale, clock, 5);
    CHECK(absolute(error(network, timescale, network.now)) < microseconds(100));
}

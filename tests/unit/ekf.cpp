// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/ekf.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

using namespace versavis;
using namespace versavis::clock;

namespace {

/// A board whose skew walks at random, by 0.01 ppm per sqrt(s), read at host times that never go
/// back by much.
class SimulatedBoard {
 public:
    SimulatedBoard(double skew_ppm, std::mt19937_64& random)
        : skew_(skew_ppm * 1e-6), random_(random) {}

    /// Integer nanoseconds on both sides, far from zero, as in a recording.
    BoardTime at(HostTime host) {
        while (host > knots_.back().host) append();
        const auto after = std::partition_point(knots_.begin(), knots_.end(),
                                                [&](const Knot& k) { return k.host < host; });
        const Knot& begin = after == knots_.begin() ? *after : *std::prev(after);
        const double since = static_cast<double>((host - begin.host).ns);
        return {host.ns - start.ns + 77'000'000'000 +
                std::llround(begin.ahead_ns + begin.skew * since)};
    }

    static constexpr HostTime start{1'700'000'000'000'000'000};

 private:
    struct Knot {
        HostTime host;
        double ahead_ns;
        double skew;
    };

    void append() {
        constexpr Duration step = milliseconds(100);
        const Knot& last = knots_.back();
        const double ahead = last.ahead_ns + last.skew * static_cast<double>(step.ns);
        skew_ += std::normal_distribution<>(0, 0.01e-6 * std::sqrt(0.1))(random_);
        knots_.push_back({last.host + step, ahead, skew_});
    }

    double skew_;
    std::mt19937_64& random_;
    std::vector<Knot> knots_{{start, 0, skew_}};
};

using Delays = std::pair<Duration, Duration>;  // to the board, to the host

/// Errors in us at every 0.1 s from 300 s to 1800 s, of exchanges every `interval`.
template <class Draw>
std::vector<double> errors_us(Duration interval, Draw draw) {
    std::vector<double> errors;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        std::mt19937_64 random(seed);
        SimulatedBoard board(std::uniform_real_distribution<>(-30, 30)(random), random);
        Ekf filter(EkfStart::fair());
        HostTime next = SimulatedBoard::start;
        for (HostTime t = SimulatedBoard::start; t < SimulatedBoard::start + seconds(1800);
             t = t + milliseconds(100)) {
            if (t >= next) {
                const auto [there, back] = draw(t, random);
                const HostTime received = t + there;
                const HostTime answered = received + microseconds(20);
                filter.add({t, board.at(received), board.at(answered), answered + back});
                next = next + interval;
            }
            if (t < SimulatedBoard::start + seconds(300)) continue;
            errors.push_back(
                std::abs(static_cast<double>((filter.translate(board.at(t)).time - t).ns)) * 1e-3);
        }
    }
    std::sort(errors.begin(), errors.end());
    return errors;
}

double p99(const std::vector<double>& sorted) { return sorted[sorted.size() * 99 / 100]; }

double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return std::sqrt(sum / static_cast<double>(values.size()));
}

Delays jittery(HostTime /*at*/, std::mt19937_64& random) {
    std::uniform_real_distribution<> delay(0.3e6, 10.3e6);
    return {{std::llround(delay(random))}, {std::llround(delay(random))}};
}

/// OUT leaves with the next 1 ms frame, IN is polled every 125 us, and the process wakes up late.
Delays usb(HostTime at, std::mt19937_64& random) {
    std::lognormal_distribution<> wake_up(std::log(40e3), 0.8);
    const auto late = [&] { return std::llround(wake_up(random)); };
    const std::int64_t frame = 1'000'000 - at.ns % 1'000'000;
    const auto poll = std::uniform_int_distribution<>(0, 125'000)(random);
    const bool preempted = std::uniform_real_distribution<>(0, 1)(random) < 0.01;
    return {{frame + 20'000}, {poll + 20'000 + late() + (preempted ? 2'000'000 : 0)}};
}

Exchange exact_exchange(std::int64_t host_ns, std::int64_t board_ns) {
    return {{host_ns - 100'000}, {board_ns - 1'000}, {board_ns + 1'000}, {host_ns + 100'000}};
}

}  // namespace

TEST_CASE("ekf: as good as the published filter with delays of +-5 ms at 1 Hz, and no better") {
    const auto errors = errors_us(seconds(1), jittery);
    CAPTURE(p99(errors), rms(errors));
    CHECK(p99(errors) == Approx(916).epsilon(0.15));
    CHECK(rms(errors) == Approx(356).epsilon(0.15));
}

TEST_CASE("ekf: ten times as many exchanges gain little, for its noise is per exchange") {
    const auto errors = errors_us(milliseconds(100), jittery);
    CAPTURE(p99(errors), rms(errors));
    CHECK(p99(errors) == Approx(792).epsilon(0.2));
}

TEST_CASE("ekf: the frames of USB bias it by the mean asymmetry") {
    // Dithered within a frame, as the service does.
    const auto errors = errors_us(milliseconds(100), [](HostTime at, auto& random) {
        return usb(at + Duration{std::uniform_int_distribution<>(0, 999'999)(random)}, random);
    });
    CAPTURE(p99(errors), rms(errors));
    CHECK(p99(errors) > 150);
    CHECK(p99(errors) < 350);
}

TEST_CASE("ekf: the gain settles where the published noises put it") {
    Ekf filter(EkfStart::fair());
    CHECK(filter.translate({5}).state == ClockState::init);
    filter.add(exact_exchange(1'000'000'000, 0));
    CHECK(filter.translate({0}).time == HostTime{1'000'000'000});
    CHECK(filter.translate({0}).state == ClockState::converging);
    for (std::int64_t i = 1; i <= 1000; ++i)
        filter.add(exact_exchange((1 + i) * 1'000'000'000, i * 1'000'000'000));
    CHECK(filter.gain() == Approx(0.0515).margin(0.0005));
    const BoardTime last = filter.last_contact();
    CHECK(filter.translate(last).state == ClockState::locked);
    CHECK(filter.translate(last).sigma.ns == Approx(16.1e6).epsilon(0.03));
    CHECK(filter.translate(last + seconds(4)).state == ClockState::holdover);
    CHECK(filter.translate(last + seconds(4)).sigma > filter.translate(last).sigma);
}

TEST_CASE("ekf: from its shipped start values it stays outside its own gate for minutes") {
    Ekf filter;
    std::int64_t s = 0;
    for (; s < 300; ++s) filter.add(exact_exchange((1 + s) * 1'000'000'000, s * 1'000'000'000));
    CHECK(filter.gated() == 299);
    CHECK(filter.translate(filter.last_contact()).state == ClockState::converging);
    for (; s < 1200; ++s) filter.add(exact_exchange((1 + s) * 1'000'000'000, s * 1'000'000'000));
    CHECK(filter.gated() == Approx(333).margin(2));
    CHECK(filter.translate(filter.last_contact()).state == ClockState::locked);
    CHECK(absolute(filter.last_residual()) < milliseconds(1));
}

TEST_CASE("ekf: a step beyond the gate locks it out for ever") {
    Ekf filter(EkfStart::fair());
    std::int64_t s = 0;
    for (; s < 100; ++s) filter.add(exact_exchange(s * 1'000'000'000, s * 1'000'000'000));
    for (; s < 400; ++s)
        filter.add(exact_exchange(s * 1'000'000'000 + 600'000'000, s * 1'000'000'000));
    CHECK(filter.gated() == 300);
    CHECK(filter.translate(filter.last_contact()).state == ClockState::converging);
}

TEST_CASE("ekf: which side began makes no difference") {
    Ekf host_began(EkfStart::fair());
    Ekf board_began(EkfStart::fair());
    for (std::int64_t s = 0; s < 50; ++s) {
        const std::int64_t t = s * 1'000'000'000;
        host_began.add({{t - 3'000'000}, {t}, {t}, {t + 3'000'000 + s}});
        board_began.add({{t + s / 2}, {t + 3'000'000}, {t - 3'000'000}, {t + s / 2}});
    }
    const BoardTime at{60'000'000'000};
    CHECK(absolute(host_began.translate(at).time - board_began.translate(at).time) <=
          nanoseconds(1));
}

TEST_CASE("ekf: stamps at the ends of their range are no reason to fail") {
    constexpr std::int64_t low = std::numeric_limits<std::int64_t>::min();
    constexpr std::int64_t high = std::numeric_limits<std::int64_t>::max();
    Ekf filter(EkfStart::fair());
    for (const std::int64_t a : {low, high, std::int64_t{0}})
        for (const std::int64_t b : {low, high, std::int64_t{0}}) {
            filter.add(Exchange{{a}, {b}, {a}, {b}});
            filter.add(Exchange{{a}, {a}, {b}, {b}});
            CHECK(filter.translate({a}).sigma.ns >= 0);
            CHECK(filter.translate({b}).state != ClockState::init);
        }
}

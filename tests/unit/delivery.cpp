// SPDX-License-Identifier: BSD-3-Clause
#include "health/delivery.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// A stream in simulated time, looked at twice a second.
struct DeliveredStream {
    explicit DeliveredStream(double rate) : rate_hz(rate), delivery(rate) { delivery.begin(now); }

    /// It delivers at `share` of its rate. Returns when its state changed, after how long.
    Duration run(double share, Duration duration, bool until_full) {
        for (Duration passed; passed < duration;) {
            passed = passed + milliseconds(500);
            now = now + milliseconds(500);
            items += share * rate_hz * 0.5;
            delivery.count(static_cast<std::uint64_t>(items), now);
            if (delivery.report().full == until_full) return passed;
        }
        return duration * 2;
    }

    double rate_hz;
    HostTime now{100'000'000'000};
    double items = 0;
    Delivery delivery;
};

}  // namespace

TEST_CASE("delivery: full soon after the start, at any rate") {
    for (const double rate : {5.0, 20.0, 200.0, 1000.0}) {
        DeliveredStream stream(rate);
        CHECK_FALSE(stream.delivery.report().ever);
        CHECK(stream.run(1, seconds(10), true) <= milliseconds(1500));
        CHECK(stream.delivery.report().ever);
        CHECK(stream.run(1, seconds(60), false) == seconds(120));
        CHECK(stream.delivery.report().rate_hz == Approx(rate).epsilon(0.01));
    }
    DeliveredStream slow(0.5);
    CHECK(slow.run(1, seconds(20), true) <= seconds(8));
    CHECK(slow.run(1, seconds(100), false) == seconds(200));
}

TEST_CASE("delivery: what is missing shows within two seconds, be it all, half or a sixth") {
    for (const double share : {0.0, 0.5, 0.75, 0.82}) {
        DeliveredStream stream(20);
        stream.run(1, seconds(5), true);
        stream.run(1, seconds(20), false);
        INFO(share);
        CHECK(stream.run(share, seconds(10), false) <= seconds(2));
    }
}

TEST_CASE("delivery: one frame in twenty shows in the end, a lost frame now and then does not") {
    DeliveredStream loses(20);
    loses.run(1, seconds(5), true);
    CHECK(loses.run(0.95, seconds(20), false) <= seconds(10));
    DeliveredStream stream(20);
    stream.run(1, seconds(5), true);
    for (int i = 0; i < 10; ++i) {
        stream.items -= 1;
        CHECK(stream.run(1, seconds(5), false) == seconds(10));
    }
}

TEST_CASE("delivery: a short stall is forgiven, a long one is over three seconds after its end") {
    DeliveredStream stream(20);
    stream.run(1, seconds(5), true);
    stream.items -= 5;
    CHECK(stream.run(1, seconds(5), false) == seconds(10));
    stream.run(1, seconds(10), false);
    CHECK(stream.run(0, seconds(2), false) <= seconds(1));
    stream.run(0, seconds(2), true);
    const Duration back = stream.run(1, seconds(10), true);
    CHECK(back >= seconds(3));
    CHECK(back <= milliseconds(3500));
    CHECK(stream.run(1, seconds(60), false) == seconds(120));
}

TEST_CASE("delivery: slow starts are no deliveries, and a start anew is proved quickly") {
    DeliveredStream stream(20);
    CHECK(stream.run(0.05, seconds(10), true) == seconds(20));
    stream.run(1, seconds(5), true);
    stream.delivery.begin(stream.now);
    CHECK_FALSE(stream.delivery.report().full);
    CHECK(stream.delivery.report().ever);
    CHECK(stream.run(1, seconds(10), true) <= seconds(1));
}

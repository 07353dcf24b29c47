// SPDX-License-Identifier: BSD-3-Clause
#include "camera/bandwidth_plan.hpp"

#include <arpa/inet.h>

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

BandwidthNeed need(double rate_hz, const std::string& link = "eth0") {
    BandwidthNeed need;
    need.link = link;
    need.link_mbps = 1000;
    need.frame_size = 1920 * 1200;
    need.packet_size = 9000;
    need.rate_hz = rate_hz;
    return need;
}

/// Time that a frame takes with this pause, against the time between frames.
double busy(const BandwidthNeed& need, Duration delay) {
    const double packets =
        std::ceil(static_cast<double>(need.frame_size) / (need.packet_size - 36));
    const double packet_us =
        (need.packet_size + 38) * 8 / need.link_mbps + static_cast<double>(delay.ns) * 1e-3;
    return packets * packet_us * 1e-6 * need.rate_hz;
}

}  // namespace

TEST_CASE("bandwidth_plan: headers count") {
    // 258 packets with 74 bytes around each, leader and trailer.
    CHECK(needed_mbps(need(20)) == Approx((1920 * 1200 + 260 * 74) * 8 * 20 * 1e-6));
}

TEST_CASE(
    "bandwidth_plan: a camera alone does not pause, sharers keep to their parts, and come and go") {
    BandwidthPlan plan;
    plan.join("cam0", need(20));
    CHECK(plan.share("cam0").packet_delay.ns == 0);
    CHECK(plan.share("cam0").fits());
    plan.join("other", need(40, "eth1"));
    CHECK(plan.share("cam0").packet_delay.ns == 0);
    plan.join("cam1", need(10));
    const auto fast = plan.share("cam0");
    const auto slow = plan.share("cam1");
    CHECK(fast.packet_delay.ns > 0);
    CHECK(slow.packet_delay > fast.packet_delay);
    CHECK(fast.link_needed_mbps == Approx(needed_mbps(need(30))).epsilon(0.01));
    CHECK(busy(need(20), fast.packet_delay) < 1);
    CHECK(busy(need(10), slow.packet_delay) < 1);
    plan.leave("cam1");
    CHECK(plan.share("cam0").packet_delay.ns == 0);
    CHECK(plan.share("nobody").needed_mbps == 0);
}

TEST_CASE("bandwidth_plan: too much is said, an unknown link plans nothing") {
    BandwidthPlan plan;
    plan.join("cam0", need(30));
    plan.join("cam1", need(30));
    CHECK_FALSE(plan.share("cam0").fits());
    BandwidthNeed unknown = need(30, "lo");
    unknown.link_mbps = 0;
    plan.join("cam2", unknown);
    plan.join("cam3", unknown);
    CHECK(plan.share("cam2").packet_delay.ns == 0);
    CHECK(plan.share("cam2").fits());
}

TEST_CASE("bandwidth_plan: interfaces are found by their address, loopback has no speed") {
    CHECK(interface_of(inet_addr("127.0.0.1")) == "lo");
    CHECK(interface_of(inet_addr("203.0.113.9")).empty());
    CHECK(link_speed_mbps("lo") == 0);
    CHECK(link_speed_mbps("no such interface") == 0);
}

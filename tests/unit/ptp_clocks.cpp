// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/ptp_clocks.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;
using clock::Agreement;

namespace {

constexpr std::int64_t ptp_ahead_ns = 1'795'000'000'000'000'000;

PtpStatus port(const char* state) {
    PtpStatus status;
    status.state = state;
    return status;
}

/// Two cameras whose clocks are read in turn.
struct TwoClocks {
    TwoClocks() {
        for (const std::size_t clock : {left, right}) clocks.note(clock, port("Slave"));
        for (int i = 0; i < 10; ++i) {
            read(left);
            read(right);
        }
    }

    Agreement read(std::size_t clock, Duration off = {}) {
        now = now + milliseconds(50);
        return clocks.read(clock, {now, CameraTime{now.ns + ptp_ahead_ns + 100'000} + off,
                                   now + microseconds(200)});
    }

    clock::Translator translator{
        *clock::OutputClock::create(clock::OutputClockKind::monotonic_raw)};
    PtpClocks clocks{translator};
    std::size_t left = clocks.add("left");
    std::size_t right = clocks.add("right");
    HostTime now = host_now();
};

}  // namespace

TEST_CASE("ptp_clocks: cameras that follow and agree can be triggered, and are translated") {
    TwoClocks two;
    CHECK(two.clocks.ready(two.left));
    CHECK(two.clocks.ready(two.right));
    const auto stamp = two.clocks.translate(CameraTime{two.now.ns + ptp_ahead_ns});
    REQUIRE(stamp);
    CHECK(absolute(stamp->host - two.now) < microseconds(100));
    CHECK(stamp->sigma_ns < 100'000);
    CHECK(two.clocks.report().state != clock::ClockState::init);
}

TEST_CASE("ptp_clocks: no camera is triggered while one is a master, until that is gone") {
    TwoClocks two;
    two.clocks.note(two.right, port("Master"));
    CHECK_FALSE(two.clocks.ready(two.left));
    CHECK(two.clocks.report().master == "right");
    CHECK(two.clocks.distrusted());
    two.clocks.note(two.right, {});
    CHECK(two.clocks.ready(two.left));
    CHECK(two.clocks.report().master.empty());
}

TEST_CASE("ptp_clocks: one that does not follow is not believed, and must agree again") {
    TwoClocks two;
    two.clocks.note(two.left, port("Listening"));
    CHECK(two.read(two.left) == Agreement::differs);
    CHECK_FALSE(two.clocks.ready(two.left));
    CHECK(two.clocks.ready(two.right));
    two.clocks.note(two.left, port("Slave"));
    CHECK_FALSE(two.clocks.ready(two.left));
    CHECK(two.read(two.left) == Agreement::agrees);
    CHECK(two.clocks.ready(two.left));
    PtpStatus unlocked = port("Slave");
    unlocked.servo_locked = false;
    two.clocks.note(two.left, unlocked);
    CHECK_FALSE(two.clocks.ready(two.left));
}

TEST_CASE("ptp_clocks: one that shows another time is named, and the others go on") {
    TwoClocks two;
    CHECK(two.read(two.right, seconds(37)) == Agreement::differs);
    CHECK(two.read(two.left) == Agreement::agrees);
    CHECK_FALSE(two.clocks.ready(two.right));
    CHECK(two.clocks.ready(two.left));
    CHECK(two.clocks.report().clocks[two.right].differing == 1);
}

TEST_CASE("ptp_clocks: where PTP's time steps for all, a new epoch begins") {
    TwoClocks two;
    const std::uint32_t before = two.translator.output_now().epoch;
    for (int i = 0; i < 10; ++i) {
        two.read(two.left, seconds(5));
        two.read(two.right, seconds(5));
    }
    CHECK(two.clocks.report().steps == 1);
    CHECK(two.translator.output_now().epoch == before + 1);
    CHECK(two.clocks.ready(two.left));
}

TEST_CASE("ptp_clocks: what the board contradicts holds for all, until that camera is gone") {
    TwoClocks two;
    two.clocks.contradict(two.left, true);
    CHECK(two.clocks.distrusted());
    CHECK(two.clocks.report().contradicted == "left");
    two.clocks.note(two.left, {});
    CHECK_FALSE(two.clocks.distrusted());
    two.clocks.contradict(two.right, true);
    CHECK(two.clocks.distrusted());
    two.read(two.right, seconds(1));  // what the board says is about that
    CHECK_FALSE(two.clocks.distrusted());
}

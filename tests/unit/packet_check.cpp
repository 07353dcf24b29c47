// SPDX-License-Identifier: BSD-3-Clause
#include "plausibility/packet_check.hpp"

#include <catch2/catch.hpp>
#include <limits>

using namespace versavis;
using namespace versavis::daemon;

namespace {

wire::BoardHello hello_of_board() {
    wire::BoardHello hello{};
    hello.cameras = wire::camera_count;
    hello.present = wire::present_all;
    return hello;
}

}  // namespace

TEST_CASE("packet_check: gaps are losses, also where the number wraps") {
    SequenceWatch watch;
    watch.begin(0xFFFFFFFD);
    CHECK(watch.add(0xFFFFFFFE));
    CHECK(watch.add(1));
    CHECK(watch.add(2));
    CHECK(watch.lost() == 2);
}

TEST_CASE("packet_check: one wrong number is an error and no loss") {
    for (const std::uint32_t wrong : {3U, 0U, 0x80000000U, 0xFFFFFFFFU, 100'000U}) {
        SequenceWatch watch;
        watch.begin(9);
        CHECK(watch.add(10));
        CHECK_FALSE(watch.add(wrong));
        CHECK(watch.add(12));
        CHECK(watch.lost() == 0);
    }
}

TEST_CASE("packet_check: numbers that go on from a wrong one are believed") {
    SequenceWatch watch;
    watch.begin(9);
    CHECK_FALSE(watch.add(1'000'000));
    CHECK(watch.add(1'000'001));
    CHECK(watch.add(1'000'003));
    CHECK(watch.lost() == 1);
}

TEST_CASE("packet_check: times before the boot or beyond any life cannot be") {
    constexpr auto largest = std::numeric_limits<std::int64_t>::max();
    for (const std::int64_t ns : {std::int64_t{-1}, wire::no_time, largest}) {
        wire::Exposure exposure{};
        exposure.trigger_ns = ns;
        CHECK_FALSE(possible(exposure));
        exposure.trigger_ns = 0;
        exposure.start_ns = ns;
        CHECK(possible(exposure) == (ns == wire::no_time));
        wire::ImuSample sample{};
        sample.time_ns = ns;
        CHECK_FALSE(possible(sample));
        wire::Event event{};
        event.time_ns = ns;
        CHECK_FALSE(possible(event));
        wire::BoardHello hello = hello_of_board();
        hello.board_time_ns = ns;
        CHECK_FALSE(possible(hello));
        CHECK_FALSE(possible(wire::ClockAnswer{1, 0, ns, 0}));
        CHECK_FALSE(possible(wire::ClockAnswer{1, 0, 0, ns}));
        CHECK_FALSE(possible(wire::ClockFollowUp{1, 0, ns}));
        wire::Health health{};
        health.board_time_ns = ns;
        CHECK_FALSE(possible(health));
    }
}

TEST_CASE("packet_check: a board has outputs, as many as it says") {
    CHECK(possible(hello_of_board()));
    wire::BoardHello hello = hello_of_board();
    hello.present = wire::present_spi | wire::present_light;
    hello.cameras = 0;
    CHECK_FALSE(possible(hello));
    hello.cameras = 1;
    CHECK_FALSE(possible(hello));
    hello.present |= wire::present_camera0 << 2U;  // outputs need not begin with the first
    CHECK(possible(hello));
    hello.present |= wire::present_camera0;
    CHECK_FALSE(possible(hello));
    hello.cameras = 2;
    CHECK(possible(hello));
    hello.present = ~0U;  // what a newer board has
    hello.cameras = wire::camera_count;
    CHECK(possible(hello));
}

TEST_CASE("packet_check: a sentence of the year 2300 labels nothing") {
    wire::Event event{};
    event.kind = wire::BoardEventKind::utc_label;
    event.value = 10'413'792'000;  // 2300-01-01
    CHECK_FALSE(possible(event));
    event.value = 1'900'000'000;
    CHECK(possible(event));
    event.value = -1;
    CHECK_FALSE(possible(event));
    event.kind = wire::BoardEventKind::pps;  // its value is no time
    CHECK(possible(event));
}

TEST_CASE("packet_check: an accelerometer's age comes with its flag only") {
    wire::ImuSample sample{};
    sample.accel_age = 1;
    CHECK_FALSE(possible(sample));
    sample.flags = wire::imu_accel_stamped;
    CHECK(possible(sample));
    sample.accel_age = 0;
    CHECK(possible(sample));
}

TEST_CASE("packet_check: a run of skipped triggers has some, and storage succeeds or fails") {
    wire::Event event{};
    event.kind = wire::BoardEventKind::triggers_skipped;
    CHECK_FALSE(possible(event));
    event.detail = 1;
    CHECK(possible(event));
    event.kind = wire::BoardEventKind::stored;
    for (const std::int64_t value : {-1, 0, 1, 2}) {
        event.value = value;
        CHECK(possible(event) == (value == 0 || value == 1));
    }
    event.kind = wire::BoardEventKind::sync_lost;  // its value is a difference
    event.value = -5'000'000;
    CHECK(possible(event));
}

TEST_CASE("packet_check: states of a report are those that there are") {
    CHECK(possible(wire::Health{}));
    wire::Health health{};
    health.pps_state = wire::PpsState::good;
    health.sync_state = wire::SyncState::followed;
    health.stamp_test = wire::StampTest::passed;
    health.reset_cause = wire::ResetCause::update;
    CHECK(possible(health));
    health.sync_state = static_cast<wire::SyncState>(3);
    CHECK_FALSE(possible(health));
    health = {};
    health.stamp_test = static_cast<wire::StampTest>(3);
    CHECK_FALSE(possible(health));
    health = {};
    health.pps_state = static_cast<wire::PpsState>(3);
    CHECK_FALSE(possible(health));
    health = {};
    health.reset_cause = static_cast<wire::ResetCause>(6);
    CHECK_FALSE(possible(health));
}

TEST_CASE(
    "packet_check: a line is printable, begins with its sign, and has the size that it says") {
    const auto sentence = [](const std::string& text) {
        wire::Sentence message{};
        message.size = static_cast<std::uint8_t>(text.size());
        text.copy(message.text, sizeof message.text);
        return message;
    };
    for (const char* good : {"$", "!", "$GPRMC,*00", "!AIVDM,~ "}) CHECK(possible(sentence(good)));
    for (const char* bad : {"", "GPRMC", " $", "$\r", "$\x7f", "$\x80", "$\x1f", "#"})
        CHECK_FALSE(possible(sentence(bad)));
    CHECK(possible(sentence("$" + std::string(wire::max_sentence_text - 1, 'A'))));
    CHECK_FALSE(possible(sentence("$" + std::string(wire::max_sentence_text, 'A'))));
    wire::Sentence late = sentence("$");
    late.time_ns = -1;
    CHECK_FALSE(possible(late));
}

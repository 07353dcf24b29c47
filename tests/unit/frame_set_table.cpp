// SPDX-License-Identifier: BSD-3-Clause
#include "export/frame_set_table.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using client::FrameSetTable;
using client::SkipReason;

namespace {

/// Of life 1 and epoch 1.
std::vector<client::SequenceBounds> sequence(OutputTime first, OutputTime last) {
    client::SequenceBounds bounds;
    bounds.continuity = {1, 1};
    bounds.first = first;
    bounds.last = last;
    return {bounds};
}

const auto whole = sequence({-1000}, {1'000'000});

client::TableFrame table_frame(std::int64_t time, std::uint64_t tick, std::uint64_t life = 1,
                               std::uint32_t epoch = 1) {
    return {{time}, tick, {life, epoch}, tick, {}};
}

}  // namespace

TEST_CASE("frame_set_table: sets are of one life, epoch and tick, named by the first camera") {
    FrameSetTable table(2);
    table.add(0, table_frame(100, 1));
    table.add(0, table_frame(200, 2));
    table.add(0, table_frame(300, 3));
    table.add(0, table_frame(400, 4));
    table.add(1, table_frame(101, 1));
    table.add(1, table_frame(201, 2, 2));     // another life
    table.add(1, table_frame(301, 3, 1, 2));  // another epoch
    table.add(1, table_frame(399, 4));
    const auto sets = table.pair(whole);
    REQUIRE(sets.size() == 2);
    CHECK(sets[0].name == OutputTime{100});
    CHECK(sets[1].name == OutputTime{400});
    CHECK(sets[1].frames == std::vector<std::size_t>{3, 3});
    CHECK(table.frames(0)[1].left_out == SkipReason::incomplete);
    CHECK(table.frames(1)[2].left_out == SkipReason::incomplete);
    CHECK(table.frames(1)[3].left_out == SkipReason::no);
}

TEST_CASE("frame_set_table: all stamps of a set lie strictly between the IMU's samples") {
    FrameSetTable table(2);
    for (const std::int64_t time : {100, 200, 300}) {
        table.add(0, table_frame(time, static_cast<std::uint64_t>(time)));
        table.add(1, table_frame(time + 1, static_cast<std::uint64_t>(time)));
    }
    CHECK(table.pair(sequence({100}, {301})).size() == 1);
    CHECK(table.frames(1)[0].left_out == SkipReason::outside_imu);
    CHECK(table.frames(0)[2].left_out == SkipReason::outside_imu);
}

TEST_CASE("frame_set_table: names increase, whatever the clock did") {
    FrameSetTable table(1);
    table.add(0, table_frame(100, 1));
    table.add(0, table_frame(100, 2));
    table.add(0, table_frame(90, 3));
    table.add(0, table_frame(101, 4));
    CHECK(table.pair(whole).size() == 2);
    CHECK(table.frames(0)[1].left_out == SkipReason::not_later);
    CHECK(table.frames(0)[2].left_out == SkipReason::not_later);
}

TEST_CASE("frame_set_table: one camera needs no ticks, two cameras do, and each tick counts once") {
    FrameSetTable one(1);
    auto untriggered = table_frame(5, 0);
    untriggered.tick.reset();
    one.add(0, untriggered);
    CHECK(one.pair(whole).size() == 1);
    FrameSetTable two(2);
    two.add(0, untriggered);
    two.add(1, untriggered);
    two.add(0, table_frame(10, 3));
    two.add(0, table_frame(11, 3));
    two.add(1, table_frame(10, 3));
    two.add(1, table_frame(11, 3));
    CHECK(two.pair(whole).size() == 1);
    CHECK(two.frames(0)[0].left_out == SkipReason::incomplete);
    CHECK(two.frames(0)[2].left_out == SkipReason::incomplete);
    CHECK(two.frames(1)[2].left_out == SkipReason::incomplete);
}

// SPDX-License-Identifier: BSD-3-Clause
#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

std::vector<std::uint64_t> gaps(const std::vector<wire::Exposure>& records, std::size_t first,
                                std::size_t count) {
    std::vector<std::uint64_t> out;
    for (std::size_t i = first + 1; i <= first + count; ++i)
        out.push_back(records[i].tick - records[i - 1].tick);
    return out;
}

const std::vector<std::uint64_t> patterns[] = {{1, 2, 1, 3, 2, 2, 3, 3, 1, 1, 1, 1},
                                               {2, 2, 1, 1, 3, 2, 1, 1, 4, 2, 1, 1}};

}  // namespace

TEST_CASE(
    "015-start-pattern: each camera begins with the gaps of the protocol, at its own rate, "
    "whenever asked") {
    Scenario world;
    world.add_camera(0);
    world.add_camera(1, {}, 50'000'000);
    world.gaps_allowed = true;
    REQUIRE(world.begin(wire::start_pattern));
    world.run(3 * second);
    for (unsigned camera = 0; camera < 2; ++camera)
        CHECK(gaps(world.inbox().exposures[camera], 0, 12) == patterns[camera]);
    CHECK(count(world.inbox().exposures[0], wire::exposure_pattern) == 11);
    // Asked again while it runs, one camera alone begins anew.
    const std::size_t before = world.camera(1).pulses().size();
    world.start(2, wire::start_pattern);
    world.run(2 * second);
    CHECK(count(world.inbox().exposures[0], wire::exposure_pattern) == 11);
    CHECK(gaps(world.inbox().exposures[1], before, 12) == patterns[1]);
    world.finish();
    CHECK(world.judge() == "");
}

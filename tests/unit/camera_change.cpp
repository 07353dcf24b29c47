// SPDX-License-Identifier: BSD-3-Clause
#include "board/camera_change.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::daemon;

namespace {

struct BeforeAndAfter {
    BeforeAndAfter() {
        for (unsigned i = 0; i < 3; ++i) {
            before.cameras[i].flags = wire::camera_enabled;
            before.cameras[i].rate_uhz = 20'000'000;
        }
        after = before;
        after.id = 1;
    }
    CameraChange now() const { return camera_change(before, after); }

    wire::Configuration before{};
    wire::Configuration after{};
};

}  // namespace

TEST_CASE("camera_change: only the cameras that differ stop") {
    BeforeAndAfter change;
    CHECK(change.now().outputs == 0);
    change.after.cameras[1].exposure_ns = 1;
    CHECK(change.now().outputs == 0b010);
    CHECK(change.now().other_rate == 0);
    change.after.cameras[2].rate_uhz = 10'000'000;
    CHECK(change.now().outputs == 0b110);
    CHECK(change.now().other_rate == 0b100);
}

TEST_CASE("camera_change: all stop where ticks could not be equal any more") {
    BeforeAndAfter change;
    for (unsigned i = 0; i < 2; ++i) change.after.cameras[i].rate_uhz = 10'000'000;
    CHECK(change.now().outputs == 0b011);
    change.after.cameras[2].rate_uhz = 10'000'000;
    CHECK(change.now().outputs == 0b111);
    change.before.cameras[2].rate_uhz = 10'000'000;
    CHECK(change.now().outputs == 0);      // it goes on, with ticks that the others do not get
    change.after.cameras[2].phase_ns = 1;  // stopped, it keeps its ticks all the same
    CHECK(change.now().outputs == 0);
    change.before.cameras[2].flags = change.after.cameras[2].flags = 0;
    change.after.cameras[2].phase_ns = change.before.cameras[2].phase_ns;
    CHECK(change.now().outputs == 0b011);
}

TEST_CASE("camera_change: all stop for what is more than settings of single cameras") {
    const auto needs_all = [](auto alter) {
        BeforeAndAfter change;
        change.after.cameras[0].exposure_ns = 1;
        alter(change);
        return change.now().outputs == 0;
    };
    CHECK_FALSE(needs_all([](BeforeAndAfter&) {}));
    CHECK(needs_all([](BeforeAndAfter& it) { it.after.flags = wire::configuration_store; }));
    CHECK(needs_all([](BeforeAndAfter& it) { it.before.flags = wire::configuration_store; }));
    CHECK(needs_all([](BeforeAndAfter& it) { it.after.ports.test = 1; }));
    CHECK(needs_all([](BeforeAndAfter& it) { it.after.ports.reserved[2] = 1; }));
    CHECK(needs_all([](BeforeAndAfter& it) { it.after.imus[0].filter = 1; }));
    CHECK(needs_all([](BeforeAndAfter& it) { it.after.illumination.lead_ns = 1; }));
    CHECK(
        needs_all([](BeforeAndAfter& it) { it.after.cameras[1].flags |= wire::camera_no_strobe; }));
    CHECK(needs_all([](BeforeAndAfter& it) { it.after.cameras[3].flags = wire::camera_enabled; }));
    CHECK(needs_all([](BeforeAndAfter& it) { it.after.cameras[3].rate_uhz = 1; }));
    CHECK(needs_all([](BeforeAndAfter& it) {
        it.before.cameras[3].flags = wire::camera_enabled | wire::camera_slave;
        it.after.cameras[3].flags = it.before.cameras[3].flags;
    }));
    CHECK(needs_all([](BeforeAndAfter& it) {
        it.before.cameras[0].flags |= wire::camera_slave;
        it.before.cameras[0].master = 1;
        it.after.cameras[0].flags = it.before.cameras[0].flags;
        it.after.cameras[0].master = 1;
    }));
}

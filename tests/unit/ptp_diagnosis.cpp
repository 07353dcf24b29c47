// SPDX-License-Identifier: BSD-3-Clause
#include "health/ptp_diagnosis.hpp"

#include <catch2/catch.hpp>

#include "health/status.hpp"

using namespace versavis;
using namespace versavis::daemon;
using Catch::Contains;

namespace {

/// Two cameras that follow PTP, and all is well.
struct PtpCameras {
    PtpCameras() {
        status.ptp.emplace();
        for (const char* name : {"cam0", "cam1"}) {
            CameraStatus camera;
            camera.name = name;
            camera.configuration.trigger = TriggerSource::ptp;
            camera.pipeline.commanded_exposure = milliseconds(3);
            camera.recent.received = camera.recent.triggers = 40;
            status.cameras.push_back(camera);
            PtpClockReport clock;
            clock.name = name;
            clock.status.state = "Slave";
            clock.status.grandmaster = "00a1";
            clock.agreement = clock::Agreement::agrees;
            status.ptp->clocks.push_back(clock);
        }
    }

    PtpFinding cam0() const { return diagnose_ptp(status.cameras[0], status); }

    void check(Fault fault, const std::string& words) const {
        CHECK(cam0().fault == fault);
        CHECK_THAT(cam0().hint, Contains(words));
    }

    std::uint64_t& misfits() {
        return status.cameras[0].recent.refused[static_cast<std::size_t>(EventReason::mismatch)];
    }

    Status status;
};

}  // namespace

TEST_CASE("ptp_diagnosis: nothing is wrong with a slave that agrees, nor with other cameras") {
    PtpCameras bench;
    CHECK(bench.cam0().fault == Fault::none);
    bench.status.ptp->clocks[0].agreement = clock::Agreement::unknown;
    CHECK(bench.cam0().fault == Fault::none);
    bench.status.ptp->clocks[0].status.state = "Master";
    bench.status.cameras[0].configuration.trigger = TriggerSource::board;
    CHECK(bench.cam0().fault == Fault::none);
}

TEST_CASE("ptp_diagnosis: a master is named to all cameras") {
    PtpCameras bench;
    bench.status.ptp->master = "cam1";
    bench.check(Fault::ptp_master, "cam1 is a PTP master");
}

TEST_CASE("ptp_diagnosis: the state of the port says what is missing") {
    PtpCameras bench;
    PtpStatus& port = bench.status.ptp->clocks[0].status;
    for (const auto& [state, words] : {std::pair{"", "does not say"},
                                       {"Listening", "ptp4l"},
                                       {"Passive", "slave only"},
                                       {"Uncalibrated", "begins to follow"},
                                       {"Disabled", "restart the camera"}}) {
        port.state = state;
        bench.check(Fault::ptp_lost, words);
    }
    port.state = "Slave";
    port.servo_locked = false;
    bench.check(Fault::ptp_lost, "servo");
}

TEST_CASE("ptp_diagnosis: another time is explained by another grandmaster, if there is one") {
    PtpCameras bench;
    PtpClockReport& clock = bench.status.ptp->clocks[0];
    clock.agreement = clock::Agreement::differs;
    bench.check(Fault::ptp_other_time, "second PTP master");
    clock.status.grandmaster = "00b2";
    bench.check(Fault::ptp_other_time, "00b2 instead of 00a1");
}

TEST_CASE("ptp_diagnosis: the board's word is about all cameras") {
    PtpCameras bench;
    bench.status.ptp->contradicted = "cam1";
    bench.status.cameras[1].pipeline.strobe = StrobeReport{9, 3, milliseconds(2)};
    bench.check(Fault::ptp_contradicted, "exposures of cam1 begin 2000 us earlier");
    bench.status.cameras[1].pipeline.strobe->error = milliseconds(-2);
    bench.check(Fault::ptp_contradicted, "2000 us later");
}

TEST_CASE("ptp_diagnosis: refused actions, by what the camera answers") {
    PtpCameras bench;
    bench.status.cameras[0].recent.actions_refused = 3;
    CHECK(bench.cam0().fault == Fault::none);  // of forty
    bench.status.cameras[0].recent.actions_refused = 30;
    for (const auto& [code, words] : {std::pair<std::uint16_t, const char*>{0x8013, "follows no"},
                                      {0x8015, "rate_hz"},
                                      {0x8016, "too late"},
                                      {0x8001, "0x8001"}}) {
        bench.status.cameras[0].pipeline.refusal = code;
        bench.check(Fault::ptp_refused, words);
    }
}

TEST_CASE("ptp_diagnosis: stamps that fit no trigger, by what they fit instead") {
    PtpCameras bench;
    bench.misfits() = 40;
    Duration& off = bench.status.cameras[0].pipeline.start_delay;
    off = milliseconds(3) + microseconds(40);
    bench.check(Fault::ptp_stamps, "stamp_instant = \"end\"");
    off = microseconds(1480);
    bench.check(Fault::ptp_stamps, "stamp_instant = \"middle\"");
    off = microseconds(700);
    bench.check(Fault::ptp_stamps, "latency_us = 700");
    off = seconds(-37);
    bench.check(Fault::ptp_stamps, "-37.000 s off what its own clock shows");
    off = seconds(-1'700'000'000);
    bench.check(Fault::ptp_stamps, "another clock");
    bench.status.cameras[0].pipeline.commanded_exposure = {};
    off = milliseconds(3);
    bench.check(Fault::ptp_stamps, "latency_us = 3000");
}

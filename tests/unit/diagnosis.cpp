// SPDX-License-Identifier: BSD-3-Clause
#include "health/diagnosis.hpp"

#include <catch2/catch.hpp>
#include <cerrno>
#include <fstream>
#include <set>

#include "base/log.hpp"
#include "health/status.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

const HostTime diagnosed_at{100'000'000'000};

/// A minute after the start, a camera at 20 Hz and an IMU deliver; the last second was looked at.
struct DiagnosisBench {
    DiagnosisBench() {
        status.now = diagnosed_at;
        status.started = diagnosed_at - seconds(60);
        status.board.state = BoardState::running;
        status.board.connections = 1;
        status.clock.state = clock::ClockState::locked;
        status.cameras.resize(2);
        for (std::size_t i = 0; i < 2; ++i) {
            CameraStatus& camera = status.cameras[i];
            camera.name = camera.configuration.name = i == 0 ? "cam0" : "cam1";
            camera.configuration.device = i == 0 ? "127.0.0.2" : "127.0.0.3";
            camera.configuration.output = static_cast<unsigned>(i);
            camera.camera.state = CameraState::streaming;
            camera.camera.packet_size = 9000;
            camera.pipeline.pairing = pairing::State::locked;
            camera.pipeline.last_sign = camera.pipeline.last_record = diagnosed_at;
            camera.pipeline.commanded_exposure = camera.pipeline.exposure = milliseconds(3);
            camera.recent.received = camera.recent.published = camera.recent.triggers = 20;
            camera.delivery = {true, true, false, diagnosed_at - seconds(59), 20};
        }
        ImuStatus imu;
        imu.report.name = "imu0";
        imu.report.model = "adis16448";
        imu.report.rate_hz = 200;
        imu.report.working = true;
        imu.recent.published = 200;
        imu.delivery = {true, true, false, diagnosed_at - seconds(59), 200};
        status.imus.push_back(imu);
    }

    Diagnosis camera() {
        board();
        return diagnose(status.cameras[0], status);
    }
    Diagnosis imu() {
        board();
        return diagnose(status.imus[0], status);
    }
    Diagnosis board() {
        status.board_diagnosis = diagnose_board(status);
        status.clock_diagnosis = diagnose_clock(status);
        return status.board_diagnosis;
    }

    CameraStatus& cam() { return status.cameras[0]; }

    /// So many frames of the last second were published, and the rest refused.
    void refuse(EventReason reason, std::uint64_t frames) {
        const bool whole =
            reason != EventReason::frame_incomplete && reason != EventReason::wrong_size;
        cam().delivery.full = false;
        cam().recent.published -= frames;
        if (!whole) {
            cam().recent.received -= frames;
            cam().recent.incomplete = frames;
        }
        cam().recent.refused[static_cast<std::size_t>(reason)] = frames;
    }

    Status status;
};

using Catch::Contains;

void check_fault(const Diagnosis& diagnosis, Fault fault, const std::string& words) {
    INFO(to_string(diagnosis.fault) << ": " << diagnosis.hint);
    CHECK(diagnosis.fault == fault);
    CHECK(diagnosis.health == Health::degraded);
    CHECK_THAT(diagnosis.hint, Contains(words));
}

}  // namespace

TEST_CASE("diagnosis: what delivers is well, and keeps the remarks of its camera") {
    DiagnosisBench bench;
    CHECK(bench.board().health == Health::ok);
    CHECK(bench.status.clock_diagnosis.health == Health::ok);
    CHECK(bench.imu().fault == Fault::none);
    bench.cam().camera.hint = "the camera is at 80 degrees";
    CHECK(bench.camera().health == Health::ok);
    CHECK(bench.camera().hint == "the camera is at 80 degrees");
}

TEST_CASE("diagnosis: a board that runs has remarks, and no fault, for sync and storage") {
    DiagnosisBench bench;
    for (const auto state : {wire::SyncState::none, wire::SyncState::followed}) {
        bench.status.board.health.sync_state = state;
        CHECK(bench.board().hint.empty());
    }
    bench.status.release = "0.2.0";
    bench.status.board.firmware = "versavis 0.1.0";
    CHECK_THAT(bench.board().hint, Contains("versavis 0.1.0, is older than this service, 0.2.0") &&
                                       Contains("'versavis flash /") && Contains("/versavis.uf2'"));
    CHECK(bench.board().health == Health::ok);
    bench.status.board.health.sync_state = wire::SyncState::lost;
    CHECK_THAT(bench.board().hint, Contains("do not fit the grid") && Contains("'sync_rate_hz'"));
    CHECK(bench.board().health == Health::ok);
    CHECK(bench.board().fault == Fault::none);
    bench.status.board.awaits_sync = true;
    CHECK_THAT(bench.board().hint, Contains("begin with pulses") && Contains("'sync_rate_hz'"));
    CHECK(bench.board().fault == Fault::none);
    bench.status.board.unkept = true;
    CHECK_THAT(bench.board().hint, Contains("keep_configuration = false"));
    bench.status.board.hint = "what comes first";
    CHECK(bench.board().hint == "what comes first");
    CHECK(bench.board().health == Health::ok);
}

TEST_CASE("diagnosis: a camera that cannot be had says why, in its own words") {
    const std::pair<CameraState, Fault> states[] = {
        {CameraState::absent, Fault::camera_absent},
        {CameraState::unreachable, Fault::camera_unreachable},
        {CameraState::busy, Fault::camera_busy},
        {CameraState::misconfigured, Fault::camera_misconfigured},
        {CameraState::failed, Fault::camera_failed}};
    for (const auto& [state, fault] : states) {
        DiagnosisBench bench;
        bench.cam().camera.state = state;
        bench.cam().camera.hint = "its own words";
        check_fault(bench.camera(), fault, "its own words");
    }
    DiagnosisBench silent;
    silent.cam().camera.state = CameraState::silent;
    check_fault(silent.camera(), Fault::camera_silent, "cable and power");
}

TEST_CASE("diagnosis: a camera that something still holds is no stranger's") {
    DiagnosisBench bench;
    bench.cam().camera.state = CameraState::opening;
    bench.cam().camera.hint = "its frame numbers started over";
    check_fault(bench.camera(), Fault::starting, "its frame numbers started over");
    bench.cam().camera.held = true;
    bench.cam().camera.hint = "it is still locked";
    check_fault(bench.camera(), Fault::camera_lease, "still locked");
}

TEST_CASE("diagnosis: without the board, triggered cameras, IMUs and the clock name the board") {
    DiagnosisBench bench;
    bench.status.board.state = BoardState::absent;
    bench.status.board.hint = "plug it in";
    bench.status.clock.state = clock::ClockState::holdover;
    check_fault(bench.board(), Fault::board_gone, "plug it in");
    check_fault(bench.camera(), Fault::board_gone, "no triggers: the board is gone");
    check_fault(bench.imu(), Fault::board_gone, "no samples: the board");
    check_fault(bench.status.clock_diagnosis, Fault::board_gone, "board");
    bench.cam().configuration.trigger = TriggerSource::free_run;
    CHECK(bench.camera().health == Health::ok);
    bench.status.board_needed = false;
    CHECK(bench.board().health == Health::ok);
}

TEST_CASE("diagnosis: a board that does not answer, or refuses, is the cause as well") {
    DiagnosisBench bench;
    bench.status.clock.since_contact = milliseconds(1200);
    check_fault(bench.board(), Fault::board_silent, "1.2 s");
    check_fault(bench.camera(), Fault::board_silent, "does not answer");
    bench.status.board.state = BoardState::handshake;
    check_fault(bench.board(), Fault::board_silent, "silent for");
    bench.status.board.state = BoardState::refused;
    bench.status.board.hint = "output 3 is used twice";
    check_fault(bench.board(), Fault::board_refuses, "used twice");
    check_fault(bench.camera(), Fault::board_refuses, "refuses");
}

TEST_CASE("diagnosis: a board whose stamps fail their test is the cause of what is not measured") {
    DiagnosisBench bench;
    bench.status.board.health.stamp_test = wire::StampTest::passed;
    CHECK(bench.board().health == Health::ok);
    bench.status.board.health.stamp_test = wire::StampTest::failed;
    check_fault(bench.board(), Fault::board_stamps, "GPIO18");
    check_fault(bench.camera(), Fault::board_stamps, "see the board's hint");
    CHECK(bench.status.clock_diagnosis.health == Health::ok);
    CHECK(bench.imu().fault == Fault::none);  // it does without a data-ready line
    bench.status.imus[0].delivery.full = false;
    check_fault(bench.imu(), Fault::board_stamps, "see the board's hint");
    bench.cam().configuration.strobe = Strobe::none;
    CHECK(bench.camera().health == Health::ok);
}

TEST_CASE("diagnosis: the clock says what its state means") {
    DiagnosisBench bench;
    const std::pair<clock::ClockState, Fault> states[] = {
        {clock::ClockState::init, Fault::clock_unknown},
        {clock::ClockState::reset, Fault::clock_unknown},
        {clock::ClockState::holdover, Fault::clock_holdover},
        {clock::ClockState::step, Fault::clock_step}};
    for (const auto& [state, fault] : states) {
        bench.status.clock.state = state;
        check_fault(diagnose_clock(bench.status), fault, "");
    }
    bench.status.clock.state = clock::ClockState::locked;
    CHECK(diagnose_clock(bench.status).health == Health::ok);
    bench.status.clock.pps.second_difference = -1;
    check_fault(diagnose_clock(bench.status), Fault::seconds_differ,
                "is 1 s behind the host: has it");
    bench.status.clock.pps.second_difference = 18;
    check_fault(diagnose_clock(bench.status), Fault::seconds_differ,
                "is 18 s ahead of the host: has it");
    bench.status.clock.pps.second_difference = 0;
    CHECK(diagnose_clock(bench.status).health == Health::ok);
    bench.status.clock.state = clock::ClockState::reset;
    check_fault(bench.camera(), Fault::clock_unknown, "withheld");
}

TEST_CASE("diagnosis: a host that names the seconds of PPS must be disciplined") {
    DiagnosisBench bench;
    for (const auto labels : {clock::PpsLabels::off, clock::PpsLabels::nmea}) {
        bench.status.pps_labels = labels;
        CHECK(diagnose_clock(bench.status).health == Health::ok);
    }
    bench.status.pps_labels = clock::PpsLabels::host;
    check_fault(diagnose_clock(bench.status), Fault::host_undisciplined,
                "PPS is not used: the kernel reports that the host's clock, which names its "
                "seconds, is not disciplined; start chrony, or ptp4l and phc2sys, or set pps = "
                "\"nmea\"");
    bench.status.started = diagnosed_at - seconds(3);
    CHECK(diagnose_clock(bench.status).health == Health::starting);  // so may be its discipline
    bench.status.clock.kernel.synchronised = true;
    CHECK(diagnose_clock(bench.status).health == Health::ok);
    bench.status.clock.kernel = {};
    bench.status.clock.kernel.error = EPERM;
    check_fault(diagnose_clock(bench.status), Fault::host_undisciplined,
                "PPS is not used: whether the host's clock, which names its seconds, is "
                "disciplined cannot be read (Operation not permitted); leave the container or "
                "remove the drop-in closed.conf that forbids it, or set pps = \"nmea\"");
}

TEST_CASE("diagnosis: a start in progress is reported, and is no fault of a young service") {
    DiagnosisBench bench;
    bench.cam().delivery = {false, false, false, diagnosed_at - seconds(2), 0};
    CHECK(bench.camera().fault == Fault::starting);
    CHECK(bench.camera().health == Health::degraded);
    bench.status.started = diagnosed_at - seconds(3);
    CHECK(bench.camera().health == Health::starting);
    bench.cam().camera.state = CameraState::absent;
    CHECK(bench.camera().fault == Fault::camera_absent);
    CHECK(bench.camera().health == Health::starting);
    bench.cam().delivery.ever = true;
    CHECK(bench.camera().health == Health::degraded);
}

TEST_CASE("diagnosis: lost packets are distinguished from packets that do not pass, in numbers") {
    DiagnosisBench bench;
    bench.refuse(EventReason::frame_incomplete, 10);
    check_fault(bench.camera(), Fault::packet_loss, "10 of the last 20 frames");
    bench.refuse(EventReason::frame_incomplete, 10);
    bench.cam().recent.incomplete = 20;
    bench.cam().recent.refused[1] = 20;
    check_fault(bench.camera(), Fault::packet_size, "9000 bytes");
    bench.cam().camera.packet_size = 1500;
    check_fault(bench.camera(), Fault::packet_loss, "20 of the last 20");
    bench.cam().camera.bandwidth.link_mbps = 100;
    bench.cam().camera.bandwidth.link_needed_mbps = 300;
    bench.cam().camera.hint = "the link carries 100 Mbit/s";
    check_fault(bench.camera(), Fault::link_full, "100 Mbit/s");
}

TEST_CASE("diagnosis: a free camera whose frames are incomplete is not well either") {
    DiagnosisBench bench;
    bench.cam().configuration.trigger = TriggerSource::free_run;
    bench.refuse(EventReason::frame_incomplete, 20);
    check_fault(bench.camera(), Fault::packet_size, "MTU");
    DiagnosisBench slow;
    slow.cam().configuration.trigger = TriggerSource::free_run;
    slow.cam().delivery = {false, true, false, diagnosed_at - seconds(50), 12};
    check_fault(slow.camera(), Fault::rate_too_high, "12.0 of 20 Hz");
}

TEST_CASE("diagnosis: frames of a wrong size, and frames without a slot") {
    DiagnosisBench bench;
    bench.refuse(EventReason::wrong_size, 15);
    check_fault(bench.camera(), Fault::wrong_size, "15 of the last 20");
    DiagnosisBench starved;
    starved.cam().delivery.full = false;
    starved.cam().recent.no_buffer = 3;
    check_fault(starved.camera(), Fault::no_buffer, "slots");
}

TEST_CASE("diagnosis: no triggers, of the board or of the master") {
    DiagnosisBench bench;
    bench.cam().delivery.full = false;
    bench.cam().recent = {};
    bench.cam().pipeline.last_record = diagnosed_at - seconds(5);
    check_fault(bench.camera(), Fault::no_triggers, "'output'");
    bench.cam().configuration.master = "cam1";
    check_fault(bench.camera(), Fault::no_triggers, "cam1");
}

TEST_CASE("diagnosis: a board that triggers slowly, or over a slow link, is not blamed") {
    DiagnosisBench bench;
    bench.cam().delivery.full = false;
    bench.cam().recent = {};  // nothing within the last second
    bench.cam().pipeline.pairing = pairing::State::searching;
    bench.cam().pipeline.last_record =
        diagnosed_at - milliseconds(3200);  // 1.75 s apart, at the slowest
    CHECK(bench.camera().fault != Fault::no_triggers);
    bench.cam().pipeline.last_record = diagnosed_at - milliseconds(3300);
    check_fault(bench.camera(), Fault::no_triggers, "'output'");
    bench.status.clock.round_trip = milliseconds(400);
    CHECK(bench.camera().fault != Fault::no_triggers);
    bench.cam().pipeline.last_record = {};
    bench.cam().delivery = {false, true, true, diagnosed_at - seconds(3),
                            0};  // it was asked just now
    CHECK(bench.camera().fault != Fault::no_triggers);
}

TEST_CASE("diagnosis: what a slow link still holds is neither missing nor too much") {
    DiagnosisBench bench;
    bench.cam().delivery.full = false;
    bench.cam().pipeline.record_delay = milliseconds(190);
    bench.cam().recent.published = 16;
    bench.cam().recent.received = 24;  // of which the records of four are on their way
    CHECK(bench.camera().fault == Fault::too_slow);
    bench.cam().recent.received = 16;  // the rate fell four periods ago
    CHECK(bench.camera().fault == Fault::too_slow);
    bench.cam().recent.received = 30;
    check_fault(bench.camera(), Fault::double_frames, "sends 30 frames for 20 triggers");
    bench.cam().recent.received = 10;
    check_fault(bench.camera(), Fault::no_frames, "10 of the last 20 exposures have no frame");
}

TEST_CASE("diagnosis: a slow start's pauses are no camera that does not expose") {
    DiagnosisBench bench;
    bench.refuse(EventReason::unproved, 20);
    bench.cam().recent.received = bench.cam().recent.triggers = bench.cam().recent.unmeasured = 4;
    bench.cam().pipeline.measured = false;
    bench.cam().pipeline.last_sign = diagnosed_at - milliseconds(900);
    bench.cam().pipeline.last_record = diagnosed_at - milliseconds(860);
    check_fault(bench.camera(), Fault::strobe_missing, "exposure line");
    bench.cam().pipeline.last_record = diagnosed_at;
    check_fault(bench.camera(), Fault::no_exposure, "no response to triggers for 0.9 s");
}

TEST_CASE("diagnosis: an exposure line that rises before its trigger") {
    DiagnosisBench bench;
    bench.refuse(EventReason::unproved, 20);
    bench.cam().pipeline.answers.lead = microseconds(380);
    check_fault(bench.camera(), Fault::line_delays, "rises 0.38 ms before the trigger");
    bench.cam().configuration.strobe = Strobe::none;
    check_fault(bench.camera(), Fault::unproved, "do not follow");
}

TEST_CASE("diagnosis: a board that is being set up is not silent") {
    DiagnosisBench bench;
    bench.status.board.state = BoardState::handshake;
    CHECK(bench.board().fault == Fault::starting);
    bench.status.clock.since_contact = milliseconds(1200);
    check_fault(bench.board(), Fault::board_silent, "silent for 1.2 s");
}

TEST_CASE("diagnosis: late records are reported with how late they are") {
    DiagnosisBench bench;
    bench.refuse(EventReason::exposure_missing, 20);
    bench.cam().pipeline.record_delay = milliseconds(46);
    bench.cam().pipeline.records_late_by = milliseconds(45);
    check_fault(bench.camera(), Fault::late_records,
                "the board's records arrive 46 ms after the exposure, 45 ms later than before: "
                "frames are withheld until exchanges show that this is the link, and no step of "
                "the board's clock; lower the load of host and USB");
    bench.cam().pipeline.record_delay = milliseconds(600);
    check_fault(bench.camera(), Fault::late_records, "600 ms");
}

TEST_CASE("diagnosis: an exposure longer than the period, and a rate that the camera cannot do") {
    DiagnosisBench bench;
    bench.cam().delivery = {false, true, false, diagnosed_at - seconds(50), 10};
    bench.cam().recent.received = bench.cam().recent.published = 10;
    bench.cam().recent.unmeasured = 10;
    check_fault(bench.camera(), Fault::rate_too_high, "10.0 of 20 Hz");
    bench.cam().pipeline.commanded_exposure = milliseconds(60);
    check_fault(bench.camera(), Fault::exposure_too_long, "60000 us");
}

TEST_CASE("diagnosis: a camera that takes every n-th trigger says so from the start on") {
    DiagnosisBench bench;
    bench.cam().delivery = {false, false, false, diagnosed_at - seconds(1), 10};
    bench.cam().recent.received = bench.cam().recent.published = 10;
    bench.cam().recent.unmeasured = bench.cam().recent.answers.ignored = 10;
    bench.cam().pipeline.answers.every = 2;
    bench.cam().pipeline.answers.shortest = milliseconds(100);
    check_fault(
        bench.camera(), Fault::rate_too_high,
        "takes every 2nd trigger: exposure (3 ms) and readout need more than 50 ms, and at most "
        "100 ms: lower 'rate_hz' to 10,");
    bench.cam().pipeline.answers.every = 3;
    bench.cam().pipeline.answers.shortest = milliseconds(150);
    check_fault(bench.camera(), Fault::rate_too_high, "every 3rd trigger");
}

TEST_CASE("diagnosis: triggers ignored at random, and frames that nobody asked for, in numbers") {
    DiagnosisBench bench;
    bench.cam().delivery = {false, true, false, diagnosed_at - seconds(50), 16};
    bench.cam().recent.received = bench.cam().recent.published = 16;
    bench.cam().recent.unmeasured = bench.cam().recent.answers.ignored = 4;
    check_fault(bench.camera(), Fault::triggers_ignored,
                "ignores 20 % of triggers: 4 of the last 20;");
    bench.cam().recent.received = 20;  // its line is what is silent
    check_fault(bench.camera(), Fault::strobe_missing, "exposure line");
    bench.cam().recent.received = 40;
    check_fault(bench.camera(), Fault::double_frames, "sends 40 frames for 20 triggers");
    bench.cam().recent.records_doubted = 20;  // of which nothing else is known
    CHECK(bench.camera().fault != Fault::double_frames);
}

TEST_CASE("diagnosis: triggers ignored without an exposure line: by events, and by block ids") {
    DiagnosisBench bench;
    bench.refuse(EventReason::unproved, 8);
    bench.cam().configuration.strobe = Strobe::none;
    bench.cam().pipeline.pairing = pairing::State::searching;
    bench.cam().recent.received = 16;
    check_fault(
        bench.camera(), Fault::triggers_ignored,
        "ignores 20 % of triggers: 4 of the last 20; it may still be exposing or reading "
        "out, or miss the pulses: lower 'rate_hz' or ExposureTime, check the trigger cable");
    bench.cam().recent.answers.ids_skipped = 4;  // these were sent, and got lost
    CHECK(bench.camera().fault != Fault::triggers_ignored);
    bench.cam().recent.triggers_missed = 5;
    bench.cam().delivery = {false, false, false, diagnosed_at - seconds(2), 0};  // even in a start
    check_fault(bench.camera(), Fault::triggers_ignored, "ignores 25 % of triggers: 5 of the last");
}

TEST_CASE("diagnosis: an exposure that changes without the service is no surplus of frames") {
    DiagnosisBench bench;
    bench.refuse(EventReason::unproved, 12);
    bench.cam().recent.triggers = 12;
    bench.cam().recent.records_doubted = 8;
    bench.cam().pipeline.doubted_exposure = milliseconds(6);
    check_fault(bench.camera(), Fault::wrong_exposure,
                "its exposure line suddenly shows 6000 us: frames are withheld until that lasts; "
                "did another program, or the camera itself, change ExposureTime?");
    DiagnosisBench seen;
    seen.cam().pipeline.exposure_contradicted = true;
    seen.cam().pipeline.camera_exposure = milliseconds(5);
    check_fault(seen.camera(), Fault::wrong_exposure,
                "the exposure line shows 3000 us, but the camera was to expose 5000 us: unless "
                "ExposureTime was changed, check 'strobe_line' and its LineSource, or set "
                "check_exposure = false");
}

TEST_CASE("diagnosis: packets without frames are no network's fault") {
    DiagnosisBench bench;
    bench.cam().delivery = {false, false, false, diagnosed_at - seconds(1), 0};
    bench.cam().recent.received = bench.cam().recent.published = 0;
    bench.cam().pipeline.last_sign = diagnosed_at - seconds(1);
    check_fault(bench.camera(), Fault::no_frames, "check network, firewall");
    bench.cam().camera.deaf = true;
    check_fault(bench.camera(), Fault::block_ids,
                "packets arrive, but no frame completes: its block ids stand still or start over, "
                "or the end of each frame is lost; it is reopened, and if that does not help, "
                "update its firmware");
}

TEST_CASE("diagnosis: a start has its reason, and a long set-up its time") {
    DiagnosisBench bench;
    bench.cam().delivery = {false, false, false, diagnosed_at - seconds(1), 0};
    bench.cam().camera.since = diagnosed_at - seconds(1);
    check_fault(bench.camera(), Fault::starting, "a start is in progress: its frames");
    bench.cam().camera.reopened = "the camera has restarted";
    check_fault(bench.camera(), Fault::starting,
                "it was reopened (the camera has restarted): its frames are being proved");
    bench.cam().camera.since = diagnosed_at - seconds(11);
    check_fault(bench.camera(), Fault::starting, "a start is in progress: its frames");
    bench.cam().camera.state = CameraState::opening;
    check_fault(bench.camera(), Fault::starting, "it is being opened and set up");
    bench.cam().camera.setting_up = milliseconds(7900);
    check_fault(bench.camera(), Fault::starting,
                "it is being set up, which has taken 7 s so far: a new description takes up to 10 "
                "s, a slow control channel longer");
}

TEST_CASE("diagnosis: block ids that do not count") {
    DiagnosisBench bench;
    bench.refuse(EventReason::unproved, 20);
    AnswerReport& answers = bench.cam().recent.answers;
    answers.ids_repeated = 20;
    answers.block_id = 1;
    check_fault(bench.camera(), Fault::block_ids, "20 frames arrived, all with block id 1");
    answers.ids_repeated = 0;
    answers.ids_restarted = 2;
    check_fault(bench.camera(), Fault::block_ids, "ids restarted 2 times");
    bench.cam().camera.renumbers = true;
    bench.cam().camera.state = CameraState::opening;
    bench.cam().camera.hint = "it is being reopened";
    check_fault(bench.camera(), Fault::block_ids, "keep restarting, and it is reopened");
    bench.cam().camera.state = CameraState::streaming;
    bench.cam().delivery.full = true;  // the fault has ended
    bench.cam().camera.hint.clear();
    CHECK(bench.camera().fault == Fault::none);
}

TEST_CASE("diagnosis: a clock in another unit is a remark when frames are paired without it") {
    DiagnosisBench bench;
    bench.cam().pipeline.answers.clock_rate = 8;
    CHECK(bench.camera().health == Health::ok);
    CHECK_THAT(bench.camera().hint, Contains("its clock runs at 8 times its stated rate"));
    bench.refuse(EventReason::unproved, 20);
    check_fault(bench.camera(), Fault::camera_clock, "camera_clock = false");
}

TEST_CASE("diagnosis: one that may be restarting is not blamed on its trigger cable") {
    DiagnosisBench bench;
    bench.cam().delivery = {false, true, true, diagnosed_at - seconds(50), 0};
    bench.cam().recent = {};
    bench.cam().recent.triggers = bench.cam().recent.unmeasured = 20;
    bench.cam().pipeline.measured = false;
    bench.cam().pipeline.last_sign = diagnosed_at - milliseconds(5900);
    check_fault(bench.camera(), Fault::no_exposure, "for 5.9 s; it may be restarting");
    bench.cam().pipeline.last_sign = diagnosed_at - milliseconds(6100);
    check_fault(bench.camera(), Fault::no_exposure, "trigger cable is on output 0");
}

TEST_CASE("diagnosis: an inverted exposure line rises where the exposure ends") {
    DiagnosisBench bench;
    bench.cam().recent.unmeasured = 20;
    bench.cam().pipeline.start_delay = microseconds(3020);
    check_fault(bench.camera(), Fault::strobe_inverted, "active_low");
    bench.cam().configuration.strobe = Strobe::active_low;
    check_fault(bench.camera(), Fault::strobe_inverted, "active_high");
    bench.cam().pipeline.start_delay = microseconds(20);
    check_fault(bench.camera(), Fault::strobe_missing, "exposure line");
}

TEST_CASE("diagnosis: cable of the trigger, cable of the strobe, network: which one is it?") {
    DiagnosisBench trigger;
    trigger.cam().delivery = {false, false, false, diagnosed_at - seconds(59), 0};
    trigger.cam().recent.received = trigger.cam().recent.published = 0;
    trigger.cam().recent.unmeasured = 20;
    trigger.cam().pipeline.measured = false;
    trigger.cam().pipeline.last_sign = diagnosed_at - seconds(1);
    check_fault(trigger.camera(), Fault::no_exposure, "output 0");
    trigger.cam().recent.received = 14;  // before it was cut
    trigger.cam().recent.unmeasured = 6;
    trigger.cam().pipeline.last_sign = diagnosed_at - milliseconds(350);
    check_fault(trigger.camera(), Fault::no_exposure, "output 0");
    DiagnosisBench strobe;
    strobe.cam().recent.unmeasured = 20;
    check_fault(strobe.camera(), Fault::strobe_missing, "measured");
    strobe.cam().pipeline.commanded_exposure = nanoseconds(4'900);
    check_fault(strobe.camera(), Fault::strobe_missing,
                "exposures of 4.9 us as glitches: lower 'glitch_us' (now 5 us)");
    DiagnosisBench network;
    network.cam().delivery.full = false;
    network.cam().pipeline.last_sign = diagnosed_at - seconds(1);
    network.cam().recent.received = network.cam().recent.published = 0;
    check_fault(network.camera(), Fault::no_frames, "20 of the last 20");
    DiagnosisBench load;
    load.cam().pipeline.edges.line = "Line1";
    load.cam().pipeline.edges.frames = 32;
    load.cam().pipeline.edges.difference = microseconds(-80);
    load.cam().pipeline.edges.sigma = microseconds(2);
    check_fault(load.camera(), Fault::line_delays, "Line1");
    DiagnosisBench contradicted;
    contradicted.cam().pipeline.exposure_contradicted = true;
    contradicted.cam().pipeline.camera_exposure = milliseconds(5);
    check_fault(contradicted.camera(), Fault::wrong_exposure, "5000 us");
}

TEST_CASE("diagnosis: triggers of another output") {
    DiagnosisBench swapped;
    swapped.refuse(EventReason::unproved, 20);
    swapped.cam().pipeline.pairing = pairing::State::searching;
    check_fault(swapped.camera(), Fault::unproved, "swapped");
    DiagnosisBench busy;
    busy.refuse(EventReason::unproved, 15);
    check_fault(busy.camera(), Fault::unproved, "only 5 of the last 20 frames were proved");
    DiagnosisBench unknown;
    unknown.cam().delivery = {false, true, false, diagnosed_at - seconds(50), 17};
    check_fault(unknown.camera(), Fault::too_slow, "17.0 of 20 Hz");
}

TEST_CASE("diagnosis: of an IMU: nobody answers, another part does, it is silent, or flawed") {
    DiagnosisBench bench;
    ImuStatus& imu = bench.status.imus[0];
    imu.delivery.full = false;
    imu.report.working = false;
    imu.report.failure = {wire::BoardEventKind::imu_failed, 1, 0, 5, diagnosed_at};
    check_fault(bench.imu(), Fault::imu_missing, "adis16448");
    imu.report.failure.answer = 120;
    check_fault(bench.imu(), Fault::imu_wrong, "0x78");
    imu.report.failure.step = imu_step_running;
    check_fault(bench.imu(), Fault::imu_failed, "set up again");
    imu.report.failure.kind = wire::BoardEventKind::imu_silent;
    check_fault(bench.imu(), Fault::imu_silent, "nothing");
    imu.report.failure = {};
    imu.recent.faulty = 100;
    check_fault(bench.imu(), Fault::imu_faulty, "100 of the last 200");
    imu.recent = {};
    check_fault(bench.imu(), Fault::imu_silent, "no samples");
    imu.recent.published = 100;
    imu.delivery.rate_hz = 100;
    check_fault(bench.imu(), Fault::too_slow, "100.0 of 200 Hz");
}

TEST_CASE("diagnosis: of a time output: the time is not known, or pulses are missing or wrong") {
    DiagnosisBench bench;
    bench.board();
    TimeOutputStatus output;
    output.report.pulses = 5;
    const auto diagnosed = [&](TimeOutputState state) {
        output.report.state = state;
        output.report.hint = "why";
        return diagnose(output, bench.status);
    };
    CHECK(diagnosed(TimeOutputState::sending).health == Health::ok);
    check_fault(diagnosed(TimeOutputState::waiting), Fault::time_unknown, "why");
    check_fault(diagnosed(TimeOutputState::silent), Fault::time_silent, "why");
    check_fault(diagnosed(TimeOutputState::wrong), Fault::time_wrong, "why");
    bench.status.board.state = BoardState::absent;
    bench.board();
    check_fault(diagnosed(TimeOutputState::waiting), Fault::board_gone, "after 'holdover_s'");
}

TEST_CASE("diagnosis: of a LiDAR: it follows, does not, or nobody knows") {
    DiagnosisBench bench;
    bench.board();
    LidarReports reports;
    const HostTime reported{seconds(100).ns};
    const auto diagnosed = [&](const char* verdict, HostTime now) {
        REQUIRE(reports.add({{"10.0.0.3", "Livox", verdict, "why", {}, {}}}, reported));
        return diagnose(LidarStatus{reports.report(now).at(0), {}}, bench.status);
    };
    CHECK(diagnosed("follows", reported).health == Health::ok);
    for (const char* verdict : {"unlocked", "unset", "off", "drifts"})
        check_fault(diagnosed(verdict, reported), Fault::lidar_not_following, "why");
    check_fault(diagnosed("unproved", reported), Fault::lidar_unproved, "why");
    CHECK(diagnosed("follows", reported + seconds(30)).fault == Fault::none);
    check_fault(diagnosed("follows", reported + seconds(31)), Fault::lidar_unproved,
                "'versavis lidar watch' runs");
    // The cause may be what the board sends.
    bench.status.time_outputs.push_back({});
    bench.status.time_outputs[0].report.name = "roof";
    CHECK(diagnosed("off", reported).hint == "why");
    bench.status.time_outputs[0].diagnosis.fault = Fault::time_unknown;
    check_fault(diagnosed("off", reported), Fault::lidar_not_following,
                "why; if its time is that of 'roof', see its hint first: it is waiting");
    CHECK(diagnosed("unproved", reported).hint == "why");
}

namespace {

std::string text_of(const char* name) {
    std::ifstream file(std::string(VERSAVIS_SOURCE_DIR "/") + name);
    REQUIRE(file);
    return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

TEST_CASE("diagnosis: every fault has a word, a row in the manual, and an entry in the catalog") {
    const std::string manual = text_of("docs/user/troubleshooting.md");
    const std::string catalog = text_of("systemd/versavis.catalog");
    std::set<std::string> words;
    for (int i = 1; i <= static_cast<int>(last_fault); ++i) {
        const std::string word = to_string(static_cast<Fault>(i));
        CHECK(words.insert(word).second);
        CHECK_THAT(manual, Contains("| `" + word + "` |"));
        CHECK_THAT(catalog, Contains("-- " + message_id(word) + "\n"));
    }
}

// SPDX-License-Identifier: BSD-3-Clause
#include "health_watch.hpp"

#include <algorithm>

namespace versavis::daemon {

namespace {

/// What happened within so long, and so many periods, is recent: causes follow from it.
constexpr Duration recent_window = seconds(1);
constexpr int recent_periods = 4;

/// A slow start has a trigger a second or less: so many are recent, but for those this old.
constexpr std::uint64_t least_triggers = 4;
constexpr Duration longest_window = seconds(8);

bool suffices(const ImuReport& /*before*/, const ImuReport& /*newest*/) { return true; }

bool suffices(const PipelineReport& before, const PipelineReport& newest) {
    return newest.triggers == 0 || newest.triggers - before.triggers >= least_triggers;
}

/// The newest report that is as old as the window and suffices, or the oldest.
template <class Report>
Report one_window_ago(std::deque<std::pair<HostTime, Report>>& reports, const Report& newest,
                      Duration window, HostTime now) {
    reports.emplace_back(now, newest);
    while (reports.size() > 2 && reports[1].first <= now - window &&
           (reports[1].first <= now - longest_window || suffices(reports[1].second, newest)))
        reports.pop_front();
    return reports.front().second;
}

PipelineReport difference(PipelineReport now, const PipelineReport& before) {
    now.received -= before.received;
    now.incomplete -= before.incomplete;
    now.no_buffer -= before.no_buffer;
    now.published -= before.published;
    now.triggers -= before.triggers;
    now.unmeasured -= before.unmeasured;
    now.records_doubted -= before.records_doubted;
    now.triggers_missed -= before.triggers_missed;
    now.suspect -= before.suspect;
    now.actions_refused -= before.actions_refused;
    now.answers.ignored -= before.answers.ignored;
    now.answers.ids_repeated -= before.answers.ids_repeated;
    now.answers.ids_restarted -= before.answers.ids_restarted;
    now.answers.ids_skipped -= before.answers.ids_skipped;
    for (std::size_t i = 0; i < now.refused.size(); ++i) now.refused[i] -= before.refused[i];
    return now;
}

ImuReport difference(ImuReport now, const ImuReport& before) {
    now.published -= before.published;
    now.faulty -= before.faulty;
    return now;
}

/// A camera without frames is opened anew, and answers within this time.
constexpr Duration reopening = milliseconds(1500);

/// Why it has none is still what is wrong meanwhile.
bool outlasts_reopening(const Diagnosis& before, const CameraStatus& camera, HostTime now) {
    return camera.diagnosis.fault == Fault::camera_silent &&
           now - camera.camera.since < reopening &&
           (before.fault == Fault::no_exposure || before.fault == Fault::no_frames);
}

/// A camera that delivers again is trusted after so long.
constexpr Duration recovery_proof = seconds(4);

/// What it lacked is seen, and not why.
bool unexplained(Fault fault) { return fault == Fault::too_slow || fault == Fault::unproved; }

/// What it lacked a moment ago has ended, and it is not yet trusted.
bool recovers(const CameraStatus& camera, HostTime explained, HostTime now) {
    return unexplained(camera.diagnosis.fault) && now - explained < recovery_proof &&
           camera.pipeline.pairing == pairing::State::locked && camera.recent.received > 0;
}

}  // namespace

void HealthWatch::examine(Status& status) {
    status.board_diagnosis = diagnose_board(status);
    date("board", to_string(status.board.state), status.board_diagnosis, status.now);
    status.clock_diagnosis = diagnose_clock(status);
    date("clock", clock::to_string(status.clock.state), status.clock_diagnosis, status.now);
    for (CameraStatus& camera : status.cameras) measure(camera, status);
    for (CameraStatus& camera : status.cameras) {
        const std::string key = "camera " + camera.name;
        camera.diagnosis = diagnose(camera, status);
        const Diagnosis& before = lasting_[key].second;
        HostTime& explained = explained_[camera.name];
        if (outlasts_reopening(before, camera, status.now) ||
            (before.fault != Fault::none && recovers(camera, explained, status.now)))
            camera.diagnosis = before;
        else if (!unexplained(camera.diagnosis.fault))
            explained = status.now;
        date(key, to_string(camera.camera.state), camera.diagnosis, status.now);
    }
    for (ImuStatus& imu : status.imus) {
        measure(imu, status);
        imu.diagnosis = diagnose(imu, status);
        date("imu " + imu.report.name, "", imu.diagnosis, status.now);
    }
    for (TimeOutputStatus& output : status.time_outputs) {
        output.diagnosis = diagnose(output, status);
        date("time " + output.report.name, to_string(output.report.state), output.diagnosis,
             status.now);
    }
    for (LidarStatus& lidar : status.lidars) {
        lidar.diagnosis = diagnose(lidar, status);
        date("lidar " + lidar.report.source, lidar.report.verdict, lidar.diagnosis, status.now);
    }
}

void HealthWatch::measure(CameraStatus& camera, const Status& status) {
    const double rate_hz = camera.configuration.rate_hz;
    auto& device = cameras_.try_emplace(camera.name, rate_hz).first->second;
    if (device.rate_hz != rate_hz) device = Device<PipelineReport>(rate_hz);  // while it runs
    const std::uint64_t starts =
        camera.camera.connections + (camera.triggered() ? status.board.connections : 0);
    if (camera.camera.state == CameraState::streaming && starts != device.starts) {
        device.delivery.begin(status.now);
        device.starts = starts;
    }
    device.delivery.count(camera.pipeline.published - camera.pipeline.suspect, status.now);
    camera.delivery = device.delivery.report();
    const Duration window =
        std::max(recent_window, period_of(camera.configuration) * recent_periods);
    camera.recent = difference(camera.pipeline,
                               one_window_ago(device.reports, camera.pipeline, window, status.now));
}

void HealthWatch::measure(ImuStatus& imu, const Status& status) {
    auto& device = imus_.try_emplace(imu.report.name, imu.report.rate_hz).first->second;
    if (status.board.connections != device.starts) {
        device.delivery.begin(status.now);
        device.starts = status.board.connections;
    }
    device.delivery.count(imu.report.published - imu.report.faulty, status.now);
    imu.delivery = device.delivery.report();
    imu.recent = difference(imu.report,
                            one_window_ago(device.reports, imu.report, recent_window, status.now));
}

void HealthWatch::date(const std::string& device, const std::string& state, Diagnosis& diagnosis,
                       HostTime now) {
    auto& [last_state, last] = lasting_[device];
    const bool same = last.since.ns != 0 && last_state == state && last.fault == diagnosis.fault;
    diagnosis.since = same ? last.since : now;
    last_state = state;
    last = diagnosis;
}

}  // namespace versavis::daemon

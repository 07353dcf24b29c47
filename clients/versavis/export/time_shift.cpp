// SPDX-License-Identifier: BSD-3-Clause
#include "export/time_shift.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace versavis::client {

namespace {

double filter_s(const TimeShift& shift) { return static_cast<double>(shift.taken_off.ns) / 1e9; }

nlohmann::json as_json(const TimeShift& shift) {
    nlohmann::json cameras = nlohmann::json::array();
    for (const auto& one : shift.cameras)
        cameras.push_back({{"camera", one.camera}, {"timeshift_cam_imu_s", one.shift_s}});
    nlohmann::json json{
        {"cameras", cameras}, {"filter_delay_taken_off_us", nullptr}, {"filter_delay_us", nullptr}};
    if (shift.known) {
        json["filter_delay_taken_off_us"] = filter_s(shift) * 1e6;
        if (shift.total_s >= 0) json["filter_delay_us"] = shift.total_s * 1e6;
    }
    return json;
}

std::string advice(const TimeShift& shift) {
    if (!shift.known)
        return "pass the recording with --recording: the delay of the IMU's filter is already "
               "subtracted from its stamps, and the configured value is the sum\n";
    std::string text = fmt::format(
        "{:.3f} ms of filter delay are already subtracted from the stamps; with them the IMU is "
        "{:.3f} ms behind {}",
        filter_s(shift) * 1e3, shift.total_s * 1e3, shift.cameras.front().camera);
    if (shift.total_s > 0 && shift.taken_off.ns > 0)
        text += fmt::format(", {:.1f} % of which its filter explains",
                            100 * filter_s(shift) / shift.total_s);
    if (shift.total_s < 0)
        return text +
               "\nno delay of the IMU explains that: the camera's stamps are late, see its "
               "line delays\n";
    return text +
           fmt::format("\nin the IMU's table of the configuration:\nfilter_delay_us = {:.1f}\n",
                       shift.total_s * 1e6);
}

}  // namespace

Expected<Duration> recorded_filter_delay(const Recording& recording, const std::string& imu,
                                         const std::string& where) {
    std::vector<std::string> imus;
    for (const RecordedStream& stream : recording.streams())
        if (stream.kind == ring::StreamKind::imu && (imu.empty() || stream.name == imu))
            imus.push_back(stream.name);
    if (imus.empty())
        return failure(
            where, imu.empty() ? "has no IMU" : "has no IMU " + imu,
            "give the recording used for the calibration; 'versavis info' lists streams");
    if (imus.size() > 1)
        return failure(where, fmt::format("has several IMUs: {}", fmt::join(imus, ", ")),
                       "choose the calibrated one with --imu");
    std::optional<Duration> delay;
    const auto read = recording.glance(imus, [&](const RecordedItem& item) {
        delay = unpack<ImuMetadata>(item.metadata).filter_delay;
        return false;
    });
    if (!read) return Unexpected(read.error());
    if (!delay) return failure(where, imus.front() + " has no sample");
    return *delay;
}

Expected<TimeShift> time_shift(const std::vector<CalibratedCamera>& cameras,
                               const std::optional<Duration>& taken_off, const std::string& where) {
    TimeShift shift;
    for (const auto& camera : cameras)
        if (camera.time_shift_s) shift.cameras.push_back({camera.key, *camera.time_shift_s});
    if (shift.cameras.empty())
        return failure(where, "has no 'timeshift_cam_imu'",
                       "give the file camchain-imucam.yaml, calibrated with --time-calibration");
    shift.known = taken_off.has_value();
    shift.taken_off = taken_off.value_or(Duration{});
    shift.total_s = shift.cameras.front().shift_s + filter_s(shift);
    return shift;
}

std::string to_text(const TimeShift& shift, bool json) {
    if (json) return as_json(shift).dump() + "\n";
    std::string text;
    for (const auto& one : shift.cameras)
        text += fmt::format("{}: the IMU's stamps are {:.3f} ms {} (timeshift_cam_imu {:+.6f} s)\n",
                            one.camera, std::abs(one.shift_s) * 1e3,
                            one.shift_s >= 0 ? "late" : "early", one.shift_s);
    return text + advice(shift);
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "status_view.hpp"

#include <fmt/format.h>

namespace versavis::client {

namespace {

using nlohmann::json;

std::string text(const json& object, const char* key) { return object.value(key, std::string()); }
std::uint64_t count(const json& object, const char* key) { return object.value(key, std::uint64_t{0}); }

std::string hint(const json& part) {
    return text(part, "hint").empty() ? "" : fmt::format("\n         {}", text(part, "hint"));
}

std::string board_line(const json& board) {
    return fmt::format("board    {:<10} {} {}  lost packets {}, late outputs {}, IMU errors {}{}\n",
                       text(board, "state"), text(board, "serial"), text(board, "firmware"),
                       count(board, "lost_packets"), count(board, "late_outputs"), count(board, "imu_errors"),
                       hint(board));
}

std::string clock_line(const json& clock) {
    return fmt::format(
        "clock    {:<10} {}  sigma {:.1f} us, bound {:.1f} us, skew {:+.3f} ppm, round trip {:.0f} us\n",
        text(clock, "state"), text(clock, "output"), clock.value("sigma_ns", 0.0) / 1e3,
        clock.value("bound_ns", 0.0) / 1e3, clock.value("skew_ppm", 0.0),
        clock.value("round_trip_ns", 0.0) / 1e3);
}

std::string camera_line(const json& camera) {
    return fmt::format(
        "{:<8} {:<10} {}  pairing {}, published {}, incomplete {}, without trigger {}, triggers without "
        "frame {}, slips {}{}\n",
        text(camera, "name"), text(camera, "state"), text(camera, "model"), text(camera, "pairing"),
        count(camera, "frames_published"), count(camera, "frames_incomplete"),
        count(camera, "frames_without_trigger"), count(camera, "triggers_without_frame"),
        count(camera, "slips"), hint(camera));
}

}  // namespace

std::string status_text(const json& status) {
    const double up_s = (status.value("host_time_ns", 0.0) - status.value("started_ns", 0.0)) * 1e-9;
    std::string out = fmt::format("versavisd '{}': {}, up {:.0f} s\n", text(status, "instance"),
                                  text(status, "health"), up_s);
    if (status.contains("board")) out += board_line(status["board"]);
    if (status.contains("clock")) out += clock_line(status["clock"]);
    for (const json& camera : status.value("cameras", json::array())) out += camera_line(camera);
    for (const json& imu : status.value("imus", json::array()))
        out += fmt::format("{:<8} {:<10} published {}, lost {}, faulty {}\n", text(imu, "name"),
                           text(imu, "model"), count(imu, "published"), count(imu, "lost"),
                           count(imu, "faulty"));
    for (const json& stream : status.value("streams", json::array()))
        out += fmt::format("stream   {:<10} {:<7} {:>10} items {:>8.1f} Hz\n", text(stream, "name"),
                           text(stream, "kind"), count(stream, "items"), stream.value("rate_hz", 0.0));
    return out;
}

}  // namespace versavis::client

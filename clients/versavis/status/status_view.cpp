// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace versavis::client {

namespace {

using nlohmann::json;

std::string text(const json& object, const char* key) { return object.value(key, std::string()); }
std::uint64_t count(const json& object, const char* key) {
    return object.value(key, std::uint64_t{0});
}

/// In a line of its own, after its word.
std::string hint(const json& part) {
    const std::string fault = text(part, "fault");
    if (text(part, "hint").empty()) return "";
    return fmt::format("\n         {}{}{}", fault, fault.empty() ? "" : ": ", text(part, "hint"));
}

/// What the board has, where it says so.
std::string parts_line(const json& board) {
    const json present = board.value("present", json());
    const json fastest = board.value("fastest_imu_hz", json());
    std::string names;
    for (const json& name : present)
        if (name.is_string()) names += (names.empty() ? "" : ", ") + name.get<std::string>();
    if (names.empty() || !fastest.is_number()) return "";
    return fmt::format("         it has {}; IMUs up to {:g} Hz\n", names, fastest.get<double>());
}

std::string board_line(const json& board) {
    return fmt::format(
        "board    {:<10} {} {}  lost packets {}, late outputs {}, IMU errors {}{}\n{}",
        text(board, "state"), text(board, "serial"), text(board, "firmware"),
        count(board, "lost_packets"), count(board, "late_outputs"), count(board, "imu_errors"),
        hint(board), parts_line(board));
}

/// Of a time in ns, without the unit; what is not known is null, and no zero.
std::string in_us(const json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_number()
               ? fmt::format("{:.1f}", found->get<double>() / 1e3)
               : "unknown";
}

/// Of a clock that is not known there are no figures.
std::string clock_figures(const json& clock) {
    if (text(clock, "state") == "init" || text(clock, "state") == "reset") return "unknown";
    return fmt::format("sigma {} us, bound {} us, skew {:+.3f} ppm, round trip {:.0f} us",
                       in_us(clock, "sigma_ns"), in_us(clock, "bound_ns"),
                       clock.value("skew_ppm", 0.0), clock.value("round_trip_ns", 0.0) / 1e3);
}

std::string clock_line(const json& clock) {
    return fmt::format("clock    {:<10} {}  {}{}\n", text(clock, "state"), text(clock, "output"),
                       clock_figures(clock), hint(clock));
}

std::string imu_line(const json& imu) {
    return fmt::format(
        "{:<8} {:<10} {}  {:.1f} of {:g} Hz, published {}, lost {}, faulty {}, filter delay {} us "
        "({}){}\n",
        text(imu, "name"), text(imu, "state"), text(imu, "model"), imu.value("delivered_hz", 0.0),
        imu.value("configured_hz", 0.0), count(imu, "published"), count(imu, "lost"),
        count(imu, "faulty"), in_us(imu, "filter_delay_ns"), text(imu, "filter_delay_source"),
        hint(imu));
}

/// What is taken off the middle of its exposures, before it is known: nothing.
std::string delay_line(const json& camera) {
    if (text(camera, "line").empty()) return "";
    return fmt::format(
        "         {}: start {} us late, end {} us, sigma {} us ({}); end less start, measured: {} "
        "us\n",
        text(camera, "line"), in_us(camera, "line_delay_start_ns"),
        in_us(camera, "line_delay_end_ns"), in_us(camera, "line_delay_sigma_ns"),
        text(camera, "line_delay_source"), in_us(camera, "edge_difference_ns"));
}

std::string camera_line(const json& camera) {
    return fmt::format(
        "{:<8} {:<10} {}  {:.1f} of {:g} Hz, pairing {}, published {}, incomplete {}, without "
        "trigger {}, triggers without frame {}, slips {}{}\n{}",
        text(camera, "name"), text(camera, "state"), text(camera, "model"),
        camera.value("delivered_hz", 0.0), camera.value("configured_hz", 0.0),
        text(camera, "pairing"), count(camera, "frames_published"),
        count(camera, "frames_incomplete"), count(camera, "frames_without_trigger"),
        count(camera, "triggers_without_frame"), count(camera, "slips"), hint(camera),
        delay_line(camera));
}

struct ClockFact {
    std::string_view key;
    std::string_view name;
    std::string_view meaning;
};

constexpr std::array clock_facts{
    ClockFact{"state", "state", ""},
    ClockFact{"health", "health", ""},
    ClockFact{"fault", "fault", "the fault, in one word"},
    ClockFact{"hint", "hint", ""},
    ClockFact{"since_ns", "since", "when state or fault changed, CLOCK_MONOTONIC_RAW"},
    ClockFact{"output", "output clock", "clock of the published stamps"},
    ClockFact{"sigma_ns", "sigma", "one standard deviation of a stamp made now"},
    ClockFact{"bound_ns", "bound", "its largest possible error, however asymmetric the link is"},
    ClockFact{"since_contact_ns", "last message", "ago"},
    ClockFact{"round_trip_ns", "round trip", "the last one"},
    ClockFact{"smallest_round_trip_ns", "smallest round trip", "in the last ten minutes"},
    ClockFact{"residual_ns", "residual", "midpoint of the newest exchange minus the estimate"},
    ClockFact{"innovation_ns", "innovation", "by how much the newest slot moved the estimate"},
    ClockFact{"skew_ppm", "skew", "host clock against board clock"},
    ClockFact{"skew_sigma_ppm", "sigma of the skew", ""},
    ClockFact{"exchanges", "exchanges", "used since the service started"},
    ClockFact{"one_way_messages", "other messages", "used as well"},
    ClockFact{"slots", "slots", "since the estimate began"},
    ClockFact{"surprises", "surprises", "delays shorter than the shortest expected"},
    ClockFact{"restarts", "restarts", "of the estimate, because measurements contradicted it"},
    ClockFact{"epoch", "epoch", "stamps of different epochs are not comparable"},
    ClockFact{"output_minus_host_ns", "output minus host",
              "output clock against CLOCK_MONOTONIC_RAW"},
    ClockFact{"output_steps", "output steps", "steps of the output clock seen so far"},
    ClockFact{"host_suspends", "suspends", "of the host"},
    ClockFact{"host_synchronised", "host synchronised", "according to the kernel"},
    ClockFact{"host_max_error_ns", "largest host error",
              "according to the kernel; 16 s: never set"},
    ClockFact{"tai_offset_s", "TAI minus UTC", "0: never set in the kernel"},
    ClockFact{"tai_valid", "TAI valid", ""},
    ClockFact{"asymmetry_ns", "asymmetry",
              "subtracted: half of what the link is slower to the host"},
    ClockFact{"asymmetry_sigma_ns", "asymmetry, sigma", ""},
    ClockFact{"asymmetry_source", "asymmetry from", ""},
    ClockFact{"pps", "stamps by PPS", ""},
    ClockFact{"pps_residual_ns", "PPS residual",
              "newest pulse by messages and host, minus its second"},
    ClockFact{"pps_pulses", "PPS pulses", "with a known second"},
    ClockFact{"pps_rejected", "PPS rejected", "did not fit the others"},
    ClockFact{"second_difference_s", "receiver minus host", "whole seconds"},
    ClockFact{"grid_aligned", "grid aligned", "to whole seconds of the output clock"},
    ClockFact{"grid_error_ns", "grid error", "from the measured exposures"},
};

bool ends_with(std::string_view key, std::string_view end) {
    return key.size() > end.size() && key.substr(key.size() - end.size()) == end;
}

/// The unit is the end of the key's name.
std::string with_unit(std::string_view key, const json& value) {
    if (value.is_string()) return value.get<std::string>();
    if (value.is_null()) return "unknown";
    if (!value.is_number()) return value.dump();
    const auto number = value.get<double>();
    if (ends_with(key, "_ns") && std::abs(number) < 1e9)
        return fmt::format("{:.1f} us", number * 1e-3);
    if (ends_with(key, "_ns")) return fmt::format("{:.6f} s", number * 1e-9);
    if (ends_with(key, "_ppm")) return fmt::format("{:.4f} ppm", number);
    if (ends_with(key, "_ppb")) return fmt::format("{} ppb", value.dump());
    if (ends_with(key, "_s")) return fmt::format("{:.1f} s", number);
    return value.dump();
}

std::string fact_line(std::string_view name, const std::string& value, std::string_view meaning) {
    const std::string line = fmt::format("{:<20} {:<22} {}", name, value, meaning);
    return line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
}

/// Facts that are not in the table, those of nested objects as parent.child.
std::string other_facts(const json& object, const std::string& parent) {
    std::string out;
    for (const auto& [key, value] : object.items()) {
        const auto known = [&key = key](const ClockFact& fact) { return fact.key == key; };
        if (parent.empty() && std::any_of(clock_facts.begin(), clock_facts.end(), known)) continue;
        const std::string name = parent + key;
        out += value.is_object() ? other_facts(value, name + ".")
                                 : fact_line(name, with_unit(key, value), "");
    }
    return out;
}

}  // namespace

std::string clock_text(const json& status) {
    const json clock = status.value("clock", json::object());
    std::string out;
    for (const ClockFact& fact : clock_facts)
        if (clock.contains(fact.key))
            out += fact_line(fact.name, with_unit(fact.key, clock[std::string(fact.key)]),
                             fact.meaning);
    out += other_facts(clock, "");
    const json board = status.value("board", json::object());
    if (board.contains("pps"))
        out += fact_line("PPS at the board", with_unit("pps", board["pps"]), "");
    if (board.value("pps", "") == "good" && board.contains("pps_error_ppb"))
        out += fact_line("board against PPS", with_unit("pps_error_ppb", board["pps_error_ppb"]),
                         "positive: the board's clock runs fast");
    return out;
}

std::string status_text(const json& status) {
    const double up_s =
        (status.value("host_time_ns", 0.0) - status.value("started_ns", 0.0)) * 1e-9;
    std::string out = fmt::format("versavisd '{}': {}, up {:.0f} s\n", text(status, "instance"),
                                  text(status, "health"), up_s);
    if (status.contains("board")) out += board_line(status["board"]);
    if (status.contains("clock")) out += clock_line(status["clock"]);
    for (const json& camera : status.value("cameras", json::array())) out += camera_line(camera);
    for (const json& imu : status.value("imus", json::array())) out += imu_line(imu);
    for (const json& stream : status.value("streams", json::array()))
        out +=
            fmt::format("stream   {:<10} {:<7} {:>10} items {:>8.1f} Hz\n", text(stream, "name"),
                        text(stream, "kind"), count(stream, "items"), stream.value("rate_hz", 0.0));
    return out;
}

}  // namespace versavis::client

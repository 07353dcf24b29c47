// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_view.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <map>
#include <string_view>

#include "base/json_text.hpp"
#include "base/wrapped_line.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

std::uint64_t count(const json& object, const char* key) {
    return object.value(key, std::uint64_t{0});
}

/// What follows the names of devices, and continues them.
constexpr std::size_t indent = 9;

constexpr auto green = "\x1b[32m";
constexpr auto yellow = "\x1b[33m";
constexpr auto red = "\x1b[31m";
constexpr auto no_colour = "\x1b[0m";

std::string wrapped_part(std::string line) { return client::wrapped(std::move(line), indent); }

/// Hints in lines of their own, after their word; what was said of another part already is not said
/// again.
class Hints {
 public:
    std::string of(const json& part, const std::string& name) {
        const std::string fault = text(part, "fault");
        const std::string hint = text(part, "hint");
        if (hint.empty()) return "";
        const auto [said, is_new] = said_of_.emplace(hint, name);
        return wrapped_part(fmt::format("{:{}}{}{}{}", "", indent, fault, fault.empty() ? "" : ": ",
                                        is_new ? hint : "as " + said->second));
    }

 private:
    std::map<std::string, std::string> said_of_;
};

/// What the board has, where it says so.
std::string parts_line(const json& board) {
    const json present = board.value("present", json());
    const json fastest = board.value("fastest_imu_hz", json());
    std::string names;
    for (const json& name : present)
        if (name.is_string()) names += (names.empty() ? "" : ", ") + name.get<std::string>();
    if (names.empty() || !fastest.is_number()) return "";
    return wrapped_part(fmt::format("{:{}}it has {}; IMUs up to {:g} Hz", "", indent, names,
                                    fastest.get<double>()));
}

/// Counters that should be zero; in a summary only those that are not.
struct Counter {
    const char* name;
    std::uint64_t count;
};

std::string listed(std::initializer_list<Counter> counters, Detail detail) {
    std::string out;
    for (const Counter& counter : counters)
        if (counter.count != 0 || detail == Detail::full)
            out += fmt::format(", {} {}", counter.name, counter.count);
    return out;
}

std::string board_lines(const json& board, Detail detail, Hints& hints) {
    const std::string line = fmt::format("board    {:<10} {} {}", text(board, "state"),
                                         text(board, "serial"), text(board, "firmware")) +
                             listed({{"lost packets", count(board, "lost_packets")},
                                     {"late outputs", count(board, "late_outputs")},
                                     {"IMU errors", count(board, "imu_errors")}},
                                    detail);
    return wrapped_part(line) + hints.of(board, "board") +
           (detail == Detail::full ? parts_line(board) : "");
}

/// Of a time in ns, without the unit; what is not known is null, and no zero.
std::string in_us(const json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_number()
               ? fmt::format("{:.1f}", found->get<double>() / 1e3)
               : "unknown";
}

/// Of a clock that is not known there are no figures.
std::string clock_figures(const json& clock, Detail detail) {
    if (text(clock, "state") == "init" || text(clock, "state") == "reset") return "unknown";
    std::string figures =
        fmt::format("sigma {} us, bound {} us", in_us(clock, "sigma_ns"), in_us(clock, "bound_ns"));
    if (detail == Detail::full)
        figures +=
            fmt::format(", skew {:+.3f} ppm, round trip {:.0f} us", clock.value("skew_ppm", 0.0),
                        clock.value("round_trip_ns", 0.0) / 1e3);
    return figures;
}

std::string clock_lines(const json& clock, Detail detail, Hints& hints) {
    return wrapped_part(fmt::format("clock    {:<10} {}  {}", text(clock, "state"),
                                    text(clock, "output"), clock_figures(clock, detail))) +
           hints.of(clock, "clock");
}

std::string ptp_lines(const json& ptp) {
    std::string line = fmt::format("ptp      {:<10} ", text(ptp, "state"));
    const json ahead_ns = ptp.value("minus_utc_ns", json());
    line += ahead_ns.is_number() ? fmt::format("{:.3f} s ahead of UTC  sigma {} us, bound {} us",
                                               ahead_ns.get<double>() * 1e-9,
                                               in_us(ptp, "sigma_ns"), in_us(ptp, "bound_ns"))
                                 : std::string("unknown");
    return wrapped_part(line);
}

/// Name, state and model of a device, and how much of its rate it delivers.
std::string delivery(const json& device) {
    return fmt::format("{:<8} {:<10} {}  {:.1f} of {:g} Hz", text(device, "name"),
                       text(device, "state"), text(device, "model"),
                       device.value("delivered_hz", 0.0), device.value("configured_hz", 0.0));
}

std::string imu_lines(const json& imu, Detail detail, Hints& hints) {
    std::string line = delivery(imu);
    if (detail == Detail::full) line += fmt::format(", published {}", count(imu, "published"));
    line += listed({{"lost", count(imu, "lost")}, {"faulty", count(imu, "faulty")}}, detail);
    const std::string filter =
        wrapped_part(fmt::format("{:{}}filter delay {} us ({})", "", indent,
                                 in_us(imu, "filter_delay_ns"), text(imu, "filter_delay_source")));
    return wrapped_part(line) + hints.of(imu, text(imu, "name")) +
           (detail == Detail::full ? filter : "");
}

std::string time_output_lines(const json& output, Hints& hints) {
    std::string line = fmt::format("{:<8} {:<10} ", text(output, "name"), text(output, "state"));
    const json utc_s = output.value("utc_s", json());
    if (utc_s.is_number_integer())
        line += fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(utc_s.get<std::int64_t>()));
    else
        line += "no pulse yet";
    if (output.value("error_ns", json()).is_number())
        line += fmt::format(", {} us off", in_us(output, "error_ns"));
    line += fmt::format(", {} pulses", count(output, "pulses"));
    return wrapped_part(line) + hints.of(output, text(output, "name"));
}

std::string lidar_lines(const json& lidar, Hints& hints) {
    std::string line = fmt::format("{:<8} {:<10} {}", text(lidar, "maker"), text(lidar, "state"),
                                   text(lidar, "name"));
    if (lidar.value("behind_ns", json()).is_number())
        line += fmt::format(", {} us behind at most, or {} ahead", in_us(lidar, "behind_ns"),
                            in_us(lidar, "ahead_ns"));
    return wrapped_part(line) + hints.of(lidar, text(lidar, "name"));
}

/// What is taken off the middle of its exposures, before it is known: nothing.
std::string delay_line(const json& camera) {
    if (text(camera, "line").empty()) return "";
    return wrapped_part(fmt::format(
        "{:{}}{}: start {} us late, end {} us, sigma {} us ({}); end less start, measured: {} us",
        "", indent, text(camera, "line"), in_us(camera, "line_delay_start_ns"),
        in_us(camera, "line_delay_end_ns"), in_us(camera, "line_delay_sigma_ns"),
        text(camera, "line_delay_source"), in_us(camera, "edge_difference_ns")));
}

std::string camera_lines(const json& camera, Detail detail, Hints& hints) {
    std::string line = delivery(camera) + ", pairing " + text(camera, "pairing");
    if (detail == Detail::full)
        line += fmt::format(", published {}", count(camera, "frames_published"));
    line += listed({{"incomplete", count(camera, "frames_incomplete")},
                    {"without trigger", count(camera, "frames_without_trigger")},
                    {"triggers without frame", count(camera, "triggers_without_frame")},
                    {"slips", count(camera, "slips")}},
                   detail);
    return wrapped_part(line) + hints.of(camera, text(camera, "name")) +
           (detail == Detail::full ? delay_line(camera) : "");
}

/// Green: it does what it should; red: it has a fault; yellow: it starts, or something is to be
/// said of it.
const char* colour_of(const json& part) {
    const std::string fault = text(part, "fault");
    if (fault.empty()) return text(part, "hint").empty() ? green : yellow;
    return fault == "starting" ? yellow : red;
}

std::string coloured(std::string lines, std::size_t begin, std::size_t size, const char* colour) {
    const std::size_t end = std::min(begin + size, lines.size());
    lines.insert(end, no_colour);
    return lines.insert(begin, colour);
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

std::string status_text(const json& status, Detail detail, Colour colour) {
    const double up_s =
        (status.value("host_time_ns", 0.0) - status.value("started_ns", 0.0)) * 1e-9;
    const std::string title = fmt::format("versavisd '{}': ", text(status, "instance"));
    const std::string health = text(status, "health");
    std::string out = fmt::format("{}{}, up {:.0f} s\n", title, health, up_s);
    const auto paint = [&](std::string lines, std::size_t begin, std::size_t size,
                           const char* with) {
        return colour == Colour::ansi ? coloured(std::move(lines), begin, size, with) : lines;
    };
    out = paint(std::move(out), title.size(), health.size(),
                health == "ok"         ? green
                : health == "starting" ? yellow
                                       : red);
    Hints hints;
    const auto add = [&](const json& part, std::string lines) {
        out += paint(std::move(lines), indent, text(part, "state").size(), colour_of(part));
    };
    if (const auto board = status.find("board"); board != status.end())
        add(*board, board_lines(*board, detail, hints));
    if (const auto clock = status.find("clock"); clock != status.end())
        add(*clock, clock_lines(*clock, detail, hints));
    if (const json ptp = status.value("ptp", json()); ptp.is_object()) add(ptp, ptp_lines(ptp));
    for (const json& camera : status.value("cameras", json::array()))
        add(camera, camera_lines(camera, detail, hints));
    for (const json& imu : status.value("imus", json::array()))
        add(imu, imu_lines(imu, detail, hints));
    for (const json& output : status.value("time_outputs", json::array()))
        add(output, time_output_lines(output, hints));
    for (const json& lidar : status.value("lidars", json::array()))
        add(lidar, lidar_lines(lidar, hints));
    if (detail == Detail::summary) return out;
    for (const json& stream : status.value("streams", json::array()))
        out +=
            fmt::format("stream   {:<10} {:<7} {:>10} items {:>8.1f} Hz\n", text(stream, "name"),
                        text(stream, "kind"), count(stream, "items"), stream.value("rate_hz", 0.0));
    return out;
}

std::string in_place(const std::string& text) {
    std::string out = "\x1b[H";
    for (const char c : text) {
        if (c == '\n') out += "\x1b[K";  // the rest of what the line showed before
        out += c;
    }
    return out + "\x1b[J";
}

}  // namespace versavis::client

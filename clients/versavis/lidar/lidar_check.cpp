// SPDX-License-Identifier: BSD-3-Clause
#include "lidar/lidar_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace versavis::client {

namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::int64_t bucket_ns = second_ns / 10;

/// Before, no clock of a LiDAR that was set can be; some begin at 1970, others at 2000.
constexpr Duration year_2020 = seconds(1'577'836'800);

/// No clock is after it: of damaged or false packets alone.
constexpr Duration year_2200 = seconds(7'258'118'400);

/// A way takes no longer, even where packets wait; more is another time. If lower, busy hosts seem
/// to have a LiDAR that is off; if higher, small offsets are not seen.
constexpr Duration longest_delay = milliseconds(50);

/// Clocks of captures have a grain, and switches stamp a little early.
constexpr Duration early = milliseconds(1);

/// A pace can be told after so long.
constexpr Duration shortest_drift = seconds(5);

/// Less than crystals differ; a LiDAR that follows has none but that of its own control.
constexpr double largest_drift_ppm = 3;

/// Into -span/2 to span/2.
Duration wrapped(Duration difference, Duration span) {
    if (span.ns == 0) return difference;
    std::int64_t rest = difference.ns % span.ns;
    if (rest > span.ns / 2) rest -= span.ns;
    if (rest < -span.ns / 2) rest += span.ns;
    return {rest};
}

std::string in_ms(Duration duration) {
    return fmt::format("{:.3f} ms", static_cast<double>(duration.ns) * 1e-6);
}

/// What a difference of so many whole seconds comes from.
std::string cause_of_seconds(std::int64_t lidar_ahead_s) {
    if (lidar_ahead_s == 37)
        return "that is TAI, as PTP has it: set the UTC offset of its PTP master";
    if (lidar_ahead_s == 18) return "that is GPS time: its receiver lacks the leap seconds";
    if (lidar_ahead_s % 3600 == 0) return "whole hours: its sentence has local time, not UTC";
    if (std::abs(lidar_ahead_s) == 1)
        return "its sentence names the wrong pulse: check the window for sentences, and polarity";
    return "it read another second: check its sentences";
}

std::string describe_offset(Duration lidar_ahead) {
    const std::int64_t whole =
        (lidar_ahead.ns + (lidar_ahead.ns < 0 ? -second_ns : second_ns) / 2) / second_ns;
    const Duration rest{lidar_ahead.ns - whole * second_ns};
    if (whole != 0 && absolute(rest) < longest_delay)
        return fmt::format("its time is {} s {} the host's: {}", std::abs(whole),
                           whole > 0 ? "ahead of" : "behind", cause_of_seconds(whole));
    return fmt::format("its time is {} {} the host's: is its pulse that of this board?",
                       in_ms(absolute(lidar_ahead)), lidar_ahead.ns > 0 ? "ahead of" : "behind");
}

struct Slope {
    double ppm = 0;
    double sigma_ppm = 0;
};

/// Least squares through the smallest delays; rising delays are a LiDAR that runs slow.
Slope slope_of(const std::map<std::int64_t, Duration>& smallest) {
    const auto count = static_cast<double>(smallest.size());
    double mean_t = 0;
    double mean_d = 0;
    const std::int64_t begin = smallest.begin()->first;
    const auto zero = static_cast<double>(smallest.begin()->second.ns);
    for (const auto& [bucket, delay] : smallest) {
        mean_t += static_cast<double>(bucket - begin) * 0.1 / count;
        mean_d += (static_cast<double>(delay.ns) - zero) * 1e-3 / count;
    }
    double tt = 0;
    double td = 0;
    double dd = 0;
    for (const auto& [bucket, delay] : smallest) {
        const double t = static_cast<double>(bucket - begin) * 0.1 - mean_t;
        const double d = (static_cast<double>(delay.ns) - zero) * 1e-3 - mean_d;
        tt += t * t;
        td += t * d;
        dd += d * d;
    }
    if (tt == 0 || count < 3) return {};
    const double slope = td / tt;
    return {-slope, std::sqrt(std::max(0.0, dd - slope * td) / (count - 2) / tt)};
}

nlohmann::json known(bool is_known, nlohmann::json value) {
    return is_known ? std::move(value) : nlohmann::json(nullptr);
}

}  // namespace

const char* to_string(LidarVerdict verdict) {
    switch (verdict) {
        case LidarVerdict::follows: return "follows";
        case LidarVerdict::unlocked: return "unlocked";
        case LidarVerdict::unset: return "unset";
        case LidarVerdict::off: return "off";
        case LidarVerdict::drifts: return "drifts";
        case LidarVerdict::unproved: return "unproved";
    }
    return "unproved";
}

void LidarCheck::add(const Datagram& datagram) {
    const auto packet = lidar_packet_of(datagram);
    if (!packet) return;
    Lidar& lidar = lidars_[datagram.source];
    if (lidar.packets++ == 0) lidar.first = datagram.arrived;
    lidar.last = datagram.arrived;
    lidar.maker = packet->maker;
    if (packet->lock != LidarLock::unknown) {
        lidar.lock = packet->lock;
        lidar.remark = packet->remark;
        if (packet->lock == LidarLock::none) ++lidar.unlocked;
    }
    if (!packet->time || *packet->time < Duration{} || *packet->time > year_2200) return;
    lidar.covers = packet->covers;
    if (packet->span.ns == 0 && *packet->time < year_2020) {
        lidar.since_start = true;
        return;
    }
    const Duration delay = wrapped(Duration{datagram.arrived.ns} - *packet->time, packet->span);
    const auto [bucket, is_new] =
        lidar.smallest.try_emplace(datagram.arrived.ns / bucket_ns, delay);
    if (!is_new) bucket->second = std::min(bucket->second, delay);
}

LidarReport LidarCheck::judge(const std::string& source, const Lidar& lidar) {
    LidarReport report{source, lidar.maker};
    report.remark = lidar.remark;
    report.packets = lidar.packets;
    report.duration = lidar.last - lidar.first;
    const auto conclude = [&report](LidarVerdict verdict, std::string hint) {
        report.verdict = verdict;
        report.hint = std::move(hint);
        return report;
    };
    const auto least =
        std::min_element(lidar.smallest.begin(), lidar.smallest.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    if (least != lidar.smallest.end()) {
        const Slope slope = slope_of(lidar.smallest);
        report.delay = least->second;
        report.behind = least->second - lidar.covers;
        report.ahead = longest_way - report.behind;
        report.drift_ppm = slope.ppm;
        report.drift_sigma_ppm = slope.sigma_ppm;
    }
    if (lidar.lock == LidarLock::none)
        return conclude(LidarVerdict::unlocked,
                        fmt::format("it says: {}; check pulse, sentence, their levels and "
                                    "polarity (docs/user/lidar.md)",
                                    lidar.remark));
    if (lidar.since_start)
        return conclude(LidarVerdict::unset,
                        "its time counts since its start: set its source of time (for Ouster "
                        "'timestamp_mode'), and check pulse and sentence");
    if (!report.delay)
        return conclude(LidarVerdict::unproved,
                        "none of its packets has a time between 1970 and 2200: capture its data "
                        "packets, too");
    if (report.duration < shortest_record)
        return conclude(LidarVerdict::unproved,
                        fmt::format("{:.1f} s are too short: capture some seconds",
                                    static_cast<double>(report.duration.ns) * 1e-9));
    if (*report.delay > longest_delay || *report.delay < -early)
        return conclude(LidarVerdict::off, describe_offset(-*report.delay));
    const double excess = std::abs(report.drift_ppm) - 3 * report.drift_sigma_ppm;
    if (report.duration >= shortest_drift && excess > largest_drift_ppm)
        return conclude(
            LidarVerdict::drifts,
            fmt::format("its clock runs {:.1f} ppm {} than the host's: it does not "
                        "follow, or was just set",
                        std::abs(report.drift_ppm), report.drift_ppm > 0 ? "faster" : "slower"));
    if (lidar.unlocked > 0)
        return conclude(
            LidarVerdict::unlocked,
            fmt::format("{} of its packets said that it was not locked", lidar.unlocked));
    return conclude(LidarVerdict::follows, "");
}

std::vector<LidarReport> LidarCheck::reports() const {
    std::vector<LidarReport> all;
    for (const auto& [source, lidar] : lidars_) all.push_back(judge(source, lidar));
    return all;
}

std::string lidar_text(const std::vector<LidarReport>& reports) {
    std::string text;
    for (const LidarReport& report : reports) {
        text += fmt::format("{} {}: {}\n", report.maker, report.source, to_string(report.verdict));
        if (!report.hint.empty()) text += fmt::format("    {}\n", report.hint);
        if (!report.remark.empty()) text += fmt::format("    its packets say: {}\n", report.remark);
        if (report.delay && report.verdict != LidarVerdict::off)
            text += fmt::format("    its clock is at most {} behind the host's, and {} ahead\n",
                                in_ms(report.behind), in_ms(report.ahead));
        if (report.delay && report.duration >= shortest_drift)
            text += fmt::format("    pace {:+.2f} ppm, sigma {:.2f}\n", report.drift_ppm,
                                report.drift_sigma_ppm);
        text += fmt::format("    {} packets in {:.1f} s\n", report.packets,
                            static_cast<double>(report.duration.ns) * 1e-9);
    }
    return text;
}

nlohmann::json lidar_json(const std::vector<LidarReport>& reports) {
    nlohmann::json all = nlohmann::json::array();
    for (const LidarReport& report : reports) {
        const bool paced = report.delay && report.duration >= shortest_drift;
        all.push_back(
            {{"source", report.source},
             {"maker", report.maker},
             {"verdict", to_string(report.verdict)},
             {"hint", report.hint},
             {"remark", report.remark},
             {"packets", report.packets},
             {"duration_s", static_cast<double>(report.duration.ns) * 1e-9},
             {"delay_ns", known(report.delay.has_value(), report.delay.value_or(Duration{}).ns)},
             {"behind_ns", known(report.delay.has_value(), report.behind.ns)},
             {"ahead_ns", known(report.delay.has_value(), report.ahead.ns)},
             {"drift_ppm", known(paced, report.drift_ppm)},
             {"drift_sigma_ppm", known(paced, report.drift_sigma_ppm)}});
    }
    return all;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/allan_report.hpp"

#include <fmt/format.h>

namespace versavis::client {

namespace {

using nlohmann::json;

json axis_json(const AxisNoise& axis) {
    json points = json::array();
    for (const AllanPoint& point : axis.points)
        points.push_back({{"tau_s", point.tau_s},
                          {"deviation", point.deviation},
                          {"relative_sigma", point.relative_sigma}});
    json walk = nullptr;
    json walk_sigma = nullptr;
    if (axis.walk) {
        walk = axis.walk->value;
        walk_sigma = axis.walk->sigma;
    }
    json drift = nullptr;
    if (axis.drift)
        drift = {{"slope", axis.drift->slope},
                 {"settling", axis.drift->settling},
                 {"time_constant_s", axis.drift->time_constant_s}};
    return {
        {"noise_density", axis.density.value},
        {"noise_density_sigma", axis.density.sigma},
        {"random_walk", walk},
        {"random_walk_sigma", walk_sigma},
        {"random_walk_limit", axis.walk_limit},
        {"random_walk_needs_s", axis.walk || axis.smooth ? json(nullptr) : json(axis.walk_needs_s)},
        {"drift", drift},
        {"smooth", axis.smooth},
        {"bias_instability", axis.flicker},
        {"points", points}};
}

json axes_json(const std::array<AxisNoise, 3>& axes) {
    json result{{"noise_density", density_of(axes).value}, {"random_walk", nullptr}};
    if (const auto walk = walk_of(axes)) result["random_walk"] = walk->value;
    for (std::size_t i = 0; i < 3; ++i) result[std::string(1, "xyz"[i])] = axis_json(axes[i]);
    return result;
}

std::string drift_text(const BiasDrift& drift, const char* unit) {
    std::string text =
        fmt::format("     a drift is taken off: {:+.2e} {} an hour", 3600 * drift.slope, unit);
    if (drift.time_constant_s > 0)
        text += fmt::format(", and {:+.2e} {} that settle within {}", drift.settling, unit,
                            span_text(drift.time_constant_s));
    return text + "\n";
}

std::string axes_text(const char* what, const char* unit, const std::array<AxisNoise, 3>& axes) {
    std::string text = fmt::format("{}\n", what);
    for (std::size_t i = 0; i < 3; ++i) {
        const AxisNoise& axis = axes[i];
        text += fmt::format("  {}  noise density {:.3e} +- {:.0e} {}/sqrt(Hz), ", "xyz"[i],
                            axis.density.value, axis.density.sigma, unit);
        if (axis.walk)
            text += fmt::format("random walk {:.2e} +- {:.0e} {}/s/sqrt(Hz)\n", axis.walk->value,
                                axis.walk->sigma, unit);
        else if (axis.smooth)
            text += "random walk not known: the bias changes as with a temperature\n";
        else
            text += fmt::format("random walk below {:.1e} {}/s/sqrt(Hz): not seen\n",
                                axis.walk_limit, unit);
        if (axis.drift) text += drift_text(*axis.drift, unit);
    }
    return text;
}

}  // namespace

std::string span_text(double seconds) {
    if (seconds < 600) return fmt::format("{:.0f} s", seconds);
    return seconds < 7200 ? fmt::format("{:.0f} min", seconds / 60)
                          : fmt::format("{:.1f} h", seconds / 3600);
}

json to_json(const AllanResult& result) {
    return {{"imu", result.name},
            {"rate_hz", result.rate_hz},
            {"duration_s", result.duration_s},
            {"missing", result.missing},
            {"spikes", result.spikes},
            {"needs_s", walk_needs_s(result)},
            {"gyroscope", axes_json(result.gyro)},
            {"accelerometer", axes_json(result.accel)}};
}

std::string to_text(const AllanResult& result) {
    std::string text = fmt::format("{}: {} at {:.1f} Hz", result.name, span_text(result.duration_s),
                                   result.rate_hz);
    if (result.missing > 0) text += fmt::format(", {} samples filled in", result.missing);
    if (result.spikes > 0) text += fmt::format(", {} spikes taken off", result.spikes);
    text += "\n" + axes_text("gyroscope", "rad/s", result.gyro) +
            axes_text("accelerometer", "m/s^2", result.accel);
    if (is_smooth(result))
        text += "record again at a constant temperature, after it has warmed up\n";
    if (const double needed = walk_needs_s(result); needed > 0)
        text +=
            fmt::format("for all random walks, record at least {} at rest\n", span_text(needed));
    return text;
}

}  // namespace versavis::client

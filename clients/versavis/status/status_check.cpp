// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "status/status_document.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

const char* to_string(CheckState state) {
    switch (state) {
        case CheckState::ok: return "OK";
        case CheckState::warning: return "WARNING";
        case CheckState::critical: return "CRITICAL";
        case CheckState::unknown: break;
    }
    return "UNKNOWN";
}

/// '|' begins performance data, and a line end other output.
std::string plain(std::string text) {
    for (char& c : text)
        if (c == '|' || static_cast<unsigned char>(c) < ' ') c = ' ';
    return text;
}

CheckResult result(CheckState state, const std::string& text, const std::string& data = {}) {
    return {state, fmt::format("VERSAVIS {} - {}{}{}", to_string(state), plain(text),
                               data.empty() ? "" : " | ", data)};
}

struct Device {
    std::string name;
    const json* keys;
};

/// In the order of cause.
std::vector<Device> devices(const json& status) {
    std::vector<Device> all;
    for (const char* part : {"board", "clock"})
        if (status.contains(part)) all.push_back({part, &status[part]});
    for (const char* kind : device_arrays)
        if (status.contains(kind))
            for (const json& device : status[kind])
                all.push_back({device.value("name", ""), &device});
    return all;
}

/// Of a device that has a rate.
bool delivers_nothing(const Device& device) {
    constexpr double has_none = 1;
    return device.keys->value("health", "") == "degraded" &&
           device.keys->value("delivered_hz", has_none) == 0;
}

std::string counted(std::size_t number, std::string_view noun) {
    return fmt::format("{} {}{}", number, noun, number == 1 ? "" : "s");
}

/// Performance data have quotes around a label with blanks, and no exponents.
std::string value(const std::string& label, double number, int digits, std::string_view unit) {
    const bool bare = label.find_first_of(" '=") == std::string::npos;
    std::string quoted = label;
    std::replace(quoted.begin(), quoted.end(), '\'', '_');
    std::replace(quoted.begin(), quoted.end(), '=', '_');
    return fmt::format("{0}{1}{0}={2:.{3}f}{4}", bare ? "" : "'", plain(quoted), number, digits,
                       unit);
}

std::string performance(const json& status) {
    std::vector<std::string> values;
    const auto counter = [&](const std::string& label, const json& device, const char* key) {
        values.push_back(value(label, device.value(key, 0.0), 0, "c"));
    };
    for (const json& camera : status.value("cameras", json::array())) {
        const std::string name = camera.value("name", "");
        values.push_back(value(name + "_rate", camera.value("delivered_hz", 0.0), 1, ""));
        counter(name + "_incomplete", camera, "frames_incomplete");
        counter(name + "_unproved", camera, "frames_without_trigger");
    }
    for (const json& imu : status.value("imus", json::array())) {
        const std::string name = imu.value("name", "");
        values.push_back(value(name + "_rate", imu.value("delivered_hz", 0.0), 1, ""));
        counter(name + "_lost", imu, "lost");
    }
    const json sigma = status.value("clock", json::object()).value("sigma_ns", json());
    if (sigma.is_number())
        values.push_back(value("clock_sigma", sigma.get<double>() * 1e-9, 9, "s"));
    return fmt::format("{}", fmt::join(values, " "));
}

/// The first cause, with its hint, and the names of the others.
std::string causes(const std::vector<Device>& all, const std::string& health) {
    std::string first;
    std::string others;
    for (const Device& device : all) {
        if (device.keys->value("health", "") != health) continue;
        if (first.empty())
            first = fmt::format("{}: {}: {}", device.name, device.keys->value("fault", ""),
                                device.keys->value("hint", ""));
        else
            others += (others.empty() ? "" : ", ") + device.name;
    }
    return others.empty() ? first : fmt::format("{} (also: {})", first, others);
}

}  // namespace

CheckResult check_status(const json& status) {
    const std::string health = status.value("health", "");
    const std::string data = performance(status);
    const std::vector<Device> all = devices(status);
    if (health == "ok")
        return result(
            CheckState::ok,
            fmt::format("{}, {}", counted(status.value("cameras", json::array()).size(), "camera"),
                        counted(status.value("imus", json::array()).size(), "IMU")),
            data);
    if (health == "starting")
        return result(CheckState::unknown, "starting: " + causes(all, health), data);
    const bool critical = std::any_of(all.begin(), all.end(), delivers_nothing);
    return result(critical ? CheckState::critical : CheckState::warning, causes(all, health), data);
}

CheckResult check_failed(const Error& error, bool may_live) {
    return result(may_live ? CheckState::unknown : CheckState::critical, error.message());
}

}  // namespace versavis::client

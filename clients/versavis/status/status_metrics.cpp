// SPDX-License-Identifier: BSD-3-Clause
#include "status/status_metrics.hpp"

#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "status/status_document.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

enum class Type { gauge, counter };

/// Where the key of a family is, and what labels its samples.
enum class Part { top, board, clock, ptp, camera, imu, time_output, stream };

struct Family {
    std::string_view name;  ///< without the _total of counters; the unit is its end
    std::string_view unit;  ///< empty: none
    Type type;
    Part part;
    std::string_view key;
    double divisor;  ///< of the key's value, to the base unit
    std::string_view help;
};

constexpr Family families[] = {
    {"versavis_board_packets", "", Type::counter, Part::board, "packets", 1,
     "Packets received from the board."},
    {"versavis_board_packets_lost", "", Type::counter, Part::board, "lost_packets", 1,
     "Packets of the board that never arrived."},
    {"versavis_board_packets_malformed", "", Type::counter, Part::board, "malformed_packets", 1,
     "Runs of bytes from the board that were no packet."},
    {"versavis_board_messages_dropped", "", Type::counter, Part::board, "dropped_by_board", 1,
     "Messages that the board replaced by newer ones, as the host did not read."},
    {"versavis_board_edges_lost", "", Type::counter, Part::board, "lost_edges", 1,
     "Input edges that the board missed."},
    {"versavis_board_outputs_late", "", Type::counter, Part::board, "late_outputs", 1,
     "Output edges that left late."},
    {"versavis_board_connections", "", Type::counter, Part::board, "connections", 1,
     "Times the board was connected."},
    {"versavis_board_loop_max_seconds", "seconds", Type::gauge, Part::board, "loop_max_ns", 1e9,
     "Longest delay from due to done on the board in the last second."},
    {"versavis_clock_sigma_seconds", "seconds", Type::gauge, Part::clock, "sigma_ns", 1e9,
     "One standard deviation of a stamp made now."},
    {"versavis_clock_bound_seconds", "seconds", Type::gauge, Part::clock, "bound_ns", 1e9,
     "Limit of the error of a stamp made now, however unequal the link's directions are."},
    {"versavis_clock_round_trip_seconds", "seconds", Type::gauge, Part::clock, "round_trip_ns", 1e9,
     "Last round trip of a clock exchange."},
    {"versavis_clock_skew_ratio", "ratio", Type::gauge, Part::clock, "skew_ppm", 1e6,
     "Host clock against board clock, less 1."},
    {"versavis_clock_exchanges", "", Type::counter, Part::clock, "exchanges", 1,
     "Clock exchanges used."},
    {"versavis_clock_restarts", "", Type::counter, Part::clock, "restarts", 1,
     "Times that measurements contradicted the estimate and it started over."},
    {"versavis_clock_output_steps", "", Type::counter, Part::clock, "output_steps", 1,
     "Steps of the clock of the published stamps."},
    {"versavis_clock_host_synchronised", "", Type::gauge, Part::clock, "host_synchronised", 1,
     "1 if the kernel says that the host's clock is synchronised."},
    {"versavis_clock_host_max_error_seconds", "seconds", Type::gauge, Part::clock,
     "host_max_error_ns", 1e9, "Largest distance of the host's clock from UTC by the kernel."},
    {"versavis_camera_configured_hertz", "hertz", Type::gauge, Part::camera, "configured_hz", 1,
     "Rate of the camera as configured."},
    {"versavis_camera_delivered_hertz", "hertz", Type::gauge, Part::camera, "delivered_hz", 1,
     "Good frames per second over the last 2 s."},
    {"versavis_camera_frames_received", "", Type::counter, Part::camera, "frames_received", 1,
     "Complete frames."},
    {"versavis_camera_frames_incomplete", "", Type::counter, Part::camera, "frames_incomplete", 1,
     "Frames that lost packets or had the wrong size."},
    {"versavis_camera_frames_published", "", Type::counter, Part::camera, "frames_published", 1,
     "Frames published."},
    {"versavis_camera_frames_suspect", "", Type::counter, Part::camera, "frames_suspect", 1,
     "Unproved frames that were published nevertheless."},
    {"versavis_camera_frames_without_trigger", "", Type::counter, Part::camera,
     "frames_without_trigger", 1, "Complete frames without a proved exposure."},
    {"versavis_camera_frames_without_buffer", "", Type::counter, Part::camera,
     "frames_without_buffer", 1, "Times frames were lost because no slot was free."},
    {"versavis_camera_triggers", "", Type::counter, Part::camera, "triggers", 1,
     "Triggers that the board reported."},
    {"versavis_camera_triggers_without_frame", "", Type::counter, Part::camera,
     "triggers_without_frame", 1, "Triggers without a proved frame."},
    {"versavis_camera_exposures_unmeasured", "", Type::counter, Part::camera,
     "exposures_unmeasured", 1, "Triggers whose exposure was not seen whole."},
    {"versavis_camera_slips", "", Type::counter, Part::camera, "slips", 1,
     "Times a frame contradicted the pairing."},
    {"versavis_camera_connections", "", Type::counter, Part::camera, "connections", 1,
     "Times the camera was opened."},
    {"versavis_camera_temperature_celsius", "celsius", Type::gauge, Part::camera, "temperature_c",
     1, "Temperature as the camera reports it."},
    {"versavis_imu_configured_hertz", "hertz", Type::gauge, Part::imu, "configured_hz", 1,
     "Rate of the IMU as configured."},
    {"versavis_imu_delivered_hertz", "hertz", Type::gauge, Part::imu, "delivered_hz", 1,
     "Good samples per second over the last 2 s."},
    {"versavis_imu_samples_published", "", Type::counter, Part::imu, "published", 1,
     "Samples published."},
    {"versavis_imu_samples_lost", "", Type::counter, Part::imu, "lost", 1,
     "Samples that never arrived."},
    {"versavis_imu_samples_faulty", "", Type::counter, Part::imu, "faulty", 1,
     "Published samples with a failed check."},
    {"versavis_imu_samples_doubted", "", Type::counter, Part::imu, "doubted", 1,
     "Samples withheld: implausible number, time or flags."},
    {"versavis_ptp_sigma_seconds", "seconds", Type::gauge, Part::ptp, "sigma_ns", 1e9,
     "One standard deviation of PTP's time on the host's clock."},
    {"versavis_ptp_bound_seconds", "seconds", Type::gauge, Part::ptp, "bound_ns", 1e9,
     "Limit of its error."},
    {"versavis_ptp_minus_utc_seconds", "seconds", Type::gauge, Part::ptp, "minus_utc_ns", 1e9,
     "PTP's time less the host's UTC."},
    {"versavis_ptp_steps", "", Type::counter, Part::ptp, "steps", 1,
     "Times that PTP's time stepped."},
    {"versavis_time_output_pulses", "", Type::counter, Part::time_output, "pulses", 1,
     "Seconds of UTC that the board gave a pulse."},
    {"versavis_time_output_error_seconds", "seconds", Type::gauge, Part::time_output, "error_ns",
     1e9, "By how much the newest pulse left after its second."},
    {"versavis_stream_items", "", Type::counter, Part::stream, "items", 1, "Items published."},
};

/// Those that are computed below.
constexpr Family up{"versavis_up",
                    "",
                    Type::gauge,
                    Part::top,
                    "",
                    1,
                    "1 if the service lives and publishes its status."};
constexpr Family info{"versavis_service_info",
                      "",
                      Type::gauge,
                      Part::top,
                      "",
                      1,
                      "Release of the service, and firmware of its board."};
constexpr Family uptime{"versavis_uptime_seconds",        "seconds", Type::gauge, Part::top, "", 1,
                        "Time since the service started."};
constexpr Family status_age{"versavis_status_age_seconds",
                            "seconds",
                            Type::gauge,
                            Part::top,
                            "",
                            1,
                            "Age of the status that these figures are from."};
constexpr Family healthy{"versavis_device_healthy",
                         "",
                         Type::gauge,
                         Part::top,
                         "",
                         1,
                         "1 if a device delivers all that is configured, with proof."};
constexpr Family device_fault{"versavis_device_fault_info",
                              "",
                              Type::gauge,
                              Part::top,
                              "",
                              1,
                              "1 for the fault that a device has, by its name."};
constexpr Family link_load{"versavis_camera_link_load_ratio",
                           "ratio",
                           Type::gauge,
                           Part::camera,
                           "",
                           1,
                           "What all cameras on its link need, of what the link carries."};
constexpr const Family* computed[] = {&up,      &info,         &uptime,   &status_age,
                                      &healthy, &device_fault, &link_load};

using Label = std::pair<std::string_view, std::string>;
using Labels = std::vector<Label>;

std::string escaped(std::string_view text) {
    std::string out;
    for (const char c : text)
        if (c == '\\' || c == '"')
            out += {'\\', c};
        else
            out += c == '\n' ? std::string("\\n") : std::string(1, c);
    return out;
}

std::string sample_name(const Family& family) {
    return fmt::format("{}{}", family.name, family.type == Type::counter ? "_total" : "");
}

/// Samples of one family after another, each family with its description.
class Exposition {
 public:
    explicit Exposition(std::string instance) : instance_(std::move(instance)) {}

    void begin(const Family& family) {
        family_ = &family;
        begun_ = false;
    }

    void add(double value, const Labels& labels) {
        if (!begun_) describe();
        begun_ = true;
        text_ += fmt::format("{}{{service=\"{}\"", sample_name(*family_), escaped(instance_));
        for (const auto& [name, content] : labels)
            text_ += fmt::format(",{}=\"{}\"", name, escaped(content));
        text_ += fmt::format("}} {}\n", value);
    }

    std::string finish() { return std::move(text_) + "# EOF\n"; }

 private:
    void describe() {
        const char* type = family_->type == Type::counter ? "counter" : "gauge";
        text_ += fmt::format("# TYPE {} {}\n", family_->name, type);
        if (!family_->unit.empty())
            text_ += fmt::format("# UNIT {} {}\n", family_->name, family_->unit);
        text_ += fmt::format("# HELP {} {}\n", family_->name, family_->help);
    }

    std::string instance_;
    const Family* family_ = nullptr;
    bool begun_ = false;  ///< a family without samples is left out
    std::string text_;
};

/// What is unknown has no sample.
std::optional<double> number(const json& object, std::string_view key) {
    const auto found = object.find(key);
    if (found == object.end()) return std::nullopt;
    if (found->is_boolean()) return found->get<bool>() ? 1 : 0;
    return found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

const char* kind_of(Part part) {
    switch (part) {
        case Part::camera: return "cameras";
        case Part::imu: return "imus";
        case Part::time_output: return "time_outputs";
        case Part::stream: return "streams";
        case Part::board: return "board";
        case Part::ptp: return "ptp";
        default: return "clock";
    }
}

const char* label_of(Part part) {
    switch (part) {
        case Part::camera: return "camera";
        case Part::imu: return "imu";
        case Part::time_output: return "time_output";
        default: return "stream";
    }
}

/// Each object that has the keys of a part, with its labels.
template <class Use>
void for_each(const json& status, Part part, Use use) {
    const auto found = status.find(kind_of(part));
    if (found == status.end()) return;
    if (found->is_object()) return use(*found, Labels{});
    for (const json& object : *found)
        use(object, Labels{{label_of(part), object.value("name", "")}});
}

/// Board, clock, cameras and IMUs.
template <class Use>
void for_each_device(const json& status, Use use) {
    for (const char* name : {"board", "clock"})
        if (status.contains(name)) use(status[name], std::string(name));
    for (const char* kind : device_arrays)
        for (const json& device : status.value(kind, json::array()))
            use(device, device.value("name", ""));
}

void add_service(Exposition& out, const json& status, HostTime now) {
    const json board = status.value("board", json::object());
    out.begin(info);
    out.add(1, {{"release", status.value("release", "")},
                {"firmware", board.value("firmware", "")},
                {"board", board.value("serial", "")}});
    const double made_ns = status.value("host_time_ns", 0.0);
    out.begin(uptime);
    out.add((made_ns - status.value("started_ns", 0.0)) / 1e9, {});
    out.begin(status_age);
    out.add((static_cast<double>(now.ns) - made_ns) / 1e9, {});
    out.begin(healthy);
    for_each_device(status, [&](const json& device, const std::string& name) {
        out.add(device.value("health", "") == "ok" ? 1 : 0, {{"device", name}});
    });
    out.begin(device_fault);
    for_each_device(status, [&](const json& device, const std::string& name) {
        const std::string word = device.value("fault", "");
        if (!word.empty()) out.add(1, {{"device", name}, {"fault", word}});
    });
    out.begin(link_load);
    for_each(status, Part::camera, [&](const json& camera, const Labels& labels) {
        const double carried = camera.value("link_mbps", 0.0);
        if (carried > 0) out.add(camera.value("link_needed_mbps", 0.0) / carried, labels);
    });
}

}  // namespace

std::string openmetrics_text(const std::string& instance, const std::optional<json>& status,
                             HostTime now) {
    Exposition out(instance);
    out.begin(up);
    out.add(status ? 1 : 0, {});
    if (!status) return out.finish();
    add_service(out, *status, now);
    for (const Family& family : families) {
        out.begin(family);
        for_each(*status, family.part, [&](const json& object, const Labels& labels) {
            const auto value = number(object, family.key);
            if (value) out.add(*value / family.divisor, labels);
        });
    }
    return out.finish();
}

std::vector<std::string> metric_names() {
    std::vector<std::string> names;
    for (const Family* family : computed) names.push_back(sample_name(*family));
    for (const Family& family : families) names.push_back(sample_name(family));
    return names;
}

}  // namespace versavis::client

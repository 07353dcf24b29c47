// SPDX-License-Identifier: BSD-3-Clause
#include "tail.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "clock/clock_json.hpp"
#include "engine/clock/recording.hpp"
#include "engine/pairing/recording.hpp"
#include "pairing/evidence_json.hpp"
#include "base/shallow_json.hpp"
#include "status/status_document.hpp"
#include "versavis/stream.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

json describe(const ring::Item& item) {
    json line{{"number", item.number}, {"time_ns", item.time.ns}};
    if (item.stale) line["stale"] = true;
    return line;
}

/// JSON numbers have no NaN: what is not known, or a part does not measure, is null.
json vector(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

json describe(const Frame& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    const FrameMetadata& d = item.data;
    const SensorState sensor = item.sensor();
    line.update({{"kind", to_string(d.stamp_kind())},
                 {"sigma_ns", d.sigma_ns == sigma_unknown ? json(nullptr) : json(d.sigma_ns)},
                 {"trigger", d.trigger},
                 {"block_id", d.block_id},
                 {"exposure_ns", d.exposure.ns},
                 {"board_time_ns", d.board_time.ns},
                 {"host_time_ns", d.host_time.ns},
                 {"arrival_ns", d.arrival.ns},
                 {"camera_time_ns", d.camera_time.ns},
                 {"delay_ns", d.delay_ns},
                 {"gain", sensor.gain},
                 {"temperature_c", sensor.temperature_c},
                 {"tick", d.tick()},
                 {"width", d.width},
                 {"height", d.height},
                 {"pixel_format", d.pixel_format},
                 {"format", pixel_format_name(d.pixel_format)},
                 {"epoch", d.epoch},
                 {"flags", d.flags},
                 {"bytes", item.payload.size()}});
    return line;
}

json describe(const ImuSample& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    const ImuMetadata& d = item.data;
    line.update(
        {{"sample", d.number},
         {"sigma_ns", d.sigma_ns},
         {"filter_delay_ns", d.filter_delay.ns},
         {"accel_age_ns", (d.flags & flag_accel_age) != 0 ? json(d.accel_age_ns) : json(nullptr)},
         {"gyro_rad_s", vector(d.gyro)},
         {"accel_m_s2", vector(d.accel)},
         {"magnetic_t", vector(d.magnetic)},
         {"temperature_c", d.temperature},
         {"pressure_pa", d.pressure},
         {"board_time_ns", d.board_time.ns},
         {"host_time_ns", d.host_time.ns},
         {"epoch", d.epoch},
         {"flags", d.flags}});
    return line;
}

json describe(const Event& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    const EventMetadata& d = item.data;
    line.update(
        {{"event", to_string(d.kind)},
         {"source", std::string(d.source_name, ::strnlen(d.source_name, sizeof d.source_name))},
         {"reason", to_string(d.reason)},
         {"value", d.value},
         {"count", d.count},
         {"board_time_ns", d.board_time.ns},
         {"host_time_ns", d.host_time.ns},
         {"epoch", d.epoch}});
    return line;
}

json describe(const pairing::EvidenceItem& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    const auto evidence = pairing::from_metadata(item.data);
    line.update(evidence ? to_json(*evidence) : json{{"evidence", "unknown"}});
    return line;
}

json describe(const clock::StampItem& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    const auto told = clock::from_metadata(item.data);
    line.update(told ? to_json(*told) : json{{"clock", "unknown"}});
    return line;
}

/// The document itself, so that a script sees what the status command sees.
json describe(const StatusDocument& item) {
    std::string text(item.payload.size(), '\0');
    json line = describe(static_cast<const ring::Item&>(item));
    if (item.payload.copy_to(reinterpret_cast<std::byte*>(text.data())))
        line["status"] = parse_shallow_json(text);
    return line;
}

std::string one_line(const json& line, bool as_json) {
    // Whatever bytes a name has.
    constexpr auto replace = json::error_handler_t::replace;
    if (as_json) return line.dump(-1, ' ', false, replace);
    std::string text;
    for (const auto& [key, value] : line.items())
        text += fmt::format("{}{}={}", text.empty() ? "" : " ", key,
                            value.dump(-1, ' ', false, replace));
    return text;
}

template <class S>
Expected<> print_stream(const TailSettings& settings) {
    StreamOptions options;
    options.instance = settings.instance;
    if (settings.oldest) options.start = Position::oldest;
    auto stream = S::open(settings.stream, options);
    if (!stream) return Unexpected(stream.error());
    bool gone = false;
    for (std::uint64_t printed = 0;
         (settings.count == 0 || printed < settings.count) && !settings.stop();) {
        const auto item = stream->next(settings.wait);
        if (item) {
            fmt::print("{}\n", one_line(describe(*item), settings.json));
            std::fflush(stdout);
            ++printed;
            gone = false;
        } else if (item.error().why != Pause::nothing &&
                   !(gone && item.error().why == Pause::gone)) {
            fmt::print(stderr, "versavis: {}\n", item.error().message());
            gone = item.error().why == Pause::gone;
        }
    }
    return {};
}

}  // namespace

Expected<> tail(const TailSettings& settings) {
    auto reader = ring::Reader::open(stream_path(settings.instance, settings.stream));
    if (!reader) return Unexpected(explain(reader.error(), settings.instance, settings.stream));
    switch (reader->kind()) {
        case ring::StreamKind::frames: return print_stream<FrameStream>(settings);
        case ring::StreamKind::imu: return print_stream<ImuStream>(settings);
        case ring::StreamKind::events: return print_stream<EventStream>(settings);
        case ring::StreamKind::status: return print_stream<StatusStream>(settings);
        case ring::StreamKind::evidence: return print_stream<pairing::EvidenceStream>(settings);
        case ring::StreamKind::clock: return print_stream<clock::ClockStream>(settings);
    }
    return failure(settings.stream, "is a kind of stream that this program does not know",
                   "install service and clients of the same release");
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "record/item_writer.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "recording/item_fields.hpp"
#include "recording/mcap_record.hpp"

namespace versavis::client {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint32_t utc_label = static_cast<std::uint32_t>(EventKind::utc_label);

/// From one status message to the next.
constexpr std::int64_t status_period_ns = 900'000'000;

constexpr const char* any_object = R"({"type":"object"})";

Json item_json(ring::StreamKind kind, const ring::Item& item) {
    Json document{{"time_ns", item.time.ns}, {"life", fmt::format("{:016x}", item.life)}};
    add_fields(document, kind, item.metadata, item.payload.attributes());
    return document;
}

/// A name in it may be no UTF-8: it must not end the recording.
std::string dump(const Json& document) {
    return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

const char* to_string(GapReason reason) {
    switch (reason) {
        case GapReason::lost: return "lost";
        case GapReason::restarted: return "restarted";
        case GapReason::gone: return "gone";
        case GapReason::epoch: return "epoch";
    }
    return "unknown";
}

std::uint16_t ItemWriter::ros_channel(Channels& channels, const std::string& topic,
                                      const std::string& type) {
    auto& id = channels.by_topic[topic];
    // What a player of ROS 2 offers with the topic; the profile wants it there.
    if (id == 0)
        id = file_.add(
            {topic, "cdr", type, "ros2msg", ros_definition(type), {{"offered_qos_profiles", ""}}});
    return id;
}

std::uint16_t ItemWriter::json_channel(Channels& channels, const std::string& topic,
                                       const std::string& schema) {
    auto& id = channels.by_topic[topic];
    if (id == 0) id = file_.add({topic, "json", "versavis." + schema, "jsonschema", any_object});
    return id;
}

std::uint16_t ItemWriter::item_channel(Channels& channels, const std::string& stream,
                                       ring::StreamKind kind) {
    const std::string topic = "/versavis/" + stream + "/item";
    auto& id = channels.by_topic[topic];
    if (id == 0)
        id = file_.add(
            {topic,
             "versavis_item",
             "versavis.Item",
             "",
             "",
             {{"kind", std::to_string(static_cast<std::uint32_t>(kind))}, {"stream", stream}}});
    return id;
}

ItemWriter::Outcome ItemWriter::write(const std::string& stream, ring::StreamKind kind,
                                      const ring::Item& item) {
    std::string payload(item.payload.size(), '\0');
    if (!payload.empty() && !item.payload.copy_to(reinterpret_cast<std::byte*>(payload.data())))
        return Outcome::overtaken;
    Channels& channels = streams_[stream];
    ++channels.sequence;
    if (kind == ring::StreamKind::imu) write_imu(channels, stream, item);
    if (kind == ring::StreamKind::events) write_event(channels, item);
    if (kind == ring::StreamKind::status) write_status(channels, item, payload);
    write_item(channels, stream, kind, item, payload);
    return Outcome::written;
}

Expected<ItemWriter::Outcome> ItemWriter::write_frame(const std::string& stream,
                                                      const ring::Item& item) {
    Channels& channels = streams_[stream];
    ++channels.sequence;
    const auto frame = unpack<FrameMetadata>(item.metadata);
    const std::span pixels(item.payload.data(), item.payload.size());
    const auto length = static_cast<std::uint32_t>(pixels.size());
    const std::uint16_t channel =
        ros_channel(channels, "/" + stream + "/image_raw", "sensor_msgs/msg/Image");
    auto written = file_.write({channel, channels.sequence, item.time.ns},
                               ros_image_head(item.time, stream, frame, length), pixels);
    if (!written) return Unexpected(written.error());
    if (!item.valid()) {
        file_.take_back();
        return Outcome::overtaken;
    }
    write_item(channels, stream, ring::StreamKind::frames, item,
               mcap_number(item.payload.attributes()));
    write_frame_notes(channels, stream, item);
    return Outcome::written;
}

Expected<> ItemWriter::write_png(const std::string& stream, const ring::Item& item,
                                 const std::vector<std::byte>& png) {
    Channels& channels = streams_[stream];
    ++channels.sequence;
    const auto frame = unpack<FrameMetadata>(item.metadata);
    const std::uint16_t channel = ros_channel(channels, "/" + stream + "/image_raw/compressed",
                                              "sensor_msgs/msg/CompressedImage");
    auto written = file_.write(
        {channel, channels.sequence, item.time.ns},
        ros_png_head(item.time, stream, frame, static_cast<std::uint32_t>(png.size())), png);
    if (!written) return written;
    write_item(channels, stream, ring::StreamKind::frames, item,
               mcap_number(item.payload.attributes()));
    write_frame_notes(channels, stream, item);
    return {};
}

void ItemWriter::write_item(Channels& channels, const std::string& stream, ring::StreamKind kind,
                            const ring::Item& item, const std::string& payload) {
    std::string data = mcap_number(item.number) + mcap_number(item.life) +
                       mcap_number(item.time.ns) +
                       mcap_number(static_cast<std::uint32_t>(item.payload.size())) +
                       mcap_number(std::uint32_t{0});
    for (const std::uint64_t word : item.metadata) data += mcap_number(word);
    file_.write({item_channel(channels, stream, kind), channels.sequence, item.time.ns},
                data + payload);
}

void ItemWriter::write_frame_notes(Channels& channels, const std::string& stream,
                                   const ring::Item& item) {
    const auto frame = unpack<FrameMetadata>(item.metadata);
    file_.write({json_channel(channels, "/versavis/" + stream + "/stamp", "Stamp"),
                 channels.sequence, item.time.ns},
                dump(item_json(ring::StreamKind::frames, item)));
    const auto lens = lenses_.find(stream);
    file_.write(
        {ros_channel(channels, "/" + stream + "/camera_info", "sensor_msgs/msg/CameraInfo"),
         channels.sequence, item.time.ns},
        ros_camera_info(item.time, stream, frame, lens == lenses_.end() ? nullptr : &lens->second));
}

void ItemWriter::write_imu(Channels& channels, const std::string& stream, const ring::Item& item) {
    const auto sample = unpack<ImuMetadata>(item.metadata);
    const auto add = [&](const char* topic, const char* type, const std::string& message) {
        file_.write(
            {ros_channel(channels, "/" + stream + topic, type), channels.sequence, item.time.ns},
            message);
    };
    add("/data_raw", "sensor_msgs/msg/Imu", ros_imu(item.time, stream, sample));
    if (!std::isnan(sample.magnetic[0]))
        add("/mag", "sensor_msgs/msg/MagneticField", ros_magnetic_field(item.time, stream, sample));
    if (std::isnan(sample.temperature) || sample.temperature == channels.temperature) return;
    channels.temperature = sample.temperature;
    add("/temperature", "sensor_msgs/msg/Temperature", ros_temperature(item.time, stream, sample));
}

void ItemWriter::write_event(Channels& channels, const ring::Item& item) {
    const auto event = unpack<EventMetadata>(item.metadata);
    file_.write(
        {json_channel(channels, "/versavis/events", "Event"), channels.sequence, item.time.ns},
        dump(item_json(ring::StreamKind::events, item)));
    if (static_cast<std::uint32_t>(event.kind) != utc_label) return;
    const OutputTime utc{event.value * 1'000'000'000};
    file_.write({ros_channel(channels, "/utc", "sensor_msgs/msg/TimeReference"), channels.sequence,
                 item.time.ns},
                ros_utc(item.time, utc));
}

void ItemWriter::write_status(Channels& channels, const ring::Item& item,
                              const std::string& document) {
    if (item.time.ns - channels.status_ns < status_period_ns && item.time.ns > channels.status_ns)
        return;
    channels.status_ns = item.time.ns;
    file_.write(
        {json_channel(channels, "/versavis/status", "Status"), channels.sequence, item.time.ns},
        document);
}

void ItemWriter::write_gap(const std::string& stream, GapReason reason, std::uint64_t items,
                           OutputTime last, OutputTime time, std::uint32_t epoch) {
    Channels& channels = streams_[stream];
    file_.write(
        {json_channel(channels, "/versavis/" + stream + "/gap", "Gap"), channels.sequence, time.ns},
        dump(Json{{"reason", to_string(reason)},
                  {"items", items},
                  {"time_ns", last.ns},
                  {"epoch", epoch}}));
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "record/item_writer.hpp"

#include <cmath>

#include "base/byte_cursor.hpp"
#include "recording/mcap_record.hpp"
#include "ros_client/names.hpp"

namespace versavis::client {

namespace {

constexpr std::uint32_t utc_label = static_cast<std::uint32_t>(EventKind::utc_label);

/// From one status message to the next.
constexpr std::int64_t status_period_ns = 900'000'000;

std::string own_topic(const std::string& stream, const char* part) {
    return "/versavis/" + ros_client::topic_part(stream) + part;
}

std::string ros_topic(const std::string& stream, const char* part) {
    return "/" + ros_client::topic_part(stream) + part;
}

std::span<const std::byte> as_bytes(const std::string& text) {
    return std::as_bytes(std::span(text));
}

ItemMessage message_of(ring::StreamKind kind, const ring::Item& item, const std::string& payload) {
    return {item.number,
            item.time.life,
            item.time.output(),
            static_cast<std::uint32_t>(item.payload.size()),
            kind,
            item.metadata,
            as_bytes(payload)};
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

std::uint16_t ItemWriter::channel(Channels& channels, const std::string& stream,
                                  const std::string& topic, std::string_view type,
                                  std::optional<ring::StreamKind> kind) {
    auto& id = channels.by_topic[topic];
    if (id == 0) id = file_.add(recorded_topic(topic, type, stream, kind));
    return id;
}

ItemWriter::Outcome ItemWriter::write(const std::string& stream, ring::StreamKind kind,
                                      const ring::Item& item) {
    std::string payload(item.payload.size(), '\0');
    if (!payload.empty() && !item.payload.copy_to(reinterpret_cast<std::byte*>(payload.data())))
        return Outcome::overtaken;
    Channels& channels = streams_[stream];
    ++channels.sequence;
    const ItemMessage message = message_of(kind, item, payload);
    if (kind == ring::StreamKind::imu) write_imu(channels, stream, item);
    if (kind == ring::StreamKind::events) write_event(channels, stream, message);
    if (kind == ring::StreamKind::nmea)
        file_.write({channel(channels, stream, ros_topic(stream, "/nmea_sentence"), sentence_type),
                     channels.sequence, item.time.ns},
                    ros_sentence(item.time.output(), stream, payload));
    if (kind == ring::StreamKind::status) write_status(channels, stream, item, payload);
    write_item(channels, stream, message);
    return Outcome::written;
}

Expected<ItemWriter::Outcome> ItemWriter::write_frame(const std::string& stream,
                                                      const ring::Item& item) {
    Channels& channels = streams_[stream];
    ++channels.sequence;
    const auto frame = unpack<FrameMetadata>(item.metadata);
    const std::span pixels(item.payload.data(), item.payload.size());
    const auto length = static_cast<std::uint32_t>(pixels.size());
    const std::uint16_t id =
        channel(channels, stream, ros_topic(stream, "/image_raw"), "sensor_msgs/msg/Image");
    auto written = file_.write({id, channels.sequence, item.time.ns},
                               ros_image_head(item.time.output(), stream, frame, length), pixels);
    if (!written) return Unexpected(written.error());
    if (!item.valid()) {
        file_.take_back();
        return Outcome::overtaken;
    }
    const std::string attributes = mcap_number(item.payload.attributes());
    const ItemMessage message = message_of(ring::StreamKind::frames, item, attributes);
    write_item(channels, stream, message);
    write_frame_notes(channels, stream, message);
    return Outcome::written;
}

Expected<> ItemWriter::write_png(const std::string& stream, const ring::Item& item,
                                 const std::vector<std::byte>& png) {
    Channels& channels = streams_[stream];
    ++channels.sequence;
    const auto frame = unpack<FrameMetadata>(item.metadata);
    const std::uint16_t id = channel(channels, stream, ros_topic(stream, "/image_raw/compressed"),
                                     "sensor_msgs/msg/CompressedImage");
    auto written = file_.write(
        {id, channels.sequence, item.time.ns},
        ros_png_head(item.time.output(), stream, frame, static_cast<std::uint32_t>(png.size())),
        png);
    if (!written) return written;
    const std::string attributes = mcap_number(item.payload.attributes());
    const ItemMessage message = message_of(ring::StreamKind::frames, item, attributes);
    write_item(channels, stream, message);
    write_frame_notes(channels, stream, message);
    return {};
}

void ItemWriter::write_item(Channels& channels, const std::string& stream,
                            const ItemMessage& item) {
    file_.write({channel(channels, stream, own_topic(stream, "/item"), item_type, item.kind),
                 channels.sequence, item.time.ns},
                item_message(item));
}

void ItemWriter::write_frame_notes(Channels& channels, const std::string& stream,
                                   const ItemMessage& item) {
    const auto frame = unpack<FrameMetadata>(item.metadata);
    file_.write({channel(channels, stream, own_topic(stream, "/stamp"), stamp_type),
                 channels.sequence, item.time.ns},
                note_message(stream, item));
    file_.write(
        {channel(channels, stream, ros_topic(stream, "/camera_info"), "sensor_msgs/msg/CameraInfo"),
         channels.sequence, item.time.ns},
        ros_camera_info(item.time, stream, frame, lenses_.find(stream)));
}

void ItemWriter::write_imu(Channels& channels, const std::string& stream, const ring::Item& item) {
    const auto sample = unpack<ImuMetadata>(item.metadata);
    const auto add = [&](const char* topic, const char* type, const std::string& message) {
        file_.write({channel(channels, stream, ros_topic(stream, topic), type), channels.sequence,
                     item.time.ns},
                    message);
    };
    add("/data_raw", "sensor_msgs/msg/Imu", ros_imu(item.time.output(), stream, sample));
    if (!std::isnan(sample.magnetic[0]))
        add("/mag", "sensor_msgs/msg/MagneticField",
            ros_magnetic_field(item.time.output(), stream, sample));
    if (std::isnan(sample.temperature) || sample.temperature == channels.temperature) return;
    channels.temperature = sample.temperature;
    add("/temperature", "sensor_msgs/msg/Temperature",
        ros_temperature(item.time.output(), stream, sample));
}

void ItemWriter::write_event(Channels& channels, const std::string& stream,
                             const ItemMessage& item) {
    const auto event = unpack<EventMetadata>(item.metadata);
    file_.write({channel(channels, stream, "/versavis/events", event_type), channels.sequence,
                 item.time.ns},
                note_message(stream, item));
    if (static_cast<std::uint32_t>(event.kind) != utc_label) return;
    const OutputTime utc{event.value * 1'000'000'000};
    file_.write({channel(channels, stream, "/utc", "sensor_msgs/msg/TimeReference"),
                 channels.sequence, item.time.ns},
                ros_utc(item.time, utc));
}

void ItemWriter::write_status(Channels& channels, const std::string& stream, const ring::Item& item,
                              const std::string& document) {
    if (item.time.ns - channels.status_ns < status_period_ns && item.time.ns > channels.status_ns)
        return;
    channels.status_ns = item.time.ns;
    file_.write(
        {channel(channels, stream, "/versavis/status", text_type), channels.sequence, item.time.ns},
        text_message(document));
}

void ItemWriter::write_gap(const std::string& stream, GapReason reason, std::uint64_t items,
                           OutputTime last, OutputTime time, std::uint32_t epoch) {
    Channels& channels = streams_[stream];
    file_.write({channel(channels, stream, own_topic(stream, "/gap"), gap_type), channels.sequence,
                 time.ns},
                gap_message(stream, time, {to_string(reason), items, last, epoch}));
}

}  // namespace versavis::client

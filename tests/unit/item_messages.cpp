// SPDX-License-Identifier: BSD-3-Clause
#include "recording/item_messages.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#include "recording/ros_messages.hpp"
#include "ros_decoder.hpp"
#include "versavis/fields.hpp"
#include "versavis/metadata.hpp"

using namespace versavis;
using namespace versavis::client;

namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
    return std::as_bytes(std::span(text));
}

nlohmann::json decoded(std::string_view type, const std::string& message) {
    return test::RosDecoder(ros_definition(type)).decode(message);
}

std::string without_comments(const std::string& path) {
    std::ifstream file(path);
    std::string text;
    for (std::string line; std::getline(file, line);)
        if (line.rfind('#', 0) != 0) text += line + "\n";
    return text;
}

}  // namespace

TEST_CASE("item_messages: the package of ROS has the definitions that recordings have") {
    for (const std::string_view type : {item_type, stamp_type, event_type, gap_type}) {
        const std::string path = VERSAVIS_SOURCE_DIR "/clients/ros/versavis_msgs/msg/" +
                                 std::string(type.substr(type.rfind('/') + 1)) + ".msg";
        INFO(path);
        CHECK(without_comments(path) == versavis_fields(type));
        CHECK(ros_definition(type).rfind(versavis_fields(type), 0) == 0);
    }
}

TEST_CASE("item_messages: an item comes back as it was, and cut off with its beginning") {
    ItemMessage item{7, 8, {-9}, 3, ring::StreamKind::status, {}, {}};
    for (std::size_t i = 0; i < item.metadata.size(); ++i) item.metadata[i] = i * 0x0101010101;
    const std::string payload("a\0b", 3);
    item.payload = bytes_of(payload);
    const std::string message = item_message(item);
    std::uint64_t size = 0;
    const auto back = parse_item_message(bytes_of(message), size);
    REQUIRE(back);
    CHECK(size == 3);
    CHECK(back->number == 7);
    CHECK(back->life == 8);
    CHECK(back->time.ns == -9);
    CHECK(back->length == 3);
    CHECK(back->kind == ring::StreamKind::status);
    CHECK(back->metadata == item.metadata);
    CHECK(std::memcmp(back->payload.data(), payload.data(), 3) == 0);
    const auto begun = parse_item_message(bytes_of(message).first(message.size() - 2), size);
    REQUIRE(begun);
    CHECK(size == 3);
    CHECK(begun->payload.size() == 1);
    CHECK_FALSE(parse_item_message(bytes_of(message).first(135), size));
    const auto json = decoded(item_type, message);
    CHECK(json["time_ns"] == -9);
    CHECK(json["kind"] == 4);
    CHECK(json["metadata"][11] == item.metadata[11]);
    CHECK(json["payload"].size() == 3);
}

TEST_CASE("item_messages: a stamp has each field of the table, and nothing for what is unknown") {
    FrameMetadata frame{};
    frame.trigger = 5;
    frame.set_tick(0x100000002);
    frame.width = 64;
    frame.sigma_ns = 900;
    frame.pixel_format = 0x01080001;
    frame.flags = flag_suspect;
    const SensorState sensor{2.5F, std::nanf("")};
    const std::uint64_t attributes = pack(sensor);
    ItemMessage item{1,
                     0xFEDCBA9876543210,
                     {1'500'000'000},
                     0,
                     ring::StreamKind::frames,
                     pack(frame),
                     std::as_bytes(std::span(&attributes, 1))};
    auto json = decoded(stamp_type, note_message("cam0", item));
    for (const Field& field : fields_of(ring::StreamKind::frames)) {
        INFO(field.name);
        CHECK(json.contains(field.name));
    }
    CHECK(json["header"]["stamp"]["sec"] == 1);
    CHECK(json["header"]["stamp"]["nanosec"] == 500'000'000);
    CHECK(json["header"]["frame_id"] == "cam0");
    CHECK(json["life"] == 0xFEDCBA9876543210);
    CHECK(json["trigger"] == nlohmann::json{5});
    CHECK(json["tick"] == nlohmann::json{0x100000002});
    CHECK(json["sigma_ns"] == nlohmann::json{900});
    CHECK(json["suspect"] == true);
    CHECK(json["holdover"] == false);
    CHECK(json["width"] == 64);
    CHECK(json["format"] == "Mono8");
    CHECK(json["gain"] == 2.5);
    CHECK(std::isnan(json["temperature_c"].get<float>()));
    CHECK(json["camera_time_ns"].empty());
    frame.trigger = 0;
    frame.sigma_ns = sigma_unknown;
    item.metadata = pack(frame);
    item.payload = {};
    json = decoded(stamp_type, note_message("cam0", item));
    CHECK(json["trigger"].empty());
    CHECK(json["tick"].empty());
    CHECK(json["sigma_ns"].empty());
    CHECK(std::isnan(json["gain"].get<float>()));
}

TEST_CASE("item_messages: events, gaps and texts are decoded by their definitions") {
    EventMetadata event{};
    event.kind = EventKind::utc_label;
    event.value = -3;
    std::strncpy(event.source_name, "pps", sizeof event.source_name - 1);
    const ItemMessage item{1, 2, {3}, 0, ring::StreamKind::events, pack(event), {}};
    const auto json = decoded(event_type, note_message("events", item));
    CHECK(json["kind"] == to_string(EventKind::utc_label));
    CHECK(json["value"] == -3);
    CHECK(json["source_name"] == "pps");
    const std::string message = gap_message("cam0", {5}, {"lost", 4, {3}, 2});
    CHECK(decoded(gap_type, message)["reason"] == "lost");
    const auto gap = parse_gap_message(bytes_of(message));
    REQUIRE(gap);
    CHECK(gap->items == 4);
    CHECK(gap->last.ns == 3);
    CHECK(gap->epoch == 2);
    CHECK_FALSE(parse_gap_message(bytes_of(message).first(message.size() - 1)));
    CHECK(decoded(text_type, text_message("{}"))["data"] == "{}");
    CHECK(note_message("imu0", {0, 0, {}, 0, ring::StreamKind::imu, {}, {}}).empty());
}

TEST_CASE("item_messages: topics keep their stream") {
    const McapTopic topic = recorded_topic("/versavis/cam0_evidence/item", item_type,
                                           "cam0-evidence", ring::StreamKind::evidence);
    const auto role = role_of({1, 1, topic.name, topic.encoding, topic.metadata});
    CHECK(role.role == Role::item);
    CHECK(role.stream == "cam0-evidence");
    CHECK(role.kind == ring::StreamKind::evidence);
    CHECK_FALSE(role.old);
    const auto old = role_of({1,
                              1,
                              "/versavis/cam0-evidence/item",
                              "versavis_item",
                              {{"kind", "5"}, {"stream", "cam0-evidence"}}});
    CHECK(old.role == Role::item);
    CHECK(old.old);
    CHECK(role_of({1, 1, "/versavis/cam0/stamp", "json", {}}).role == Role::stamp);
    CHECK(role_of({1, 1, "/versavis/events", "json", {}}).stream == "events");
    CHECK(role_of({1, 1, "/cam0/image_raw", "ros1", {}}).role == Role::other);
    CHECK(role_of({1, 1, "/versavis/../item", "cdr", {{"kind", "5"}}}).role == Role::other);
}

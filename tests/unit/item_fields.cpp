// SPDX-License-Identifier: BSD-3-Clause
#include "recording/item_fields.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "versavis/metadata.hpp"

using namespace versavis;
using namespace versavis::client;
using nlohmann::json;

namespace {

constexpr float not_known = std::numeric_limits<float>::quiet_NaN();

FrameMetadata known_frame() {
    FrameMetadata frame{};
    frame.trigger = 7;
    frame.block_id = 8;
    frame.board_time = {9};
    frame.host_time = {10};
    frame.arrival = {11};
    frame.exposure = {12};
    frame.camera_time = {13};
    frame.sigma_ns = 14;
    frame.width = 15;
    frame.height = 16;
    frame.stride = 17;
    frame.pixel_format = 0x01080001;
    frame.epoch = 18;
    frame.flags = 1 | flag_holdover | flag_camera_length;
    frame.set_tick(5'000'000'000);
    frame.delay_ns = -19;
    return frame;
}

template <class T>
json as_json(ring::StreamKind kind, const T& metadata, std::uint64_t attributes = 0) {
    json line;
    add_fields(line, kind, pack(metadata), attributes);
    return line;
}

std::string text_of(const std::string& name) {
    std::ifstream file(std::string(VERSAVIS_SOURCE_DIR) + "/docs/contracts/" + name);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

/// From this heading to the next one.
std::string section(const std::string& text, const std::string& heading) {
    const auto begin = text.find("\n## " + heading);
    REQUIRE(begin != std::string::npos);
    return text.substr(begin, text.find("\n## ", begin + 1) - begin);
}

struct Row {
    unsigned offset;
    std::string name;
    std::string meaning;
    std::string type;
};

std::vector<Row> rows_of(const std::string& text) {
    const std::regex row(R"(\n\| (\d+) \| (?:`(\w+)`)? ?\| ([^|]*) \| ([^|]*) \|)");
    std::vector<Row> rows;
    for (std::sregex_iterator at(text.begin(), text.end(), row), end; at != end; ++at)
        rows.push_back({static_cast<unsigned>(std::stoul((*at)[1])), (*at)[2], (*at)[3], (*at)[4]});
    return rows;
}

std::string type_of(const Field& field) {
    switch (field.type) {
        case FieldType::u64: return "u64";
        case FieldType::i64: return "i64";
        case FieldType::i32: return "i32";
        case FieldType::f32: return field.count == 1 ? "f32" : "f32[3]";
        case FieldType::text: return "char[32]";
        default: return "u32";
    }
}

/// What stands in flags, or says the same in words: no row of their own.
bool derived(const Field& field) {
    return field.type == FieldType::flag || field.type == FieldType::stamp_kind ||
           field.type == FieldType::pixel_format;
}

}  // namespace

TEST_CASE("item_fields: a frame says all that is known") {
    const json line = as_json(ring::StreamKind::frames, known_frame(), pack(SensorState{6.5F, 41}));
    CHECK(line == json::parse(R"({"epoch": 18, "sigma_ns": 14, "kind": "predicted",
        "suspect": false, "holdover": true, "clamped": false, "sensor_error": false,
        "camera_length": true, "flags": 265, "trigger": 7, "tick": 5000000000, "block_id": 8,
        "board_time_ns": 9, "host_time_ns": 10, "arrival_ns": 11, "camera_time_ns": 13,
        "exposure_ns": 12, "delay_ns": -19, "width": 15, "height": 16, "stride": 17,
        "pixel_format": 17301505, "format": "Mono8", "gain": 6.5, "temperature_c": 41.0})"));
    CHECK(field_columns(ring::StreamKind::frames) ==
          ",epoch,sigma_ns,kind,suspect,holdover,clamped,sensor_error,camera_length,flags,trigger,"
          "tick,block_id,board_time_ns,host_time_ns,arrival_ns,camera_time_ns,exposure_ns,delay_ns,"
          "width,height,stride,pixel_format,format,gain,temperature_c");
    CHECK(field_row(ring::StreamKind::frames, pack(known_frame()), pack(SensorState{6.5F, 41})) ==
          ",18,14,predicted,0,1,0,0,1,265,7,5000000000,8,9,10,11,13,12,-19,15,16,17,17301505,Mono8,"
          "6.5,41");
}

TEST_CASE("item_fields: what is unknown is null, and empty in CSV") {
    FrameMetadata frame{};
    frame.sigma_ns = sigma_unknown;
    frame.flags = 3 | flag_suspect;
    const json line = as_json(ring::StreamKind::frames, frame, pack(SensorState{}));
    for (const char* name : {"sigma_ns", "trigger", "board_time_ns", "camera_time_ns",
                             "exposure_ns", "gain", "temperature_c"})
        CHECK(line.at(name).is_null());
    CHECK(line.at("kind") == "arrival");
    CHECK(line.at("suspect") == true);
    CHECK(field_row(ring::StreamKind::frames, pack(frame), pack(SensorState{})) ==
          ",0,,arrival,1,0,0,0,0,7,,0,0,,0,0,,,0,0,0,0,0,unknown,,");
}

TEST_CASE("item_fields: an IMU sample") {
    ImuMetadata sample{};
    sample.number = 5;
    sample.gyro[0] = 0.5F;
    sample.gyro[2] = -2;
    sample.accel[1] = 9.75F;
    sample.magnetic[0] = sample.magnetic[1] = sample.magnetic[2] = not_known;
    sample.temperature = 25;
    sample.pressure = not_known;
    sample.sigma_ns = sigma_unknown;
    sample.accel_age_ns = 300;
    sample.flags = flag_repeated;
    json line = as_json(ring::StreamKind::imu, sample);
    CHECK(line.at("gyro_rad_s") == json({0.5, 0.0, -2.0}));
    CHECK(line.at("magnetic_t") == json({nullptr, nullptr, nullptr}));
    CHECK(line.at("temperature_c") == 25);
    for (const char* name : {"pressure_pa", "sigma_ns", "accel_age_ns"})
        CHECK(line.at(name).is_null());
    CHECK(line.at("repeated") == true);
    CHECK(field_columns(ring::StreamKind::imu).find(",gyro_rad_s_x,gyro_rad_s_y,gyro_rad_s_z,") !=
          std::string::npos);
    sample.flags |= flag_accel_age;
    CHECK(as_json(ring::StreamKind::imu, sample).at("accel_age_ns") == 300);
}

TEST_CASE("item_fields: an event, whose name needs quotes in CSV") {
    EventMetadata event{};
    event.kind = EventKind::trigger_without_frame;
    event.reason = EventReason::camera_busy;
    event.source = 2;
    event.value = -4;
    event.sigma_ns = 6;
    std::strcpy(event.source_name, "le\"ft,1");
    const json line = as_json(ring::StreamKind::events, event);
    CHECK(line == json::parse(R"({"epoch": 0, "sigma_ns": 6, "kind": "trigger_without_frame",
        "reason": "camera_busy", "source": 2, "source_name": "le\"ft,1", "value": -4,
        "expected": 0, "count": 0, "board_time_ns": null, "host_time_ns": 0, "suspect": false,
        "flags": 0})"));
    CHECK(field_row(ring::StreamKind::events, pack(event), 0) ==
          ",0,6,trigger_without_frame,camera_busy,2,\"le\"\"ft,1\",-4,0,0,,0,0,0");
    std::memset(event.source_name, 'x', sizeof event.source_name);
    CHECK(as_json(ring::StreamKind::events, event).at("source_name") ==
          std::string(sizeof event.source_name, 'x'));
}

TEST_CASE("item_fields: the contract has the same names, offsets, types and versions") {
    const std::string contract = text_of("shm-layout.md");
    const std::pair<ring::StreamKind, const char*> kinds[] = {
        {ring::StreamKind::frames, "Metadata of a frame"},
        {ring::StreamKind::imu, "Metadata of an IMU sample"},
        {ring::StreamKind::events, "Metadata of an event"}};
    for (const auto& [kind, heading] : kinds) {
        const std::string text = section(contract, heading);
        const std::vector<Row> rows = rows_of(text.substr(0, text.find("\n\n", 80)));
        REQUIRE(rows.size() > 8);
        std::set<std::string> documented;
        for (const Row& row : rows) documented.insert(row.name);
        documented.erase("");
        std::set<std::string> expected;
        for (const Field& field : fields_of(kind)) {
            if (derived(field) || field.offset >= ring::metadata_size) continue;
            expected.insert(field.name);
            INFO(heading << ": " << field.name);
            const auto row = std::find_if(rows.begin(), rows.end(), [&](const Row& each) {
                return each.name == field.name && each.offset == field.offset;
            });
            REQUIRE(row != rows.end());
            CHECK(row->type == type_of(field));
            const std::string since = "since ABI 1." + std::to_string(field.since);
            CHECK((row->meaning.find("since ABI") == std::string::npos) == (field.since == 0));
            if (field.since != 0) CHECK(row->meaning.find(since) != std::string::npos);
        }
        CHECK(documented == expected);
    }
    for (const Field& field : fields_of(ring::StreamKind::frames))
        if (derived(field) || field.offset >= ring::metadata_size)
            CHECK(contract.find("`" + std::string(field.name) + "`") != std::string::npos);
}

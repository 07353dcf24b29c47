// SPDX-License-Identifier: BSD-3-Clause
#include "recording/item_fields.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <vector>

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

ImuMetadata known_sample() {
    ImuMetadata sample{};
    sample.board_time = {6};
    sample.host_time = {7};
    sample.number = 5;
    const float rows[3][3] = {{0.5F, 0.25F, -2}, {0, 9.75F, 1}, {1.5F, 2.5F, 3.5F}};
    std::memcpy(sample.gyro, rows, sizeof rows);
    sample.temperature = 25;
    sample.pressure = 101'325;
    sample.sigma_ns = 2;
    sample.epoch = 1;
    sample.flags = flag_holdover | flag_repeated | flag_accel_age;
    sample.filter_delay = {8};
    sample.accel_age_ns = -300;
    return sample;
}

template <class T>
json as_json(ring::StreamKind kind, const T& metadata, std::uint64_t attributes = 0) {
    json line;
    add_fields(line, kind, pack(metadata), attributes);
    return line;
}

std::string text_of(const std::string& file) {
    std::ifstream in(std::string(VERSAVIS_SOURCE_DIR) + "/" + file);
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
}

/// From this heading to the next one.
std::string section(const std::string& text, const std::string& heading) {
    const auto begin = text.find("\n## " + heading);
    REQUIRE(begin != std::string::npos);
    return text.substr(begin, text.find("\n## ", begin + 1) - begin);
}

std::vector<std::smatch> matches(const std::string& text, const std::regex& pattern) {
    return {std::sregex_iterator(text.begin(), text.end(), pattern), {}};
}

unsigned number(const std::string& text) { return static_cast<unsigned>(std::stoul(text)); }

/// Minor version of the ABI, by the words of the contract; 0: from the beginning.
unsigned since_of(const std::string& meaning) {
    std::smatch match;
    return std::regex_search(meaning, match, std::regex(R"(since ABI 1\.(\d+))")) ? number(match[1])
                                                                                  : 0;
}

std::string since_text(unsigned minor) {
    return minor == 0 ? "" : ", since 1." + std::to_string(minor);
}

unsigned bit_of(std::uint32_t flag) {
    unsigned bit = 0;
    while (flag >> bit != 1) ++bit;
    return bit;
}

/// A field, as the contract has it.
struct FieldRow {
    std::string name;
    std::string type;
    UnknownIf unknown = UnknownIf::never;
    unsigned since = 0;
    unsigned flag = 0;

    bool operator==(const FieldRow&) const = default;
};

std::ostream& operator<<(std::ostream& out, const FieldRow& row) {
    return out << row.name << ", " << row.type << ", unknown by " << static_cast<int>(row.unknown)
               << ", since " << row.since << ", flag " << row.flag;
}

/// By their offsets.
using Rows = std::map<unsigned, FieldRow>;

FieldRow row_of(const std::string& name, const std::string& meaning, const std::string& type) {
    FieldRow row{name, type, UnknownIf::never, since_of(meaning), 0};
    std::smatch flag;
    const auto says = [&](const char* value) {
        return meaning.find(std::string("; ") + value + ": ") != std::string::npos;
    };
    if (meaning.find("unknown without trigger") != std::string::npos)
        row.unknown = UnknownIf::without_trigger;
    if (says("0")) row.unknown = UnknownIf::zero;
    if (says("0xFFFFFFFF")) row.unknown = UnknownIf::ones;
    // Of a number with a fraction, whether the contract expects that or not.
    if (type.rfind("f32", 0) == 0) row.unknown = UnknownIf::nan;
    if (std::regex_search(meaning, flag, std::regex(R"(with flag (\d+))"))) {
        row.unknown = UnknownIf::without_flag;
        row.flag = number(flag[1]);
    }
    return row;
}

/// Of the tables of a section; what has no name is reserved.
Rows fields_in(const std::string& section) {
    const std::regex pattern(R"(\n\| (\d+) \| `(\w+)` \| ([^|\n]*) \| ([^|\n]*) \|)");
    const auto gain = section.find("| offset from the generation word");
    Rows rows;
    for (const std::smatch& match : matches(section, pattern)) {
        // A slot's generation word of 8 bytes stands before what is behind the metadata.
        const bool beside = static_cast<std::size_t>(match.position()) > gain;
        const unsigned offset =
            number(match[1]) + (beside ? ring::metadata_size - sizeof(std::uint64_t) : 0);
        rows[offset] = row_of(match[2], match[3], match[4]);
        if (beside) rows[offset].since = since_of(section.substr(section.find("### Gain")));
    }
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

FieldRow as_documented(const Field& field) {
    const unsigned flag = field.unknown == UnknownIf::without_flag ? bit_of(field.flags) : 0;
    return {field.name, type_of(field), field.unknown, field.since, flag};
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
        "camera_length": true, "second_doubted": false, "flags": 265, "trigger": 7, "tick": 5000000000, "block_id": 8,
        "board_time_ns": 9, "host_time_ns": 10, "arrival_ns": 11, "camera_time_ns": 13,
        "exposure_ns": 12, "delay_ns": -19, "width": 15, "height": 16, "stride": 17,
        "pixel_format": 17301505, "format": "Mono8", "gain": 6.5, "temperature_c": 41.0})"));
    CHECK(field_columns(ring::StreamKind::frames) ==
          ",epoch,sigma_ns,kind,suspect,holdover,clamped,sensor_error,camera_length,second_doubted,"
          "flags,trigger,tick,block_id,board_time_ns,host_time_ns,arrival_ns,camera_time_ns,"
          "exposure_ns,delay_ns,"
          "width,height,stride,pixel_format,format,gain,temperature_c");
    CHECK(
        field_row(ring::StreamKind::frames, pack(known_frame()), pack(SensorState{6.5F, 41})) ==
        ",18,14,predicted,0,1,0,0,1,0,265,7,5000000000,8,9,10,11,13,12,-19,15,16,17,17301505,Mono8,"
        "6.5,41");
}

TEST_CASE("item_fields: what is unknown is null, and empty in CSV") {
    FrameMetadata frame{};
    frame.sigma_ns = sigma_unknown;
    frame.flags = 3 | flag_suspect;
    const json line = as_json(ring::StreamKind::frames, frame, pack(SensorState{}));
    for (const char* name : {"sigma_ns", "trigger", "tick", "board_time_ns", "camera_time_ns",
                             "exposure_ns", "gain", "temperature_c"})
        CHECK(line.at(name).is_null());
    CHECK(line.at("kind") == "arrival");
    CHECK(line.at("suspect") == true);
    CHECK(field_row(ring::StreamKind::frames, pack(frame), pack(SensorState{})) ==
          ",0,,arrival,1,0,0,0,0,0,7,,,0,,0,0,,,0,0,0,0,0,unknown,,");
}

TEST_CASE("item_fields: an IMU sample says all that is known") {
    const json line = as_json(ring::StreamKind::imu, known_sample());
    CHECK(line == json::parse(R"({"epoch": 1, "sigma_ns": 2, "suspect": false, "holdover": true,
        "clamped": false, "sensor_error": false, "repeated": true, "second_doubted": false, "flags": 200, "sample": 5,
        "board_time_ns": 6, "host_time_ns": 7, "filter_delay_ns": 8, "accel_age_ns": -300,
        "gyro_rad_s": [0.5, 0.25, -2.0], "accel_m_s2": [0.0, 9.75, 1.0],
        "magnetic_t": [1.5, 2.5, 3.5], "temperature_c": 25.0, "pressure_pa": 101325.0})"));
    CHECK(field_columns(ring::StreamKind::imu) ==
          ",epoch,sigma_ns,suspect,holdover,clamped,sensor_error,repeated,second_doubted,flags,"
          "sample,"
          "board_time_ns,host_time_ns,filter_delay_ns,accel_age_ns,gyro_rad_s_x,gyro_rad_s_y,"
          "gyro_rad_s_z,accel_m_s2_x,accel_m_s2_y,accel_m_s2_z,magnetic_t_x,magnetic_t_y,"
          "magnetic_t_z,temperature_c,pressure_pa");
    CHECK(field_row(ring::StreamKind::imu, pack(known_sample()), 0) ==
          ",1,2,0,1,0,0,1,0,200,5,6,7,8,-300,0.5,0.25,-2,0,9.75,1,1.5,2.5,3.5,25,101325");
}

TEST_CASE("item_fields: what is unknown of an IMU sample is null, and empty in CSV") {
    ImuMetadata sample = known_sample();
    sample.magnetic[0] = sample.magnetic[1] = sample.magnetic[2] = not_known;
    sample.temperature = sample.pressure = not_known;
    sample.sigma_ns = sigma_unknown;
    sample.flags = 0;
    const json line = as_json(ring::StreamKind::imu, sample);
    CHECK(line.at("magnetic_t") == json({nullptr, nullptr, nullptr}));
    for (const char* name : {"temperature_c", "pressure_pa", "sigma_ns", "accel_age_ns"})
        CHECK(line.at(name).is_null());
    CHECK(field_row(ring::StreamKind::imu, pack(sample), 0) ==
          ",1,,0,0,0,0,0,0,0,5,6,7,8,,0.5,0.25,-2,0,9.75,1,,,,,");
}

TEST_CASE("item_fields: an event says all that is known, with quotes in CSV where it needs them") {
    EventMetadata event{};
    event.kind = EventKind::triggers_skipped;
    event.reason = EventReason::camera_busy;
    event.source = 2;
    event.value = -4;
    event.sigma_ns = 6;
    event.board_time = {7};
    event.host_time = {8};
    event.epoch = 9;
    event.expected = -10;
    event.count = 11;
    event.flags = flag_suspect;
    std::strcpy(event.source_name, "le\"ft,1");
    CHECK(as_json(ring::StreamKind::events, event) ==
          json::parse(R"({"epoch": 9, "sigma_ns": 6, "kind": "triggers_skipped",
        "reason": "camera_busy", "source": 2, "source_name": "le\"ft,1", "value": -4,
        "expected": -10, "count": 11, "board_time_ns": 7, "host_time_ns": 8, "suspect": true,
        "second_doubted": false, "flags": 4})"));
    CHECK(field_columns(ring::StreamKind::events) ==
          ",epoch,sigma_ns,kind,reason,source,source_name,value,expected,count,board_time_ns,"
          "host_time_ns,suspect,second_doubted,flags");
    CHECK(field_row(ring::StreamKind::events, pack(event), 0) ==
          ",9,6,triggers_skipped,camera_busy,2,\"le\"\"ft,1\",-4,-10,11,7,8,1,0,4");
    std::memset(event.source_name, 'x', sizeof event.source_name);
    CHECK(as_json(ring::StreamKind::events, event).at("source_name") ==
          std::string(sizeof event.source_name, 'x'));
}

TEST_CASE("item_fields: what is unknown of an event is null, and empty in CSV") {
    EventMetadata event{};
    event.sigma_ns = sigma_unknown;
    const json line = as_json(ring::StreamKind::events, event);
    for (const char* name : {"sigma_ns", "board_time_ns"}) CHECK(line.at(name).is_null());
    CHECK(field_row(ring::StreamKind::events, pack(event), 0) ==
          ",0,,unknown,none,0,,0,0,0,,0,0,0,0");
}

TEST_CASE("item_fields: the contract has the same names, places, types and unknown values") {
    const std::string contract = text_of("docs/contracts/shm-layout.md");
    const std::pair<ring::StreamKind, const char*> kinds[] = {
        {ring::StreamKind::frames, "Metadata of a frame"},
        {ring::StreamKind::imu, "Metadata of an IMU sample"},
        {ring::StreamKind::events, "Metadata of an event"},
        {ring::StreamKind::nmea, "Metadata of a sentence"}};
    for (const auto& [kind, heading] : kinds) {
        const std::string text = section(contract, heading);
        const Rows documented = fields_in(text);
        Rows expected;
        for (const Field& field : fields_of(kind))
            if (!derived(field)) expected.emplace(field.offset, as_documented(field));
        if (kind == ring::StreamKind::frames)  // the only one that lies in two places
            expected.emplace(offsetof(FrameMetadata, tick_high),
                             FieldRow{"tick", "u32", UnknownIf::never, 5, 0});
        INFO(heading);
        for (const auto& [offset, row] : documented) CHECK(expected.count(offset) == 1);
        for (const auto& [offset, row] : expected) {
            INFO("offset " << offset << ": " << row.name);
            REQUIRE(documented.count(offset) == 1);
            CHECK(documented.at(offset) == row);
        }
    }
}

TEST_CASE("item_fields: the contract has the same flags, and each flag has its field") {
    std::map<unsigned, std::string> expected;
    for (const auto kind : {ring::StreamKind::frames, ring::StreamKind::imu,
                            ring::StreamKind::events, ring::StreamKind::nmea})
        for (const Field& field : fields_of(kind))
            if (field.type == FieldType::flag || field.unknown == UnknownIf::without_flag)
                expected[bit_of(field.flags)] =
                    (field.type == FieldType::flag ? field.name : "") + since_text(field.since);
    const std::string contract = text_of("docs/contracts/shm-layout.md");
    const std::regex row(R"(\n\| (\d+) \| (?:`(\w+)`)? ?\| ([^|]*) \|(?=\n))");
    std::map<unsigned, std::string> documented;
    const std::string text = section(contract, "Metadata of a frame");
    for (const std::smatch& match : matches(text, row))
        documented[number(match[1])] = match[2].str() + since_text(since_of(match[3]));
    CHECK(documented == expected);

    const std::regex constant(R"(flag_\w+ =\s+1U << (\d+)U)");
    const std::string header = text_of("libversavis/include/versavis/metadata.hpp");
    std::set<unsigned> declared;
    for (const std::smatch& match : matches(header, constant)) declared.insert(number(match[1]));
    std::set<unsigned> named;
    for (const auto& [bit, name] : expected) named.insert(bit);
    CHECK(declared == named);
}

TEST_CASE("item_fields: the contract has the names of stamps, and of what is derived") {
    const std::string text =
        section(text_of("docs/contracts/shm-layout.md"), "Metadata of a frame");
    for (unsigned kind = 0; kind < 4; ++kind)
        CHECK(std::regex_search(text, std::regex(std::to_string(kind) + "\\s`" +
                                                 to_string(static_cast<StampKind>(kind)) + "`")));
    for (const char* name : {"`kind`", "`format`"}) CHECK(text.find(name) != std::string::npos);
}

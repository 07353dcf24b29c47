// SPDX-License-Identifier: BSD-3-Clause
#include "recording_file.hpp"

#include <fmt/format.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "versavis/pixel_format.hpp"

namespace versavis::test {

namespace {

constexpr std::uint64_t life = 0x1122334455667788;
constexpr std::int64_t begin_ns = 1'700'000'000'000'000'000;

template <class T>
std::string raw(T value) {
    return {reinterpret_cast<const char*>(&value), sizeof value};
}

std::string text(const std::string& value) {
    return raw(static_cast<std::uint32_t>(value.size())) + value;
}

std::uint32_t crc(const std::string& bytes) {
    return static_cast<std::uint32_t>(
        crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

std::string as_text(const std::vector<std::byte>& bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Fields of CDR, aligned from behind the encapsulation.
class Cdr {
 public:
    template <class T>
    void number(T value) {
        while ((bytes_.size() - 4) % sizeof value != 0) bytes_ += '\0';
        bytes_ += raw(value);
    }
    void text(const std::string& value) {
        number(static_cast<std::uint32_t>(value.size() + 1));
        bytes_ += value + '\0';
    }
    void bytes(const std::string& value) {
        number(static_cast<std::uint32_t>(value.size()));
        bytes_ += value;
    }
    void header(OutputTime time, const std::string& frame) {
        number(static_cast<std::int32_t>(time.ns / 1'000'000'000));
        number(static_cast<std::uint32_t>(time.ns % 1'000'000'000));
        text(frame);
    }
    const std::string& all() const { return bytes_; }

 private:
    std::string bytes_ = std::string("\0\1\0\0", 4);
};

std::string encoding_of(std::uint32_t pixel_format) {
    return pixel_layout(pixel_format).bytes_per_channel == 2 ? "mono16" : "mono8";
}

std::string image(const FileItem& item) {
    const auto frame = unpack<FrameMetadata>(item.metadata);
    Cdr cdr;
    cdr.header(item.time, item.stream);
    cdr.number(frame.height);
    cdr.number(frame.width);
    cdr.text(encoding_of(frame.pixel_format));
    cdr.number(std::uint8_t{0});
    cdr.number(frame.stride);
    cdr.bytes(as_text(item.payload));
    return cdr.all();
}

std::string png_of(const FrameMetadata& frame, const std::vector<std::byte>& pixels) {
    const auto words = pixel_layout(frame.pixel_format).bytes_per_channel;
    png_image picture{};
    picture.version = PNG_IMAGE_VERSION;
    picture.width = frame.width;
    picture.height = frame.height;
    picture.format = words == 2 ? PNG_FORMAT_LINEAR_Y : PNG_FORMAT_GRAY;
    const auto stride = static_cast<png_int_32>(frame.stride / words);
    png_alloc_size_t size = 0;
    png_image_write_to_memory(&picture, nullptr, &size, 0, pixels.data(), stride, nullptr);
    std::string png(size, '\0');
    png_image_write_to_memory(&picture, png.data(), &size, 0, pixels.data(), stride, nullptr);
    png.resize(size);
    return png;
}

std::string compressed_image(const FileItem& item) {
    const auto frame = unpack<FrameMetadata>(item.metadata);
    const auto encoding = encoding_of(frame.pixel_format);
    Cdr cdr;
    cdr.header(item.time, item.stream);
    cdr.text(encoding + "; png compressed " + encoding);
    cdr.bytes(png_of(frame, item.payload));
    return cdr.all();
}

std::string envelope(const FileItem& item) {
    std::string data = raw(item.number) + raw(item.life) + raw(item.time.ns) +
                       raw(static_cast<std::uint32_t>(item.payload.size())) +
                       raw(std::uint32_t{0}) + raw(item.metadata);
    if (item.kind != ring::StreamKind::frames) return data + as_text(item.payload);
    return item.attributes == ring::no_attributes ? data : data + raw(item.attributes);
}

std::string map_text(const std::map<std::string, std::string>& map) {
    std::string entries;
    for (const auto& [key, value] : map) entries += text(key) + text(value);
    return text(entries);
}

}  // namespace

std::string RecordingFile::record(std::uint8_t opcode, const std::string& content) {
    return raw(opcode) + raw(static_cast<std::uint64_t>(content.size())) + content;
}

RecordingFile::RecordingFile(const std::string& part, const std::string& recording) {
    bytes_ = "\x89MCAP0\r\n" + record(1, text("ros2") + text("a test"));
    const std::string metadata =
        record(0x0C, text("versavis") + map_text({{"version", "1"},
                                                  {"instance", "test"},
                                                  {"output_clock", "realtime"},
                                                  {"part", part},
                                                  {"recording", recording},
                                                  {"recorder", "0"}}));
    summary_.metadata.push_back({bytes_.size(), metadata.size(), "versavis"});
    bytes_ += metadata;
}

std::uint16_t RecordingFile::channel(const std::string& topic, const std::string& encoding,
                                     const std::string& schema, const std::string& schema_encoding,
                                     const std::map<std::string, std::string>& metadata) {
    const auto id = channels_.try_emplace(topic, static_cast<std::uint16_t>(channels_.size() + 1))
                        .first->second;
    if (!announced_.insert(id).second) return id;
    summary_.schemas[id] = raw(id) + text(schema) + text(schema_encoding) + text("");
    summary_.channels[id] = raw(id) + raw(id) + text(topic) + text(encoding) + map_text(metadata);
    chunk_ += record(3, summary_.schemas[id]) + record(4, summary_.channels[id]);
    return id;
}

void RecordingFile::message(std::uint16_t channel, std::uint32_t sequence, std::int64_t time,
                            const std::string& data) {
    places_[channel].push_back({static_cast<std::uint64_t>(time), chunk_.size()});
    ++summary_.messages[channel];
    chunk_ += record(5, raw(channel) + raw(sequence) + raw(time) + raw(time) + data);
}

void RecordingFile::add(const FileItem& item, bool as_png) {
    const std::uint32_t sequence = ++sequence_;
    if (item.kind == ring::StreamKind::frames) {
        const std::string topic = "/" + item.stream + "/image_raw" + (as_png ? "/compressed" : "");
        const std::string schema =
            std::string("sensor_msgs/msg/") + (as_png ? "CompressedImage" : "Image");
        message(channel(topic, "cdr", schema, "ros2msg", {}), sequence, item.time.ns,
                as_png ? compressed_image(item) : image(item));
    }
    const auto id = channel(
        "/versavis/" + item.stream + "/item", "versavis_item", "versavis.Item", "",
        {{"kind", std::to_string(static_cast<std::uint32_t>(item.kind))}, {"stream", item.stream}});
    message(id, sequence, item.time.ns, envelope(item));
}

void RecordingFile::add_gap(const std::string& stream, const std::string& reason,
                            std::uint64_t items, OutputTime time) {
    const auto id =
        channel("/versavis/" + stream + "/gap", "json", "versavis.Gap", "jsonschema", {});
    message(id, 0, time.ns,
            fmt::format(R"({{"reason":"{}","items":{},"time_ns":{},"epoch":1}})", reason, items,
                        time.ns));
}

void RecordingFile::end_chunk(bool anew) {
    if (chunk_.empty()) return;
    if (anew) announced_.clear();
    std::uint64_t first = ~std::uint64_t{0};
    std::uint64_t last = 0;
    for (const auto& [id, places] : places_)
        for (const auto& place : places) {
            first = std::min(first, place.log_time);
            last = std::max(last, place.log_time);
        }
    const std::string all =
        record(6, raw(first) + raw(last) + raw(std::uint64_t{chunk_.size()}) + raw(crc(chunk_)) +
                      text("") + raw(std::uint64_t{chunk_.size()}) + chunk_);
    client::SummaryChunk one{first, last, bytes_.size(), all.size(), {}, 0, chunk_.size()};
    bytes_ += all;
    for (const auto& [id, places] : places_) {
        one.indexes[id] = bytes_.size();
        const std::string index = client::message_index(id, places);
        one.indexes_length += index.size();
        bytes_ += index;
    }
    if (summary_.chunks.empty()) summary_.start_time = first;
    summary_.start_time = std::min(summary_.start_time, first);
    summary_.end_time = std::max(summary_.end_time, last);
    summary_.chunks.push_back(std::move(one));
    chunk_.clear();
    places_.clear();
}

void RecordingFile::add_attachment(const std::string& name, const std::string& content) {
    end_chunk();
    const std::string body = raw(std::uint64_t{1}) + raw(std::uint64_t{2}) + text(name) +
                             text("application/octet-stream") + raw(std::uint64_t{content.size()}) +
                             content;
    const std::string all = record(9, body + raw(crc(body)));
    summary_.attachments.push_back(
        {bytes_.size(), all.size(), 1, 2, content.size(), name, "application/octet-stream"});
    bytes_ += all;
}

std::string RecordingFile::finish() {
    end_chunk();
    return bytes_ + client::mcap_end(summary_, bytes_.size());
}

std::vector<std::byte> sample_pixels(const FrameMetadata& frame, std::uint64_t number) {
    std::vector<std::byte> pixels(std::size_t{frame.stride} * frame.height);
    const auto words = pixel_layout(frame.pixel_format).bytes_per_channel;
    for (std::uint32_t y = 0; y < frame.height; ++y)
        for (std::uint32_t x = 0; x < frame.width; ++x) {
            const auto value = static_cast<std::uint16_t>((x * 7 + y * 13 + number * 3) %
                                                          (words == 2 ? 4096 : 256));
            std::memcpy(pixels.data() + std::size_t{frame.stride} * y + x * words, &value, words);
        }
    return pixels;
}

namespace {

FileItem sample_frame(const std::string& camera, std::uint64_t number, std::int64_t time,
                      std::uint32_t pixel_format, std::uint32_t width, std::uint32_t height) {
    FrameMetadata frame{};
    frame.trigger = number + 1;
    frame.set_tick(1000 + number);
    frame.block_id = number + 1;
    frame.width = width;
    frame.height = height;
    frame.stride = (width + 3) * pixel_layout(pixel_format).bytes_per_channel;
    frame.pixel_format = pixel_format;
    frame.exposure = microseconds(500);
    frame.sigma_ns = 900;
    frame.epoch = 1;
    if (camera == "cam0" && number == 7) frame.flags = flag_suspect;
    return {camera,
            ring::StreamKind::frames,
            number,
            life,
            {time},
            pack(frame),
            sample_pixels(frame, number),
            camera == "cam1" ? pack(SensorState{static_cast<float>(number), 41.5F})
                             : ring::no_attributes};
}

FileItem sample_sample(std::uint64_t number, std::int64_t time) {
    ImuMetadata imu{};
    imu.number = number;
    imu.gyro[0] = 0.001F * static_cast<float>(number);
    imu.gyro[1] = -1e-6F;
    imu.accel[2] = 9.81F;
    imu.magnetic[0] = imu.magnetic[1] = imu.magnetic[2] = imu.pressure = NAN;
    imu.temperature = 30;
    imu.sigma_ns = 500;
    imu.epoch = 1;
    imu.filter_delay = microseconds(3662);
    if (number % 10 == 9) imu.flags = flag_repeated;
    return {"imu0", ring::StreamKind::imu, number, life, {time}, pack(imu), {}};
}

FileItem sample_status(std::uint64_t number, std::int64_t time) {
    const std::string json = R"({"schema":1,"instance":"test","health":"ok"})";
    const auto* bytes = reinterpret_cast<const std::byte*>(json.data());
    return {"status", ring::StreamKind::status,    number, life, {time},
            {},       {bytes, bytes + json.size()}};
}

}  // namespace

std::string sample_recording(int seconds, bool as_png, bool cut_off, std::uint32_t pixel_format,
                             std::uint32_t width, std::uint32_t height) {
    constexpr std::int64_t imu_period = 5'000'000;
    RecordingFile file;
    file.add_attachment("configuration.toml", "instance = \"test\"\n");
    for (int step = 0; step < seconds * 200; ++step) {
        const std::int64_t time = begin_ns + step * imu_period;
        const auto number = static_cast<std::uint64_t>(step);
        // The IMU begins after the first images and ends before the last ones.
        if (step >= 15 && step < seconds * 200 - 15) file.add(sample_sample(number, time));
        if (step % 10 == 3) {
            // Frames come later than samples of the same time: the file is only nearly in order.
            const std::uint64_t frame = number / 10;
            file.add(sample_frame("cam0", frame, time - 7'000'000, pixel_format, width, height),
                     as_png);
            if (frame % 8 != 5)
                file.add(sample_frame("cam1", frame, time - 6'999'960, pixel_format, width, height),
                         as_png);
        }
        if (step % 100 == 50) file.add(sample_status(number / 100, time));
        if (step % 40 == 39) file.end_chunk();
    }
    file.add_gap("cam1", "lost", 3, {begin_ns});
    if (!cut_off) return file.finish();
    return file.cut() + std::string("\x06\0\0\0\0\0\0\0\0 a chunk that was not ended", 36);
}

}  // namespace versavis::test

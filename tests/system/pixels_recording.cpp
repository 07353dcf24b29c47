// SPDX-License-Identifier: BSD-3-Clause
// pixels-recording FILE SECONDS: writes a recording with a camera for each kind of pixels, named by
// what ROS calls them, and an IMU at rest. recording_tools draws the same pixels.
#include <cmath>
#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <utility>

#include "recording_file.hpp"
#include "versavis/pixel_format.hpp"

namespace {

using namespace versavis;

constexpr std::int64_t begin_ns = 1'700'000'000'000'000'000;
constexpr std::uint32_t width = 61;
constexpr std::uint32_t height = 9;

constexpr std::pair<const char*, std::uint32_t> cameras[] = {
    {"bayer_bggr8", 0x0108000B}, {"bayer_gbrg8", 0x0108000A}, {"bayer_grbg8", 0x01080008},
    {"bayer_rggb8", 0x01080009}, {"bgr8", 0x02180015},        {"mono16", 0x01100007},
    {"mono8", 0x01080001},       {"rgb8", 0x02180014}};

test::FileItem frame_of(const char* name, std::uint32_t format, std::uint64_t number) {
    const PixelLayout layout = pixel_layout(format);
    const std::uint32_t size = layout.bytes_per_channel;
    FrameMetadata frame{};
    frame.trigger = frame.block_id = number + 1;
    frame.set_tick(number);
    frame.width = width;
    frame.height = height;
    frame.stride = (width + 2) * layout.channels * size;
    frame.pixel_format = format;
    frame.exposure = microseconds(500);
    frame.sigma_ns = 900;
    frame.epoch = 1;
    std::vector<std::byte> pixels(std::size_t{frame.stride} * height);
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x)
            for (std::uint32_t channel = 0; channel < layout.channels; ++channel) {
                const auto value =
                    static_cast<std::uint16_t>(x * 701 + y * 1303 + channel * 5003 + number * 311);
                std::memcpy(pixels.data() + std::size_t{frame.stride} * y +
                                (x * layout.channels + channel) * size,
                            &value, size);
            }
    return {name,
            ring::StreamKind::frames,
            number,
            1,
            {begin_ns + 42'000'000 + static_cast<std::int64_t>(number) * 50'000'000},
            pack(frame),
            pixels};
}

test::FileItem sample_at(std::uint64_t number, std::mt19937& random) {
    std::normal_distribution<float> noise(0, 0.002F);
    ImuMetadata imu{};
    imu.number = number;
    for (float& rate : imu.gyro) rate = noise(random);
    for (float& value : imu.accel) value = 10 * noise(random);
    imu.accel[2] += 9.81F;
    imu.magnetic[0] = imu.magnetic[1] = imu.magnetic[2] = imu.pressure = NAN;
    imu.temperature = 30;
    imu.sigma_ns = 500;
    imu.epoch = 1;
    return {"imu0",
            ring::StreamKind::imu,
            number,
            1,
            {begin_ns + static_cast<std::int64_t>(number) * 5'000'000},
            pack(imu),
            {}};
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3) return 64;
    const auto samples = 200 * std::stoull(argv[2]);
    test::RecordingFile file;
    std::mt19937 random(1);
    for (std::uint64_t number = 0; number < samples; ++number) {
        file.add(sample_at(number, random));
        if (number % 10 == 9)
            for (const auto& [name, format] : cameras)
                file.add(frame_of(name, format, number / 10));
        if (number % 100 == 99) file.end_chunk();
    }
    std::ofstream out(argv[1], std::ios::binary);
    out << file.finish();
    return out.flush() ? 0 : 1;
}

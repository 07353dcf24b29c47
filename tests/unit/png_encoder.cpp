// SPDX-License-Identifier: BSD-3-Clause
#include "record/png_encoder.hpp"

#include <catch2/catch.hpp>
#include <random>

#include "pixel_formats.hpp"
#include "recording/ros_image.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;

namespace {

constexpr std::uint32_t bgr8 = 0x02180015;

FrameMetadata frame_of(std::uint32_t format, std::uint32_t width, std::uint32_t height,
                       std::uint32_t stride) {
    FrameMetadata frame{};
    frame.pixel_format = format;
    frame.width = width;
    frame.height = height;
    frame.stride = stride;
    return frame;
}

}  // namespace

TEST_CASE("png_encoder: libpng reads each pixel as it was") {
    struct Case {
        std::uint32_t format, width, height, stride;
    };
    const Case one = GENERATE(Case{mono8, 1, 1, 1}, Case{mono8, 61, 9, 61}, Case{mono8, 61, 9, 64},
                              Case{mono8, 1920, 1200, 1920}, Case{bayer_rg8, 640, 480, 640},
                              Case{mono12, 1, 3, 2}, Case{mono12, 101, 33, 208},
                              Case{rgb8, 1, 1, 3}, Case{bgr8, 77, 5, 231});
    const bool flat = GENERATE(false, true);
    INFO("format " << one.format << ", " << one.width << " x " << one.height);
    const FrameMetadata frame = frame_of(one.format, one.width, one.height, one.stride);
    std::mt19937 random(one.width);
    std::vector<std::byte> pixels(std::size_t{one.stride} * one.height);
    const std::uint32_t bytes = one.format == mono12                       ? 2
                                : one.format == rgb8 || one.format == bgr8 ? 3
                                                                           : 1;
    for (std::uint32_t y = 0; y < one.height; ++y)
        for (std::uint32_t x = 0; x < one.width * bytes; ++x)  // what pads a row is not kept
            pixels[std::size_t{y} * one.stride + x] =
                flat ? std::byte{200} : static_cast<std::byte>(random());
    REQUIRE(can_be_png(frame, pixels.size()));
    const auto png = encode_png(frame, pixels);
    std::vector<std::byte> unpacked;
    REQUIRE(unpack_png(png, frame, unpacked));
    CHECK(unpacked == pixels);
    if (flat && one.width > 60) CHECK(png.size() < pixels.size() / 2);
}

TEST_CASE("png_encoder: what no PNG can hold, or has not all rows, stays as it is") {
    CHECK(can_be_png(frame_of(mono8, 10, 10, 10), 100));
    CHECK_FALSE(can_be_png(frame_of(mono8, 10, 10, 10), 99));
    CHECK_FALSE(can_be_png(frame_of(mono8, 10, 10, 9), 1000));
    CHECK_FALSE(can_be_png(frame_of(mono8, 0, 10, 10), 100));
    CHECK_FALSE(can_be_png(frame_of(mono8, 10, 0, 10), 100));
    CHECK_FALSE(can_be_png(frame_of(mono12p, 10, 10, 15), 150));
    CHECK_FALSE(can_be_png(frame_of(mono8, 0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFFF), 100));
}

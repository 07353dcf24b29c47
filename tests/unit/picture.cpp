// SPDX-License-Identifier: BSD-3-Clause
#include "picture.hpp"

#include <catch2/catch.hpp>
#include <numeric>
#include <vector>

using namespace versavis;
using namespace versavis::client;

namespace {

constexpr std::uint32_t mono8 = 0x01080001;
constexpr std::uint32_t mono12 = 0x01100005;
constexpr std::uint32_t mono12_packed = 0x010C0006;
constexpr std::uint32_t bayer_rg8 = 0x01080009;
constexpr std::uint32_t rgb8 = 0x02180014;

FrameMetadata frame_of(std::uint32_t width, std::uint32_t height, std::uint32_t format,
                       std::uint32_t bytes) {
    FrameMetadata frame{};
    frame.width = width;
    frame.height = height;
    frame.stride = width * bytes;
    frame.pixel_format = format;
    return frame;
}

/// What a sensor with this pattern shows of an area of one colour.
Pixels mosaic(std::uint32_t width, std::uint32_t height, const std::string& pattern,
              std::array<std::uint8_t, 3> colour) {
    Pixels raw{width, height, 1, {}};
    for (std::uint32_t y = 0; y < height; ++y)
        for (std::uint32_t x = 0; x < width; ++x) {
            const char at = pattern[(y % 2) * 2 + x % 2];
            raw.values.push_back(colour.at(std::string("rgb").find(at)));
        }
    return raw;
}

std::uint32_t total(const Picture& picture) {
    return std::accumulate(picture.histogram.begin(), picture.histogram.end(), 0U);
}

}  // namespace

TEST_CASE("picture: an area of one colour is that, whatever the pattern and size") {
    const std::array<std::uint8_t, 3> colour{200, 90, 10};
    const std::string pattern = GENERATE("rggb", "grbg", "gbrg", "bggr");
    const auto [width, height] = GENERATE(std::pair(2U, 2U), std::pair(3U, 5U), std::pair(8U, 2U));
    const Pixels raw = mosaic(width, height, pattern, colour);
    for (const Pixels& made : {demosaic(raw, pattern), demosaic_by_cells(raw, pattern)}) {
        REQUIRE(made.values.size() == std::size_t{made.width} * made.height * 3);
        for (std::size_t i = 0; i < made.values.size(); ++i)
            CHECK(made.values[i] == colour.at(i % 3));
    }
    CHECK(demosaic(raw, pattern).width == width);
    CHECK(demosaic_by_cells(raw, pattern).height == height / 2);
}

TEST_CASE("picture: a reduced picture has the means of its squares") {
    const Pixels pixels{
        5, 4, 1, {0, 10, 20, 30, 99, 10, 20, 40, 50, 99, 1, 1, 5, 5, 99, 1, 1, 5, 5, 99}};
    const Pixels made = reduced(pixels, 2);
    CHECK(made.width == 2);
    CHECK(made.height == 2);
    CHECK(made.values == std::vector<std::uint8_t>{10, 35, 1, 5});
    CHECK(reduced(pixels, 1).values == pixels.values);
}

TEST_CASE("picture: histogram and saturation are of all bits") {
    std::vector<std::byte> payload(8, std::byte{0});
    payload[1] = std::byte{0x0f};  // 0x0f00
    payload[2] = std::byte{0xff};
    payload[3] = std::byte{0x0f};  // 0x0fff: full scale of 12 bits
    payload[4] = std::byte{0xfe};
    payload[5] = std::byte{0x0f};
    const auto picture = make_picture("cam0", frame_of(4, 1, mono12, 2), payload, 4);
    REQUIRE(picture);
    CHECK(picture->saturated == 0.25);
    CHECK(picture->histogram.front() == 1);
    CHECK(picture->histogram.back() == 2);
    CHECK(picture->histogram.at(60) == 1);
    CHECK(picture->width == 4);
}

TEST_CASE("picture: wide frames are reduced, and small ones are shown as they are") {
    const auto [format, width, height, shown_width, shown_height] = GENERATE(
        std::tuple(mono8, 1920U, 1200U, 640U, 400U),
        std::tuple(bayer_rg8, 1920U, 1200U, 480U, 300U), std::tuple(bayer_rg8, 1600U, 6U, 800U, 3U),
        std::tuple(mono8, 800U, 6U, 800U, 6U), std::tuple(mono8, 801U, 6U, 400U, 3U),
        std::tuple(bayer_rg8, 801U, 6U, 400U, 3U), std::tuple(mono8, 1U, 1U, 1U, 1U),
        std::tuple(bayer_rg8, 1U, 1U, 1U, 1U), std::tuple(mono8, 4000U, 1U, 4000U, 1U),
        std::tuple(bayer_rg8, 1U, 3000U, 1U, 3000U));
    const std::vector<std::byte> payload(std::size_t{width} * height, std::byte{7});
    const auto picture = make_picture("cam0", frame_of(width, height, format, 1), payload, 800);
    REQUIRE(picture);
    CHECK(picture->width == shown_width);
    CHECK(picture->height == shown_height);
    CHECK(total(*picture) == width * height);
    CHECK(picture->jpeg.substr(0, 2) == "\xff\xd8");
}

TEST_CASE("picture: what cannot be shown says why") {
    const std::vector<std::byte> payload(100);
    const auto packed = make_picture("cam0", frame_of(4, 4, mono12_packed, 2), payload, 800);
    REQUIRE_FALSE(packed);
    CHECK(packed.error().message() ==
          "cam0: pixels of format Mono12Packed cannot be shown; choose an unpacked one as the "
          "camera's PixelFormat");
    for (const auto& frame : {frame_of(11, 10, mono8, 1), frame_of(0, 10, mono8, 1),
                              frame_of(10, 0, mono8, 1), frame_of(6, 6, rgb8, 3)})
        CHECK_FALSE(make_picture("cam0", frame, payload, 800));
    FrameMetadata lying = frame_of(10, 10, mono8, 1);
    lying.stride = 9;
    CHECK_FALSE(make_picture("cam0", lying, payload, 800));
    lying.stride = 0xFFFFFFFF;
    CHECK_FALSE(make_picture("cam0", lying, payload, 800));
}

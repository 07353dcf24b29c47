// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/grey_picture.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis::client;

namespace {

FrameMetadata picture_frame(std::uint32_t format, std::uint32_t width, std::uint32_t height,
                            std::uint32_t stride) {
    FrameMetadata frame{};
    frame.width = width;
    frame.height = height;
    frame.stride = stride;
    frame.pixel_format = format;
    return frame;
}

std::vector<std::byte> bytes(std::initializer_list<int> values) {
    std::vector<std::byte> out;
    for (const int value : values) out.push_back(static_cast<std::byte>(value));
    return out;
}

}  // namespace

TEST_CASE("grey_picture: bytes, words and colours keep their depth, padding is left out") {
    const auto mono =
        grey_picture("cam", picture_frame(0x01080001, 2, 2, 3), bytes({1, 2, 0, 3, 255}));
    REQUIRE(mono);
    CHECK(mono->pixels == std::vector<std::uint16_t>{1, 2, 3, 255});
    CHECK(mono->full == 255);
    const auto deep =
        grey_picture("cam", picture_frame(0x01100005, 1, 2, 2), bytes({0xFF, 0x0F, 1, 2}));
    REQUIRE(deep);
    CHECK(deep->pixels == std::vector<std::uint16_t>{4095, 513});
    CHECK(deep->full == 4095);
    const auto colour =
        grey_picture("cam", picture_frame(0x02180014, 1, 1, 3), bytes({10, 20, 60}));
    REQUIRE(colour);
    CHECK(colour->pixels == std::vector<std::uint16_t>{30});
}

TEST_CASE("grey_picture: what cannot be read is reported") {
    const auto packed = grey_picture("cam3", picture_frame(0x010C0047, 2, 1, 3), bytes({1, 2, 3}));
    REQUIRE_FALSE(packed);
    CHECK_THAT(packed.error().message(), Catch::Contains("cam3") && Catch::Contains("Mono12p"));
    const auto shorter = grey_picture("cam3", picture_frame(0x01080001, 4, 4, 4), bytes({1, 2, 3}));
    REQUIRE_FALSE(shorter);
    CHECK_THAT(shorter.error().message(), Catch::Contains("4 x 4") && Catch::Contains("3 bytes"));
    CHECK_FALSE(grey_picture("cam3", picture_frame(0x01080001, 0, 4, 4), {}));
}

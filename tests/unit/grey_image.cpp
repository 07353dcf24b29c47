// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/grey_image.hpp"

#include <catch2/catch.hpp>

#include "pixel_formats.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;
using Pixels = std::vector<std::uint8_t>;

TEST_CASE("grey_image: eight bits stay as they are", "[grey_image]") {
    const GreyImage image = grey_image({2, 2, {1, 2, 3, 255}, 255}, mono8);
    CHECK(image.width == 2);
    CHECK(image.height == 2);
    CHECK(image.pixels == Pixels{1, 2, 3, 255});
}

TEST_CASE("grey_image: more bits are scaled to eight", "[grey_image]") {
    CHECK(grey_image({3, 1, {0, 2048, 4095}, 4095}, mono12).pixels == Pixels{0, 127, 255});
    CHECK(grey_image({1, 1, {5000}, 4095}, mono12).pixels == Pixels{255});
}

TEST_CASE("grey_image: a mosaic is smoothed", "[grey_image]") {
    CHECK(grey_image({2, 2, {0, 100, 100, 200}, 255}, bayer_rg8).pixels ==
          Pixels{100, 150, 150, 200});
}

TEST_CASE("grey_image: of nothing, nothing", "[grey_image]") {
    CHECK(grey_image({}, mono8).pixels.empty());
}

// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/pixel_format.hpp"

#include <arv.h>

#include <catch2/catch.hpp>
#include <string>
#include <vector>

using namespace versavis;

namespace {

struct Known {
    std::uint32_t code;
    std::string name;

    bool is_packed() const {
        return name.back() == 'p' || name.find("Packed") != std::string::npos;
    }
};

/// Aravis knows most of them by their GStreamer or GenICam names, under the same codes.
const std::vector<Known> known_formats{
    {ARV_PIXEL_FORMAT_MONO_8, "Mono8"},
    {ARV_PIXEL_FORMAT_MONO_10, "Mono10"},
    {ARV_PIXEL_FORMAT_MONO_12, "Mono12"},
    {ARV_PIXEL_FORMAT_MONO_14, "Mono14"},
    {ARV_PIXEL_FORMAT_MONO_16, "Mono16"},
    {ARV_PIXEL_FORMAT_MONO_10_PACKED, "Mono10Packed"},
    {ARV_PIXEL_FORMAT_MONO_12_PACKED, "Mono12Packed"},
    {ARV_PIXEL_FORMAT_BAYER_GR_8, "BayerGR8"},
    {ARV_PIXEL_FORMAT_BAYER_RG_8, "BayerRG8"},
    {ARV_PIXEL_FORMAT_BAYER_GB_8, "BayerGB8"},
    {ARV_PIXEL_FORMAT_BAYER_BG_8, "BayerBG8"},
    {ARV_PIXEL_FORMAT_BAYER_GR_10, "BayerGR10"},
    {ARV_PIXEL_FORMAT_BAYER_RG_10, "BayerRG10"},
    {ARV_PIXEL_FORMAT_BAYER_GB_10, "BayerGB10"},
    {ARV_PIXEL_FORMAT_BAYER_BG_10, "BayerBG10"},
    {ARV_PIXEL_FORMAT_BAYER_GR_12, "BayerGR12"},
    {ARV_PIXEL_FORMAT_BAYER_RG_12, "BayerRG12"},
    {ARV_PIXEL_FORMAT_BAYER_GB_12, "BayerGB12"},
    {ARV_PIXEL_FORMAT_BAYER_BG_12, "BayerBG12"},
    {ARV_PIXEL_FORMAT_BAYER_GR_16, "BayerGR16"},
    {ARV_PIXEL_FORMAT_BAYER_RG_16, "BayerRG16"},
    {ARV_PIXEL_FORMAT_BAYER_GB_16, "BayerGB16"},
    {ARV_PIXEL_FORMAT_BAYER_BG_16, "BayerBG16"},
    {ARV_PIXEL_FORMAT_BAYER_GR_10P, "BayerGR10p"},
    {ARV_PIXEL_FORMAT_BAYER_RG_10P, "BayerRG10p"},
    {ARV_PIXEL_FORMAT_BAYER_GB_10P, "BayerGB10p"},
    {ARV_PIXEL_FORMAT_BAYER_BG_10P, "BayerBG10p"},
    {ARV_PIXEL_FORMAT_BAYER_GR_12P, "BayerGR12p"},
    {ARV_PIXEL_FORMAT_BAYER_RG_12P, "BayerRG12p"},
    {ARV_PIXEL_FORMAT_BAYER_GB_12P, "BayerGB12p"},
    {ARV_PIXEL_FORMAT_BAYER_BG_12P, "BayerBG12p"},
    {ARV_PIXEL_FORMAT_BAYER_GR_12_PACKED, "BayerGR12Packed"},
    {ARV_PIXEL_FORMAT_BAYER_RG_12_PACKED, "BayerRG12Packed"},
    {ARV_PIXEL_FORMAT_BAYER_GB_12_PACKED, "BayerGB12Packed"},
    {ARV_PIXEL_FORMAT_BAYER_BG_12_PACKED, "BayerBG12Packed"},
    {ARV_PIXEL_FORMAT_RGB_8_PACKED, "RGB8"},
    {ARV_PIXEL_FORMAT_BGR_8_PACKED, "BGR8"},
    {ARV_PIXEL_FORMAT_RGBA_8_PACKED, "RGBa8"},
    {ARV_PIXEL_FORMAT_BGRA_8_PACKED, "BGRa8"},
    {ARV_PIXEL_FORMAT_YUV_422_YUYV_PACKED, "YUV422_8"},
    {ARV_PIXEL_FORMAT_YUV_422_PACKED, "YUV422_8_UYVY"},
    // And three of the convention's own table.
    {0x010A0046, "Mono10p"},
    {0x010C0047, "Mono12p"},
    {0x0210003B, "YCbCr422_8"},
};

}  // namespace

TEST_CASE("pixel_format: codes have the names that another library gives them") {
    for (const Known& format : known_formats) CHECK(pixel_format_name(format.code) == format.name);
    for (const std::uint32_t code : {0U, 1U, 0x12345678U, 0xFFFFFFFFU})
        CHECK(pixel_format_name(code) == std::string("unknown"));
}

TEST_CASE("pixel_format: the layout fits the bits that the code itself names") {
    for (const Known& format : known_formats) {
        CAPTURE(format.name);
        const PixelLayout layout = pixel_layout(format.code);
        const std::uint32_t bits = format.code >> 16U & 0xFFU;
        CHECK(layout.channels * layout.bytes_per_channel * 8 == (format.is_packed() ? 0 : bits));
        const bool is_colour = format.code >> 24U == 2;
        CHECK((layout.channels > 1) == is_colour);
    }
    CHECK(pixel_layout(0).channels == 0);
}

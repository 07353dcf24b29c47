// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/pixel_format.hpp"

#include <arv.h>

#include <catch2/catch.hpp>
#include <string>

using namespace versavis;

TEST_CASE("pixel_format: codes have the names and sizes that another library gives them") {
    // Aravis knows most of them by their GStreamer or GenICam names, under the same codes.
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_MONO_8) == std::string("Mono8"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_MONO_12_PACKED) == std::string("Mono12Packed"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_MONO_14) == std::string("Mono14"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_BAYER_RG_8) == std::string("BayerRG8"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_BAYER_BG_10) == std::string("BayerBG10"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_BAYER_GB_12) == std::string("BayerGB12"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_BAYER_GR_16) == std::string("BayerGR16"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_BAYER_RG_10P) == std::string("BayerRG10p"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_BAYER_RG_12P) == std::string("BayerRG12p"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_BAYER_RG_12_PACKED) == std::string("BayerRG12Packed"));
    CHECK(pixel_format_name(ARV_PIXEL_FORMAT_RGB_8_PACKED) == std::string("RGB8"));
    CHECK(pixel_format_name(0x12345678) == std::string("unknown"));
}

TEST_CASE("pixel_format: the layout fits the bits that the code itself names") {
    for (const std::uint32_t code : {0x01080001U, 0x01100003U, 0x01100007U, 0x0108000BU,
                                     0x01100031U, 0x02180014U, 0x02200017U, 0x02100032U}) {
        const PixelLayout layout = pixel_layout(code);
        CHECK(layout.channels * layout.bytes_per_channel * 8 == (code >> 16U & 0xFFU));
    }
    for (const std::uint32_t packed : {0x010C0006U, 0x010A0046U, 0x010C0059U, 0U})
        CHECK(pixel_layout(packed).channels == 0);
}

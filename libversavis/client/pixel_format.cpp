// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/pixel_format.hpp"

#include <algorithm>
#include <array>

namespace versavis {

namespace {

struct Format {
    std::uint32_t code;
    const char* name;
    PixelLayout layout;
};

constexpr PixelLayout one_byte{1, 1};
constexpr PixelLayout two_bytes{1, 2};
constexpr PixelLayout packed{};

/// Source: PFNC 2.4, table of values.
constexpr std::array formats{
    Format{0x01080001, "Mono8", one_byte},
    Format{0x01100003, "Mono10", two_bytes},
    Format{0x01100005, "Mono12", two_bytes},
    Format{0x01100025, "Mono14", two_bytes},
    Format{0x01100007, "Mono16", two_bytes},
    Format{0x010A0046, "Mono10p", packed},
    Format{0x010C0047, "Mono12p", packed},
    Format{0x010C0004, "Mono10Packed", packed},
    Format{0x010C0006, "Mono12Packed", packed},
    Format{0x01080008, "BayerGR8", one_byte},
    Format{0x01080009, "BayerRG8", one_byte},
    Format{0x0108000A, "BayerGB8", one_byte},
    Format{0x0108000B, "BayerBG8", one_byte},
    Format{0x0110000C, "BayerGR10", two_bytes},
    Format{0x0110000D, "BayerRG10", two_bytes},
    Format{0x0110000E, "BayerGB10", two_bytes},
    Format{0x0110000F, "BayerBG10", two_bytes},
    Format{0x01100010, "BayerGR12", two_bytes},
    Format{0x01100011, "BayerRG12", two_bytes},
    Format{0x01100012, "BayerGB12", two_bytes},
    Format{0x01100013, "BayerBG12", two_bytes},
    Format{0x0110002E, "BayerGR16", two_bytes},
    Format{0x0110002F, "BayerRG16", two_bytes},
    Format{0x01100030, "BayerGB16", two_bytes},
    Format{0x01100031, "BayerBG16", two_bytes},
    Format{0x010A0056, "BayerGR10p", packed},
    Format{0x010A0058, "BayerRG10p", packed},
    Format{0x010A0054, "BayerGB10p", packed},
    Format{0x010A0052, "BayerBG10p", packed},
    Format{0x010C0057, "BayerGR12p", packed},
    Format{0x010C0059, "BayerRG12p", packed},
    Format{0x010C0055, "BayerGB12p", packed},
    Format{0x010C0053, "BayerBG12p", packed},
    Format{0x010C002A, "BayerGR12Packed", packed},
    Format{0x010C002B, "BayerRG12Packed", packed},
    Format{0x010C002C, "BayerGB12Packed", packed},
    Format{0x010C002D, "BayerBG12Packed", packed},
    Format{0x02180014, "RGB8", {3, 1}},
    Format{0x02180015, "BGR8", {3, 1}},
    Format{0x02200016, "RGBa8", {4, 1}},
    Format{0x02200017, "BGRa8", {4, 1}},
    Format{0x02100032, "YUV422_8", {2, 1}},
    Format{0x0210001F, "YUV422_8_UYVY", {2, 1}},
    Format{0x0210003B, "YCbCr422_8", {2, 1}},
};

const Format* find(std::uint32_t code) {
    const auto* found = std::find_if(formats.begin(), formats.end(),
                                     [=](const Format& format) { return format.code == code; });
    return found == formats.end() ? nullptr : found;
}

}  // namespace

const char* pixel_format_name(std::uint32_t code) {
    const Format* format = find(code);
    return format == nullptr ? "unknown" : format->name;
}

PixelLayout pixel_layout(std::uint32_t code) {
    const Format* format = find(code);
    return format == nullptr ? PixelLayout{} : format->layout;
}

}  // namespace versavis

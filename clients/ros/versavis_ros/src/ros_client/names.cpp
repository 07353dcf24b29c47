// SPDX-License-Identifier: BSD-3-Clause
#include "ros_client/names.hpp"

#include <utility>

#include "versavis/pixel_format.hpp"

namespace versavis::ros_client {

namespace {

/// "" unless the format's name is one of Bayer.
std::string bayer_encoding(std::string_view name, unsigned bits) {
    constexpr std::pair<std::string_view, const char*> patterns[]{{"BayerRG", "bayer_rggb"},
                                                                  {"BayerBG", "bayer_bggr"},
                                                                  {"BayerGB", "bayer_gbrg"},
                                                                  {"BayerGR", "bayer_grbg"}};
    for (const auto& [begin, pattern] : patterns)
        if (name.substr(0, begin.size()) == begin) return pattern + std::to_string(bits);
    return {};
}

}  // namespace

std::string encoding_of(std::uint32_t pixel_format) {
    const std::string_view name = pixel_format_name(pixel_format);
    const PixelLayout layout = pixel_layout(pixel_format);
    if (layout.channels == 0) return std::string(name);
    const unsigned bits = 8 * layout.bytes_per_channel;
    if (name == "RGB8") return "rgb8";
    if (name == "BGR8") return "bgr8";
    if (name.substr(0, 4) == "Mono") return "mono" + std::to_string(bits);
    const std::string bayer = bayer_encoding(name, bits);
    return bayer.empty() ? std::string(name) : bayer;
}

std::string topic_part(std::string_view stream) {
    std::string part(stream);
    for (char& one : part) {
        const bool letter = (one >= 'a' && one <= 'z') || (one >= 'A' && one <= 'Z');
        if (!letter && !(one >= '0' && one <= '9')) one = '_';
    }
    return part.front() >= '0' && part.front() <= '9' ? "_" + part : part;
}

}  // namespace versavis::ros_client

// SPDX-License-Identifier: BSD-3-Clause
#include "stream/snapshot.hpp"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "status/status_document.hpp"
#include "versavis/stream.hpp"

namespace versavis::client {

namespace {

struct PixelLayout {
    png_uint_32 format;
    std::uint32_t bytes_per_pixel;
};

/// Codes of the Pixel Format Naming Convention. The upper byte but one is the number of bits a
/// pixel takes.
std::optional<PixelLayout> layout_of(std::uint32_t pixel_format) {
    constexpr std::uint32_t rgb8 = 0x02180014;
    constexpr std::uint32_t bgr8 = 0x02180015;
    const std::uint32_t bits = pixel_format >> 16U & 0xFFU;
    const bool one_channel = pixel_format >> 24U == 0x01;
    if (pixel_format == rgb8) return PixelLayout{PNG_FORMAT_RGB, 3};
    if (pixel_format == bgr8) return PixelLayout{PNG_FORMAT_BGR, 3};
    if (one_channel && bits == 8) return PixelLayout{PNG_FORMAT_GRAY, 1};
    if (one_channel && bits == 16) return PixelLayout{PNG_FORMAT_LINEAR_Y, 2};
    return std::nullopt;
}

Expected<> write_png(const std::string& path, const FrameMetadata& frame,
                     const std::vector<std::byte>& pixels) {
    const auto layout = layout_of(frame.pixel_format);
    if (!layout)
        return failure(path,
                       fmt::format("pixel format {:#010x} is not supported", frame.pixel_format),
                       "choose an unpacked format of 8 or 16 bits in the camera's [features]");
    if (std::uint64_t{frame.stride} * frame.height > pixels.size() ||
        frame.stride < frame.width * layout->bytes_per_pixel)
        return failure(path, "the frame holds fewer bytes than its width and height require");
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = frame.width;
    image.height = frame.height;
    image.format = layout->format;
    const bool wide = layout->bytes_per_pixel == 2;
    const auto stride = static_cast<png_int_32>(wide ? frame.stride / 2 : frame.stride);
    if (png_image_write_to_file(&image, path.c_str(), 0, pixels.data(), stride, nullptr) == 0)
        return failure(path, image.message, "is its directory writable?");
    return {};
}

}  // namespace

Expected<std::string> snapshot(const std::string& instance, const std::string& stream_name,
                               const std::string& path, Duration timeout) {
    auto stream = FrameStream::open(stream_name, instance);
    if (!stream) return Unexpected(explain(stream.error(), instance, stream_name));
    const HostTime deadline = host_now() + timeout;
    while (host_now() < deadline) {
        const auto item = stream->wait(deadline - host_now());
        if (item.found != Found::item) continue;
        std::vector<std::byte> pixels(item.payload_size);
        if (!stream->copy(item, pixels.data())) continue;
        if (auto written = write_png(path, item.data, pixels); !written)
            return Unexpected(written.error());
        return fmt::format("{}: {} x {}, {} stamp {} ns", path, item.data.width, item.data.height,
                           to_string(item.data.stamp_kind()), item.time.ns);
    }
    const Error late{stream_name, "no frame arrived in time", "see 'versavis status'"};
    return Unexpected(explain(late, instance, stream_name));
}

}  // namespace versavis::client

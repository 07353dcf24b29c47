// SPDX-License-Identifier: BSD-3-Clause
#include "snapshot.hpp"

#include <fmt/format.h>
#include <png.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "posix/file.hpp"
#include "status/status_document.hpp"
#include "versavis/stream.hpp"

namespace versavis::client {

namespace {

/// As libpng writes it; none: packed, or colours that it does not know.
std::optional<png_uint_32> png_format(std::uint32_t pixel_format) {
    constexpr std::uint32_t rgb8 = 0x02180014;
    constexpr std::uint32_t bgr8 = 0x02180015;
    if (pixel_format == rgb8) return PNG_FORMAT_RGB;
    if (pixel_format == bgr8) return PNG_FORMAT_BGR;
    const PixelLayout layout = pixel_layout(pixel_format);
    if (layout.channels != 1) return std::nullopt;
    return layout.bytes_per_channel == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_LINEAR_Y;
}

Expected<> write_png(const std::string& path, const ImageView& view,
                     const std::vector<std::byte>& pixels) {
    const auto format = png_format(view.pixel_format);
    if (!format)
        return failure(path,
                       fmt::format("pixel format {} ({:#010x}) is not supported",
                                   pixel_format_name(view.pixel_format), view.pixel_format),
                       "choose an unpacked format of 8 or 16 bits in the camera's [features]");
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = view.width;
    image.height = view.height;
    image.format = *format;
    const auto stride = static_cast<png_int_32>(view.stride / view.layout.bytes_per_channel);
    std::string png(PNG_IMAGE_PNG_SIZE_MAX(image), '\0');
    png_alloc_size_t size = png.size();
    if (png_image_write_to_memory(&image, png.data(), &size, 0, pixels.data(), stride, nullptr) ==
        0)
        return failure(path, image.message);
    return write_whole_file(path, {png.data(), size});
}

}  // namespace

Expected<std::string> snapshot(const std::string& instance, const std::string& stream_name,
                               const std::string& path, Duration timeout) {
    StreamOptions options;
    options.instance = instance;
    auto stream = FrameStream::open(stream_name, options);
    if (!stream) return Unexpected(explain(stream.error(), instance, stream_name));
    const HostTime deadline = host_now() + timeout;
    while (host_now() < deadline) {
        const auto frame = stream->next(deadline - host_now());
        if (!frame) continue;
        const auto view = frame->image();
        if (!view)
            return failure(path, "the frame holds fewer bytes than its width and height require");
        std::vector<std::byte> pixels(frame->payload.size());
        if (!frame->payload.copy_to(pixels.data())) continue;
        if (auto written = write_png(path, *view, pixels); !written)
            return Unexpected(written.error());
        return fmt::format("{}: {} x {} {}, {} stamp {} ns", path, view->width, view->height,
                           pixel_format_name(view->pixel_format),
                           to_string(frame->data.stamp_kind()), frame->time.ns);
    }
    const Error late{stream_name, "no frame arrived in time", "see 'versavis status'"};
    return Unexpected(explain(late, instance, stream_name));
}

}  // namespace versavis::client

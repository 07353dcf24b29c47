// SPDX-License-Identifier: BSD-3-Clause
#include "export/export_image.hpp"

#include <fmt/format.h>
#include <png.h>

#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "posix/file.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

/// Fastest: on the noise of a camera, more effort gains some percent. Sub is the filter that the
/// recorder uses, too.
constexpr int png_effort = 1;

void stay_silent(png_structp, png_const_charp) {}

/// In a function without objects of its own: libpng leaves it by longjmp.
bool write_rows(png_structp png, png_infop info, std::FILE* file, const ExportFormat& format,
                std::uint32_t width, std::uint32_t height, const std::byte* pixels) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;  // NOLINT(cert-err52-cpp): libpng's way
    png_init_io(png, file);
    png_set_compression_level(png, png_effort);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_set_IHDR(png, info, width, height, static_cast<int>(8 * format.bytes),
                 format.channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    if (format.bytes == 2) png_set_swap(png);
    if (format.bgr) png_set_bgr(png);
    const std::size_t row = std::size_t{width} * format.channels * format.bytes;
    for (std::uint32_t y = 0; y < height; ++y)
        png_write_row(png, reinterpret_cast<png_const_bytep>(pixels + row * y));
    png_write_end(png, info);
    return true;
}

/// BayerRG8 begins with the first red, then green: rggb.
const char* bayer_order(const std::string& name) {
    const std::string order = name.substr(5, 2);
    if (order == "RG") return "rggb";
    if (order == "GR") return "grbg";
    if (order == "GB") return "gbrg";
    return order == "BG" ? "bggr" : nullptr;
}

}  // namespace

Expected<ExportFormat> export_format(const std::string& stream, std::uint32_t pixel_format) {
    const std::string name = pixel_format_name(pixel_format);
    const PixelLayout layout = pixel_layout(pixel_format);
    if (name == "RGB8") return ExportFormat{"rgb8", 3, 1, 0, false};
    if (name == "BGR8") return ExportFormat{"bgr8", 3, 1, 0, true};
    const bool mono = name.starts_with("Mono");
    const bool bayer = name.starts_with("Bayer");
    if (layout.channels == 1 && (mono || bayer)) {
        const auto digits = name.substr(name.find_first_of("0123456789"));
        const auto bits = static_cast<std::uint32_t>(std::strtoul(digits.c_str(), nullptr, 10));
        const std::uint32_t words = 8 * layout.bytes_per_channel;
        if (mono)
            return ExportFormat{words == 8 ? "mono8" : "mono16", 1, words / 8, words - bits, false};
        if (const char* order = bayer_order(name); order != nullptr)
            return ExportFormat{fmt::format("bayer_{}{}", order, words), 1, words / 8, words - bits,
                                false};
    }
    return failure(stream, fmt::format("pixels of format {} cannot be exported", name),
                   "leave the camera out, or record an unpacked format");
}

std::vector<std::byte> export_pixels(const ExportFormat& format, const FrameMetadata& frame,
                                     std::span<const std::byte> payload) {
    const std::uint64_t row = std::uint64_t{frame.width} * format.channels * format.bytes;
    if (frame.height == 0 || row == 0 || frame.stride < row ||
        payload.size() < std::uint64_t{frame.stride} * (frame.height - 1) + row)
        return {};
    std::vector<std::byte> pixels(row * frame.height);
    for (std::uint64_t y = 0; y < frame.height; ++y)
        std::memcpy(pixels.data() + y * row, payload.data() + y * frame.stride, row);
    if (format.shift == 0) return pixels;
    for (std::size_t at = 0; at < pixels.size(); at += 2) {
        std::uint16_t word = 0;
        std::memcpy(&word, pixels.data() + at, sizeof word);
        word = static_cast<std::uint16_t>(word << format.shift);
        std::memcpy(pixels.data() + at, &word, sizeof word);
    }
    return pixels;
}

Expected<> write_png(const std::string& path, const ExportFormat& format, std::uint32_t width,
                     std::uint32_t height, std::span<const std::byte> pixels) {
    auto file = NewFile::create(path);
    if (!file) return Unexpected(file.error());
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, stay_silent);
    png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
    const bool good = info != nullptr &&
                      write_rows(png, info, file->stream(), format, width, height, pixels.data());
    png_destroy_write_struct(&png, &info);
    if (!good) return not_written(path);
    return file->close();
}

}  // namespace versavis::client

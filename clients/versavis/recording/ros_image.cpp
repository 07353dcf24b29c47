// SPDX-License-Identifier: BSD-3-Clause
#include "recording/ros_image.hpp"

#include <png.h>

#include <algorithm>
#include <csetjmp>
#include <cstring>

#include "base/byte_cursor.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

constexpr std::size_t encapsulation = 4;  ///< fields are aligned from behind it

/// Deflate cannot do better: a PNG that claims to hold more than so many times its size is none.
/// Source: the format's longest match, 258 bytes of 2 bits.
constexpr std::uint64_t deflate_limit = 1032;

std::string_view cdr_text(ByteCursor& cursor) {
    cursor.align(4, encapsulation);
    const std::string_view text = cursor.text();
    return text.empty() ? text : text.substr(0, text.size() - 1);  // without its zero
}

template <class T>
T cdr_number(ByteCursor& cursor) {
    cursor.align(sizeof(T), encapsulation);
    return cursor.number<T>();
}

bool begin_message(ByteCursor& cursor) {
    const auto kind = cursor.bytes(encapsulation);
    if (kind.empty() || kind[0] != std::byte{0} || kind[1] != std::byte{1}) return false;
    cursor.bytes(8);  // stamp
    cdr_text(cursor);
    return cursor.good();
}

struct PngSource {
    std::span<const std::byte> bytes;
};

void read_png(png_structp png, png_bytep into, png_size_t count) {
    auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
    if (count > source->bytes.size()) png_error(png, "cut off");
    std::memcpy(into, source->bytes.data(), count);
    source->bytes = source->bytes.subspan(count);
}

/// The program's output is its own.
void stay_silent(png_structp, png_const_charp) {}

struct Wanted {
    const FrameMetadata& frame;
    PixelLayout layout;
    std::uint64_t row_bytes;
};

bool fits(png_structp png, png_infop info, const Wanted& wanted) {
    const int colour = wanted.layout.channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY;
    return png_get_image_width(png, info) == wanted.frame.width &&
           png_get_image_height(png, info) == wanted.frame.height &&
           png_get_color_type(png, info) == colour &&
           png_get_bit_depth(png, info) == 8 * wanted.layout.bytes_per_channel &&
           png_get_interlace_type(png, info) == PNG_INTERLACE_NONE &&
           png_get_rowbytes(png, info) == wanted.row_bytes;
}

/// In a function without objects of its own: libpng leaves it by longjmp.
bool read_rows(png_structp png, png_infop info, const Wanted& wanted, std::byte* pixels) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;  // NOLINT(cert-err52-cpp): libpng's way
    png_read_info(png, info);
    if (!fits(png, info, wanted)) return false;
    if (wanted.layout.bytes_per_channel == 2) png_set_swap(png);
    constexpr std::uint32_t bgr8 = 0x02180015;
    if (wanted.frame.pixel_format == bgr8) png_set_bgr(png);
    for (std::uint32_t row = 0; row < wanted.frame.height; ++row)
        png_read_row(png,
                     reinterpret_cast<png_bytep>(pixels + std::size_t{wanted.frame.stride} * row),
                     nullptr);
    png_read_end(png, nullptr);
    return true;
}

}  // namespace

std::optional<RosImage> parse_image(std::span<const std::byte> message) {
    ByteCursor cursor(message);
    if (!begin_message(cursor)) return std::nullopt;
    RosImage image{};
    image.height = cdr_number<std::uint32_t>(cursor);
    image.width = cdr_number<std::uint32_t>(cursor);
    image.encoding = cdr_text(cursor);
    cursor.bytes(1);  // is_bigendian: never
    image.step = cdr_number<std::uint32_t>(cursor);
    image.data = cursor.bytes(cdr_number<std::uint32_t>(cursor));
    if (!cursor.good()) return std::nullopt;
    return image;
}

std::optional<RosCompressedImage> parse_compressed_image(std::span<const std::byte> message) {
    ByteCursor cursor(message);
    if (!begin_message(cursor)) return std::nullopt;
    RosCompressedImage image{};
    image.format = cdr_text(cursor);
    image.data = cursor.bytes(cdr_number<std::uint32_t>(cursor));
    if (!cursor.good()) return std::nullopt;
    return image;
}

bool unpack_png(std::span<const std::byte> bytes, const FrameMetadata& frame,
                std::vector<std::byte>& pixels) {
    const PixelLayout layout = pixel_layout(frame.pixel_format);
    const std::uint64_t row =
        std::uint64_t{frame.width} * layout.channels * layout.bytes_per_channel;
    if ((layout.channels != 1 && layout.channels != 3) || frame.height == 0 || row == 0 ||
        frame.stride < row || row > deflate_limit * bytes.size() / frame.height ||
        frame.stride > 2 * row + 4096)
        return false;
    pixels.assign(std::size_t{frame.stride} * frame.height, std::byte{0});
    PngSource source{bytes};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, stay_silent);
    if (png == nullptr) return false;
    png_infop info = png_create_info_struct(png);
    png_set_read_fn(png, &source, read_png);
    const bool good = info != nullptr && read_rows(png, info, {frame, layout, row}, pixels.data());
    png_destroy_read_struct(&png, &info, nullptr);
    return good;
}

}  // namespace versavis::client

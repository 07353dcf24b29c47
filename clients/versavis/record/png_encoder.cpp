// SPDX-License-Identifier: BSD-3-Clause
#include "record/png_encoder.hpp"

#include <arpa/inet.h>
#include <isa-l/crc.h>
#include <isa-l/igzip_lib.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <string_view>

#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

constexpr std::uint32_t rgb8 = 0x02180014;
constexpr std::uint32_t bgr8 = 0x02180015;

constexpr std::byte filter_sub{1};

/// What packing may add to what cannot be packed: less than an eighth, and the stream's own words.
constexpr std::size_t room_for(std::size_t size) { return size + size / 8 + 4096; }

using Bytes = std::vector<std::byte>;

void put_u32(Bytes& out, std::uint32_t value) {
    const std::uint32_t wire = htonl(value);
    const auto* bytes = reinterpret_cast<const std::byte*>(&wire);
    out.insert(out.end(), bytes, bytes + sizeof wire);
}

std::uint32_t crc_of(std::span<const std::byte> bytes) {
    // The library's argument is not const; it only reads.
    auto* data = reinterpret_cast<unsigned char*>(const_cast<std::byte*>(bytes.data()));
    return ::crc32_gzip_refl(0, data, bytes.size());
}

/// Length, type, content and checksum.
void put_chunk(Bytes& out, std::string_view type, std::span<const std::byte> content) {
    put_u32(out, static_cast<std::uint32_t>(content.size()));
    const std::size_t begin = out.size();
    const auto* name = reinterpret_cast<const std::byte*>(type.data());
    out.insert(out.end(), name, name + type.size());
    out.insert(out.end(), content.begin(), content.end());
    put_u32(out, crc_of(std::span(out).subspan(begin)));
}

/// One row as PNG orders its bytes: words of 16 bits the high byte first, colours as RGB.
void order_row(const std::byte* row, std::size_t size, const FrameMetadata& frame,
               std::byte* ordered) {
    std::memcpy(ordered, row, size);
    if (frame.pixel_format == bgr8)
        for (std::size_t i = 0; i + 2 < size; i += 3) std::swap(ordered[i], ordered[i + 2]);
    if (pixel_layout(frame.pixel_format).bytes_per_channel == 2)
        for (std::size_t i = 0; i + 1 < size; i += 2) std::swap(ordered[i], ordered[i + 1]);
}

/// All rows, each behind the number of its filter.
Bytes filtered(const FrameMetadata& frame, std::span<const std::byte> pixels) {
    const PixelLayout layout = pixel_layout(frame.pixel_format);
    const std::size_t pixel = std::size_t{layout.channels} * layout.bytes_per_channel;
    const std::size_t row_size = pixel * frame.width;
    Bytes rows((row_size + 1) * frame.height);
    Bytes ordered(row_size);
    for (std::size_t y = 0; y < frame.height; ++y) {
        order_row(pixels.data() + y * frame.stride, row_size, frame, ordered.data());
        std::byte* out = rows.data() + y * (row_size + 1);
        *out++ = filter_sub;
        std::memcpy(out, ordered.data(), pixel);
        const auto* in = reinterpret_cast<const std::uint8_t*>(ordered.data());
        auto* differences = reinterpret_cast<std::uint8_t*>(out);
        for (std::size_t x = pixel; x < row_size; ++x)
            differences[x] = static_cast<std::uint8_t>(in[x] - in[x - pixel]);
    }
    return rows;
}

Bytes packed(Bytes rows) {
    Bytes out(room_for(rows.size()));
    const auto level_buffer = std::make_unique<std::uint8_t[]>(ISAL_DEF_LVL1_DEFAULT);
    isal_zstream stream{};
    ::isal_deflate_init(&stream);
    stream.level = 1;
    stream.level_buf = level_buffer.get();
    stream.level_buf_size = ISAL_DEF_LVL1_DEFAULT;
    stream.gzip_flag = IGZIP_ZLIB;
    stream.end_of_stream = 1;
    stream.next_in = reinterpret_cast<std::uint8_t*>(rows.data());
    stream.avail_in = static_cast<std::uint32_t>(rows.size());
    stream.next_out = reinterpret_cast<std::uint8_t*>(out.data());
    stream.avail_out = static_cast<std::uint32_t>(out.size());
    ::isal_deflate(&stream);
    out.resize(stream.total_out);
    return out;
}

}  // namespace

bool can_be_png(const FrameMetadata& frame, std::size_t size) {
    const PixelLayout layout = pixel_layout(frame.pixel_format);
    const bool colour = frame.pixel_format == rgb8 || frame.pixel_format == bgr8;
    const std::uint64_t row =
        std::uint64_t{layout.channels} * layout.bytes_per_channel * frame.width;
    constexpr std::uint64_t largest = 1 << 30U;  // what the packer counts in 32 bits, with room
    return (layout.channels == 1 || colour) && row > 0 && frame.height > 0 && frame.stride >= row &&
           std::uint64_t{frame.stride} * frame.height <= std::min<std::uint64_t>(size, largest);
}

std::vector<std::byte> encode_png(const FrameMetadata& frame, std::span<const std::byte> pixels) {
    const PixelLayout layout = pixel_layout(frame.pixel_format);
    Bytes header;
    put_u32(header, frame.width);
    put_u32(header, frame.height);
    constexpr std::byte grey{0};
    constexpr std::byte truecolour{2};
    header.push_back(static_cast<std::byte>(8 * layout.bytes_per_channel));
    header.push_back(layout.channels == 1 ? grey : truecolour);
    header.resize(header.size() + 3);  // compression, filter and interlace as there is one of each

    constexpr unsigned char signature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
    const auto* magic = reinterpret_cast<const std::byte*>(signature);
    const Bytes data = packed(filtered(frame, pixels));
    Bytes png;
    png.reserve(data.size() + 64);
    png.insert(png.end(), magic, magic + sizeof signature);
    put_chunk(png, "IHDR", header);
    put_chunk(png, "IDAT", data);
    put_chunk(png, "IEND", {});
    return png;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "picture.hpp"

#include <turbojpeg.h>

#include <algorithm>
#include <memory>

#include "export/export_image.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

/// Larger is sharper; below 85, edges of one pixel blur visibly.
constexpr int jpeg_quality = 85;

/// As `pixels` of full scale, cut to 8 bits.
Pixels to_8_bit(const ExportFormat& format, const FrameMetadata& frame,
                std::vector<std::byte> pixels) {
    Pixels made{frame.width, frame.height, format.channels, {}};
    made.values.resize(pixels.size() / format.bytes);
    for (std::size_t i = 0; i < made.values.size(); ++i)  // the upper byte, little-endian
        made.values[i] = std::to_integer<std::uint8_t>(pixels[i * format.bytes + format.bytes - 1]);
    if (format.bgr)
        for (std::size_t i = 0; i + 2 < made.values.size(); i += 3)
            std::swap(made.values[i], made.values[i + 2]);
    return made;
}

/// Of words, all bits count: the largest value of 12 bits is 0xfff0 at full scale.
double saturated_part(const ExportFormat& format, const std::vector<std::byte>& pixels) {
    const std::size_t values = pixels.size() / format.bytes;
    const auto most = static_cast<std::uint16_t>(0xffffU << format.shift);
    std::size_t saturated = 0;
    for (std::size_t i = 0; i < values; ++i) {
        const auto low = std::to_integer<unsigned>(pixels[i * format.bytes]);
        const bool full = format.bytes == 1
                              ? low == 0xff
                              : (low | std::to_integer<unsigned>(pixels[i * 2 + 1]) << 8U) == most;
        saturated += full ? 1 : 0;
    }
    return static_cast<double>(saturated) / static_cast<double>(values);
}

constexpr std::size_t green = 1;

/// 0 red, 1 green, 2 blue.
std::size_t colour_of(const std::string& pattern, std::uint32_t x, std::uint32_t y) {
    const char colour = pattern[(y & 1U) * 2 + (x & 1U)];
    return colour == 'r' ? 0 : colour == 'g' ? 1 : 2;
}

struct Sums {
    std::array<unsigned, 3> sum{};
    std::array<unsigned, 3> count{};

    void add(std::size_t colour, std::uint8_t value) {
        sum.at(colour) += value;
        ++count.at(colour);
    }
    /// Without any pixel of a colour, as at the edge of a very small frame, that is dark.
    std::uint8_t mean(std::size_t colour) const {
        return static_cast<std::uint8_t>(sum.at(colour) / std::max(1U, count.at(colour)));
    }
};

Expected<std::string> compress(const std::string& stream, const Pixels& pixels) {
    const std::unique_ptr<void, int (*)(tjhandle)> encoder(tjInitCompress(), tjDestroy);
    unsigned char* made = nullptr;
    unsigned long size = 0;
    const bool grey = pixels.channels == 1;
    const bool good =
        encoder && tjCompress2(encoder.get(), pixels.values.data(), static_cast<int>(pixels.width),
                               0, static_cast<int>(pixels.height), grey ? TJPF_GRAY : TJPF_RGB,
                               &made, &size, grey ? TJSAMP_GRAY : TJSAMP_444, jpeg_quality, 0) == 0;
    const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owned(made, tjFree);
    if (!good) return failure(stream, tjGetErrorStr2(encoder.get()));
    return std::string(reinterpret_cast<const char*>(made), size);
}

}  // namespace

Pixels demosaic(const Pixels& raw, const std::string& pattern) {
    Pixels made{raw.width, raw.height, 3, {}};
    made.values.resize(std::size_t{raw.width} * raw.height * 3);
    std::uint8_t* to = made.values.data();
    // Beyond an edge is what lies as far inside it, which is of the same colour.
    const auto before = [](std::uint32_t i, std::uint32_t size) {
        return i > 0 ? i - 1 : std::min(1U, size - 1);
    };
    const auto after = [](std::uint32_t i, std::uint32_t size) {
        return i + 1 < size ? i + 1 : std::max(size, 2U) - 2;
    };
    for (std::uint32_t y = 0; y < raw.height; ++y) {
        const auto row = [&](std::uint32_t v) {
            return raw.values.data() + std::size_t{v} * raw.width;
        };
        const std::uint8_t* above = row(before(y, raw.height));
        const std::uint8_t* here = row(y);
        const std::uint8_t* below = row(after(y, raw.height));
        const std::array own{colour_of(pattern, 0, y), colour_of(pattern, 1, y)};
        for (std::uint32_t x = 0; x < raw.width; ++x, to += 3) {
            const std::uint32_t left = before(x, raw.width);
            const std::uint32_t right = after(x, raw.width);
            const std::size_t colour = own[x & 1U];
            const std::size_t beside = own[~x & 1U];
            to[colour] = here[x];
            if (colour == green) {
                to[beside] = static_cast<std::uint8_t>((here[left] + here[right]) / 2);
                to[2 - beside] = static_cast<std::uint8_t>((above[x] + below[x]) / 2);
            } else {
                to[green] =
                    static_cast<std::uint8_t>((here[left] + here[right] + above[x] + below[x]) / 4);
                to[2 - colour] = static_cast<std::uint8_t>(
                    (above[left] + above[right] + below[left] + below[right]) / 4);
            }
        }
    }
    return made;
}

Pixels demosaic_by_cells(const Pixels& raw, const std::string& pattern) {
    Pixels made{raw.width / 2, raw.height / 2, 3, {}};
    made.values.resize(std::size_t{made.width} * made.height * 3);
    std::uint8_t* to = made.values.data();
    for (std::uint32_t y = 0; y < made.height; ++y)
        for (std::uint32_t x = 0; x < made.width; ++x, to += 3) {
            Sums cell;
            for (const std::uint32_t v : {2 * y, 2 * y + 1})
                for (const std::uint32_t u : {2 * x, 2 * x + 1})
                    cell.add(colour_of(pattern, u, v), raw.values[std::size_t{v} * raw.width + u]);
            for (std::size_t colour = 0; colour < 3; ++colour) to[colour] = cell.mean(colour);
        }
    return made;
}

Pixels reduced(const Pixels& pixels, std::uint32_t factor) {
    if (factor <= 1) return pixels;
    Pixels made{pixels.width / factor, pixels.height / factor, pixels.channels, {}};
    const std::size_t channels = pixels.channels;
    made.values.reserve(std::size_t{made.width} * made.height * channels);
    std::vector<unsigned> sums;
    for (std::uint32_t y = 0; y < made.height; ++y) {
        sums.assign(made.width * channels, 0);
        for (std::uint32_t v = 0; v < factor; ++v) {
            const std::uint8_t* from =
                pixels.values.data() + std::size_t{y * factor + v} * pixels.width * channels;
            for (std::uint32_t x = 0; x < made.width; ++x)
                for (std::uint32_t u = 0; u < factor; ++u)
                    for (std::size_t c = 0; c < channels; ++c) sums[x * channels + c] += *from++;
        }
        for (const unsigned sum : sums)
            made.values.push_back(static_cast<std::uint8_t>(sum / (factor * factor)));
    }
    return made;
}

Expected<Picture> make_picture(const std::string& stream, const FrameMetadata& frame,
                               std::span<const std::byte> payload, std::uint32_t widest) {
    const auto format = export_format(stream, frame.pixel_format);
    if (!format)
        return failure(stream,
                       std::string("pixels of format ") + pixel_format_name(frame.pixel_format) +
                           " cannot be shown",
                       "choose an unpacked one as the camera's PixelFormat");
    auto pixels = export_pixels(*format, frame, payload);
    if (pixels.empty())
        return failure(stream, "the frame holds fewer bytes than its width and height require");
    Picture picture;
    picture.saturated = saturated_part(*format, pixels);
    Pixels shown = to_8_bit(*format, frame, std::move(pixels));
    for (const std::uint8_t value : shown.values)
        ++picture.histogram.at(value * histogram_bins / 256);
    if (format->encoding.starts_with("bayer_")) {
        const std::string pattern = format->encoding.substr(6, 4);
        const bool by_cells = shown.width > widest && shown.height > 1;
        shown = by_cells ? demosaic_by_cells(shown, pattern) : demosaic(shown, pattern);
    }
    shown = reduced(shown, std::min((shown.width - 1) / widest + 1, shown.height));
    picture.width = shown.width;
    picture.height = shown.height;
    auto jpeg = compress(stream, shown);
    if (!jpeg) return Unexpected(jpeg.error());
    picture.jpeg = std::move(*jpeg);
    return picture;
}

}  // namespace versavis::client

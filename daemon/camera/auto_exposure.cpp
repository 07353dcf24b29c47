// SPDX-License-Identifier: BSD-3-Clause
#include "camera/auto_exposure.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

namespace versavis::daemon {

namespace {

/// Pixels that are looked at.
constexpr std::uint32_t columns = 64;
constexpr std::uint32_t rows = 48;

/// Part of the step to the right exposure that is taken at once.
constexpr double part_of_the_way = 0.7;

/// Relative error of brightness that is left alone.
constexpr double dead_zone = 0.04;

/// Brightness that a black image counts as: one step of 8 bits.
constexpr double darkest = 1.0 / 255;

// Pixel Format Naming Convention: bits 24 to 31 say grey or Bayer, 16 to 23 the bits that a pixel
// takes.
constexpr std::uint32_t family_mask = 0xFF000000U;
constexpr std::uint32_t family_one_component = 0x01000000U;

unsigned occupied_bits(std::uint32_t pixel_format) { return pixel_format >> 16U & 0xFFU; }

/// Significant bits of a pixel in two bytes, by the format's number.
unsigned significant_bits(std::uint32_t pixel_format) {
    switch (pixel_format & 0xFFFFU) {
        case 0x03:
        case 0x0C:
        case 0x0D:
        case 0x0E:
        case 0x0F: return 10;
        case 0x05:
        case 0x10:
        case 0x11:
        case 0x12:
        case 0x13: return 12;
        case 0x25: return 14;
        default: return 16;
    }
}

double pixel(const Image& image, std::size_t index, bool wide) {
    if (!wide) return std::to_integer<unsigned>(image.pixels[index]) / 255.0;
    std::uint16_t value = 0;
    std::memcpy(&value, image.pixels.data() + 2 * index, sizeof value);
    return value / static_cast<double>((1U << significant_bits(image.pixel_format)) - 1U);
}

}  // namespace

std::optional<double> brightness(const Image& image, double percentile) {
    const unsigned bits = occupied_bits(image.pixel_format);
    if ((image.pixel_format & family_mask) != family_one_component || (bits != 8 && bits != 16))
        return std::nullopt;
    const bool wide = bits == 16;
    const std::size_t needed = std::size_t{image.width} * image.height * (wide ? 2 : 1);
    if (needed == 0 || image.pixels.size() < needed) return std::nullopt;
    // Steps are odd, so that all colours of a Bayer pattern are met.
    const std::uint32_t step_x = std::max(1U, image.width / columns) | 1U;
    const std::uint32_t step_y = std::max(1U, image.height / rows) | 1U;
    std::vector<double> values;
    for (std::uint32_t y = step_y / 2; y < image.height; y += step_y)
        for (std::uint32_t x = step_x / 2; x < image.width; x += step_x)
            values.push_back(pixel(image, std::size_t{y} * image.width + x, wide));
    if (values.empty()) return std::nullopt;
    if (percentile == 0) {
        double sum = 0;
        for (const double value : values) sum += value;
        return sum / static_cast<double>(values.size());
    }
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(
                                         percentile / 100 * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

std::optional<Duration> AutoExposure::update(double brightness) {
    const double error = settings_.target / std::max(brightness, darkest);
    const double exposure_us = static_cast<double>(exposure_.ns) * 1e-3;
    const double factor = std::clamp(std::pow(error, part_of_the_way), 1 / settings_.largest_step,
                                     settings_.largest_step);
    const bool right = std::abs(std::log(error)) < dead_zone;
    const double wanted_us =
        std::clamp(right ? exposure_us : exposure_us * factor, settings_.min_us, settings_.max_us);
    const Duration wanted{std::llround(wanted_us * 1e3)};
    if (wanted == exposure_) return std::nullopt;
    exposure_ = wanted;
    return wanted;
}

void FrameMeter::take(const Image& image, HostTime arrived) {
    const auto value = brightness(image, percentile_);
    const std::lock_guard lock(mutex_);
    usable_ = value.has_value();
    brightness_ = value;
    arrived_ = arrived;
}

std::optional<double> FrameMeter::newest(HostTime since) {
    const std::lock_guard lock(mutex_);
    if (arrived_ <= since) return std::nullopt;
    std::optional<double> value;
    value.swap(brightness_);
    return value;
}

bool FrameMeter::usable() const {
    const std::lock_guard lock(mutex_);
    return usable_;
}

}  // namespace versavis::daemon

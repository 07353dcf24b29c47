// SPDX-License-Identifier: BSD-3-Clause
#include "camera_view.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace versavis::rig {

namespace {

constexpr double default_focal = 0.8;  // of the width: 64 degrees are seen
constexpr double plate_level = 20;     // of the LED board between its LEDs
/// In distances from LED to LED: half the board's height, what it has beyond its last LEDs, and
/// the radius of an LED's light.
constexpr double half_height = 0.9;
constexpr double margin = 0.8;
constexpr double spot_radius = 0.34;
constexpr std::size_t noise_samples = 1U << 16U;

double focal_px(const CameraScenario& camera) {
    return camera.focal_px > 0 ? camera.focal_px : default_focal * camera.width;
}

double sharpest(const Scenario& scenario) {
    double focal = 0;
    for (const CameraScenario& camera : scenario.cameras) focal = std::max(focal, focal_px(camera));
    return focal;
}

Eigen::Matrix3d rotation(const std::vector<double>& degrees) {
    const Eigen::Vector3d vector =
        Eigen::Vector3d(degrees[0], degrees[1], degrees[2]) * std::numbers::pi / 180;
    return vector.norm() > 0
               ? Eigen::AngleAxisd(vector.norm(), vector.normalized()).toRotationMatrix()
               : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

/// Sums of twelve uniform numbers are normal enough, and the same with each standard library.
std::vector<std::int8_t> draw_noise(double sigma, std::uint64_t seed) {
    std::vector<std::int8_t> noise(sigma > 0 ? noise_samples : 0);
    std::mt19937_64 random(seed);
    for (std::int8_t& value : noise) {
        double sum = -6;
        for (int i = 0; i < 12; ++i) sum += static_cast<double>(random() >> 11U) * 0x1p-53;
        value = static_cast<std::int8_t>(std::clamp(std::lround(sum * sigma), -128L, 127L));
    }
    return noise;
}

std::uint8_t pixel(double value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
}

/// Light of an LED at this distance from its middle: flat within, soft at the edge.
double spot(double distance, double radius) {
    const double inner = 0.4 * radius;
    if (distance <= inner) return 1;
    if (distance >= radius) return 0;
    const double c = std::cos((distance - inner) / (radius - inner) * std::numbers::pi / 2);
    return c * c;
}

}  // namespace

Surroundings::Surroundings(HostTime zero, const Scenario& scenario)
    : motion(zero, scenario.motion, scenario.seed),
      world(scenario.motion.nods ? nullptr
                                 : std::make_unique<Sphere>(sharpest(scenario), scenario.seed)),
      leds(scenario.leds.present ? std::make_unique<TimingBoard>(scenario.leds) : nullptr) {}

CameraView::CameraView(const Scenario& scenario, const CameraScenario& settings,
                       const Surroundings& surroundings)
    : settings_(settings),
      seed_(scenario.seed),
      surroundings_(surroundings),
      pinhole_{settings.width, settings.height, focal_px(settings)},
      imu_from_camera_(rotation(settings.imu_rotation_deg).transpose()),
      noise_(draw_noise(settings.noise, scenario.seed)) {
    if (!surroundings.world) wall_.emplace(settings.width, settings.height, scenario.seed);
}

bool CameraView::painted() const {
    return surroundings_.world || !settings_.leds.empty() || settings_.light > 0 || !noise_.empty();
}

std::span<const std::uint8_t> CameraView::wall(HostTime at) const {
    return wall_->view(surroundings_.motion.roll_rad(at));
}

void CameraView::paint(HostTime start, HostTime end, std::uint64_t serial,
                       std::span<std::uint8_t> out) const {
    if (surroundings_.world)
        paint_world(start, end, out);
    else
        std::copy_n(wall(middle(start, end)).begin(), out.size(), out.begin());
    if (!settings_.leds.empty()) paint_leds(surroundings_.leds->lit(start, end), out);
    if (settings_.light > 0) light_up(end - start, out);
    if (!noise_.empty()) add_noise(serial, out);
}

/// The mean of instants in the middle of equal parts of the exposure.
void CameraView::paint_world(HostTime start, HostTime end, std::span<std::uint8_t> out) const {
    const auto steps = static_cast<std::int64_t>(settings_.blur_steps);
    std::vector<std::uint16_t> sums(std::size_t{pinhole_.width} * pinhole_.height);
    for (std::int64_t i = 0; i < steps; ++i) {
        const HostTime at = start + (end - start) * (2 * i + 1) / (2 * steps);
        surroundings_.world->add_view(pinhole_,
                                      surroundings_.motion.attitude(at) * imu_from_camera_, sums);
    }
    const unsigned divisor = 16 * settings_.blur_steps;
    for (std::size_t i = 0; i < std::min(out.size(), sums.size()); ++i)
        out[i] = static_cast<std::uint8_t>((sums[i] + divisor / 2) / divisor);
}

void CameraView::paint_leds(const TimingBoard::Row& row, std::span<std::uint8_t> out) const {
    const Eigen::Vector2d first(settings_.leds[0], settings_.leds[1]);
    const Eigen::Vector2d last(settings_.leds[2], settings_.leds[3]);
    const double pitch = (last - first).norm() / (TimingBoard::leds - 1);
    if (pitch == 0) return;
    const Eigen::Vector2d along = (last - first).normalized();
    const Eigen::Vector2d across(-along.y(), along.x());
    const auto rows = static_cast<std::int64_t>(out.size() / settings_.width);
    const double reach = (margin + half_height) * pitch;
    const auto bound = [](double value, std::int64_t end) {
        return static_cast<std::int64_t>(std::clamp(value, 0.0, static_cast<double>(end)));
    };
    const std::int64_t end_y = bound(std::max(first.y(), last.y()) + reach, rows);
    const std::int64_t end_x = bound(std::max(first.x(), last.x()) + reach, settings_.width);
    for (std::int64_t y = bound(std::min(first.y(), last.y()) - reach, rows); y < end_y; ++y)
        for (std::int64_t x = bound(std::min(first.x(), last.x()) - reach, settings_.width);
             x < end_x; ++x) {
            const Eigen::Vector2d from_first =
                Eigen::Vector2d(static_cast<double>(x), static_cast<double>(y)) - first;
            const double u = from_first.dot(along) / pitch;
            const double v = from_first.dot(across) / pitch;
            if (std::abs(v) > half_height || u < -margin || u > TimingBoard::leds - 1 + margin)
                continue;
            const double led = std::clamp(std::round(u), 0.0, TimingBoard::leds - 1.0);
            const double light =
                row.at(static_cast<std::size_t>(led)) * spot(std::hypot(u - led, v), spot_radius);
            out[static_cast<std::size_t>(y) * settings_.width + static_cast<std::size_t>(x)] =
                pixel(plate_level + (settings_.led_level - plate_level) * light);
        }
}

/// The brightness of the scene follows the exposure time.
void CameraView::light_up(Duration exposure, std::span<std::uint8_t> out) const {
    const double gain = settings_.light * static_cast<double>(exposure.ns) * 1e-6;
    std::array<std::uint8_t, 256> table{};
    for (std::size_t i = 0; i < table.size(); ++i)
        table.at(i) = static_cast<std::uint8_t>(std::min(255.0, static_cast<double>(i) * gain));
    for (std::uint8_t& value : out) value = table.at(value);
}

void CameraView::add_noise(std::uint64_t serial, std::span<std::uint8_t> out) const {
    std::mt19937_64 random(seed_ * 0x9E3779B97F4A7C15U + serial);
    for (std::size_t row = 0; row < out.size(); row += settings_.width) {
        std::size_t at = random() % noise_.size();
        const std::size_t end = std::min(out.size(), row + settings_.width);
        for (std::size_t i = row; i < end; ++i) {
            out[i] = static_cast<std::uint8_t>(std::clamp(out[i] + noise_[at], 0, 255));
            at = (at + 1) % noise_.size();
        }
    }
}

}  // namespace versavis::rig

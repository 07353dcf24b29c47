// SPDX-License-Identifier: BSD-3-Clause
// A rig that turns, as its camera and its gyro see it.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "evaluate/rotation_offset.hpp"

namespace versavis::test {

using client::FrameRotation;
using client::GyroSample;
using client::rotation_by;
using client::rotation_of;

struct Wave {
    Eigen::Vector3d amplitude;
    double frequency;
    double phase;
};

/// What moves, and how it is seen.
struct MovingWorld {
    double rate_rms = 0.6;  ///< rad/s, each axis
    double bandwidth_hz = 2;
    double seconds = 30;
    double camera_sigma = 0.5e-3;
    double outliers = 0;     ///< share of rotations
    double lost = 0;         ///< share of rotations, too
    double parallax = 0;     ///< share of what it turns that near things seem to turn beside it
    double sway_rms = 0;     ///< rad/s, slow: what near things seem to turn for other reasons
    double lorry_s = 0;      ///< so long at the end, all pixels show something that passes by
    double period_s = 0.05;  ///< of the frames
    double gyro_density = 2.4e-4;
    double gyro_hz = 200;
    double offset_s = 0.0123;
    Eigen::Vector3d axes{1, 1, 1};  ///< shares of the rate
};

inline const Eigen::Vector3d true_rotation(1.1, -0.4, 0.7);
inline const Eigen::Vector3d true_bias(0.01, -0.02, 0.005);

struct Seen {
    std::vector<FrameRotation> frames;
    std::vector<GyroSample> gyro;
};

inline OutputTime output_at(double s) {
    return {1'700'000'000'000'000'000 + std::llround(s * 1e9)};
}

class OffsetSimulation {
 public:
    OffsetSimulation(const MovingWorld& world, unsigned seed) : world_(world), random_(seed) {
        for (int axis = 0; axis < 3; ++axis)
            for (int i = 0; i < count; ++i) {
                const double amplitude = world.axes[axis] * world.rate_rms * std::sqrt(2.0 / count);
                waves_.push_back({amplitude * Eigen::Vector3d::Unit(axis),
                                  world.bandwidth_hz * uniform(), 2 * M_PI * uniform()});
            }
        if (world.sway_rms <= 0) return;
        for (int i = 0; i < count; ++i)
            sway_.push_back({noise(world.sway_rms * std::sqrt(2.0 / count)), 0.5 * uniform(),
                             2 * M_PI * uniform()});
    }

    Seen run() {
        Seen seen;
        const double interval = 1 / world_.gyro_hz;
        for (int i = 0; i * interval < world_.seconds + 2; ++i)
            seen.gyro.push_back({output_at(i * interval),
                                 rate(i * interval) + true_bias +
                                     noise(world_.gyro_density * std::sqrt(world_.gyro_hz))});
        const Eigen::Quaterniond camera = rotation_by(true_rotation);
        const double period = world_.period_s;
        for (int i = 0; i < world_.seconds / period; ++i) {
            const double from = 1 + i * period;
            Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
            constexpr int steps = 40;
            for (int k = 0; k < steps; ++k)
                turn = turn * rotation_by(rate(from + (k + 0.5) * period / steps) * period / steps);
            Eigen::Quaterniond shown =
                camera * turn * camera.conjugate() * rotation_by(noise(world_.camera_sigma));
            const double middle = from + period / 2;
            shown = shown * rotation_by(period *
                                        (camera * (world_.parallax * rate(middle) + sway(middle))));
            if (from > 1 + world_.seconds - world_.lorry_s)
                shown = shown * rotation_by({0, 0.4 * period, 0});
            if (uniform() < world_.outliers) shown = rotation_by(noise(0.05));
            if (world_.lost > 0 && uniform() < world_.lost) continue;
            seen.frames.push_back({output_at(from - world_.offset_s),
                                   output_at(from + period - world_.offset_s), rotation_of(shown),
                                   Eigen::Vector3d::Constant(world_.camera_sigma)});
        }
        return seen;
    }

 private:
    static constexpr int count = 12;  ///< waves about each axis

    static Eigen::Vector3d sum(const std::vector<Wave>& waves, double s) {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const Wave& wave : waves)
            sum += wave.amplitude * std::sin(2 * M_PI * wave.frequency * s + wave.phase);
        return sum;
    }
    Eigen::Vector3d rate(double s) const { return sum(waves_, s); }
    Eigen::Vector3d sway(double s) const { return sum(sway_, s); }
    double uniform() { return std::uniform_real_distribution<double>()(random_); }
    Eigen::Vector3d noise(double sigma) {
        std::normal_distribution<double> normal(0, sigma);
        const double x = normal(random_);
        const double y = normal(random_);
        return {x, y, normal(random_)};
    }

    MovingWorld world_;
    std::mt19937_64 random_;
    std::vector<Wave> waves_;
    std::vector<Wave> sway_;
};

}  // namespace versavis::test

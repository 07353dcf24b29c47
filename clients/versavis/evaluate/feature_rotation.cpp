// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/feature_rotation.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <random>
#include <vector>

#include "base/median.hpp"

namespace versavis::client {

namespace {

// Corners weaker than this share of the strongest are left out. If lower, more of them slide along
// edges; if higher, scenes with one bright lamp have too few.
constexpr double quality = 0.01;

// Of the frame's width, between features. If lower, they crowd on one object; if higher, fewer fit
// than are looked for.
constexpr double spacing = 0.025;

// Side of the tracked patch, pixels. If lower, more are lost in noise; if higher, it takes more
// time, and patches at the border are lost.
constexpr int patch = 21;

// Levels above the frame itself, each of half the size. One less: rotations above 50 pixels a frame
// are lost. One more: gains nothing but time.
constexpr int levels = 4;

// A feature that does not come back to this many pixels from where it began is astray. If lower,
// noise takes away good ones; if higher, more bad ones must be found by the rotation alone.
constexpr float most_return = 0.5F;

// Pixels by which a feature may miss the rotation that the others agree on. If lower, what is near,
// and moves on its own, is left out, but in noise also good ones; if higher, such features pull
// more.
constexpr double most_miss = 2;

// Rotations that are tried, each from two features: even if half of the features are wrong, fewer
// than one in 10^12 frames finds no good pair.
constexpr int trials = 200;

// Features that must agree, and their share. If lower, chance agreements pass in poor scenes; if
// higher, frames of scenes with few corners are left out.
constexpr std::size_t least_agreeing = 20;
constexpr double least_share = 0.4;

using Bearings = std::vector<Eigen::Vector3d>;

/// The rotation with before[i] = rotation * now[i], by weighted least squares (Kabsch 1976).
Eigen::Matrix3d best_rotation(const Bearings& before, const Bearings& now,
                              const std::vector<double>& weights) {
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < before.size(); ++i)
        if (weights[i] > 0) products += weights[i] * before[i] * now[i].transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(products,
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
    return svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

/// Of two features: exact but for the angle between them.
Eigen::Matrix3d rotation_of_pair(const Bearings& before, const Bearings& now, std::size_t i,
                                 std::size_t k) {
    const auto frame = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
        Eigen::Matrix3d axes;
        axes.col(0) = (a + b).normalized();
        axes.col(1) = a.cross(b).normalized();
        axes.col(2) = axes.col(0).cross(axes.col(1));
        return axes;
    };
    return frame(before[i], before[k]) * frame(now[i], now[k]).transpose();
}

struct Agreement {
    Eigen::Matrix3d rotation;
    std::size_t count = 0;
};

/// M. Fischler, R. Bolles, Random sample consensus, 1981.
Agreement consensus(const Bearings& before, const Bearings& now, double miss) {
    std::mt19937 random(1);  // NOLINT(cert-msc51-cpp): the same picture, the same answer
    std::uniform_int_distribution<std::size_t> any(0, before.size() - 1);
    Agreement best;
    for (int trial = 0; trial < trials; ++trial) {
        const std::size_t i = any(random);
        const std::size_t k = any(random);
        if (before[i].cross(before[k]).norm() < 0.05) continue;  // too close to show a rotation
        const Eigen::Matrix3d rotation = rotation_of_pair(before, now, i, k);
        std::size_t count = 0;
        for (std::size_t n = 0; n < before.size(); ++n)
            if ((before[n] - rotation * now[n]).norm() < miss) ++count;
        if (count > best.count) best = {rotation, count};
    }
    return best;
}

/// Sigma of a rotation about each axis, from features that miss it by `miss` in each direction.
Eigen::Vector3d sigma_of(const Bearings& now, const std::vector<double>& weights, double miss) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < now.size(); ++i)
        information += weights[i] * (Eigen::Matrix3d::Identity() - now[i] * now[i].transpose());
    return miss * information.inverse().diagonal().cwiseSqrt();
}

std::vector<cv::Point2f> corners(const cv::Mat& image, int features) {
    std::vector<cv::Point2f> points;
    cv::goodFeaturesToTrack(image, points, features, quality, image.cols * spacing);
    return points;
}

/// Keeps those of `before` and `now` that lead there and back.
void track(const std::vector<cv::Mat>& first, const std::vector<cv::Mat>& second,
           std::vector<cv::Point2f>& before, std::vector<cv::Point2f>& now) {
    const cv::Size window(patch, patch);
    std::vector<cv::Point2f> back;
    std::vector<unsigned char> forth_found;
    std::vector<unsigned char> back_found;
    cv::calcOpticalFlowPyrLK(first, second, before, now, forth_found, cv::noArray(), window,
                             levels);
    cv::calcOpticalFlowPyrLK(second, first, now, back, back_found, cv::noArray(), window, levels);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < before.size(); ++i) {
        const cv::Point2f off = back[i] - before[i];
        if (forth_found[i] == 0 || back_found[i] == 0 || std::hypot(off.x, off.y) > most_return)
            continue;
        before[kept] = before[i];
        now[kept++] = now[i];
    }
    before.resize(kept);
    now.resize(kept);
}

}  // namespace

struct FeatureRotation::Tracker {
    CameraModel camera;
    int features;
    cv::Size size;
    std::vector<cv::Mat> pyramid;  ///< of the frame before
    std::vector<cv::Point2f> corners;
    OutputTime time;

    Bearings bearings(const std::vector<cv::Point2f>& points) const;
    std::optional<FrameRotation> rotation_to(const std::vector<cv::Mat>& now) const;
    std::optional<FrameRotation> add(const GreyImage& image, OutputTime at);
};

Bearings FeatureRotation::Tracker::bearings(const std::vector<cv::Point2f>& points) const {
    Bearings result;
    result.reserve(points.size());
    for (const cv::Point2f& point : points) result.push_back(bearing_of(camera, point.x, point.y));
    return result;
}

std::optional<FrameRotation> FeatureRotation::Tracker::rotation_to(
    const std::vector<cv::Mat>& second) const {
    std::vector<cv::Point2f> before_points = corners;
    std::vector<cv::Point2f> now_points;
    if (before_points.size() < least_agreeing) return std::nullopt;
    track(pyramid, second, before_points, now_points);
    if (before_points.size() < least_agreeing) return std::nullopt;
    const Bearings before = bearings(before_points);
    const Bearings now = bearings(now_points);
    const double pixel = 2 / (camera.fx + camera.fy);
    const Agreement agreed = consensus(before, now, most_miss * pixel);
    if (agreed.count < least_agreeing ||
        static_cast<double>(agreed.count) < least_share * static_cast<double>(before.size()))
        return std::nullopt;
    Eigen::Matrix3d rotation = agreed.rotation;
    std::vector<double> weights(before.size());
    double scale = most_miss * pixel;
    for (int pass = 0; pass < 4; ++pass) {
        std::vector<double> misses;
        for (std::size_t i = 0; i < before.size(); ++i) {
            const double miss = (before[i] - rotation * now[i]).norm();
            weights[i] = miss < most_miss * pixel ? 1 / (1 + miss * miss / (scale * scale)) : 0;
            if (weights[i] > 0) misses.push_back(miss);
        }
        if (misses.size() < least_agreeing) return std::nullopt;
        // Half of the lengths of two normal components are below 1.18 sigmas.
        scale = std::max(median(misses) / 1.18 * 2, 1e-3 * pixel);
        rotation = best_rotation(before, now, weights);
    }
    FrameRotation result;
    result.rotation = rotation_of(Eigen::Quaterniond(rotation));
    result.sigma = sigma_of(now, weights, scale / 2);
    if (!result.sigma.allFinite()) return std::nullopt;
    return result;
}

std::optional<FrameRotation> FeatureRotation::Tracker::add(const GreyImage& image, OutputTime at) {
    const cv::Mat pixels(static_cast<int>(image.height), static_cast<int>(image.width), CV_8UC1,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    std::vector<cv::Mat> now;
    cv::buildOpticalFlowPyramid(pixels, now, cv::Size(patch, patch), levels);
    std::optional<FrameRotation> result;
    if (!pyramid.empty()) result = rotation_to(now);
    if (result) {
        result->from = time;
        result->to = at;
    }
    pyramid = std::move(now);
    corners = client::corners(pixels, features);
    time = at;
    return result;
}

void FeatureRotation::use_one_thread() { cv::setNumThreads(1); }

FeatureRotation::FeatureRotation(std::unique_ptr<Tracker> tracker) : tracker_(std::move(tracker)) {}
FeatureRotation::FeatureRotation(FeatureRotation&&) noexcept = default;
FeatureRotation& FeatureRotation::operator=(FeatureRotation&&) noexcept = default;
FeatureRotation::~FeatureRotation() = default;

Expected<FeatureRotation> FeatureRotation::create(const CameraModel& camera, int features) {
    if (!(camera.fx > 0) || !(camera.fy > 0))
        return failure("camera", "has no focal length", "give it in pixels, or a calibration");
    auto tracker = std::make_unique<Tracker>();
    tracker->camera = camera;
    tracker->features = features;
    return FeatureRotation(std::move(tracker));
}

Expected<std::optional<FrameRotation>> FeatureRotation::add(GreyImage image, OutputTime time) {
    const cv::Size size(static_cast<int>(image.width), static_cast<int>(image.height));
    if (image.pixels.size() != std::size_t{image.width} * image.height || image.pixels.empty())
        return failure("frame", fmt::format("has {} pixels, not {} x {}", image.pixels.size(),
                                            image.width, image.height));
    if (!tracker_->pyramid.empty() && size != tracker_->size)
        return failure("frame",
                       fmt::format("has {} x {} pixels, and earlier ones {} x {}", size.width,
                                   size.height, tracker_->size.width, tracker_->size.height),
                       "evaluate a recording of one size");
    tracker_->size = size;
    try {
        return tracker_->add(image, time);
    } catch (const cv::Exception& error) {
        return failure("OpenCV", error.what(), "please report it, with the recording");
    }
}

}  // namespace versavis::client

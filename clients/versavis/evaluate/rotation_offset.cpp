// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/rotation_offset.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "base/median.hpp"

namespace versavis::client {

namespace {

using Vector7 = Eigen::Matrix<double, 7, 1>;  ///< rotation, offset, bias
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Jacobian = Eigen::Matrix<double, 3, 7>;

constexpr int offset_at = 3;

// Rotations between frames that are needed. If lower, seven unknowns are hardly checked; if higher,
// five seconds at 20 Hz are refused.
constexpr std::size_t least_rotations = 50;

// Residuals up to this many sigmas count in full (Huber): one of ten exceeds it. If lower, a third
// of the information is lost; if higher, outliers pull harder.
constexpr double huber = 2.5;

// Median length of three normal components.
constexpr double median_length = 1.538;

// Steps between the offsets that are tried. If higher, the valley of a motion of 10 Hz lies between
// two of them.
constexpr double scan_step_s = 0.005;

// Valleys that are followed to their bottom. If lower, of a shaken rig the right one may be left
// out.
constexpr std::size_t valleys_followed = 6;

// Steps of Gauss and Newton; it is over after 3 to 6. If lower, the last digits are missing after a
// start far off.
constexpr int most_steps = 15;

// Neighbours whose errors may be correlated with a rotation's. If lower, what lasts as a parallax
// does is not seen in full; if higher, the sigma scatters more.
constexpr std::size_t correlated = 8;

// An offset that is not known better is no result. If lower, slow motion is refused that is right
// within its sigma; if higher, the model is not straight over its sigma any more, and sigma too
// small.
constexpr double worst_sigma_s = 3e-3;

// The same for the rotation, rad.
constexpr double worst_rotation = 0.1;

// A rotation about a second axis of this share of that about the first shows how the axes of camera
// and IMU lie. If lower, what near things and the lens leave of the first axis in the second passes
// for a motion of its own: errors of 10 degrees; if higher, rigs held in the hand are refused.
constexpr double least_second_axis = 0.2;

// How far one step may turn what the motion does not show, rad: else it would run away.
constexpr double longest_turn = 0.5;

// Another offset must fit worse by this in sigmas, squared. If lower, a motion that nearly repeats
// passes more often; if higher, a short recording is refused more often.
constexpr double clearly_worse = 25;

// Gyro gaps of this many intervals are not bridged. If lower, each lost sample takes a frame with
// it; if higher, rotations are wrong by the motion within.
constexpr double longest_gap = 3;

// A rotation counts at most as if its sigma were this many times smaller than usual: the sigma of
// features leaves out errors that they have in common. If lower, good axes lose half of their say;
// if higher, a few lucky frames outweigh the others.
constexpr double most_weight = 4;

// A scale of the camera's turns counts when it differs from 1 by so many sigmas. If lower, noise is
// taken for a lens; if higher, the rotation is off by more than its sigma.
constexpr double clear_scale = 3;

// From one scale to the next it changes by a tenth or less.
constexpr int most_scales = 5;

// A focal length that is off by more is a wrong calibration, as one of another resolution.
constexpr double worst_scale = 0.3;

double seconds_of(Duration d) { return static_cast<double>(d.ns) * 1e-9; }
double square(double x) { return x * x; }

struct Turn {
    double from;  ///< s since the first sample of the gyro
    double to;
    Eigen::Vector3d rotation;
    Eigen::Quaterniond back;  ///< the inverse of the rotation
    Eigen::Vector3d roots;    ///< of the weights: 1 / sigma, 1 where that is as usual
    double weight;            ///< mean of their squares
};

struct State {
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
    double offset = 0;
    Eigen::Vector3d bias = Eigen::Vector3d::Zero();
};

/// Residuals of all turns and how they depend on the unknowns, both by sigma.
struct Linearised {
    std::vector<Eigen::Vector3d> residuals;
    std::vector<Jacobian> jacobians;

    double scale() const {
        std::vector<double> lengths;
        lengths.reserve(residuals.size());
        for (const auto& residual : residuals) lengths.push_back(residual.norm());
        return median(std::move(lengths)) / median_length;
    }
};

double huber_weight(const Eigen::Vector3d& residual, double scale) {
    const double length = residual.norm();
    return length <= huber * scale ? 1 : huber * scale / length;
}

double huber_cost(const Linearised& at, double scale) {
    double cost = 0;
    for (const auto& residual : at.residuals) {
        const double length = residual.norm() / scale;
        cost += length <= huber ? square(length) : 2 * huber * length - square(huber);
    }
    return cost;
}

class Problem {
 public:
    Problem(std::vector<Turn> turns, const std::vector<GyroSample>& gyro)
        : turns_(std::move(turns)), gyro_(gyro) {}

    const std::vector<Turn>& turns() const { return turns_; }

    /// The camera turned less about its x and y than it seems, by this factor.
    void divide_by(double scale) {
        for (Turn& turn : turns_) {
            turn.rotation.head<2>() /= scale;
            turn.back = rotation_by(-turn.rotation);
        }
    }

    Linearised at(const State& state) const {
        const GyroTrack track(gyro_, state.bias);
        const Eigen::Matrix3d rotation = state.rotation.toRotationMatrix();
        Linearised result;
        for (const Turn& turn : turns_) {
            const double from = turn.from + state.offset;
            const double to = turn.to + state.offset;
            const Eigen::Quaterniond gyro =
                track.orientation(from).conjugate() * track.orientation(to);
            const Eigen::Quaterniond seen = state.rotation * gyro * state.rotation.conjugate();
            result.residuals.emplace_back(turn.roots.cwiseProduct(rotation_of(turn.back * seen)));
            Jacobian jacobian;
            jacobian.leftCols<3>() =
                seen.toRotationMatrix().transpose() - Eigen::Matrix3d::Identity();
            jacobian.col(offset_at) =
                rotation * (track.rate(to) - gyro.conjugate() * track.rate(from));
            const Eigen::Quaterniond half = rotation_by(-0.5 * rotation_of(gyro));
            jacobian.rightCols<3>() = -(to - from) * rotation * half.toRotationMatrix();
            result.jacobians.emplace_back(turn.roots.asDiagonal() * jacobian);
        }
        return result;
    }

    const std::vector<GyroSample>& gyro() const { return gyro_; }

 private:
    std::vector<Turn> turns_;
    const std::vector<GyroSample>& gyro_;
};

/// How far the camera's turns are from the gyro's at this offset, with the rotation and the bias
/// that fit best, and that rotation: W. Kabsch, A solution for the best rotation to relate two sets
/// of vectors, 1976.
struct OffsetFit {
    double misfit;
    Eigen::Quaterniond rotation;
};

OffsetFit fit_rotation(const Problem& problem, const GyroTrack& track, double offset,
                       double longest) {
    Eigen::Vector3d camera_sum = Eigen::Vector3d::Zero();
    Eigen::Vector3d gyro_sum = Eigen::Vector3d::Zero();
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    double squares = 0;
    double weights = 0;
    for (const Turn& turn : problem.turns()) {
        if (turn.rotation.norm() > longest) continue;  // the gyro never turned so far: an outlier
        const Eigen::Vector3d gyro = rotation_of(track.orientation(turn.from + offset).conjugate() *
                                                 track.orientation(turn.to + offset));
        weights += turn.weight;
        camera_sum += turn.weight * turn.rotation;
        gyro_sum += turn.weight * gyro;
        products += turn.weight * turn.rotation * gyro.transpose();
        squares += turn.weight * (turn.rotation.squaredNorm() + gyro.squaredNorm());
    }
    if (weights <= 0) return {HUGE_VAL, Eigen::Quaterniond::Identity()};
    // Without the means, which a bias makes.
    products -= camera_sum * gyro_sum.transpose() / weights;
    squares -= (camera_sum.squaredNorm() + gyro_sum.squaredNorm()) / weights;
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(products,
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
    const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
    return {squares - 2 * signs.dot(svd.singularValues()), Eigen::Quaterniond(rotation)};
}

/// The valleys among the offsets within +- `range`, deepest first.
std::vector<State> starts(const Problem& problem, double range) {
    const GyroTrack track(problem.gyro(), Eigen::Vector3d::Zero());
    double longest = 0;
    for (const Turn& turn : problem.turns())
        longest = std::max(longest, rotation_of(track.orientation(turn.from).conjugate() *
                                                track.orientation(turn.to))
                                        .norm());
    const auto steps = static_cast<int>(std::floor(range / scan_step_s));
    std::vector<std::pair<OffsetFit, double>> fits;
    for (int i = -steps; i <= steps; ++i)
        fits.emplace_back(fit_rotation(problem, track, i * scan_step_s, 2 * longest),
                          i * scan_step_s);
    std::vector<std::pair<double, State>> valleys;
    for (std::size_t i = 0; i < fits.size(); ++i) {
        const double misfit = fits[i].first.misfit;
        if (i > 0 && fits[i - 1].first.misfit < misfit) continue;
        if (i + 1 < fits.size() && fits[i + 1].first.misfit < misfit) continue;
        State state;
        state.rotation = fits[i].first.rotation;
        state.offset = fits[i].second;
        valleys.emplace_back(misfit, state);
    }
    std::sort(valleys.begin(), valleys.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    if (valleys.size() > valleys_followed) valleys.resize(valleys_followed);
    std::vector<State> result;
    for (const auto& valley : valleys) result.push_back(valley.second);
    return result;
}

struct Solution {
    State state;
    Linearised at;
    double scale = 0;
};

/// Solves by own sizes of the unknowns; none where they are not determined at all.
Matrix7 inverse_of(const Matrix7& information) {
    Vector7 size;
    for (int i = 0; i < 7; ++i) size[i] = 1 / std::sqrt(std::max(information(i, i), 1e-30));
    Matrix7 scaled = size.asDiagonal() * information * size.asDiagonal();
    // What nothing shows gets a sigma so large that it is refused, instead of a division by zero.
    scaled += 1e-9 * Matrix7::Identity();
    return size.asDiagonal() * scaled.inverse() * size.asDiagonal();
}

/// None when it leaves the range.
std::optional<Solution> follow(const Problem& problem, State state, double range) {
    for (int step = 0; step < most_steps; ++step) {
        Linearised at = problem.at(state);
        const double scale = std::max(at.scale(), 1e-12);
        Matrix7 information = Matrix7::Zero();
        Vector7 right = Vector7::Zero();
        for (std::size_t i = 0; i < at.residuals.size(); ++i) {
            const double weight = huber_weight(at.residuals[i], scale);
            information += weight * at.jacobians[i].transpose() * at.jacobians[i];
            right += weight * at.jacobians[i].transpose() * at.residuals[i];
        }
        information.topLeftCorner<3, 3>() +=
            square(scale / longest_turn) * Eigen::Matrix3d::Identity();
        const Matrix7 spread = inverse_of(information);
        // An offset that nothing shows would run away; the caller refuses it as it is.
        if (scale * std::sqrt(spread(offset_at, offset_at)) > 0.1 * range) break;
        const Vector7 change = -spread * right;
        state.rotation = (rotation_by(change.head<3>()) * state.rotation).normalized();
        state.offset += change[offset_at];
        state.bias += change.tail<3>();
        if (!(std::abs(state.offset) <= range)) return std::nullopt;
        if (std::abs(change[offset_at]) < 1e-8 && change.head<3>().norm() < 1e-8) break;
    }
    Solution solution{state, problem.at(state), 0};
    solution.scale = std::max(solution.at.scale(), 1e-12);
    return solution;
}

/// Covariance of a Huber estimate (P. Huber, Robust statistics, 1981, section 7.6), with what
/// neighbouring errors have in common (W. Newey, K. West, 1987). Never less than if they had
/// nothing in common: from a finite number, that share comes out too small as well.
Matrix7 covariance(const Solution& solution) {
    const Linearised& at = solution.at;
    const std::size_t n = at.residuals.size();
    Matrix7 bread = Matrix7::Zero();
    Matrix7 plain = Matrix7::Zero();
    double squares = 0;
    std::vector<Vector7> pulls;
    for (std::size_t i = 0; i < n; ++i) {
        const Eigen::Vector3d& residual = at.residuals[i];
        const double weight = huber_weight(residual, solution.scale);
        Eigen::Matrix3d slope = Eigen::Matrix3d::Identity();
        if (weight < 1)
            slope = weight * (slope - residual * residual.transpose() / residual.squaredNorm());
        bread += at.jacobians[i].transpose() * slope * at.jacobians[i];
        plain += at.jacobians[i].transpose() * at.jacobians[i];
        squares += square(weight) * residual.squaredNorm();
        pulls.emplace_back(weight * at.jacobians[i].transpose() * residual);
    }
    const auto count = static_cast<double>(3 * n);
    plain *= squares / (count - 7);
    Matrix7 lagged = Matrix7::Zero();
    for (std::size_t lag = 0; lag <= correlated; ++lag) {
        const double share = 1 - static_cast<double>(lag) / (correlated + 1);
        for (std::size_t i = 0; i + lag < n; ++i) {
            const Matrix7 product = share * pulls[i] * pulls[i + lag].transpose();
            lagged += lag == 0 ? product : Matrix7(product + product.transpose());
        }
    }
    lagged *= count / (count - 7);
    const Matrix7 outer = inverse_of(bread);
    const Matrix7 by_plain = outer * plain * outer;
    const Matrix7 by_lagged = outer * lagged * outer;
    Matrix7 result = by_plain;
    for (int i = 0; i < 7; ++i) result(i, i) = std::max(by_plain(i, i), by_lagged(i, i));
    return result;
}

struct LensScale {
    double value = 1;
    double sigma = HUGE_VAL;
};

/// A focal length that is too short by a factor makes turns about x and y too large by it, and
/// leaves those about the optical axis; so does a near scene, where the camera moves as it turns.
LensScale lens_scale(const Problem& problem, const Solution& solution) {
    const GyroTrack track(problem.gyro(), solution.state.bias);
    double products = 0;
    double squares = 0;
    for (std::size_t i = 0; i < problem.turns().size(); ++i) {
        const Turn& turn = problem.turns()[i];
        const Eigen::Quaterniond gyro =
            track.orientation(turn.from + solution.state.offset).conjugate() *
            track.orientation(turn.to + solution.state.offset);
        const Eigen::Vector3d seen = solution.state.rotation * rotation_of(gyro);
        const double weight = huber_weight(solution.at.residuals[i], solution.scale);
        const Eigen::Vector2d weights = weight * turn.roots.head<2>().cwiseAbs2();
        products += weights.dot(turn.rotation.head<2>().cwiseProduct(seen.head<2>()));
        squares += weights.dot(seen.head<2>().cwiseAbs2());
    }
    if (squares <= 0) return {};
    return {products / squares, solution.scale / std::sqrt(squares)};
}

std::vector<Turn> turns_within(const std::vector<FrameRotation>& frames,
                               const std::vector<GyroSample>& gyro, Duration range) {
    std::vector<std::int64_t> intervals;
    for (std::size_t i = 1; i < gyro.size(); ++i)
        intervals.push_back((gyro[i].time - gyro[i - 1].time).ns);
    const auto usual = static_cast<double>(median(intervals));
    std::vector<OutputTime> gaps;  // where they end
    std::vector<Duration> lengths;
    for (std::size_t i = 1; i < gyro.size(); ++i) {
        const Duration gap = gyro[i].time - gyro[i - 1].time;
        if (static_cast<double>(gap.ns) <= longest_gap * usual) continue;
        gaps.push_back(gyro[i].time);
        lengths.push_back(gap);
    }
    const auto bridged = [&](OutputTime from, OutputTime to) {
        for (std::size_t i = 0; i < gaps.size(); ++i)
            if (gaps[i] >= from && gaps[i] - lengths[i] <= to) return true;
        return false;
    };
    std::vector<double> sigmas;
    for (const FrameRotation& frame : frames)
        sigmas.insert(sigmas.end(), frame.sigma.begin(), frame.sigma.end());
    const double usual_sigma = median(sigmas);
    std::vector<Turn> turns;
    for (const FrameRotation& frame : frames) {
        const bool within = frame.from - range >= gyro.front().time &&
                            frame.to + range <= gyro.back().time && frame.from < frame.to;
        if (!within || !(frame.sigma.minCoeff() > 0) ||
            bridged(frame.from - range, frame.to + range))
            continue;
        const Eigen::Vector3d roots =
            (usual_sigma * frame.sigma.cwiseInverse()).cwiseMin(most_weight);
        turns.push_back({seconds_of(frame.from - gyro.front().time),
                         seconds_of(frame.to - gyro.front().time), frame.rotation,
                         rotation_by(-frame.rotation), roots, roots.squaredNorm() / 3});
    }
    return turns;
}

/// What the user sees of the motion.
std::string motion_text(const Problem& problem, const State& state) {
    const GyroTrack track(problem.gyro(), state.bias);
    Eigen::Vector3d rates = Eigen::Vector3d::Zero();
    double changes = 0;
    for (const Turn& turn : problem.turns()) {
        const Eigen::Vector3d rate = track.rate(turn.from + state.offset);
        rates += rate.cwiseAbs2();
        changes +=
            (track.rate(turn.to + state.offset) - rate).squaredNorm() / square(turn.to - turn.from);
    }
    const auto n = static_cast<double>(problem.turns().size());
    rates = (rates / n).cwiseSqrt();
    return fmt::format(
        "it turned by {:.2f}, {:.2f}, {:.2f} rad/s about the IMU's axes, and the "
        "rate changed by {:.2f} rad/s^2 (all rms)",
        rates[0], rates[1], rates[2], std::sqrt(changes / n));
}

Error not_excited(const std::string& what, const std::string& motion, const std::string& cure) {
    return {"camera and IMU", what + ": " + motion, cure};
}

Expected<> check(const Problem& problem, const Solution& best, const Matrix7& variances,
                 const std::vector<Solution>& others) {
    const double sigma = std::sqrt(variances(offset_at, offset_at));
    const std::string motion = motion_text(problem, best.state);
    if (!(sigma <= worst_sigma_s))
        return Unexpected(not_excited(
            fmt::format("the motion determines the offset only to within {:.1f} ms", sigma * 1e3),
            motion,
            "rotate the rig back and forth about all axes, once a second or faster, by some 30 "
            "degrees"));
    const double cost = huber_cost(best.at, best.scale);
    for (const Solution& other : others) {
        const double apart = std::abs(other.state.offset - best.state.offset);
        if (apart < std::max(10 * sigma, 2 * scan_step_s)) continue;
        if (huber_cost(other.at, best.scale) - cost < clearly_worse)
            return Unexpected(not_excited(
                fmt::format("offsets of {:.1f} ms and of {:.1f} ms fit nearly as well",
                            best.state.offset * 1e3, other.state.offset * 1e3),
                motion, "rotate the rig irregularly: periodic motion fits more than once"));
    }
    return {};
}

/// Turns about one axis leave the rotation about that axis open, however small its sigma.
bool shows_rotation(const Problem& problem, const Solution& best, const Matrix7& variances) {
    if (!(variances.diagonal().head<3>().maxCoeff() <= square(worst_rotation))) return false;
    const GyroTrack track(problem.gyro(), best.state.bias);
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (const Turn& turn : problem.turns()) {
        const Eigen::Vector3d turned =
            rotation_of(track.orientation(turn.from + best.state.offset).conjugate() *
                        track.orientation(turn.to + best.state.offset));
        moments += turned * turned.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(moments, Eigen::EigenvaluesOnly);
    return axes.eigenvalues()[1] >= square(least_second_axis) * axes.eigenvalues()[2];
}

/// All solutions anew, without the scale of the lens, which is returned.
double take_off_scale(Problem& problem, std::vector<Solution>& solutions, std::size_t best,
                      double range) {
    double scale = 1;
    for (int i = 0; i < most_scales; ++i) {
        const LensScale found = lens_scale(problem, solutions[best]);
        if (!(std::abs(found.value - 1) > clear_scale * found.sigma) || found.value <= 0) break;
        problem.divide_by(found.value);
        scale *= found.value;
        for (Solution& solution : solutions)
            if (auto again = follow(problem, solution.state, range)) solution = std::move(*again);
    }
    return scale;
}

RotationOffset result_of(const Problem& problem, const Solution& best, const Matrix7& variances) {
    RotationOffset result;
    result.offset_s = best.state.offset;
    result.camera_from_imu = best.state.rotation;
    result.gyro_bias = best.state.bias;
    const Vector7 sigmas = variances.diagonal().cwiseMax(0).cwiseSqrt();
    result.rotation_shown = shows_rotation(problem, best, variances);
    result.rotation_sigma = sigmas.head<3>();
    result.offset_sigma_s = sigmas[offset_at];
    result.gyro_bias_sigma = sigmas.tail<3>();
    result.residual = best.scale;
    result.rotations = problem.turns().size();
    std::size_t outliers = 0;
    for (const auto& residual : best.at.residuals)
        if (huber_weight(residual, best.scale) < 0.5) ++outliers;
    result.outlier_share = static_cast<double>(outliers) / static_cast<double>(result.rotations);
    return result;
}

}  // namespace

Expected<RotationOffset> rotation_offset(const std::vector<FrameRotation>& frames,
                                         const std::vector<GyroSample>& gyro,
                                         const RotationOffsetSettings& settings) {
    if (gyro.size() < 2 || frames.empty())
        return failure("camera and IMU", "there are no frames or no samples to compare",
                       "record a camera and an IMU together");
    Problem problem(turns_within(frames, gyro, settings.range), gyro);
    if (problem.turns().size() < least_rotations)
        return failure("camera and IMU",
                       fmt::format("only {} rotations between frames lie within the IMU's samples",
                                   problem.turns().size()),
                       "record 30 s of both together, in front of a scene with many corners");
    const double range = seconds_of(settings.range);
    std::vector<Solution> solutions;
    for (const State& start : starts(problem, range))
        if (auto solution = follow(problem, start, range))
            solutions.push_back(std::move(*solution));
    if (solutions.empty())
        return failure("camera and IMU",
                       fmt::format("no offset within {:.0f} ms fits", range * 1e3),
                       "try a larger --range, and check that camera and IMU are on one rig");
    std::size_t best = 0;
    for (std::size_t i = 1; i < solutions.size(); ++i)
        if (solutions[i].scale < solutions[best].scale) best = i;
    const double scale = take_off_scale(problem, solutions, best, range);
    const Matrix7 variances = covariance(solutions[best]);
    if (const auto checked = check(problem, solutions[best], variances, solutions); !checked)
        return Unexpected(checked.error());
    if (std::abs(scale - 1) > worst_scale)
        return failure("camera and IMU",
                       fmt::format("the pictures turn by {:.2f} times what the gyro says", scale),
                       "check the focal length: is the calibration of this lens, and of this "
                       "resolution?");
    RotationOffset result = result_of(problem, solutions[best], variances);
    result.camera_scale = scale;
    return result;
}

}  // namespace versavis::client

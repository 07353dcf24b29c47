// SPDX-License-Identifier: BSD-3-Clause
#include "verify/picture_judge.hpp"

#include <algorithm>
#include <cmath>

#include "base/median.hpp"

namespace versavis::client {

namespace {

/// Fewer do not show which of them is unlike the others.
constexpr std::size_t least_offsets = 3;

constexpr double departing_sigmas = 5;

bool departs(Duration by, Duration sigma, Duration least) {
    const auto allowed = departing_sigmas * static_cast<double>(sigma.ns);
    return absolute(by) > least && std::abs(static_cast<double>(by.ns)) > allowed;
}

}  // namespace

PictureJudge::PictureJudge(const PictureEvidence& evidence) : evidence_(evidence) {
    const auto& all = evidence.offsets;
    if (all.size() < least_offsets) return;
    std::vector<std::int64_t> offsets;
    std::vector<std::int64_t> sigmas;
    for (const PictureOffset& one : all) {
        offsets.push_back(one.offset.ns);
        sigmas.push_back(one.sigma.ns);
    }
    const auto scatter = static_cast<double>(median(std::move(sigmas)));
    const auto sigma = std::llround(scatter / std::sqrt(static_cast<double>(all.size())));
    usual_ = {all.front().from, all.back().to, {median(std::move(offsets))}, {sigma}};
    if (!evidence.calibrated) return;
    const Duration off = usual_->offset - *evidence.calibrated;
    if (departs(off, usual_->sigma, least_miscalibration)) by_calibration_ = off;
}

std::optional<Duration> PictureJudge::off(OutputTime at) const {
    if (!usual_) return std::nullopt;
    if (by_calibration_ != Duration{}) return by_calibration_;
    const auto around =
        std::find_if(evidence_.offsets.begin(), evidence_.offsets.end(),
                     [&](const PictureOffset& one) { return one.from <= at && at < one.to; });
    if (around == evidence_.offsets.end()) return std::nullopt;
    const Duration by = around->offset - usual_->offset;
    const auto sigma = std::llround(std::hypot(around->sigma.ns, usual_->sigma.ns));
    return departs(by, {sigma}, least_departure) ? std::optional(by) : std::nullopt;
}

}  // namespace versavis::client

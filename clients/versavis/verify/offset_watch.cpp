// SPDX-License-Identifier: BSD-3-Clause
#include "verify/offset_watch.hpp"

#include <algorithm>
#include <cmath>

#include "base/median.hpp"
#include "verify/picture_judge.hpp"

namespace versavis::client {

namespace {

// Stretches that show the usual offset: with fewer, one that misleads decides.
constexpr std::size_t least_learned = 3;

// It is known then: half of the least departure is 2.5 of these.
constexpr Duration usual_sigma{100'000};

// No more are learned: what they tell is as good as it gets, and a drift is not to be learned.
constexpr std::size_t most_learned = 30;

// What near things, blur and a rolling shutter leave in every stretch, whatever it claims.
constexpr Duration least_sigma{100'000};

// Stretches that must depart together: one alone may be a lorry that passes. If lower, that is an
// alarm; if higher, a step of 1 ms is not found within a minute.
constexpr std::size_t least_departing = 2;
constexpr std::size_t most_departing = 4;

// Of all of them together, and of each: honest ones pass both once in 10^7 stretches.
constexpr double together_sigmas = 5.5;
constexpr double each_sigmas = 2;

// By which the scatter of the offsets is judged: ten minutes.
constexpr std::size_t most_changes = 30;

// Half of the absolute values of normal errors are below so many sigmas.
constexpr double median_change = 0.6745;

double ns(Duration d) { return static_cast<double>(d.ns); }
double weight(const PictureOffset& one) {
    return 1 / (ns(one.sigma) * ns(one.sigma) + ns(least_sigma) * ns(least_sigma));
}

/// Half of the weight is below, and half above.
Duration weighted_median(std::vector<PictureOffset> offsets) {
    std::sort(offsets.begin(), offsets.end(),
              [](const auto& a, const auto& b) { return a.offset < b.offset; });
    double all = 0;
    for (const PictureOffset& one : offsets) all += weight(one);
    double sum = 0;
    for (const PictureOffset& one : offsets)
        if ((sum += weight(one)) >= all / 2) return one.offset;
    return offsets.back().offset;
}

/// By how much the last offsets differ from the usual one: their weighted mean.
Departure mean_departure(const std::deque<PictureOffset>& offsets, std::size_t count,
                         const PictureOffset& usual) {
    double weights = 0;
    double sum = 0;
    const std::size_t first = offsets.size() - count;
    for (std::size_t i = first; i < offsets.size(); ++i) {
        weights += weight(offsets[i]);
        sum += weight(offsets[i]) * ns(offsets[i].offset - usual.offset);
    }
    const double sigma = std::sqrt(1 / weights + ns(usual.sigma) * ns(usual.sigma));
    return {{std::llround(sum / weights)}, {std::llround(sigma)}, offsets[first].from};
}

}  // namespace

void OffsetWatch::add(const PictureOffset& offset) {
    if (!usual_) return learn(offset);
    latest_.push_back(offset);
    if (latest_.size() > most_departing) settle();
    const auto found = departing();
    if (departure_ && agrees_again())
        departure_.reset();
    else if (found)
        departure_ =
            Departure{found->by, found->sigma, departure_ ? departure_->since : found->since};
}

/// The oldest of the latest ones departs from nothing any more: it counts for what is usual.
void OffsetWatch::settle() {
    const PictureOffset& oldest = latest_.front();
    const PictureOffset& next = latest_[1];
    const double change = ns(next.offset - oldest.offset);
    changes_.push_back(std::abs(change) / std::sqrt(1 / weight(oldest) + 1 / weight(next)));
    if (changes_.size() > most_changes) changes_.pop_front();
    if (!departure_ && learned_.size() < most_learned &&
        absolute(oldest.offset - usual_->offset) < least_departure)
        learn(oldest);
    latest_.pop_front();
}

void OffsetWatch::learn(const PictureOffset& offset) {
    learned_.push_back(offset);
    double weights = 0;
    for (const PictureOffset& one : learned_) weights += weight(one);
    // The median of normal errors scatters by a quarter more than their mean.
    const Duration sigma{std::llround(1.25 / std::sqrt(weights))};
    if (learned_.size() < least_learned || sigma > usual_sigma) return;
    usual_ = {learned_.front().from, offset.to, weighted_median(learned_), sigma};
    if (!calibrated_) return;
    const Duration off = usual_->offset - *calibrated_;
    if (absolute(off) <= least_miscalibration || std::abs(ns(off)) <= together_sigmas * ns(sigma))
        return;
    usual_->offset = *calibrated_;
    departure_ = Departure{off, sigma, usual_->from};
    learned_.clear();
}

double OffsetWatch::sigmas(const PictureOffset& offset) const {
    return ns(offset.offset - usual_->offset) * std::sqrt(weight(offset));
}

/// From one offset to the next, against their sigmas; 1 if these are honest. A drift hardly counts,
/// and neither does what chance makes of few changes.
double OffsetWatch::scatter() const {
    if (changes_.size() < most_departing) return 1;
    const std::vector<double> changes(changes_.begin(), changes_.end());
    const double chance = 1 - 1 / std::sqrt(static_cast<double>(changes.size()));
    return std::max(1.0, chance * median(changes) / median_change);
}

std::optional<Departure> OffsetWatch::departing() const {
    const double scatter = this->scatter();
    for (std::size_t count = least_departing; count <= latest_.size(); ++count) {
        const auto begin = latest_.end() - static_cast<std::ptrdiff_t>(count);
        Departure found = mean_departure(latest_, count, *usual_);
        found.sigma = {std::llround(scatter * ns(found.sigma))};
        const double sign = found.by.ns < 0 ? -1 : 1;
        const bool all = std::all_of(begin, latest_.end(), [&](const PictureOffset& one) {
            return sign * sigmas(one) > each_sigmas * scatter;
        });
        if (all && absolute(found.by) >= least_departure &&
            std::abs(ns(found.by)) > together_sigmas * ns(found.sigma))
            return found;
    }
    return std::nullopt;
}

/// The latest ones are nearer to the usual offset than to the departed one.
bool OffsetWatch::agrees_again() const {
    return latest_.size() >= least_departing &&
           std::all_of(
               latest_.end() - least_departing, latest_.end(), [&](const PictureOffset& one) {
                   return absolute(one.offset - usual_->offset) < absolute(departure_->by) / 2;
               });
}

}  // namespace versavis::client

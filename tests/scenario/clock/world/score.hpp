// SPDX-License-Identifier: BSD-3-Clause
// How an estimator does in a simulated world, by the truth.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "clock_world.hpp"
#include "engine/clock/estimate.hpp"

namespace versavis::clock_world {

/// Errors of stamps made at once, and how honest their sigma was.
class Score {
 public:
    void add(Duration error, const clock::HostEstimate& estimate) {
        const auto ns = static_cast<double>(error.ns);
        const auto sigma = static_cast<double>(std::max<std::int64_t>(estimate.sigma.ns, 1));
        errors_ns_.push_back(std::abs(ns));
        squares_ += ns * ns / (sigma * sigma);
        beyond_bound_ += absolute(error) > estimate.bound ? 1 : 0;
        sorted_ = false;
    }

    void add(const Score& other) {
        errors_ns_.insert(errors_ns_.end(), other.errors_ns_.begin(), other.errors_ns_.end());
        squares_ += other.squares_;
        beyond_bound_ += other.beyond_bound_;
        sorted_ = false;
    }

    double rms_us() const {
        double sum = 0;
        for (const double error_ns : errors_ns_) sum += error_ns * error_ns;
        return std::sqrt(sum / static_cast<double>(errors_ns_.size())) * 1e-3;
    }

    /// The error that a share of them does not exceed, in us.
    double quantile_us(double share) {
        if (errors_ns_.empty()) return 0;
        if (!sorted_) std::sort(errors_ns_.begin(), errors_ns_.end());
        sorted_ = true;
        return errors_ns_[static_cast<std::size_t>(share *
                                                   static_cast<double>(errors_ns_.size() - 1))] *
               1e-3;
    }
    double p99_us() { return quantile_us(0.99); }
    double largest_us() { return quantile_us(1); }

    /// Mean square of the error in sigmas; 1: sigma is what it says.
    double nees() const { return squares_ / static_cast<double>(errors_ns_.size()); }
    double beyond_bound() const { return beyond_bound_ / static_cast<double>(errors_ns_.size()); }

 private:
    std::vector<double> errors_ns_;
    bool sorted_ = false;
    double squares_ = 0;
    double beyond_bound_ = 0;
};

/// All that reached the host.
inline std::vector<clock::Message> messages_of(const World& world) {
    std::vector<clock::Message> messages;
    for (const Delivery& delivery : world.deliveries()) messages.push_back(delivery.message);
    return messages;
}

/// Feeds an estimator with what arrives, as time passes.
template <class Estimator>
class Observer {
 public:
    explicit Observer(const World& world) : world_(world) {}

    Estimator& at(TrueTime now) {
        const auto& deliveries = world_.deliveries();
        for (; next_ < deliveries.size() && deliveries[next_].at <= now; ++next_)
            std::visit([&](const auto& message) { estimator_.add(message); },
                       deliveries[next_].message);
        return estimator_;
    }

    clock::HostEstimate estimate(TrueTime now) { return at(now).translate(world_.board(now)); }
    Duration error(TrueTime now) { return estimate(now).time - world_.host(now); }

    /// Adds what a stamp made every `interval` would be wrong by.
    void observe(Span span, Duration interval, Score& score) {
        for (TrueTime now = span.begin; now < span.end; now = now + interval) {
            const clock::HostEstimate now_estimate = estimate(now);
            score.add(now_estimate.time - world_.host(now), now_estimate);
        }
    }

 private:
    const World& world_;
    Estimator estimator_;
    std::size_t next_ = 0;
};

/// The score of one estimator over many seeds, from `from` to the end.
template <class Estimator>
Score score(Settings settings, unsigned seeds, TrueTime from = {seconds(300).ns}) {
    Score result;
    for (settings.seed = 1; settings.seed <= seeds; ++settings.seed) {
        const World world(settings);
        Observer<Estimator> observer(world);
        observer.observe({from, {settings.length.ns}}, milliseconds(100), result);
    }
    return result;
}

}  // namespace versavis::clock_world

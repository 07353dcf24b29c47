// SPDX-License-Identifier: BSD-3-Clause
#include "clock_world.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::clock_world {

namespace {

constexpr Duration shortest_answer = microseconds(20);
constexpr std::int64_t answer_spread_ns = 200'000;
constexpr Duration host_begin = seconds(5000);

}  // namespace

World::World(const Settings& settings)
    : settings_(settings),
      random_(settings.seed),
      crystal_(settings.crystal, settings.length + seconds(100), random_),
      link_(settings.link(random_)) {
    exchange_all();
    if (settings_.imu_hz > 0) send_imu_packets();
    std::stable_sort(deliveries_.begin(), deliveries_.end(),
                     [](const Delivery& a, const Delivery& b) { return a.at < b.at; });
}

BoardTime World::board(TrueTime at) const {
    const BoardTime untouched{settings_.board_begin.ns + at.ns + crystal_.gained(at).ns};
    if (!settings_.board_reset || at < *settings_.board_reset) return untouched;
    return {untouched.ns - board(*settings_.board_reset - nanoseconds(1)).ns};
}

HostTime World::host(TrueTime at) const {
    HostTime time{host_begin.ns + at.ns};
    double rate_ppm = 0;
    TrueTime since;
    const auto slewed = [&](TrueTime until) {
        return Duration{std::llround(static_cast<double>((until - since).ns) * rate_ppm * 1e-6)};
    };
    for (const ClockChange& change : settings_.host_changes) {
        if (at < change.at) break;
        time = time + slewed(change.at) + change.by;
        rate_ppm = change.rate_ppm;
        since = change.at;
    }
    return time + slewed(at);
}

bool World::lost(TrueTime at) {
    const bool unlucky = std::uniform_real_distribution<>()(random_) < settings_.lost;
    return unlucky || settings_.silence.holds(at);
}

void World::exchange_all() {
    std::uniform_real_distribution<> dither(1e9 * (1 - settings_.dither),
                                            1e9 * (1 + settings_.dither));
    std::uniform_int_distribution<std::int64_t> answering(0, answer_spread_ns);
    const TrueTime end{settings_.length.ns};
    for (TrueTime next{1'000'000}; next < end;) {
        const TrueTime sent = next;
        const TrueTime received = sent + link_->to_board(sent, random_);
        const TrueTime answered = received + shortest_answer + Duration{answering(random_)};
        const TrueTime arrived = answered + link_->to_host(answered, random_);
        next = sent + Duration{std::llround(dither(random_) / settings_.exchange_hz)};
        if (lost(sent)) continue;
        const bool reset_between = settings_.board_reset && sent < *settings_.board_reset &&
                                   *settings_.board_reset < arrived;
        if (reset_between) continue;
        deliveries_.push_back({arrived, clock::Exchange{host(sent), board(received),
                                                        board(answered), host(arrived)}});
        next = std::max(next, arrived);  // one at a time
    }
}

void World::send_imu_packets() {
    const Duration interval{std::llround(1e9 / settings_.imu_hz)};
    TrueTime newest;
    for (TrueTime sent{1'234'567}; sent.ns < settings_.length.ns; sent = sent + interval) {
        if (lost(sent)) continue;
        newest =
            std::max(newest, sent + link_->to_host(sent, random_));  // a stream keeps its order
        deliveries_.push_back({newest, clock::OneWay{board(sent), host(newest)}});
    }
}

}  // namespace versavis::clock_world

// SPDX-License-Identifier: BSD-3-Clause
// Estimators of the board's clock against the truth of simulated clocks and links, many seeds each.
#include <chrono>
#include <cmath>

#include "engine/clock/ekf.hpp"
#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/smoother.hpp"
#include "metric.hpp"
#include "score.hpp"
#include "troubles.hpp"

namespace versavis::bench {

namespace {

using clock::EnvelopeFilter;
using clock_world::Observer;
using clock_world::Score;
using clock_world::Settings;
using clock_world::TrueTime;
using clock_world::World;
using Metrics = std::vector<Metric>;

/// The published filter as it would be with a fair start: its own values keep it outside its gate
/// for minutes.
struct FairEkf : clock::Ekf {
    FairEkf() : Ekf(clock::EkfStart::fair()) {}
};

Settings jittery(clock_world::MakeLink link) {
    Settings settings;
    settings.exchange_hz = 1;
    settings.link = std::move(link);
    return settings;
}

Settings usb(double imu_hz = 0) {
    Settings settings;
    settings.imu_hz = imu_hz;
    return settings;
}

Settings loaded_trace() {
    Settings settings;
    settings.exchange_hz = 20;
    settings.length = seconds(80);
    settings.link = [](clock_world::Random& random) {
        return clock_world::measured(VERSAVIS_TEST_DATA "/clock/pty_load_delays.csv", random);
    };
    return settings;
}

/// 0: sigma is what it says; 1: the error's mean square is half, or twice, that of sigma.
double octaves(const Score& score) { return std::abs(std::log2(score.nees())); }

void compare(Metrics& metrics, const std::string& name, const Settings& settings, double goal_us,
             unsigned seeds, TrueTime from = {seconds(300).ns}) {
    Score ours = clock_world::score<EnvelopeFilter>(settings, seeds, from);
    Score published = clock_world::score<FairEkf>(settings, std::min(seeds, 8U), from);
    metrics.push_back({"clock_" + name, ours.p99_us(), "us p99", goal_us});
    metrics.push_back(
        {"clock_" + name + "_of_published", ours.p99_us() / published.p99_us(), "times", 0.5});
    metrics.push_back({"clock_" + name + "_nees", octaves(ours), "octaves", 1});
}

void smooth(Metrics& metrics) {
    Settings settings = usb(200);
    Score score;
    for (settings.seed = 1; settings.seed <= 12; ++settings.seed) {
        const World world(settings);
        const clock::Smoother smoother(messages_of(world));
        for (TrueTime t{seconds(1).ns}; t.ns < seconds(899).ns; t = t + milliseconds(100)) {
            const clock::HostEstimate estimate = smoother.translate(world.board(t));
            score.add(estimate.time - world.host(t), estimate);
        }
    }
    metrics.push_back({"clock_smoothed", score.p99_us(), "us p99", 4.5});
    metrics.push_back({"clock_smoothed_nees", octaves(score), "octaves", 1});
}

void start(Metrics& metrics) {
    Settings settings;
    settings.length = seconds(20);
    std::vector<double> first_us;
    std::vector<double> until_tenth_s;
    for (settings.seed = 1; settings.seed <= 400; ++settings.seed) {
        const World world(settings);
        Observer<EnvelopeFilter> observer(world);
        const TrueTime first = world.deliveries().front().at;
        first_us.push_back(static_cast<double>(absolute(observer.error(first)).ns) * 1e-3);
        TrueTime worse = first;
        for (const auto& delivery : world.deliveries())
            if (absolute(observer.error(delivery.at)) >= microseconds(100)) worse = delivery.at;
        until_tenth_s.push_back(static_cast<double>((worse - first).ns) * 1e-9);
    }
    std::sort(first_us.begin(), first_us.end());
    std::sort(until_tenth_s.begin(), until_tenth_s.end());
    metrics.push_back({"clock_first_exchange", first_us[396], "us p99", 1000});
    metrics.push_back({"clock_until_0.1ms_median", until_tenth_s[200], "s", 1});
    metrics.push_back({"clock_until_0.1ms_p95", until_tenth_s[380], "s", 2});
}

void hold_over(Metrics& metrics) {
    Settings settings;
    settings.length = seconds(470);
    settings.silence = {{seconds(400).ns}, {seconds(480).ns}};
    Score after[2];
    for (settings.seed = 1; settings.seed <= 200; ++settings.seed) {
        const World world(settings);
        Observer<EnvelopeFilter> observer(world);
        for (const int minute : {0, 1}) {
            const TrueTime now = settings.silence.begin + seconds(minute == 0 ? 10 : 60);
            const clock::HostEstimate estimate = observer.estimate(now);
            after[minute].add(estimate.time - world.host(now), estimate);
        }
    }
    metrics.push_back({"clock_10s_without_contact", after[0].quantile_us(0.95), "us p95", 16});
    metrics.push_back({"clock_10s_without_contact_nees", octaves(after[0]), "octaves", 1});
    metrics.push_back({"clock_60s_without_contact", after[1].quantile_us(0.95), "us p95", 33});
    metrics.push_back({"clock_60s_without_contact_nees", octaves(after[1]), "octaves", 1});
}

void burst(Metrics& metrics, const std::string& name, double imu_hz) {
    Settings settings = usb(imu_hz);
    settings.length = seconds(440);
    settings.link = [](clock_world::Random& random) {
        return clock_world::usb_full_speed({.load = {{seconds(400).ns}, {seconds(430).ns}}},
                                           random);
    };
    Score score = clock_world::score<EnvelopeFilter>(settings, 60, {seconds(400).ns});
    metrics.push_back({name, score.largest_us(), "us max", 20});
    metrics.push_back({name + "_nees", octaves(score), "octaves", 1});
}

void lock_out(Metrics& metrics) {
    unsigned locked_out = 0;
    unsigned off = 0;
    for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
        const World world(clock_world::troubled(seed));
        Observer<EnvelopeFilter> observer(world);
        const unsigned instants = clock_world::instants_off(world, observer);
        off += instants > 0 ? 1 : 0;
        locked_out += instants == 120 ? 1 : 0;
    }
    metrics.push_back({"clock_lock_outs_of_1000", static_cast<double>(locked_out), "seeds", 0});
    metrics.push_back({"clock_still_off_of_1000", static_cast<double>(off), "seeds", 0});
}

template <class Work>
double seconds_of(const Work& work) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

void cost(Metrics& metrics) {
    const World world(usb());
    EnvelopeFilter filter;
    const double adding = seconds_of([&] {
        for (const auto& delivery : world.deliveries())
            filter.add(std::get<clock::Exchange>(delivery.message));
    });
    metrics.push_back(
        {"clock_exchange", adding * 1e6 / static_cast<double>(world.deliveries().size()), "us", 5});
    constexpr int translations = 2'000'000;
    std::int64_t sum = 0;
    const BoardTime newest = filter.last_contact();
    const double translating = seconds_of([&] {
        for (int i = 0; i < translations; ++i)
            sum += filter.translate(newest + nanoseconds(i)).sigma.ns;
    });
    if (sum == 0) throw std::runtime_error("nothing was translated");
    metrics.push_back({"clock_translation", translating * 1e9 / translations, "ns", 50});
}

}  // namespace

std::vector<Metric> bench_clock() {
    using clock_world::Random;
    Metrics metrics;
    compare(metrics, "paper_visible",
            jittery([](Random&) { return clock_world::visible_jitter(); }), 240, 48);
    compare(metrics, "paper_invisible",
            jittery([](Random&) { return clock_world::invisible_jitter(); }), 390, 48);
    compare(metrics, "usb", usb(), 16, 24);
    compare(metrics, "usb_imu", usb(200), 9, 24);
    compare(metrics, "loaded_trace", loaded_trace(), 10, 24, {seconds(20).ns});
    smooth(metrics);
    start(metrics);
    hold_over(metrics);
    burst(metrics, "clock_load_burst", 0);
    burst(metrics, "clock_load_burst_imu", 200);
    lock_out(metrics);
    cost(metrics);
    return metrics;
}

}  // namespace versavis::bench

// SPDX-License-Identifier: BSD-3-Clause
#include "timing_board.hpp"

#include <algorithm>
#include <chrono>

namespace versavis::rig {

namespace {

/// Pulses that are remembered: two seconds of the fastest.
constexpr std::size_t most_pulses = 20'000;
constexpr std::chrono::milliseconds longest_wait{500};

}  // namespace

void TimingBoard::pulse(HostTime at) {
    const std::lock_guard lock(mutex_);
    pulses_.push_back(at);
    if (pulses_.size() <= most_pulses) return;
    pulses_.pop_front();
    ++forgotten_;
}

void TimingBoard::settle(HostTime until) {
    {
        const std::lock_guard lock(mutex_);
        known_until_ = std::max(known_until_, until);
    }
    settled_.notify_all();
}

TimingBoard::Row TimingBoard::shown(std::uint64_t count) const {
    Row row{};
    row.front() = row.back() = 1;
    const std::uint64_t place = count % 4;
    row.at(scenario_.backward ? 4 - place : 1 + place) = 1;
    for (std::size_t bit = 0; bit < 4; ++bit)
        row.at(scenario_.high_bit_first ? 8 - bit : 5 + bit) =
            static_cast<double>(count / 4 >> bit & 1U);
    return row;
}

TimingBoard::Row TimingBoard::lit(HostTime start, HostTime end) {
    std::unique_lock lock(mutex_);
    settled_.wait_for(lock, longest_wait, [&] { return known_until_ >= end; });
    Row sum{};
    const auto add = [&](std::uint64_t count, Duration span) {
        const Row row = shown(count);
        for (std::size_t i = 0; i < leds; ++i)
            sum.at(i) += row.at(i) * static_cast<double>(span.ns);
    };
    auto next = std::upper_bound(pulses_.begin(), pulses_.end(), start);
    HostTime from = start;
    std::uint64_t count = forgotten_ + static_cast<std::uint64_t>(next - pulses_.begin());
    for (; next != pulses_.end() && *next < end; from = *next++) add(count++, *next - from);
    add(count, end - from);
    for (double& led : sum) led /= static_cast<double>((end - start).ns);
    return sum;
}

}  // namespace versavis::rig

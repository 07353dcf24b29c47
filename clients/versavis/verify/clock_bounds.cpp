// SPDX-License-Identifier: BSD-3-Clause
#include "verify/clock_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/median.hpp"

namespace versavis::client {

namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

/// Bounds within so much of a second apply to it. Longer: the line bends with temperature; shorter:
/// at one exchange per second few bounds are left.
constexpr Duration window = seconds(4);

/// The quickest exchanges within this make the slope, of which an error of 3 ppm is allowed: 0.1 ms
/// of jitter over 30 s.
constexpr Duration slope_window = seconds(15);
constexpr double slope_error = 3e-6;

/// Two crystals that nothing is known of.
constexpr double unknown_slope_error = 200e-6;

/// Less than this share of the exchanges in a window agreeing: they contradict each other.
constexpr double agreeing_share = 0.6;

std::int64_t floor_second(BoardTime at) {
    return at.ns >= 0 ? at.ns / second_ns : -((second_ns - 1 - at.ns) / second_ns);
}

BoardTime middle_of(std::int64_t block) { return {block * second_ns + second_ns / 2}; }

Duration scaled(Duration span, double factor) {
    return {static_cast<std::int64_t>(std::llround(static_cast<double>(span.ns) * factor))};
}

/// Of those that contain it.
struct Overlap {
    Duration lowest;
    Duration highest;
    std::size_t count = 0;
};

/// Where most of the intervals overlap.
Overlap largest_overlap(const std::vector<std::pair<Duration, Duration>>& intervals) {
    std::vector<std::pair<std::int64_t, int>> ends;
    for (const auto& [low, high] : intervals) {
        ends.emplace_back(low.ns, -1);  // sorted before an end at the same place
        ends.emplace_back(high.ns, 1);
    }
    std::sort(ends.begin(), ends.end());
    Overlap best;
    std::size_t open = 0;
    for (std::size_t i = 0; i < ends.size(); ++i) {
        if (ends[i].second == 1) {
            --open;
            continue;
        }
        if (++open <= best.count) continue;
        best = {{ends[i].first}, {ends[i + 1].first}, open};
    }
    return best;
}

}  // namespace

Duration ClockBounds::Interval::outside(HostTime at) const {
    if (at < earliest) return at - earliest;
    return at > latest ? at - latest : Duration{};
}

ClockBounds::ClockBounds(std::vector<ClockExchange> exchanges, std::vector<ClockMessage> messages)
    : exchanges_(std::move(exchanges)),
      messages_(std::move(messages)),
      exchange_count_(exchanges_.size()) {
    std::erase_if(exchanges_, [](const ClockExchange& each) {
        return each.arrived < each.sent || each.answered < each.received;
    });
    if (exchanges_.empty()) return;
    begin_ = exchanges_.front().sent;
    end_ = exchanges_.front().arrived;
    for (const ClockExchange& each : exchanges_) {
        begin_ = std::min(begin_, each.sent);
        end_ = std::max(end_, each.arrived);
    }
    const auto by_board = [](const auto& a, const auto& b) { return a.received < b.received; };
    std::sort(exchanges_.begin(), exchanges_.end(), by_board);
    std::sort(messages_.begin(), messages_.end(),
              [](const auto& a, const auto& b) { return a.departed < b.departed; });

    std::vector<Bound> quickest;  // of each second
    for (const ClockExchange& each : exchanges_) {
        const Bound bound{each.received, each.sent - HostTime{each.received.ns},
                          each.arrived - HostTime{each.answered.ns}};
        const bool same =
            !quickest.empty() && floor_second(quickest.back().at) == floor_second(bound.at);
        if (!same)
            quickest.push_back(bound);
        else if (bound.highest - bound.lowest < quickest.back().highest - quickest.back().lowest)
            quickest.back() = bound;
    }
    const std::int64_t reach = window.ns / second_ns;
    for (const Bound& bound : quickest) {
        const std::int64_t second = floor_second(bound.at);
        for (std::int64_t number = second - reach; number <= second + reach; ++number)
            if (blocks_.find(number) == blocks_.end()) make_block(number, quickest);
    }
    for (const ClockExchange& each : exchanges_) {
        const auto interval = at(each.received);
        if (interval && (each.sent > interval->latest ||
                         each.arrived < interval->earliest + (each.answered - each.received)))
            ++refused_;
    }
}

/// The median of all slopes between two points that lie apart (Theil-Sen).
double ClockBounds::slope_around(BoardTime at, const std::vector<Bound>& quickest,
                                 double& error) const {
    constexpr Duration least_apart = seconds(3);
    const auto first =
        std::lower_bound(quickest.begin(), quickest.end(), at - slope_window,
                         [](const Bound& bound, BoardTime from) { return bound.at < from; });
    std::vector<double> slopes;
    for (auto a = first; a != quickest.end() && a->at <= at + slope_window; ++a)
        for (auto b = a + 1; b != quickest.end() && b->at <= at + slope_window; ++b) {
            if (b->at - a->at < least_apart) continue;
            const Duration risen = (b->lowest + b->highest) / 2 - (a->lowest + a->highest) / 2;
            slopes.push_back(static_cast<double>(risen.ns) /
                             static_cast<double>((b->at - a->at).ns));
        }
    error = slopes.size() < 3 ? unknown_slope_error : slope_error;
    if (slopes.size() < 3) return 0;
    return median(std::move(slopes));
}

void ClockBounds::make_block(std::int64_t number, const std::vector<Bound>& quickest) {
    const BoardTime centre = middle_of(number);
    double error = 0;
    Block made;
    made.slope = slope_around(centre, quickest, error);
    const Duration reach = window + Duration{second_ns / 2};
    const auto moved = [&](Duration bound, BoardTime at, double sign) {
        const Duration apart = at - centre;
        return bound - scaled(apart, made.slope) + scaled(absolute(apart), sign * error);
    };
    std::vector<std::pair<Duration, Duration>> intervals;
    auto exchange = std::lower_bound(
        exchanges_.begin(), exchanges_.end(), centre - reach,
        [](const ClockExchange& each, BoardTime from) { return each.received < from; });
    for (; exchange != exchanges_.end() && exchange->received <= centre + reach; ++exchange)
        intervals.emplace_back(
            moved(exchange->sent - HostTime{exchange->received.ns}, exchange->received, -1),
            moved(exchange->arrived - HostTime{exchange->answered.ns}, exchange->answered, 1));
    std::erase_if(intervals, [](const auto& each) { return each.second < each.first; });
    const Overlap overlap = largest_overlap(intervals);
    made.lowest = overlap.lowest;
    made.highest = overlap.highest;
    made.agree = overlap.count > 0 && static_cast<double>(overlap.count) >=
                                          agreeing_share * static_cast<double>(intervals.size());
    // Messages narrow it where they agree with the exchanges; one that does not is no witness.
    auto message = std::lower_bound(
        messages_.begin(), messages_.end(), centre - reach,
        [](const ClockMessage& each, BoardTime from) { return each.departed < from; });
    for (; message != messages_.end() && message->departed <= centre + reach; ++message) {
        const Duration bound =
            moved(message->arrived - HostTime{message->departed.ns}, message->departed, 1);
        if (bound >= made.lowest) made.highest = std::min(made.highest, bound);
    }
    blocks_.emplace(number, made);
}

const ClockBounds::Block* ClockBounds::block(BoardTime at) const {
    const auto found = blocks_.find(floor_second(at));
    return found == blocks_.end() ? nullptr : &found->second;
}

std::optional<ClockBounds::Interval> ClockBounds::at(BoardTime board) const {
    const Block* found = block(board);
    if (found == nullptr || !found->agree) return std::nullopt;
    const HostTime on_line =
        HostTime{board.ns} + scaled(board - middle_of(floor_second(board)), found->slope);
    return Interval{on_line + found->lowest, on_line + found->highest};
}

bool ClockBounds::contradictory(BoardTime board) const {
    const Block* found = block(board);
    return found != nullptr && !found->agree;
}

Duration ClockBounds::usual_width() const {
    std::vector<Duration> widths;
    for (const auto& [number, each] : blocks_)
        if (each.agree) widths.push_back(each.highest - each.lowest);
    if (widths.empty()) return {};
    return median(std::move(widths));
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "process/stamp_choice.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::client {

namespace {

// Between a stamp and a known sigma of the clock. Half: gaps between frames leave it unknown.
// Twice: a sigma from before the loss of contact counts for longer.
constexpr Duration same_sigma = seconds(2);

// Sigma must become smaller than this share of what it was. Half: much of what could be improved
// is left. Above one, stamps would become worse.
constexpr double better = 0.9;

// Deviations of both estimates together by which they may differ. Half: one of seven good stamps
// disagrees. Twice: a wrong estimate replaces a right one.
constexpr double agreeing = 3;

// Around stamps of another clock, and around those that disagree. Half: where the two differ by
// little for a while, some are replaced. Twice: short recordings are left as they are.
constexpr Duration around_other_clock = seconds(30);
constexpr Duration around_disagreement = seconds(20);

// Stamps in a row that are another clock's, or disagree. One: those next to a step of the output
// clock pass for PPS, and one of 400 good stamps leaves its surroundings as they were. Twice: short
// stretches are not seen where both differ by little.
constexpr int no_accident = 3;

/// What lies behind stamps of a kind, within a time.
class Shadow {
 public:
    Shadow(Choice of, Duration length) : of_(of), length_(length) {}

    bool falls_on(const DatedChoice& one) {
        in_row_ = one.choice == of_ ? in_row_ + 1 : 0;
        if (in_row_ >= no_accident) newest_ = one.at, seen_ = true;
        return seen_ && absolute(one.at - newest_) < length_;
    }

 private:
    Choice of_;
    Duration length_;
    int in_row_ = 0;
    bool seen_ = false;
    HostTime newest_;
};

template <class Iterator>
void spread_onwards(Iterator begin, Iterator end) {
    Shadow other_clock(Choice::other_clock, around_other_clock);
    Shadow disagreement(Choice::disagrees, around_disagreement);
    for (; begin != end; ++begin) {
        const bool by_other_clock = other_clock.falls_on(*begin);
        const bool disagrees = disagreement.falls_on(*begin);
        if (begin->choice != Choice::improved) continue;
        if (by_other_clock)
            begin->choice = Choice::other_clock;
        else if (disagrees)
            begin->choice = Choice::disagrees;
    }
}

}  // namespace

void LiveSigmas::sort() {
    std::stable_sort(known_.begin(), known_.end(),
                     [](const Known& a, const Known& b) { return a.at < b.at; });
}

std::optional<Duration> LiveSigmas::at(HostTime at) const {
    const auto after =
        std::lower_bound(known_.begin(), known_.end(), at,
                         [](const Known& known, HostTime time) { return known.at < time; });
    std::optional<Duration> found;
    const auto take = [&](const Known& known) {
        if (absolute(known.at - at) < same_sigma)
            found = found ? std::min(*found, known.sigma) : known.sigma;
    };
    if (after != known_.end()) take(*after);
    if (after != known_.begin()) take(*(after - 1));
    return found;
}

std::optional<Duration> LiveSigmas::least() const {
    const auto least =
        std::min_element(known_.begin(), known_.end(),
                         [](const auto& a, const auto& b) { return a.sigma < b.sigma; });
    return least == known_.end() ? std::nullopt : std::optional(least->sigma);
}

bool by_other_clock(const LiveStamp& live, const Restamping& restamping) {
    const auto by_link = restamping.output(live.host);
    return !live.held && by_link &&
           absolute(live.time - *by_link) > restamping.reading_error(live.host);
}

Choice choose(const LiveStamp& live, const std::optional<Restamping::Stamp>& stamp,
              const Restamping& restamping) {
    if (!stamp) return Choice::no_estimate;
    if (by_other_clock(live, restamping)) return Choice::other_clock;
    const auto by_link = restamping.output(live.host);
    const Duration error = restamping.reading_error(live.host);
    if (!by_link || absolute((stamp->output - *by_link) - (stamp->host - live.host)) > error)
        return Choice::no_estimate;  // the output clock was stepped in between
    const auto is = static_cast<double>(stamp->sigma.ns);
    const auto moved = static_cast<double>(absolute(stamp->host - live.host).ns);
    if (moved > agreeing * std::hypot(static_cast<double>(live.most_sigma.ns), is))
        return Choice::disagrees;
    return is < better * static_cast<double>(live.least_sigma.ns) ? Choice::improved
                                                                  : Choice::no_better;
}

void spread(std::vector<DatedChoice>& choices) {
    std::vector<DatedChoice> backward(choices.rbegin(), choices.rend());
    spread_onwards(choices.begin(), choices.end());
    spread_onwards(backward.begin(), backward.end());
    for (std::size_t i = 0; i < choices.size(); ++i)
        if (choices[i].choice == Choice::improved)
            choices[i].choice = backward[choices.size() - 1 - i].choice;
}

}  // namespace versavis::client

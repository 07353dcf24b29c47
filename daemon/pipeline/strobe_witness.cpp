// SPDX-License-Identifier: BSD-3-Clause
#include "strobe_witness.hpp"

#include <algorithm>

#include "engine/rounding.hpp"

namespace versavis::daemon {

void StrobeWitness::take(const clock::HostEstimate& start, Starts& own, Starts& others,
                         bool by_board) {
    const auto apart = [&](const clock::HostEstimate& other) {
        return absolute(other.time - start.time);
    };
    const auto nearest =
        std::min_element(others.begin(), others.end(),
                         [&](const auto& a, const auto& b) { return apart(a) < apart(b); });
    if (nearest == others.end() || apart(*nearest) >= period_ / 2) {
        own.push_back(start);
        if (own.size() > most_kept) own.pop_front();
        return;
    }
    const Duration line = rounded(clock::bound_sigmas * static_cast<double>(line_sigma_.ns));
    const bool contradicts = apart(*nearest) > start.bound + nearest->bound + line;
    const Duration later = start.time - nearest->time;
    report_.error = by_board ? -later : later;
    ++report_.compared;
    compared_ = start.time;
    if (contradicts) ++report_.contradicting;
    in_a_row_ = contradicts ? in_a_row_ + 1 : 0;
    others.erase(others.begin(), nearest + 1);
}

}  // namespace versavis::daemon

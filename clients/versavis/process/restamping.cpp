// SPDX-License-Identifier: BSD-3-Clause
#include "process/restamping.hpp"

#include "base/plausible_time.hpp"

namespace versavis::client {

Restamping::Restamping(const RecordedClocks& clocks, Duration asymmetry)
    : outputs_(clocks.outputs), asymmetry_(asymmetry) {
    for (const BoardLife& life : clocks.lives) {
        if (life.exchanges < 2) continue;
        std::vector<clock::Message> messages;
        messages.reserve(life.stamps.messages.size());
        for (const TimedMessage& message : life.stamps.messages)
            messages.push_back(message.message);
        smoothers_.emplace_back(messages);
    }
}

std::optional<Restamping::Stamp> Restamping::stamp(BoardTime board, HostTime about) const {
    if (!is_plausible(board.ns) || !is_plausible(about.ns)) return std::nullopt;
    for (const clock::Smoother& smoother : smoothers_) {
        const clock::HostEstimate estimate = smoother.translate(board);
        if (estimate.state != clock::ClockState::locked) continue;
        const HostTime host = estimate.time - asymmetry_;
        if (absolute(host - about) > same_life) continue;
        const auto shown = output(host);
        if (!shown) return std::nullopt;
        return Stamp{host, *shown, estimate.sigma};
    }
    return std::nullopt;
}

std::optional<OutputTime> Restamping::output(HostTime host) const {
    const auto difference = output_minus_host(outputs_, host);
    if (!difference) return std::nullopt;
    return OutputTime{(host + *difference).ns};
}

}  // namespace versavis::client

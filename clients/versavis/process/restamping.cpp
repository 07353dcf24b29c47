// SPDX-License-Identifier: BSD-3-Clause
#include "process/restamping.hpp"

#include <algorithm>

#include "base/plausible_time.hpp"

namespace versavis::client {

namespace {

// Beyond the uncertainty of both readings: what the output clock, slewed, is off from the line
// between two of them. Half: a slewed clock passes for another one. Twice: so do stamps of PPS,
// which are off from the link's by less for longer.
constexpr Duration off_the_line = nanoseconds(500);

}  // namespace

Restamping::Restamping(const RecordedClocks& clocks,
                       const std::optional<clock::Asymmetry>& asymmetry)
    : outputs_(clocks.outputs) {
    for (const BoardLife& life : clocks.lives) {
        if (life.exchanges < 2) continue;
        std::vector<clock::Message> messages;
        messages.reserve(life.stamps.messages.size());
        clock::EnvelopeFilter filter;
        filter.set_asymmetry(asymmetry);
        for (const TimedMessage& message : life.stamps.messages) {
            messages.push_back(message.message);
            std::visit([&](const auto& one) { filter.add(one); }, message.message);
            if (filter.confirmed() && std::holds_alternative<clock::Exchange>(message.message))
                live_sigmas_.push_back(
                    {message.available, filter.translate(filter.last_contact()).sigma});
        }
        smoothers_.emplace_back(messages, asymmetry);
    }
    std::stable_sort(live_sigmas_.begin(), live_sigmas_.end(),
                     [](const auto& a, const auto& b) { return a.at < b.at; });
    const auto least =
        std::min_element(live_sigmas_.begin(), live_sigmas_.end(),
                         [](const auto& a, const auto& b) { return a.sigma < b.sigma; });
    if (least != live_sigmas_.end()) least_live_sigma_ = least->sigma;
}

std::optional<Restamping::Replayed> Restamping::live_sigma(HostTime host) const {
    const auto after =
        std::upper_bound(live_sigmas_.begin(), live_sigmas_.end(), host,
                         [](HostTime at, const DatedSigma& sigma) { return at < sigma.at; });
    if (after == live_sigmas_.begin()) return std::nullopt;
    return Replayed{(after - 1)->sigma, least_live_sigma_};
}

std::optional<Restamping::Stamp> Restamping::stamp(BoardTime board, HostTime about) const {
    if (!is_plausible(board.ns) || !is_plausible(about.ns)) return std::nullopt;
    for (const clock::Smoother& smoother : smoothers_) {
        const clock::HostEstimate estimate = smoother.translate(board);
        if (estimate.state != clock::ClockState::locked) continue;
        const HostTime host = estimate.time;
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

std::optional<std::uint32_t> Restamping::epoch(HostTime host) const {
    const auto after = std::upper_bound(
        outputs_.begin(), outputs_.end(), host,
        [](HostTime at, const clock::RecordedOutput& output) { return at < output.host; });
    if (after == outputs_.begin()) return std::nullopt;
    return (after - 1)->epoch;
}

Duration Restamping::reading_error(HostTime host) const {
    const auto after = std::upper_bound(
        outputs_.begin(), outputs_.end(), host,
        [](HostTime at, const clock::RecordedOutput& output) { return at < output.host; });
    Duration widest;
    if (after != outputs_.end()) widest = after->uncertainty;
    if (after != outputs_.begin()) widest = std::max(widest, (after - 1)->uncertainty);
    return off_the_line + widest * 2;
}

}  // namespace versavis::client

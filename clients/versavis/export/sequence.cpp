// SPDX-License-Identifier: BSD-3-Clause
#include "export/sequence.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/median.hpp"

namespace versavis::client {

namespace {

/// An IMU that is read more often than it measures repeats samples, which leaves up to 20 ms
/// between those that are exported: twice that. Half: such an IMU has holes. Twice: a turn of 100
/// degrees a second is integrated over 8 degrees in one step.
constexpr Duration shortest_hole = milliseconds(40);

/// Slow IMUs: a few samples that are lost are bridged, as the tools do.
constexpr std::int64_t periods_of_hole = 5;

/// Shorter sequences are of no use to odometry, which needs as long to begin.
constexpr Duration shortest_sequence = seconds(1);

Duration hole_of(const std::vector<TimedSample>& samples) {
    std::vector<std::int64_t> periods;
    for (std::size_t i = 1; i < samples.size(); ++i)
        if (samples[i].continuity == samples[i - 1].continuity)
            periods.push_back((samples[i].time - samples[i - 1].time).ns);
    return std::max(shortest_hole,
                    Duration{periods.empty() ? 0 : median(periods)} * periods_of_hole);
}

std::string cause_of(const TimedSample& before, const TimedSample& after) {
    if (before.continuity.life != after.continuity.life) return "the service was restarted";
    if (before.continuity.epoch != after.continuity.epoch)
        return fmt::format("epoch {} follows epoch {}: the clock or the pairing was restarted",
                           after.continuity.epoch, before.continuity.epoch);
    return fmt::format("the IMU has a hole of {:.3f} s",
                       static_cast<double>((after.time - before.time).ns) * 1e-9);
}

std::vector<SequenceBounds> runs_of(const std::vector<TimedSample>& samples) {
    std::vector<SequenceBounds> runs;
    const Duration hole = hole_of(samples);
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const TimedSample& sample = samples[i];
        const bool follows = i > 0 && sample.continuity == samples[i - 1].continuity &&
                             sample.time - samples[i - 1].time < hole;
        if (!follows)
            runs.push_back({sample.continuity, sample.time, sample.time, false,
                            i == 0 ? "" : cause_of(samples[i - 1], sample)});
        runs.back().last = sample.time;
    }
    return runs;
}

/// What both have, each part with the cause of the one that begins later.
std::vector<SequenceBounds> common(const std::vector<SequenceBounds>& some,
                                   const std::vector<SequenceBounds>& others) {
    std::vector<SequenceBounds> parts;
    for (const SequenceBounds& one : some)
        for (const SequenceBounds& other : others) {
            if (!one.fits(other.continuity)) continue;
            SequenceBounds part = one.first < other.first ? other : one;
            part.last = std::min(one.last, other.last);
            if (part.first < part.last) parts.push_back(std::move(part));
        }
    return parts;
}

/// Without an IMU: wherever frames can be compared.
std::vector<SequenceBounds> continuities(const std::vector<TimedSample>& frames) {
    std::vector<SequenceBounds> found;
    for (const TimedSample& frame : frames) {
        const bool known = std::any_of(found.begin(), found.end(), [&](const SequenceBounds& one) {
            return one.fits(frame.continuity);
        });
        if (known) continue;
        SequenceBounds one;
        one.continuity = frame.continuity;
        if (!found.empty())
            one.cause = cause_of({{}, found.back().continuity}, {{}, frame.continuity});
        found.push_back(one);
    }
    return found;
}

void drop_brief(std::vector<SequenceBounds>& sequences) {
    const auto brief = [](const SequenceBounds& one) { return one.length() < shortest_sequence; };
    if (std::all_of(sequences.begin(), sequences.end(), brief)) return;
    sequences.erase(std::remove_if(sequences.begin(), sequences.end(), brief), sequences.end());
}

}  // namespace

Duration SequenceBounds::length() const {
    return first == earliest || last == latest ? Duration{std::numeric_limits<std::int64_t>::max()}
                                               : last - first;
}

std::vector<SequenceBounds> find_sequences(const std::vector<std::vector<TimedSample>>& imus,
                                           const std::vector<TimedSample>& frames, bool join) {
    std::vector<SequenceBounds> sequences;
    SequenceBounds all;
    all.joined = true;
    bool first = true;
    for (const auto& samples : imus) {
        if (samples.empty()) continue;  // it had failed: images are as good as without it
        all.first = std::max(all.first, samples.front().time);
        all.last = std::min(all.last, samples.back().time);
        sequences = first ? runs_of(samples) : common(sequences, runs_of(samples));
        first = false;
    }
    if (join) return {all};
    if (first) sequences = continuities(frames);
    drop_brief(sequences);
    return sequences;
}

}  // namespace versavis::client

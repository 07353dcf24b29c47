// SPDX-License-Identifier: BSD-3-Clause
#include "export/frame_set_table.hpp"

#include <algorithm>
#include <map>
#include <tuple>

namespace versavis::client {

namespace {

using Key = std::tuple<Continuity, std::uint64_t>;

std::optional<Key> key_of(const TableFrame& frame) {
    if (!frame.tick) return std::nullopt;
    return Key{frame.continuity, *frame.tick};
}

using Index = std::map<Key, std::size_t>;

/// Of two frames with one key the first counts.
Index index_of(const std::vector<TableFrame>& frames) {
    Index index;
    for (std::size_t i = 0; i < frames.size(); ++i)
        if (const auto key = key_of(frames[i]); key && frames[i].left_out == SkipReason::no)
            index.emplace(*key, i);
    return index;
}

/// Empty: one is missing.
std::vector<std::size_t> partners(const std::vector<Index>& others, const TableFrame& frame) {
    std::vector<std::size_t> found;
    const auto key = key_of(frame);
    for (const Index& index : others) {
        const auto partner = key ? index.find(*key) : index.end();
        if (partner == index.end()) return {};
        found.push_back(partner->second);
    }
    return found;
}

}  // namespace

const char* to_string(SkipReason reason) {
    switch (reason) {
        case SkipReason::no: return "exported";
        case SkipReason::suspect: return "suspect";
        case SkipReason::arrival: return "arrival_only";
        case SkipReason::edge: return "trigger_edge";
        case SkipReason::holdover: return "holdover";
        case SkipReason::sigma: return "sigma";
        case SkipReason::incomplete: return "incomplete_set";
        case SkipReason::outside_imu: return "outside_imu";
        case SkipReason::not_later: return "not_later";
        case SkipReason::repeated: return "repeated";
        case SkipReason::no_pixels: return "no_pixels";
        case SkipReason::another_size: return "another_size";
        case SkipReason::brief: return "brief_sequence";
    }
    return "unknown";
}

bool FrameSetTable::inside(const FrameSet& set, const SequenceBounds& sequence) const {
    for (std::size_t camera = 0; camera < frames_.size(); ++camera) {
        const TableFrame& frame = frames_[camera][set.frames[camera]];
        if (!sequence.has(frame.continuity, frame.time)) return false;
    }
    return true;
}

void FrameSetTable::mark(const FrameSet& set, SkipReason reason) {
    for (std::size_t camera = 0; camera < frames_.size(); ++camera)
        frames_[camera][set.frames[camera]].left_out = reason;
}

std::vector<FrameSet> FrameSetTable::pair(const std::vector<SequenceBounds>& sequences) {
    std::vector<FrameSet> sets;
    std::vector<OutputTime> newest(sequences.size(), SequenceBounds::earliest);
    if (frames_.empty()) return sets;
    std::vector<Index> others;
    for (std::size_t camera = 1; camera < frames_.size(); ++camera)
        others.push_back(index_of(frames_[camera]));
    std::vector<std::vector<bool>> paired;
    for (const auto& frames : frames_) paired.emplace_back(frames.size(), false);
    for (std::size_t i = 0; i < frames_[0].size(); ++i) {
        const TableFrame& first = frames_[0][i];
        if (first.left_out != SkipReason::no) continue;
        FrameSet set{first.time, partners(others, first), 0};
        if (set.frames.size() != others.size()) continue;
        set.frames.insert(set.frames.begin(), i);
        // A second frame of the first camera with the same tick finds its partners taken.
        if (frames_.size() > 1 && paired[1][set.frames[1]]) continue;
        for (std::size_t camera = 0; camera < frames_.size(); ++camera)
            paired[camera][set.frames[camera]] = true;
        const auto sequence =
            std::find_if(sequences.begin(), sequences.end(),
                         [&](const SequenceBounds& one) { return inside(set, one); });
        set.sequence = static_cast<std::size_t>(sequence - sequences.begin());
        if (sequence == sequences.end()) {
            mark(set, SkipReason::outside_imu);
        } else if (set.name <= newest[set.sequence]) {
            mark(set, SkipReason::not_later);
        } else {
            newest[set.sequence] = set.name;
            sets.push_back(std::move(set));
        }
    }
    for (std::size_t camera = 0; camera < frames_.size(); ++camera)
        for (std::size_t i = 0; i < frames_[camera].size(); ++i)
            if (frames_[camera][i].left_out == SkipReason::no && !paired[camera][i])
                frames_[camera][i].left_out = SkipReason::incomplete;
    return sets;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "output_queue.hpp"

namespace versavis::firmware {

OutputQueue::OutputQueue(OutputSchedule& hardware, OutputMoves& moves, const PortFacts& facts)
    : hardware_(hardware), moves_(moves), grain_(facts.output_grain()), step_(facts.output_step) {}

Nanoseconds OutputQueue::set(Nanoseconds at, unsigned output, bool level, Nanoseconds hold) {
    const auto on_grain = [this](Nanoseconds time) { return (time + grain_ / 2) & ~(grain_ - 1); };
    at = on_grain(at);
    if (at < committed_until_ + step_) at = committed_until_ + step_;
    if (!has_room(output, 1)) return at;
    ++counts_[output];
    // What is put off by it stays on the grain.
    insert({at, at, static_cast<std::uint32_t>(on_grain(hold)), static_cast<std::uint8_t>(output),
            level});
    if (size_ > high_water_) high_water_ = size_;
    return at;
}

/// Behind those of the same instant: edges of one output stay in the order of their calls.
void OutputQueue::insert(const PendingEdge& edge) {
    std::size_t i = size_++;
    for (; i > 0 && edges_[i - 1].at > edge.at; --i) edges_[i] = edges_[i - 1];
    edges_[i] = edge;
}

void OutputQueue::remove_first(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) --counts_[edges_[i].output];
    size_ -= count;
    for (std::size_t i = 0; i < size_; ++i) edges_[i] = edges_[i + count];
}

/// True: the edge must not leave at `at` yet, since the one before it left late. It was put off,
/// with those behind it.
bool OutputQueue::held_back(const PendingEdge& edge, Nanoseconds at) {
    const std::uint8_t output = edge.output;
    if (changed_[output] + edge.hold <= at) return false;
    Nanoseconds before = changed_[output];
    for (std::size_t i = 0; i < size_; ++i) {
        PendingEdge& later = edges_[i];
        if (later.output != output) continue;
        if (later.at < before + later.hold) later.at = before + later.hold;
        before = later.at;
    }
    // Those of one output are in order among themselves; a stable sort keeps that.
    const std::size_t count = size_;
    for (size_ = 0; size_ < count;) insert(PendingEdge(edges_[size_]));
    return true;
}

/// False: the hardware's queue is full.
bool OutputQueue::push_word() {
    const Nanoseconds soonest = committed_until_ + step_;
    const Nanoseconds at = edges_[0].at > soonest ? edges_[0].at : soonest;
    std::uint32_t levels = levels_;
    std::uint32_t changed = 0;
    std::size_t end = 0;
    for (; end < size_ && edges_[end].at <= at; ++end) {
        const PendingEdge& edge = edges_[end];
        if (held_back(edge, at)) return true;
        const std::uint32_t bit = 1U << edge.output;
        // An edge that would undo another of the same word leaves with the next one.
        if ((changed & bit) != 0 && edge.hold > 0) break;
        changed |= bit;
        levels = edge.level ? levels | bit : levels & ~bit;
    }
    const Nanoseconds left = hardware_.push(at, levels);
    if (left == never) return false;
    for (std::size_t i = 0; i < end; ++i) {
        const PendingEdge& edge = edges_[i];
        changed_[edge.output] = left;
        if (left != edge.asked) moves_.moved(edge.output, edge.level, edge.asked, left);
    }
    levels_ = levels;
    committed_until_ = left;
    remove_first(end);
    return true;
}

bool OutputQueue::commit(Nanoseconds now) {
    for (unsigned words = 0; words < words_a_commit; ++words) {
        if (size_ == 0 || edges_[0].at > now + horizon) break;
        if (!push_word()) return false;
    }
    return true;
}

bool OutputQueue::cancel(unsigned output) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i)
        if (edges_[i].output != output) edges_[kept++] = edges_[i];
    size_ = kept;
    counts_[output] = 0;
    return (levels_ >> output & 1U) != 0;
}

}  // namespace versavis::firmware

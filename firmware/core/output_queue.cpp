// SPDX-License-Identifier: BSD-3-Clause
#include "output_queue.hpp"

namespace versavis::firmware {

Nanoseconds OutputQueue::set(Nanoseconds at, unsigned output, bool level, Nanoseconds hold) {
    if (at <= committed_until_) at = committed_until_ + 1;
    if (size_ == capacity) return at;
    insert({at, at, hold, static_cast<std::uint8_t>(output), level});
    if (size_ > high_water_) high_water_ = size_;
    return at;
}

void OutputQueue::insert(const PendingEdge& edge) {
    std::size_t i = size_++;
    for (; i > 0 && edges_[i - 1].at > edge.at; --i) edges_[i] = edges_[i - 1];
    edges_[i] = edge;
}

void OutputQueue::remove_first(std::size_t count) {
    for (std::size_t i = count; i < size_; ++i) edges_[i - count] = edges_[i];
    size_ -= count;
}

/// True: the first edge cannot leave on time and was postponed, with those of its output behind
/// it.
bool OutputQueue::postpone_first(Nanoseconds now) {
    const std::uint8_t output = edges_[0].output;
    const auto earliest = [&](const PendingEdge& edge, Nanoseconds before) {
        const Nanoseconds held = edge.hold > 0 ? before + edge.hold : before;
        const Nanoseconds at = edge.at > now ? edge.at : now;
        return at > held ? at : held;
    };
    if (earliest(edges_[0], changed_[output]) == edges_[0].at) return false;
    PendingEdge moved[capacity];
    std::size_t count = 0;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i)
        (edges_[i].output == output ? moved[count++] : edges_[kept++]) = edges_[i];
    size_ = kept;
    Nanoseconds before = changed_[output];
    for (std::size_t i = 0; i < count; ++i) {
        before = moved[i].at = earliest(moved[i], before);
        insert(moved[i]);
    }
    return true;
}

bool OutputQueue::commit(Nanoseconds now) {
    while (size_ > 0 && edges_[0].at <= now + horizon) {
        if (postpone_first(now)) continue;
        // An edge that would undo another of the same word is postponed to the next word.
        const Nanoseconds at = edges_[0].at;
        std::uint32_t levels = levels_;
        std::uint32_t changed = 0;
        std::size_t end = 0;
        for (; end < size_ && edges_[end].at == at; ++end) {
            const std::uint32_t bit = 1U << edges_[end].output;
            if ((changed & bit) != 0 && edges_[end].hold > 0) break;
            changed |= bit;
            levels = edges_[end].level ? levels | bit : levels & ~bit;
        }
        if (!hardware_.push(at, levels)) return false;  // tried again at the next poll
        for (std::size_t i = 0; i < end; ++i) {
            changed_[edges_[i].output] = at;
            if (at > edges_[i].asked && late_count_ < late_capacity)
                late_[late_count_++] = {edges_[i].asked, at};
        }
        levels_ = levels;
        committed_until_ = at;
        remove_first(end);
    }
    return true;
}

bool OutputQueue::take_late(OutputSchedule::Late& late) {
    if (late_count_ == 0) return hardware_.take_late(late);
    late = late_[--late_count_];
    return true;
}

bool OutputQueue::cancel(unsigned output) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i)
        if (edges_[i].output != output) edges_[kept++] = edges_[i];
    size_ = kept;
    return (levels_ >> output & 1U) != 0;
}

}  // namespace versavis::firmware

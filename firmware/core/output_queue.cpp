// SPDX-License-Identifier: BSD-3-Clause
#include "output_queue.hpp"

namespace versavis::firmware {

Nanoseconds OutputQueue::set(Nanoseconds at, unsigned output, bool level) {
    if (at <= committed_until_) at = committed_until_ + 1;
    if (size_ == capacity) return at;
    std::size_t i = size_++;
    for (; i > 0 && edges_[i - 1].at > at; --i) edges_[i] = edges_[i - 1];
    edges_[i] = {at, static_cast<std::uint8_t>(output), level};
    if (size_ > high_water_) high_water_ = size_;
    return at;
}

bool OutputQueue::commit(Nanoseconds now) {
    std::size_t taken = 0;
    bool accepted = true;
    while (taken < size_ && edges_[taken].at < now + horizon) {
        const Nanoseconds at = edges_[taken].at;
        std::uint32_t levels = levels_;
        std::size_t end = taken;
        for (; end < size_ && edges_[end].at == at; ++end) {
            const std::uint32_t bit = 1U << edges_[end].output;
            levels = edges_[end].level ? levels | bit : levels & ~bit;
        }
        accepted = hardware_.push(at, levels);
        if (!accepted) break;  // it is tried again at the next poll
        levels_ = levels;
        committed_until_ = at;
        taken = end;
    }
    for (std::size_t i = taken; i < size_; ++i) edges_[i - taken] = edges_[i];
    size_ -= taken;
    return accepted;
}

bool OutputQueue::cancel(unsigned output) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i)
        if (edges_[i].output != output) edges_[kept++] = edges_[i];
    size_ = kept;
    return (levels_ >> output & 1U) != 0;
}

}  // namespace versavis::firmware

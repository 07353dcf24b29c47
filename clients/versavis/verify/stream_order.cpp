// SPDX-License-Identifier: BSD-3-Clause
#include "verify/stream_order.hpp"

#include <algorithm>

namespace versavis::client {

namespace {

constexpr Duration far = seconds(5);
constexpr int many = 3;

}  // namespace

StreamOrder::StreamOrder(const std::vector<RecordedGap>& gaps, HostTime begin,
                         const std::map<std::int64_t, Duration>* messages)
    : gaps_(gaps), begin_(begin), messages_(messages) {}

std::int64_t StreamOrder::second(HostTime host) {
    const bool is_far = last_host_ && absolute(host - *last_host_) > far;
    far_off_ = is_far ? far_off_ + 1 : 0;
    if (!is_far || far_off_ > many) last_host_ = host;
    const Duration since = *last_host_ - begin_;
    return std::max<std::int64_t>(0, since.ns / seconds(1).ns);
}

/// The recorder noted a gap behind the item of this time.
bool StreamOrder::noted(OutputTime before) const {
    return std::any_of(gaps_.begin(), gaps_.end(),
                       [&](const RecordedGap& gap) { return gap.time == before; });
}

void StreamOrder::judge(const StampedItem& item, std::uint32_t epoch, VerdictBuilder& verdict) {
    if (last_ && last_->life == item.life) {
        if (item.number <= last_->number)
            verdict.add(Finding::repeated);
        else if (item.number > last_->number + 1 && !noted(last_->time))
            verdict.add(Finding::missing);
        if (epoch == last_epoch_ && item.time < last_->time)
            verdict.add(Finding::backwards, item.time - last_->time);
    }
    if (messages_ != nullptr)
        if (const auto off = messages_->find(item.time.ns); off != messages_->end())
            verdict.add(Finding::message_stamp, off->second);
    last_ = item;
    last_epoch_ = epoch;
}

}  // namespace versavis::client

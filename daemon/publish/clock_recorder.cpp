// SPDX-License-Identifier: BSD-3-Clause
#include "clock_recorder.hpp"

#include "versavis/metadata.hpp"

namespace versavis::daemon {

namespace {

/// Between readings of the output clock in the recording.
constexpr Duration output_interval = seconds(1);

}  // namespace

void ClockRecorder::board_restarted(std::uint32_t nonce) {
    const std::lock_guard lock(mutex_);
    nonce_ = nonce;
    publish(clock::RecordedRestart{nonce});
}

void ClockRecorder::exchange(std::uint32_t request, const clock::Exchange& exchange) {
    const std::lock_guard lock(mutex_);
    publish(clock::RecordedExchange{nonce_, request, 0, exchange.sent, exchange.received,
                                    exchange.answered, exchange.arrived},
            exchange.arrived);
}

void ClockRecorder::one_way(const clock::OneWay& message) {
    const std::lock_guard lock(mutex_);
    publish(clock::RecordedMessage{nonce_, message.sent, message.arrived}, message.arrived);
}

void ClockRecorder::tick(HostTime now) {
    const std::lock_guard lock(mutex_);
    ring_.heartbeat(now);
    const clock::OutputRelation relation = translator_.output_now();
    if (relation.epoch != epoch_ || relation.host >= next_output_) record_output(relation);
}

/// `recorded_at`: none for now. A step of the output clock precedes the first item that is stamped
/// by it.
void ClockRecorder::publish(const clock::ClockItem& item, std::optional<HostTime> recorded_at) {
    const clock::OutputRelation relation = translator_.output_now();
    if (relation.epoch != epoch_) record_output(relation);
    const HostTime at = recorded_at.value_or(relation.host);
    ring_.publish({at.ns + relation.minus_host.ns}, pack(clock::to_metadata(item)));
}

void ClockRecorder::record_output(const clock::OutputRelation& relation) {
    epoch_ = relation.epoch;
    next_output_ = relation.host + output_interval;
    const clock::RecordedOutput output{relation.epoch, relation.host, relation.minus_host,
                                       relation.uncertainty};
    ring_.publish({relation.host.ns + relation.minus_host.ns}, pack(clock::to_metadata(output)));
}

std::uint64_t ClockRecorder::items() {
    const std::lock_guard lock(mutex_);
    return ring_.head();
}

}  // namespace versavis::daemon

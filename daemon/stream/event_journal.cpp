// SPDX-License-Identifier: BSD-3-Clause
#include "stream/event_journal.hpp"

namespace versavis::daemon {

void EventJournal::add(const Happening& happening) {
    std::optional<clock::Stamp> stamp;
    if (happening.board_time) stamp = translator_.translate(*happening.board_time);
    // The clock is not known yet: the moment of its report is all there is.
    if (!stamp) stamp = translator_.translate(host_now(), microseconds(100));
    EventMetadata metadata{};
    metadata.kind = happening.kind;
    metadata.source = happening.source;
    metadata.reason = happening.reason;
    metadata.value = happening.value;
    metadata.board_time = happening.board_time.value_or(BoardTime{});
    metadata.host_time = stamp->host;
    metadata.sigma_ns = stamp->sigma_ns;
    metadata.epoch = stamp->epoch;
    happening.source_name.copy(metadata.source_name, sizeof metadata.source_name - 1);
    const std::lock_guard lock(mutex_);
    ring_.publish(stamp->output, pack(metadata));
}

void EventJournal::heartbeat(HostTime now) {
    const std::lock_guard lock(mutex_);
    ring_.heartbeat(now);
}

std::uint64_t EventJournal::items() {
    const std::lock_guard lock(mutex_);
    return ring_.head();
}

}  // namespace versavis::daemon

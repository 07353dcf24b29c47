// SPDX-License-Identifier: BSD-3-Clause
#include "event_journal.hpp"

namespace versavis::daemon {

void EventJournal::add(const JournalEntry& entry) {
    std::optional<clock::Stamp> stamp;
    if (entry.board_time && !entry.suspect) stamp = translator_.translate(*entry.board_time);
    // The clock is not known, or the time is doubted: the moment of its report is all there is.
    if (!stamp) stamp = translator_.translate(host_now(), microseconds(100));
    EventMetadata metadata{};
    metadata.kind = entry.kind;
    metadata.source = entry.source;
    metadata.reason = entry.reason;
    metadata.value = entry.value;
    metadata.expected = entry.expected;
    metadata.count = entry.count;
    metadata.board_time = entry.board_time.value_or(BoardTime{});
    metadata.host_time = stamp->host;
    metadata.sigma_ns = entry.suspect ? sigma_unknown : stamp->sigma_ns;
    if (entry.suspect) metadata.flags |= flag_suspect;
    if (stamp->second_doubted) metadata.flags |= flag_second_doubted;
    metadata.epoch = stamp->epoch;
    entry.source_name.copy(metadata.source_name, sizeof metadata.source_name - 1);
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

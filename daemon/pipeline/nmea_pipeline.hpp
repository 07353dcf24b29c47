// SPDX-License-Identifier: BSD-3-Clause
// The sentences of the GNSS receiver at the board, stamped, in a ring.
#pragma once

#include <mutex>
#include <optional>
#include <string_view>

#include "engine/clock/translator.hpp"
#include "engine/ring/writer.hpp"
#include "publish/stamp_guard.hpp"
#include "settings/configuration.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

struct NmeaReport {
    std::uint64_t sentences = 0;  ///< published
    std::uint64_t damaged = 0;    ///< of those: the checksum is wrong, or there is none
    std::uint64_t suspect = 0;  ///< of those: stamped by its arrival, as the board's time cannot be
                                ///< or is not known yet
    std::uint64_t lost = 0;     ///< on the way from the board
};

/// The end of a sentence is the checksum of what lies before it.
bool has_right_checksum(std::string_view sentence);

/// Thread-safe: the link's thread adds, the main thread does the rest.
class NmeaPipeline {
 public:
    explicit NmeaPipeline(clock::Translator& translator) : translator_(translator) {}

    /// Makes the ring, unless there is one; sentences that come before are dropped. `baud`: of the
    /// receiver, by which the board's stamps of bytes are uncertain.
    Expected<> configure(const ring::Place& place, std::uint32_t baud);

    void board_restarted();
    void add(const wire::Sentence& sentence, HostTime received);
    void heartbeat(HostTime now);

    /// None: it was not configured.
    std::optional<NmeaReport> report() const;

 private:
    clock::Translator& translator_;
    mutable std::mutex mutex_;
    std::optional<ring::Writer> ring_;
    Duration sigma_;  ///< of the board's stamps
    std::optional<std::uint32_t> last_sequence_;
    StampGuard guard_;
    NmeaReport report_;
};

}  // namespace versavis::daemon

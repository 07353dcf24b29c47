// SPDX-License-Identifier: BSD-3-Clause
// The sentences of the GNSS receiver at the board, stamped, in a ring.
#pragma once

#include <mutex>
#include <optional>
#include <string_view>

#include "engine/clock/translator.hpp"
#include "engine/ring/writer.hpp"
#include "publish/stamp_guard.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

inline constexpr const char* nmea_stream = "nmea0";

struct NmeaReport {
    std::uint64_t sentences = 0;  ///< published
    std::uint64_t damaged = 0;    ///< of those: the checksum is wrong, or there is none
    std::uint64_t suspect = 0;  ///< of those: stamped by its arrival, as the board's time cannot be
                                ///< or is not known yet
    std::uint64_t lost = 0;     ///< on the way from the board
};

/// The end of a sentence is the checksum of what lies before it.
bool has_right_checksum(std::string_view sentence);

/// Thread-safe: the link's thread adds, the main thread reports.
class NmeaPipeline {
 public:
    static Expected<ring::Writer> make_ring(const ring::Place& place);

    /// `baud`: of the receiver, by which the board's stamps of bytes are uncertain.
    NmeaPipeline(std::uint32_t baud, ring::Writer ring, clock::Translator& translator);

    void board_restarted();
    void add(const wire::Sentence& sentence, HostTime received);
    void heartbeat(HostTime now);
    NmeaReport report() const;

 private:
    const Duration sigma_;
    mutable std::mutex mutex_;
    ring::Writer ring_;
    clock::Translator& translator_;
    std::optional<std::uint32_t> last_sequence_;
    StampGuard guard_;
    NmeaReport report_;
};

}  // namespace versavis::daemon

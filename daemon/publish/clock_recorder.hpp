// SPDX-License-Identifier: BSD-3-Clause
// The ring of all stamps that clocks are compared by, so that any recording can be processed again.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>

#include "engine/clock/messages.hpp"
#include "engine/clock/recording.hpp"
#include "engine/clock/translator.hpp"
#include "engine/ring/writer.hpp"

namespace versavis::daemon {

/// Thread-safe.
class ClockRecorder {
 public:
    ClockRecorder(ring::Writer ring, clock::Translator& translator)
        : ring_(std::move(ring)), translator_(translator) {}

    /// The board began a life of this nonce: what follows is of it.
    void board_restarted(std::uint32_t nonce);

    void exchange(std::uint32_t request, const clock::Exchange& exchange);

    /// A message of the board that was not asked for.
    void one_way(const clock::OneWay& message);

    /// Once a second the output clock is recorded, and heartbeats more often; call it every 50 ms
    /// or so.
    void tick(HostTime now);

    std::uint64_t items();

 private:
    void publish(const clock::ClockItem& item, std::optional<HostTime> recorded_at = {});
    void record_output(const clock::OutputRelation& relation);

    std::mutex mutex_;
    ring::Writer ring_;
    clock::Translator& translator_;
    std::uint32_t nonce_ = 0;
    std::optional<std::uint32_t> epoch_;  ///< of the last record of the output clock
    HostTime next_output_;
};

}  // namespace versavis::daemon

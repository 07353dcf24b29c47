// SPDX-License-Identifier: BSD-3-Clause
// All stamps that clocks were compared by, as items of a ring: so that any estimate can be made
// again, elsewhere.
#pragma once

#include <cstdint>
#include <variant>

#include "versavis/error.hpp"
#include "versavis/ring_layout.hpp"
#include "versavis/stream.hpp"
#include "versavis/time.hpp"

namespace versavis::clock {

/// A request and its answer: host -> board -> host.
struct RecordedExchange {
    std::uint32_t nonce =
        0;  ///< drawn by the board at each boot: board times of equal nonce compare
    std::uint32_t request = 0;
    std::uint32_t flags = 0;
    HostTime sent;
    BoardTime received;
    BoardTime answered;
    HostTime arrived;
};

/// A message of the board that was not asked for.
struct RecordedMessage {
    std::uint32_t nonce = 0;
    BoardTime departed;
    HostTime arrived;
};

/// The board's clock starts over.
struct RecordedRestart {
    std::uint32_t nonce = 0;
};

/// The output clock against the host clock.
struct RecordedOutput {
    std::uint32_t epoch = 0;
    HostTime host;
    Duration minus_host;
    Duration uncertainty;
};

/// One item of the ring `clock`.
using ClockItem = std::variant<RecordedExchange, RecordedMessage, RecordedRestart, RecordedOutput>;

/// The 96 bytes of an item of kind `clock` (docs/contracts/shm-layout.md).
struct ClockMetadata {
    std::uint32_t kind;   ///< 1 + index in ClockItem
    std::uint32_t whose;  ///< the board's nonce; of kind 4, the epoch
    std::uint64_t words[11];
};
static_assert(sizeof(ClockMetadata) == ring::metadata_size, "96 bytes of inline metadata");

using StampItem = Typed<ClockMetadata>;
using ClockStream = Stream<StampItem, ring::StreamKind::clock>;

ClockMetadata to_metadata(const ClockItem& item);

/// Errors: a kind that this version does not know.
Expected<ClockItem> from_metadata(const ClockMetadata& metadata);

}  // namespace versavis::clock

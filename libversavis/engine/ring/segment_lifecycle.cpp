// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/segment_lifecycle.hpp"

#include <climits>

#include "client/futex.hpp"

namespace versavis::ring {

namespace {

void set_state(Header& header, WriterState state) {
    // SYNC 6: release here, acquire in writer_lives(): the last item precedes the new state.
    header.state.store(static_cast<std::uint32_t>(state), std::memory_order_release);
}

}  // namespace

void supersede(Header& header) { set_state(header, WriterState::superseded); }

void reinstate(Header& header) { set_state(header, WriterState::live); }

void wake_readers(Header& header) {
    // SYNC 5: release here, acquire in Reader::next(): a reader that wakes up sees the new state.
    header.wake.fetch_add(1, std::memory_order_release);
    futex_wake(header.wake, INT_MAX);
}

void end(Header& header) {
    set_state(header, WriterState::closed);
    wake_readers(header);
}

}  // namespace versavis::ring

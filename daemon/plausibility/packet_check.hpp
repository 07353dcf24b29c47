// SPDX-License-Identifier: BSD-3-Clause
// Whether what a packet says can be at all: its number, and its times.
#pragma once

#include <cstdint>
#include <optional>

#include "wire/messages.hpp"

namespace versavis::daemon {

/// What the numbers of packets show, of one life of the board.
class SequenceWatch {
 public:
    /// The next packet follows this one, whatever its number.
    void begin(std::uint32_t sequence) { next_ = sequence + 1; }

    /// One more packet. False: its number does not follow. It is no loss then, but an error. The
    /// packet counts as the one that was due, until the next goes on from it.
    bool add(std::uint32_t sequence);

    std::uint64_t lost() const { return lost_; }  ///< packets, since this was made

 private:
    std::uint32_t next_ = 0;
    /// The number that would confirm the last one that was wrong.
    std::optional<std::uint32_t> after_error_;
    std::uint64_t lost_ = 0;
};

/// Times of the board lie between its boot and a bound far beyond the life of any, so that no
/// arithmetic with them overflows; a label of a pulse names a second that int64 can hold in ns.
/// What else a message says must agree within it.
bool possible(const wire::BoardHello& message);
bool possible(const wire::Exposure& message);
bool possible(const wire::ImuSample& message);
bool possible(const wire::Event& message);
bool possible(const wire::Sentence& message);
bool possible(const wire::Health& message);
bool possible(const wire::ClockAnswer& message);
bool possible(const wire::ClockFollowUp& message);

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
// Waiting for several streams at once, in one sleep, or by one file descriptor.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>

#include "ring_reader.hpp"
#include "versavis/error.hpp"
#include "versavis/export.hpp"
#include "versavis/time.hpp"

namespace versavis {

/// Not thread-safe. Readers that were added must stay where they are as long as it lives.
class VERSAVIS_API WaitSet {
 public:
    WaitSet();
    WaitSet(WaitSet&&) noexcept;
    WaitSet& operator=(WaitSet&&) noexcept;
    ~WaitSet();

    /// Errors: 127 readers are in it already.
    Expected<> add(ring::Reader& reader);

    /// Sleeps until next() of one of the readers has something to return: an item, or another
    /// reason than Pause::nothing. Returns its number, in the order of add(); none: nothing within
    /// `timeout`. Readers take turns, so that a fast stream does not keep a slow one waiting.
    std::optional<std::size_t> wait(Duration timeout);

    /// For poll and epoll: readable when wait() may find something, until it finds nothing. With
    /// `deadline`, also from that time on. Errors: no descriptor or thread available.
    Expected<int> fd();

    /// The descriptor becomes readable then at the latest; none: only when something happens.
    void set_deadline(std::optional<HostTime> deadline);

 private:
    struct State;
    std::optional<std::size_t> ready();
    void arm();

    std::unique_ptr<State> state_;
};

}  // namespace versavis

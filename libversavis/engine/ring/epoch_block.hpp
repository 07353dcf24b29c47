// SPDX-License-Identifier: BSD-3-Clause
// Numbers of epochs that no earlier run of the service has used: blocks of them are reserved in a
// file that outlives it.
#pragma once

#include <cstdint>

namespace versavis::ring {

/// Numbers reserved at once. If lower, a service that begins 256 epochs between two calls of
/// keep(), and is killed then, may see its last ones used again; if higher, numbers grow faster.
constexpr std::uint32_t epochs_reserved = 1024;

class EpochBlock {
 public:
    /// `file`: open for reading and writing, as long as this lives. What is not four bytes is no
    /// number: then it begins at 0.
    explicit EpochBlock(int file);

    /// The first number that this run may use.
    std::uint32_t first() const { return first_; }

    /// `epoch` is in use: the next block is reserved in time. A write of four bytes at most.
    void keep(std::uint32_t epoch);

 private:
    void reserve_until(std::uint32_t end);

    int file_;
    std::uint32_t first_{};
    std::uint32_t end_{};
};

}  // namespace versavis::ring

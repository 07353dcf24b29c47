// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/epoch_block.hpp"

#include <unistd.h>

namespace versavis::ring {

EpochBlock::EpochBlock(int file) : file_(file) {
    if (::pread(file, &first_, sizeof first_, 0) != sizeof first_) first_ = 0;
    reserve_until(first_ + epochs_reserved);
}

void EpochBlock::keep(std::uint32_t epoch) {
    // Numbers wrap: what counts is how far they are apart.
    if (end_ - epoch < epochs_reserved / 2) reserve_until(end_ + epochs_reserved);
}

void EpochBlock::reserve_until(std::uint32_t end) {
    if (::pwrite(file_, &end, sizeof end, 0) == sizeof end) end_ = end;
}

}  // namespace versavis::ring

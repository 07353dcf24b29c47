// SPDX-License-Identifier: BSD-3-Clause
// Camera frame numbers without wraps.
#pragma once

#include <cstdint>

namespace versavis::pairing {

/// GigE Vision block ids of 16 bits run from 65535 to 1, leaving out 0; longer ones do not wrap,
/// and a camera that once sent one has no others.
class BlockIdUnwrapper {
 public:
    std::uint64_t unwrap(std::uint64_t id) {
        constexpr std::uint64_t cycle = 0xFFFF;
        wide_ = wide_ || id > cycle;
        if (wide_) return id;
        const std::uint64_t laps = last_ / cycle * cycle;
        std::uint64_t unwrapped = laps + id;
        if (unwrapped + cycle / 2 < last_) unwrapped += cycle;
        if (unwrapped > last_ + cycle / 2 && unwrapped >= cycle && last_ != 0) unwrapped -= cycle;
        if (unwrapped > last_) last_ = unwrapped;
        return unwrapped;
    }

 private:
    bool wide_ = false;
    std::uint64_t last_ = 0;
};

}  // namespace versavis::pairing

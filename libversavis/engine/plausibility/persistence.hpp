// SPDX-License-Identifier: BSD-3-Clause
// Where no witness says which of two is right, the one that lasts is.
#pragma once

#include <algorithm>
#include <cstdint>

namespace versavis {

/// Two minutes of ten exchanges a second: what contradicts for longer is believed, however long the
/// other was.
constexpr std::uint64_t most_to_prevail = 1200;

/// 70 s of ten exchanges a second, for a stream that the time of its arrival contradicts, too: a
/// minute of false times is not believed, however short the time before it was. If higher, a stream
/// whose first messages were false, or late as on a host that boots, is withheld for longer.
constexpr std::uint64_t least_to_prevail = 700;

/// What contradicts prevails when it has lasted for twice as long as what it contradicts. Some
/// agree by chance while others contradict, so one that agrees only takes back a few. Not
/// thread-safe.
class Persistence {
 public:
    void agree() {
        ++agreed_;
        contradicted_ -= std::min(contradicted_, taken_back);
    }

    /// True: this one prevails. `least`: contradictions that it takes in any case.
    bool contradict(std::uint64_t least) {
        return ++contradicted_ >= std::clamp(2 * agreed_, least, most_to_prevail);
    }

    void forget() { agreed_ = contradicted_ = 0; }

 private:
    static constexpr std::uint64_t taken_back = 8;

    std::uint64_t agreed_ = 0;
    std::uint64_t contradicted_ = 0;  ///< less those taken back
};

}  // namespace versavis

// SPDX-License-Identifier: BSD-3-Clause
// The last exposures of one camera, found by number or by time.
#pragma once

#include <cstdint>
#include <deque>

#include "engine/pairing/evidence.hpp"

namespace versavis::pairing {

/// A share of a gap between exposures, as all tolerances are stated.
inline std::int64_t part_of(std::int64_t ns, double share) {
    return static_cast<std::int64_t>(share * static_cast<double>(ns));
}

struct Record {
    Exposure exposure;
    BoardTime end;               ///< of the exposure, as likely as can be said when nobody saw it
    HostTime end_on_host;        ///< the same
    bool used = false;           ///< a frame of it was published
    std::uint64_t recorded = 0;  ///< records until this one, itself included
    std::uint64_t silent = 0;    ///< those of them without an exposure

    bool prompt =
        true;  ///< reached the host as soon as others did, or was held up with one that did

    std::int64_t instant_ns(Instant instant) const;
};

class ExposureLog {
 public:
    explicit ExposureLog(Duration period) : period_(period), smallest_gap_(period) {}

    /// Comes after the one before in number and in start.
    void add(const Exposure& exposure, bool prompt = true);

    bool empty() const { return records_.empty(); }
    std::size_t size() const { return records_.size(); }
    const Record& operator[](std::size_t i) const { return records_[i]; }
    const Record& front() const { return records_.front(); }
    const Record& back() const { return records_.back(); }
    Record pop_front();

    const Record* find(std::uint64_t trigger) const;
    Record* find(std::uint64_t trigger);

    /// The exposure closest to `instant_ns`, if it is within the tolerance; else null.
    const Record* near(Instant instant, std::int64_t instant_ns, std::int64_t tolerance_ns) const;

    /// True when an exposure whose record never came may lie about there. `before_first`: the
    /// newest trigger that is known from before the log begins.
    bool lost_near(Instant instant, std::int64_t instant_ns, std::uint64_t before_first) const;

    /// False: no exposure line shows which triggers the camera took.
    bool takes_seen() const;

    /// Smallest distance of neighbouring exposures, at most the period. Always above zero.
    std::int64_t smallest_gap_ns() const { return smallest_gap_.ns; }

 private:
    void measure();
    void explain_late_ones();

    Duration period_;
    Duration smallest_gap_;
    Duration longest_;      ///< of the exposures here
    Duration last_length_;  ///< of the newest that was measured
    std::deque<Record> records_;
    std::uint64_t recorded_ = 0;
    std::uint64_t silent_ = 0;
};

}  // namespace versavis::pairing

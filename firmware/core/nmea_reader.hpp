// SPDX-License-Identifier: BSD-3-Clause
// NMEA 0183 sentences of a GNSS receiver: which second its time pulse marked.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/hal.hpp"

namespace versavis::firmware {

/// Seconds since 1970 of an RMC or ZDA sentence of any talker, "$GPRMC,..*hh" without the end of
/// the line. False: not such a sentence, damaged, marked invalid (status V), not at a whole second,
/// or at a leap second.
bool nmea_utc(const char* sentence, std::size_t size, std::int64_t& utc_s);

/// A pulse and the second it marks.
struct UtcLabel {
    Nanoseconds pulse;
    std::int64_t utc_s;
};

/// A sentence labels the last pulse before the sentence began, if that is less than 0.9 s old.
class NmeaReader {
 public:
    void begin(std::uint32_t baud);

    void pulse(Nanoseconds at) {
        before_ = newest_;
        newest_ = at;
    }

    /// A byte whose end arrived at `at`. True: `label` is that of a pulse; each is given once.
    bool take(std::uint8_t byte, Nanoseconds at, UtcLabel& label);

    Nanoseconds byte_duration() const { return byte_duration_; }

 private:
    static constexpr Nanoseconds long_ago = INT64_MIN / 2;
    static constexpr std::size_t longest =
        100;  // by the standard 82, which not every receiver keeps

    bool finish(UtcLabel& label);

    std::size_t size_ = 0;
    Nanoseconds began_ = 0;
    Nanoseconds byte_duration_ = 0;
    Nanoseconds newest_ = long_ago;
    Nanoseconds before_ = long_ago;  ///< the bytes of a sentence may be read after the next pulse
    UtcLabel reported_{};
    char line_[longest];
};

}  // namespace versavis::firmware

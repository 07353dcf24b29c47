// SPDX-License-Identifier: BSD-3-Clause
// NMEA 0183 sentences of a GNSS receiver, and which second its time pulse marked.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/hal.hpp"
#include "wire/messages.hpp"

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

/// Finds lines of printable ASCII from '$' or '!' on among other bytes, as a receiver's binary
/// messages. A sentence labels the last pulse before the sentence began, if that is less than 0.9 s
/// old.
class NmeaReader {
 public:
    void begin(std::uint32_t baud);

    void pulse(Nanoseconds at) {
        before_ = newest_;
        newest_ = at;
    }

    /// A byte whose end arrived at `at`. True: it completes a line, which is there until the next
    /// byte.
    bool take(std::uint8_t byte, Nanoseconds at);

    void copy_to(wire::Sentence& line) const;

    /// Of the line; false: it labels no pulse, or as was said before.
    bool label(UtcLabel& label);

    Nanoseconds byte_duration() const { return byte_duration_; }

 private:
    static constexpr Nanoseconds long_ago = INT64_MIN / 2;

    std::size_t size_ = 0;  ///< 0: between two lines
    bool complete_ = false;
    std::uint32_t lines_ = 0;
    Nanoseconds began_ = 0;
    Nanoseconds byte_duration_ = 0;
    Nanoseconds newest_ = long_ago;
    Nanoseconds before_ = long_ago;  ///< the bytes of a sentence may be read after the next pulse
    UtcLabel reported_{};
    char line_[wire::max_sentence_text];
};

}  // namespace versavis::firmware

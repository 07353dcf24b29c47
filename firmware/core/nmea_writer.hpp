// SPDX-License-Identifier: BSD-3-Clause
// NMEA 0183 sentences that name a second of UTC, as GNSS receivers send them after a time pulse.
#pragma once

#include <cstddef>
#include <cstdint>

#include "wire/messages.hpp"

namespace versavis::firmware {

/// The end of the line included; by the standard.
inline constexpr std::size_t longest_sentence = 82;

/// Writes `sentence` of `talker` for the second `utc_s` since 1970, which lies in 2000 to 2099;
/// null: the time is not known, and the sentence says so. The position is 0, which is not known.
/// Returns its size.
std::size_t write_sentence(wire::TimeSentence sentence, const char (&talker)[2],
                           const std::int64_t* utc_s, char (&line)[longest_sentence]);

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// Limits of a configuration: the board refuses what is beyond them, and the host, whose file has
// other units, refuses it before.
#pragma once

#include <cstdint>

namespace versavis::wire::limits {

inline constexpr std::uint32_t slowest_camera_uhz = 100'000;
inline constexpr std::uint32_t fastest_camera_uhz = 1'000'000'000;
inline constexpr std::int64_t shortest_pulse_ns = 1'000;
inline constexpr std::int64_t longest_pulse_ns = 10'000'000;
inline constexpr std::int64_t longest_latency_ns = 100'000'000;
inline constexpr std::int64_t longest_exposure_ns = 10'000'000'000;
/// Of what the wire has in 32 bits, such as phase and gap.
inline constexpr std::int64_t longest_short_ns = 4'000'000'000;
inline constexpr std::int64_t shortest_max_exposure_ns = 1'000;

inline constexpr std::uint32_t slowest_imu_millihertz = 1'000;
/// A reading without the part's own signal is set up half a millisecond ahead.
inline constexpr std::uint32_t fastest_imu_without_data_ready_millihertz = 1'000'000;

inline constexpr std::uint32_t longest_lead_ns = 1'000'000;
inline constexpr std::uint32_t shortest_light_ns = 10'000;  ///< beside its lead
inline constexpr std::uint32_t longest_light_ns = 1'000'000'000;

inline constexpr std::uint32_t slowest_test_millihertz = 100;
inline constexpr std::uint32_t fastest_test_millihertz = 10'000'000;
inline constexpr std::uint32_t slowest_sync_uhz = 100'000;
inline constexpr std::uint32_t fastest_sync_uhz = 10'000'000;
/// Of two boards' crystals. If lower, bad ones are never followed; if higher, false pulses pass
/// more easily.
inline constexpr std::int64_t largest_sync_pace_ppm = 500;
/// By which the grid goes to a sender that restarted. If higher, cameras in a chain could not
/// follow it.
inline constexpr std::int64_t sync_slew_ppm = 1'000;
inline constexpr std::uint32_t slowest_nmea_baud = 1'200;
inline constexpr std::uint32_t fastest_nmea_baud = 921'600;

inline constexpr std::int64_t time_reach_ns = 10'000'000'000;
/// What the two digits of a sentence's year can say: 2000 to 2099.
inline constexpr std::int64_t first_utc_s = 946'684'800;
inline constexpr std::int64_t last_utc_s = 4'102'444'799;
inline constexpr std::int32_t longest_time_delay_ns = 100'000'000;
inline constexpr std::uint32_t shortest_time_pulse_ns = 1'000'000;
inline constexpr std::uint32_t longest_time_pulse_ns = 500'000'000;
inline constexpr std::uint32_t longest_holdover_s = 3'600;
/// After the pulse, by when the last sentence has ended: receivers take what comes later for that
/// of the next pulse.
inline constexpr std::uint32_t last_sentence_ms = 900;
inline constexpr std::uint32_t slowest_time_baud = 4'800;
inline constexpr std::uint32_t fastest_time_baud = 115'200;

/// So many sentences of the greatest length that NMEA 0183 allows take at most so long.
constexpr std::uint32_t sentences_last_ms(std::uint32_t count, std::uint32_t baud) {
    constexpr std::uint32_t characters = 82;
    constexpr std::uint32_t bits_a_character = 10;
    return count * characters * bits_a_character * 1000 / baud + 1;
}

}  // namespace versavis::wire::limits

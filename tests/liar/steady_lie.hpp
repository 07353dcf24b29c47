// SPDX-License-Identifier: BSD-3-Clause
// Lies that go on for a time and agree with themselves: offsets and drifts of one stream of the
// board's messages, of several, or of all.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "foreign_packet.hpp"
#include "versavis/time.hpp"

namespace versavis::liar {

/// Streams of messages, as a mask.
namespace streams {
inline constexpr unsigned cam0 = 1;
inline constexpr unsigned cam1 = 2;
inline constexpr unsigned cam2 = 4;
inline constexpr unsigned cam3 = 8;
inline constexpr unsigned cameras = 15;
inline constexpr unsigned imu = 16;
inline constexpr unsigned exchanges = 32;
inline constexpr unsigned other = 64;  ///< events, health, hello
inline constexpr unsigned all = 127;
}  // namespace streams

/// What of a message is false.
enum class Part {
    instants,   ///< all of its instants
    start,      ///< of the exposure
    end,        ///< the same
    edges,      ///< both
    trigger,    ///< the number; the amount is no time
    age,        ///< of the IMU's sample
    departure,  ///< instant and age of the IMU's sample, so that the two contradict nothing
    label,      ///< UTC that a receiver gives a pulse, seconds
};

enum class Setting {
    running,     ///< it begins when all is well
    from_start,  ///< the service hears it from the first message on
    nmea,        ///< the service stamps by PPS, and a receiver names its seconds
    nmea_from_start,
};

inline bool from_start(Setting setting) {
    return setting == Setting::from_start || setting == Setting::nmea_from_start;
}

inline bool by_nmea(Setting setting) {
    return setting == Setting::nmea || setting == Setting::nmea_from_start;
}

struct SteadyLie {
    std::string name;
    unsigned streams = 0;
    Part part = Part::instants;
    std::int64_t amount = 0;      ///< added to each field, ns
    std::int64_t periods = 0;     ///< and so many periods of the triggers
    std::int64_t per_second = 0;  ///< and so many ns for each second since it began
    unsigned every = 1;           ///< only each n-th message of a stream
    Duration lasts{};
    Setting setting = Setting::running;
    bool gate = true;      ///< false: the service is known to fail
    bool lengthy = false;  ///< a minute or more
    bool brief = false;    ///< part of a brief run, for a second
};

const std::vector<SteadyLie>& steady_lies();

/// All of the board's messages agree: its clock has stepped, and nobody lies.
bool steps_clock(const SteadyLie& lie);

class SteadyLiar {
 public:
    SteadyLiar(const SteadyLie& lie, Duration period) : lie_(&lie), period_(period) {}

    /// True: the packet is false now.
    bool alter(Packet& packet, HostTime now);

    const SteadyLie& lie() const { return *lie_; }

 private:
    std::int64_t amount(HostTime now);

    const SteadyLie* lie_;
    Duration period_;
    std::optional<HostTime> begin_;
    std::map<std::pair<Type, std::int64_t>, unsigned> seen_;
    std::map<std::uint32_t, std::int64_t> answers_;  ///< lie of each whose follow-up may come
};

/// Adds to those fields that were observed. False: none was.
bool shift_fields(const std::vector<Field>& fields, std::int64_t by, Packet& packet);

}  // namespace versavis::liar

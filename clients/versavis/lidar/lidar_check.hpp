// SPDX-License-Identifier: BSD-3-Clause
// Whether a LiDAR follows the host's time, from its own packets.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "lidar/lidar_packet.hpp"

namespace versavis::client {

enum class LidarVerdict {
    follows,
    unlocked,  ///< it says that it does not
    unset,     ///< its time counts since its start
    off,       ///< its time is another
    drifts,    ///< its time runs at another pace
    unproved,  ///< too few packets, or none with a time
};
const char* to_string(LidarVerdict verdict);

struct LidarReport {
    std::string source;  ///< address
    std::string maker;
    LidarVerdict verdict = LidarVerdict::unproved;
    std::string hint{};    ///< why, and what to do
    std::string remark{};  ///< of its packets on their source of time
    std::uint64_t packets = 0;
    Duration duration{};  ///< from the first packet to the last
    /// Arrival less the LiDAR's time, the smallest; its clock is ahead of the host's by no more
    /// than `ahead`, and behind by no more than `behind`, if the way takes at most `longest_way`.
    std::optional<Duration> delay{};
    Duration ahead{};
    Duration behind{};
    double drift_ppm = 0;  ///< of the LiDAR's clock against the host's
    double drift_sigma_ppm = 0;
};

/// From the last measurement in a packet to its arrival, where nothing waits. If lower, LiDARs that
/// work on their data seem late; if higher, less is known of their clocks.
inline constexpr Duration longest_way = milliseconds(5);

/// One that was seen for less is not judged.
inline constexpr Duration shortest_record = seconds(1);

/// Takes the packets of all LiDARs in the order of their arrival. The delay of a packet is the way
/// and what it waited, which is never negative: the smallest ones show the clock (minimum filter,
/// as in NTP's clock filter).
class LidarCheck {
 public:
    void add(const Datagram& datagram);

    /// By address.
    std::vector<LidarReport> reports() const;

 private:
    struct Lidar {
        std::string maker;
        std::uint64_t packets = 0;
        OutputTime first;
        OutputTime last;
        LidarLock lock = LidarLock::unknown;  ///< of the newest packet that says it
        std::uint64_t unlocked = 0;           ///< packets that say that it is not
        std::string remark;
        bool since_start = false;
        Duration covers;
        std::map<std::int64_t, Duration> smallest;  ///< delay, by tenths of a second of arrival
    };

    static LidarReport judge(const std::string& source, const Lidar& lidar);

    std::map<std::string, Lidar> lidars_;
};

std::string lidar_text(const std::vector<LidarReport>& reports);
nlohmann::json lidar_json(const std::vector<LidarReport>& reports);

}  // namespace versavis::client

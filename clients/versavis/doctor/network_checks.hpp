// SPDX-License-Identifier: BSD-3-Clause
// The links of GigE Vision cameras: size of packets, losses, receive buffers, and how the
// interface takes packets in.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "doctor/finding.hpp"
#include "doctor/subject.hpp"

namespace versavis::client {

/// Packets lost on their way into the host, since it booted.
struct LossCounters {
    std::map<std::string, std::int64_t> interfaces;  ///< of those that have cameras
    std::int64_t receive_buffers = 0;                ///< of UDP: nobody read in time
};

LossCounters read_losses(const Subject& subject);

/// What a driver says by its ioctl; none: it does not say.
struct InterfaceSettings {
    std::optional<std::uint32_t> moderation_us{};  ///< between interrupts for packets received
    std::optional<bool> adaptive_moderation{};
    std::optional<std::uint32_t> ring{};  ///< packets that it may receive ahead
    std::optional<std::uint32_t> longest_ring{};
    /// What merges packets, as ethtool names it, and whether it is on.
    std::map<std::string, bool> merging{};
};

InterfaceSettings read_interface_settings(const std::string& interface);

/// `before` and `after`: read so far apart that a loss that goes on shows.
Findings check_network(const Subject& subject, const LossCounters& before,
                       const LossCounters& after);

/// One link's, by what its driver said; `losses`: it loses packets now.
Findings check_interface_settings(const std::string& interface, const InterfaceSettings& settings,
                                  bool losses);

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "camera/bandwidth_plan.hpp"

#include <ifaddrs.h>
#include <netinet/in.h>

#include <cmath>
#include <fstream>
#include <memory>

namespace versavis::daemon {

namespace {

constexpr double ethernet_overhead = 38;  // preamble, header, checksum and gap, bytes
constexpr double gvsp_overhead = 36;      // IP, UDP and GVSP headers, bytes
constexpr double leader_and_trailer = 2;  // packets

/// Part of a link that cameras may fill; the rest is for control and resends.
constexpr double usable_part = 0.95;

double packets_per_frame(const BandwidthNeed& need) {
    return std::ceil(static_cast<double>(need.frame_size) / (need.packet_size - gvsp_overhead));
}

}  // namespace

double needed_mbps(const BandwidthNeed& need) {
    if (need.packet_size <= gvsp_overhead) return 0;
    const double packets = packets_per_frame(need);
    const double bytes = static_cast<double>(need.frame_size) +
                         (packets + leader_and_trailer) * (gvsp_overhead + ethernet_overhead);
    return bytes * 8 * need.rate_hz * 1e-6;
}

void BandwidthPlan::join(const std::string& camera, const BandwidthNeed& need) {
    const std::lock_guard lock(mutex_);
    needs_[camera] = need;
}

void BandwidthPlan::leave(const std::string& camera) {
    const std::lock_guard lock(mutex_);
    needs_.erase(camera);
}

BandwidthShare BandwidthPlan::share(const std::string& camera) const {
    const std::lock_guard lock(mutex_);
    const auto own = needs_.find(camera);
    if (own == needs_.end()) return {};
    BandwidthShare share;
    share.link = own->second.link;
    share.needed_mbps = needed_mbps(own->second);
    share.link_mbps = own->second.link_mbps * usable_part;
    std::size_t sharers = 0;
    for (const auto& [name, need] : needs_) {
        if (need.link != own->second.link) continue;
        share.link_needed_mbps += needed_mbps(need);
        ++sharers;
    }
    if (sharers < 2 || share.link_mbps == 0 || share.link_needed_mbps == 0) return share;
    // Its packets take their part of the link's time, however much of it is free.
    const double part = share.needed_mbps / share.link_needed_mbps;
    const double packet_bits = (own->second.packet_size + ethernet_overhead) * 8;
    const double on_the_wire_us = packet_bits / own->second.link_mbps;
    const double allotted_us = packet_bits / (share.link_mbps * part);
    share.packet_delay = Duration{std::llround((allotted_us - on_the_wire_us) * 1e3)};
    return share;
}

double link_speed_mbps(const std::string& interface) {
    std::ifstream file("/sys/class/net/" + interface + "/speed");
    double speed = 0;
    return file >> speed && speed > 0 ? speed : 0;
}

std::string interface_of(std::uint32_t address_big_endian) {
    ifaddrs* all = nullptr;
    if (getifaddrs(&all) != 0) return "";
    const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(all, &freeifaddrs);
    for (const ifaddrs* entry = all; entry != nullptr; entry = entry->ifa_next)
        if (entry->ifa_addr != nullptr && entry->ifa_addr->sa_family == AF_INET &&
            reinterpret_cast<const sockaddr_in*>(entry->ifa_addr)->sin_addr.s_addr ==
                address_big_endian)
            return entry->ifa_name;
    return "";
}

}  // namespace versavis::daemon

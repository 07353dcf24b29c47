// SPDX-License-Identifier: BSD-3-Clause
#include "lidar/capture.hpp"

#include <fmt/format.h>
#include <pcap/pcap.h>

#include <array>

namespace versavis::client {

namespace {

constexpr int longest_frame = 65536;
constexpr int wait_ms = 100;
constexpr int buffer_bytes = 16 << 20;

/// The year 2242. What a file says beyond is no time.
constexpr std::int64_t latest_s = std::int64_t{1} << 33U;

constexpr std::uint16_t ethertype_ip = 0x0800;
constexpr std::uint16_t ethertype_vlan = 0x8100;
constexpr std::uint16_t ethertype_service_vlan = 0x88A8;
constexpr std::uint8_t protocol_udp = 17;
constexpr std::size_t smallest_ip_header = 20;
constexpr std::size_t udp_header = 8;

std::uint16_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
    return static_cast<std::uint16_t>(bytes[at] << 8U | bytes[at + 1]);
}

/// The IP packet in a frame; empty: it has none.
std::span<const std::uint8_t> ip_packet(std::span<const std::uint8_t> frame, int link_type) {
    std::size_t type_at = 0;
    std::size_t header = 0;
    switch (link_type) {
        case DLT_RAW: return frame;
        case DLT_EN10MB: type_at = 12, header = 14; break;
        case DLT_LINUX_SLL: type_at = 14, header = 16; break;
        case DLT_LINUX_SLL2: type_at = 0, header = 20; break;
        default: return {};
    }
    if (frame.size() < header) return {};
    std::uint16_t type = word(frame, type_at);
    while (type == ethertype_vlan || type == ethertype_service_vlan) {
        constexpr std::size_t tag = 4;
        if (frame.size() < header + tag) return {};
        type = word(frame, header + 2);
        header += tag;
    }
    return type == ethertype_ip ? frame.subspan(header) : std::span<const std::uint8_t>();
}

OutputTime arrival(const pcap_pkthdr& header) {  // opened with nanoseconds
    return {std::int64_t{header.ts.tv_sec} * 1'000'000'000 + header.ts.tv_usec};
}

}  // namespace

std::optional<Datagram> datagram_of(std::span<const std::uint8_t> frame, int link_type) {
    const auto ip = ip_packet(frame, link_type);
    if (ip.size() < smallest_ip_header || ip[0] >> 4U != 4 || ip[9] != protocol_udp) return {};
    const std::size_t header = (ip[0] & 15U) * std::size_t{4};
    constexpr std::uint16_t fragment_offset = 0x1FFF;
    if (header < smallest_ip_header || ip.size() < header + udp_header ||
        (word(ip, 6) & fragment_offset) != 0)
        return {};
    const auto udp = ip.subspan(header);
    const std::size_t length = word(udp, 4);
    if (length < udp_header) return {};
    Datagram datagram;
    datagram.source = fmt::format("{}.{}.{}.{}", ip[12], ip[13], ip[14], ip[15]);
    datagram.source_port = word(udp, 0);
    datagram.port = word(udp, 2);
    datagram.size = length - udp_header;
    datagram.payload = udp.subspan(udp_header);
    if (datagram.payload.size() > datagram.size)  // the link's padding
        datagram.payload = datagram.payload.first(datagram.size);
    return datagram;
}

void Capture::Closer::operator()(pcap* handle) const { pcap_close(handle); }

Expected<Capture> Capture::open_file(const std::string& path) {
    std::array<char, PCAP_ERRBUF_SIZE> error{};
    pcap* handle = pcap_open_offline_with_tstamp_precision(path.c_str(), PCAP_TSTAMP_PRECISION_NANO,
                                                           error.data());
    if (handle == nullptr)
        return failure(path, fmt::format("it cannot be read as a capture: {}", error.data()),
                       "make one with: tcpdump -i INTERFACE -w FILE udp");
    return Capture(handle, path, false);
}

Expected<Capture> Capture::open_interface(const std::string& name) {
    std::array<char, PCAP_ERRBUF_SIZE> error{};
    Capture capture(pcap_create(name.c_str(), error.data()), name, true);
    pcap* handle = capture.handle_.get();
    if (handle == nullptr) return failure(name, error.data(), "'ip link' lists the interfaces");
    pcap_set_snaplen(handle, longest_frame);
    pcap_set_timeout(handle, wait_ms);
    pcap_set_buffer_size(handle, buffer_bytes);
    pcap_set_tstamp_precision(handle, PCAP_TSTAMP_PRECISION_NANO);
    const int result = pcap_activate(handle);
    if (result == PCAP_ERROR_PERM_DENIED)
        return failure(name, "capturing is not permitted",
                       "run it as root, or read a file that tcpdump wrote");
    if (result < 0)
        return failure(name, pcap_statustostr(result), "'ip link' lists the interfaces");
    bpf_program only_udp{};
    if (pcap_compile(handle, &only_udp, "udp or (vlan and udp)", 1, PCAP_NETMASK_UNKNOWN) == 0) {
        pcap_setfilter(handle, &only_udp);
        pcap_freecode(&only_udp);
    }
    return capture;
}

Expected<std::optional<Datagram>> Capture::next() {
    for (;;) {
        pcap_pkthdr* header = nullptr;
        const u_char* data = nullptr;
        const int result = pcap_next_ex(handle_.get(), &header, &data);
        if (result == 0) return std::optional<Datagram>();
        if (result == PCAP_ERROR_BREAK) {
            ended_ = true;
            return std::optional<Datagram>();
        }
        if (result < 0)
            return failure(name_, pcap_geterr(handle_.get()),
                           live_ ? "is the interface up?" : "the file is cut off or damaged");
        if (header->ts.tv_sec < 0 || header->ts.tv_sec > latest_s) continue;
        auto datagram = datagram_of({data, header->caplen}, pcap_datalink(handle_.get()));
        if (!datagram) continue;
        datagram->arrived = arrival(*header);
        return datagram;
    }
}

std::uint64_t Capture::dropped() const {
    pcap_stat statistics{};
    return live_ && pcap_stats(handle_.get(), &statistics) == 0 ? statistics.ps_drop : 0;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/network_checks.hpp"

#include <fmt/format.h>
#include <linux/ethtool.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <array>
#include <cstring>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include "posix/file_descriptor.hpp"

namespace versavis::client {

namespace {

/// Of packets that carry GigE Vision well; those of 1500 bytes cost six times as many interrupts.
constexpr std::int64_t jumbo_mtu = 9000;

/// What the service asks for; it gets it with CAP_NET_ADMIN, else as far as rmem_max allows.
constexpr std::int64_t receive_buffer = 32 << 20;
constexpr unsigned cap_net_admin = 12;
constexpr unsigned cap_net_raw = 13;

/// Below this, one camera of 1 Mpixel does not reach 20 Hz.
constexpr std::int64_t slowest_link_mbps = 1000;

/// Not rx_dropped: it also counts packets that no program wants, as a switch's own.
constexpr std::array loss_counters{"rx_missed_errors", "rx_fifo_errors", "rx_over_errors",
                                   "rx_crc_errors"};

std::string statistics(const std::string& interface, const char* counter) {
    return "/sys/class/net/" + interface + "/statistics/" + counter;
}

std::set<std::string> links(const Subject& subject) {
    std::set<std::string> names;
    for (const LinkedCamera& camera : subject.cameras)
        if (camera.interface != "lo") names.insert(camera.interface);
    return names;
}

/// Column `name` of the two lines that /proc/net/snmp has for a protocol.
std::int64_t snmp_counter(const std::string& text, const std::string& protocol,
                          const std::string& name) {
    std::istringstream lines(text);
    std::string titles;
    for (std::string line; std::getline(lines, line);) {
        if (line.rfind(protocol + ": ", 0) != 0) continue;
        if (titles.empty()) {
            titles = line;
            continue;
        }
        std::istringstream title_words(titles);
        std::istringstream values(line);
        std::string title;
        std::string value;
        while (title_words >> title && values >> value)
            if (title == name) return std::strtoll(value.c_str(), nullptr, 10);
    }
    return 0;
}

std::uint32_t largest_packet(const Subject& subject, const std::string& interface) {
    std::uint32_t largest = 0;
    for (const LinkedCamera& camera : subject.cameras)
        if (camera.interface == interface) largest = std::max(largest, camera.packet_size);
    return largest;
}

Findings check_mtu(const Subject& subject, const std::string& interface) {
    const auto mtu = subject.files.number("/sys/class/net/" + interface + "/mtu");
    if (!mtu) return {};
    Finding finding{"mtu", interface, fmt::format("{} bytes", *mtu)};
    finding.cure = fmt::format("sudo ip link set dev {} mtu {}, and the same in the switch",
                               interface, jumbo_mtu);
    const std::uint32_t packet = largest_packet(subject, interface);
    if (packet > *mtu) {
        finding.verdict = Verdict::bad;
        finding.reason =
            fmt::format("a camera sends packets of {} bytes, which do not pass", packet);
    } else if (*mtu < jumbo_mtu) {
        finding.verdict = Verdict::warning;
        finding.reason = fmt::format("packets of {} bytes would be {:.1f} times fewer", jumbo_mtu,
                                     static_cast<double>(jumbo_mtu) / static_cast<double>(*mtu));
    } else {
        finding.cure.clear();
    }
    return {finding};
}

Findings check_speed(const Subject& subject, const std::string& interface) {
    const auto speed = subject.files.number("/sys/class/net/" + interface + "/speed");
    const auto carrier = subject.files.number("/sys/class/net/" + interface + "/carrier");
    if (carrier == 0)
        return {{"link_speed", interface, "no carrier", Verdict::bad,
                 "nothing is connected, or it has no power", "check cable and switch"}};
    if (!speed || *speed <= 0) return {};  // a virtual one does not say
    Finding finding{"link_speed", interface, fmt::format("{} Mbit/s", *speed)};
    if (*speed < slowest_link_mbps) {
        finding.verdict = Verdict::bad;
        finding.reason = "cameras need 1 Gbit/s: a wire of the cable may be broken";
        finding.cure = fmt::format("replace the cable; then: ethtool {} | grep Speed", interface);
    }
    return {finding};
}

std::int64_t of(const LossCounters& counters, const std::string& interface) {
    const auto found = counters.interfaces.find(interface);
    return found == counters.interfaces.end() ? 0 : found->second;
}

Finding lossy(Finding finding, std::int64_t before, std::int64_t after, std::string reason,
              std::string cure) {
    finding.value = fmt::format("{} lost since boot, {} of them now", after, after - before);
    if (after == before) return finding;
    finding.verdict = Verdict::bad;
    finding.reason = std::move(reason);
    finding.cure = std::move(cure);
    return finding;
}

/// Frames of one camera, by the service.
Findings check_frames(const nlohmann::json& status) {
    Findings findings;
    for (const auto& camera : status.value("cameras", nlohmann::json::array())) {
        const double received = camera.value("frames_received", 0.0);
        const double incomplete = camera.value("frames_incomplete", 0.0);
        if (received + incomplete == 0) continue;
        const double share = incomplete / (received + incomplete);
        Finding finding{"frame_loss", camera.value("name", ""),
                        fmt::format("{} of {} frames incomplete ({:.3f} %)", incomplete,
                                    received + incomplete, share * 100)};
        if (share > 0.001) {
            finding.verdict = Verdict::warning;
            finding.reason = "packets are lost between camera and service";
            finding.cure = "see mtu, link_loss, receive_buffers and rx_ring; else cable and switch";
        }
        findings.push_back(finding);
    }
    return findings;
}

bool has_capability(const HostFiles& files, int pid, unsigned capability) {
    const auto text = files.text(fmt::format("/proc/{}/status", pid));
    const std::size_t at = text ? text->find("CapEff:") : std::string::npos;
    if (at == std::string::npos) return false;
    return ((std::strtoull(text->c_str() + at + 7, nullptr, 16) >> capability) & 1U) != 0;
}

Findings check_receive_buffer(const Subject& subject) {
    const char* path = "/proc/sys/net/core/rmem_max";
    const auto limit = subject.files.number(path);
    if (!limit) return {};
    Finding finding{"rmem_max", "", fmt::format("{} KiB", *limit >> 10)};
    if (*limit >= receive_buffer) return {finding};
    if (subject.pid() != 0 && has_capability(subject.files, subject.pid(), cap_net_admin)) {
        finding.value += ", and the service has CAP_NET_ADMIN";
        return {finding};
    }
    finding.verdict = Verdict::bad;
    finding.reason = fmt::format(
        "the service asks for receive buffers of {} KiB, and its unit gives it no CAP_NET_ADMIN: "
        "bursts of frames are lost",
        receive_buffer >> 10);
    finding.cure = fmt::format(
        "echo net.core.rmem_max={} | sudo tee /etc/sysctl.d/90-versavis.conf; sudo sysctl "
        "--system; "
        "then restart the service",
        receive_buffer);
    finding.fix = Fix{path, std::to_string(receive_buffer)};
    return {finding};
}

/// How images come in. The right to do it for less is the administrator's choice: it has a price,
/// which tests/system/systemd_units measures.
Findings check_packet_socket(const Subject& subject) {
    std::size_t by_socket = 0;
    std::size_t by_packet = 0;
    for (const auto& camera : subject.status->value("cameras", nlohmann::json::array())) {
        const std::string receive = camera.value("receive", "");
        by_socket += receive == "socket" ? 1 : 0;
        by_packet += receive == "packet" ? 1 : 0;
    }
    if (by_socket + by_packet == 0) return {};
    Finding finding{"packet_socket", "",
                    fmt::format("used for {} of {} cameras", by_packet, by_socket + by_packet)};
    if (by_socket == 0 || has_capability(subject.files, subject.pid(), cap_net_raw))
        return {finding};
    finding.verdict = Verdict::unknown;
    finding.reason =
        "the service may open none. They take a third of the processor time, and raise the "
        "exposure that 'systemd-analyze security' shows from 1.9 to 2.2";
    finding.cure =
        "where processor time is short: sudo install -Dm 644 "
        "/usr/share/doc/versavis/examples/packet-socket.conf "
        "/etc/systemd/system/versavisd.service.d/packet-socket.conf; receive = \"auto\" for the "
        "cameras; then sudo systemctl daemon-reload and restart the service";
    return {finding};
}

/// One question to a driver; false: it does not answer it.
template <class Question>
bool ask(const FileDescriptor& socket, const std::string& interface, Question& question) {
    ifreq request{};
    interface.copy(request.ifr_name, sizeof request.ifr_name - 1);
    request.ifr_data = reinterpret_cast<char*>(&question);
    return ::ioctl(socket.get(), SIOCETHTOOL, &request) == 0;
}

/// Features that merge UDP packets: as the kernel names them, and as ethtool -K does.
constexpr std::pair<const char*, const char*> merging_features[] = {
    {"rx-lro", "lro"},
    {"rx-gro-list", "rx-gro-list"},
    {"rx-udp-gro-forwarding", "rx-udp-gro-forwarding"}};

/// An ioctl's structure, with words for the array at its end.
std::vector<std::uint32_t> question(std::uint32_t command, std::size_t words) {
    std::vector<std::uint32_t> memory(words);
    memory[0] = command;
    return memory;
}

/// Features of an interface that the kernel knows, and whether they are on.
std::map<std::string, bool> read_features(const FileDescriptor& socket,
                                          const std::string& interface) {
    auto count = question(ETHTOOL_GSSET_INFO, 5);
    count[2] = 1U << ETH_SS_FEATURES;  // of the mask's 64 bits, on a little-endian machine
    if (!ask(socket, interface, *count.data()) || count[2] == 0) return {};
    const std::uint32_t features = count[4];
    auto names = question(ETHTOOL_GSTRINGS, 3 + std::size_t{features} * ETH_GSTRING_LEN / 4);
    names[1] = ETH_SS_FEATURES;
    names[2] = features;
    const std::uint32_t blocks = (features + 31) / 32;
    auto states = question(ETHTOOL_GFEATURES, 2 + std::size_t{blocks} * 4);
    states[1] = blocks;
    if (!ask(socket, interface, *names.data()) || !ask(socket, interface, *states.data()))
        return {};
    std::map<std::string, bool> found;
    for (std::uint32_t i = 0; i < features; ++i) {
        const auto* name = reinterpret_cast<const char*>(&names[3 + i * ETH_GSTRING_LEN / 4]);
        const std::uint32_t active = states[2 + i / 32 * 4 + 2];
        found[{name, ::strnlen(name, ETH_GSTRING_LEN)}] = ((active >> (i % 32)) & 1U) != 0;
    }
    return found;
}

}  // namespace

LossCounters read_losses(const Subject& subject) {
    LossCounters counters;
    for (const std::string& interface : links(subject))
        for (const char* counter : loss_counters)
            counters.interfaces[interface] +=
                subject.files.number(statistics(interface, counter)).value_or(0);
    counters.receive_buffers =
        snmp_counter(subject.files.text("/proc/net/snmp").value_or(""), "Udp", "RcvbufErrors");
    return counters;
}

InterfaceSettings read_interface_settings(const std::string& interface) {
    InterfaceSettings settings;
    const FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    ethtool_coalesce moderation{};
    moderation.cmd = ETHTOOL_GCOALESCE;
    if (ask(socket, interface, moderation)) {
        settings.moderation_us = moderation.rx_coalesce_usecs;
        settings.adaptive_moderation = moderation.use_adaptive_rx_coalesce != 0;
    }
    ethtool_ringparam ring{};
    ring.cmd = ETHTOOL_GRINGPARAM;
    if (ask(socket, interface, ring) && ring.rx_max_pending != 0) {
        settings.ring = ring.rx_pending;
        settings.longest_ring = ring.rx_max_pending;
    }
    const auto features = read_features(socket, interface);
    for (const auto& [kernel_name, name] : merging_features)
        if (const auto found = features.find(kernel_name); found != features.end())
            settings.merging[name] = found->second;
    return settings;
}

Findings check_interface_settings(const std::string& interface, const InterfaceSettings& settings,
                                  bool losses) {
    Findings findings;
    if (settings.ring) {
        Finding finding{"rx_ring", interface,
                        fmt::format("{} of {} packets", *settings.ring, *settings.longest_ring)};
        if (losses && *settings.ring < *settings.longest_ring) {
            finding.verdict = Verdict::bad;
            finding.reason = "packets are lost on this link, and the interface could hold more";
            finding.cure =
                fmt::format("sudo ethtool -G {} rx {}", interface, *settings.longest_ring);
        }
        findings.push_back(finding);
    }
    if (settings.moderation_us) {
        const bool adaptive = settings.adaptive_moderation.value_or(false);
        Finding finding{
            "moderation", interface,
            fmt::format("{} us{}", *settings.moderation_us, adaptive ? ", adaptive" : "")};
        if (*settings.moderation_us == 0 && !adaptive) {
            finding.verdict = Verdict::warning;
            finding.reason = "each packet interrupts the host";
            finding.cure = fmt::format("sudo ethtool -C {} rx-usecs 50", interface);
        }
        findings.push_back(finding);
    }
    if (!settings.merging.empty()) {
        std::string on;
        for (const auto& [name, is_on] : settings.merging)
            if (is_on) on += (on.empty() ? "" : " ") + name;
        Finding finding{"offload", interface, on.empty() ? "packets are not merged" : on + " on"};
        if (!on.empty()) {
            finding.verdict = Verdict::warning;
            finding.reason = "packets are merged, which receivers of single ones miss";
            finding.cure = "sudo ethtool -K " + interface;
            for (const auto& [name, is_on] : settings.merging)
                if (is_on) finding.cure += fmt::format(" {} off", name);
        }
        findings.push_back(finding);
    }
    return findings;
}

Findings check_network(const Subject& subject, const LossCounters& before,
                       const LossCounters& after) {
    Findings findings;
    const auto add = [&findings](Findings more) {
        findings.insert(findings.end(), more.begin(), more.end());
    };
    for (const std::string& interface : links(subject)) {
        add(check_mtu(subject, interface));
        add(check_speed(subject, interface));
        const bool losses = of(after, interface) != of(before, interface);
        add({lossy({"link_loss", interface, ""}, of(before, interface), of(after, interface),
                   "packets arrive damaged, or faster than the host takes them",
                   fmt::format("ip -s -s link show {} says where; see rx_ring", interface))});
        add(check_interface_settings(interface, read_interface_settings(interface), losses));
    }
    if (!subject.cameras.empty()) {
        add(check_receive_buffer(subject));
        add({lossy({"receive_buffers", "UDP", ""}, before.receive_buffers, after.receive_buffers,
                   "a program does not read its packets in time",
                   "lower the load of the host; see rmem_max and governor")});
    }
    if (subject.status) {
        add(check_frames(*subject.status));
        add(check_packet_socket(subject));
    }
    return findings;
}

}  // namespace versavis::client

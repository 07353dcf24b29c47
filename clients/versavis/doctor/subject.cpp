// SPDX-License-Identifier: BSD-3-Clause
#include "doctor/subject.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <netinet/in.h>

#include <memory>

#include "engine/toml/service_file.hpp"
#include "status/status_document.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

std::uint32_t ipv4_of(const sockaddr* address) {
    return reinterpret_cast<const sockaddr_in*>(address)->sin_addr.s_addr;
}

/// The service knows it of cameras that it has opened, the configuration of those with an address.
std::vector<LinkedCamera> linked_cameras(const std::optional<json>& status,
                                         const std::optional<ConfiguredParts>& configuration) {
    std::vector<LinkedCamera> cameras;
    const json known = status ? status->value("cameras", json::array()) : json::array();
    for (const json& camera : known)
        if (!camera.value("link", "").empty())
            cameras.push_back({camera.value("name", ""), camera.value("link", ""),
                               camera.value("packet_size", 0U)});
    if (!configuration) return cameras;
    for (const auto& [name, device] : configuration->cameras) {
        const auto same = [&name = name](const LinkedCamera& camera) {
            return camera.name == name;
        };
        if (std::any_of(cameras.begin(), cameras.end(), same)) continue;
        const std::string interface = interface_towards(device);
        if (!interface.empty()) cameras.push_back({name, interface, 0});
    }
    return cameras;
}

}  // namespace

std::string interface_towards(const std::string& ipv4) {
    in_addr address{};
    ifaddrs* all = nullptr;
    if (inet_pton(AF_INET, ipv4.c_str(), &address) != 1 || getifaddrs(&all) != 0) return "";
    const std::unique_ptr<ifaddrs, decltype(&freeifaddrs)> owner(all, &freeifaddrs);
    for (const ifaddrs* entry = all; entry != nullptr; entry = entry->ifa_next) {
        if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET) continue;
        const std::uint32_t mask =
            entry->ifa_netmask != nullptr ? ipv4_of(entry->ifa_netmask) : ~0U;
        if ((ipv4_of(entry->ifa_addr) & mask) == (address.s_addr & mask)) return entry->ifa_name;
    }
    return "";
}

Expected<ConfiguredParts> read_configured_parts(const std::string& path) {
    const auto table = parse_service_file(path);
    if (!table) return Unexpected<>(table.error().front());
    ConfiguredParts parts;
    parts.path = path;
    parts.board_link = (*table)["board"]["link"].value_or(parts.board_link);
    parts.board_serial = (*table)["board"]["serial"].value_or(parts.board_serial);
    parts.state_directory = (*table)["state_directory"].value_or(parts.state_directory);
    parts.sealed_rings = (*table)["memory"]["sealed"].value_or(parts.sealed_rings);
    parts.output = (*table)["clock"]["output"].value_or(parts.output);
    if (const auto* cameras = (*table)["camera"].as_array())
        for (const auto& camera : *cameras)
            if (const auto* keys = camera.as_table())
                parts.cameras.emplace_back((*keys)["name"].value_or(std::string()),
                                           (*keys)["device"].value_or(std::string()));
    return parts;
}

bool Subject::uses_board() const {
    return !status || status->value("board", json::object()).value("state", "") != "unused";
}

Subject examine(const std::string& instance, const std::string& configuration,
                const std::string& release) {
    Subject subject;
    subject.instance = instance;
    subject.release = release;
    auto status = read_status(instance);
    if (status)
        subject.status = std::move(*status);
    else
        subject.silence = status.error();
    if (!status) subject.unit = why_silent();
    auto parts = read_configured_parts(configuration_path(configuration, subject.status));
    if (parts)
        subject.configuration = std::move(*parts);
    else
        subject.configuration_error = parts.error();
    subject.cameras = linked_cameras(subject.status, subject.configuration);
    return subject;
}

}  // namespace versavis::client

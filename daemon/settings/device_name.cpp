// SPDX-License-Identifier: BSD-3-Clause
#include "device_name.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <cctype>

#include "base/lower_case.hpp"

namespace versavis::daemon {

namespace {

constexpr std::size_t mac_digits = 12;

/// Ends of names that only resolvers know (RFC 2606, 6762 and 8375, and what routers assign).
constexpr std::string_view host_suffixes[]{"localhost", ".local", ".localdomain", ".lan",
                                           ".home",     ".arpa",  ".internal",    ".intranet"};

const char* other_names =
    "set the camera's IP address, MAC address, serial number or name; "
    "versavis discover lists them";

std::optional<in_addr> ipv4_address(const std::string& text) {
    in_addr address{};
    return ::inet_pton(AF_INET, text.c_str(), &address) == 1 ? std::optional(address)
                                                             : std::nullopt;
}

/// Of [ADDRESS%INTERFACE]:PORT as well.
bool is_ipv6_address(std::string_view text) {
    if (!text.empty() && text.front() == '[') text = text.substr(1, text.find(']') - 1);
    const std::string address(text.substr(0, text.find_first_of("%/")));
    in6_addr parsed{};
    return ::inet_pton(AF_INET6, address.c_str(), &parsed) == 1;
}

/// What is left without SCHEME:// and without a port, a prefix length or a path.
std::string host_of(const std::string& text) {
    const std::string_view mark = "://";
    const std::size_t scheme = text.find(mark);
    const std::size_t begin = scheme == std::string::npos ? 0 : scheme + mark.size();
    return text.substr(begin, text.find_first_of(":/%", begin) - begin);
}

/// Digits and dots in three groups or more are meant as an IP address.
bool meant_as_address(const std::string& host) {
    return host.find_first_not_of("0123456789.,") == std::string::npos &&
           std::count_if(host.begin(), host.end(), [](char c) { return c == '.' || c == ','; }) >=
               2;
}

bool is_host_name(const std::string& host) {
    const std::string name = lower_case(host);
    return std::any_of(std::begin(host_suffixes), std::end(host_suffixes), [&](auto suffix) {
        return name.size() >= suffix.size() &&
               std::string_view(name).substr(name.size() - suffix.size()) == suffix;
    });
}

/// One camera's: not this network, not several and not all.
bool is_of_one_device(in_addr address) {
    constexpr std::uint32_t first_multicast = 224;
    const std::uint32_t first = ntohl(address.s_addr) >> 24U;
    return first != 0 && first < first_multicast;
}

}  // namespace

std::optional<std::string> mac_address(std::string_view text) {
    std::string digits;
    std::string marks;
    const std::size_t groups =
        1 + static_cast<std::size_t>(std::count_if(
                text.begin(), text.end(), [](unsigned char c) { return std::isxdigit(c) == 0; }));
    if (groups != 1 && groups != 3 && groups != 6) return std::nullopt;
    for (const char c : text) {
        if (std::isxdigit(static_cast<unsigned char>(c)) != 0) {
            digits += c;
        } else {
            marks += c;
            if (digits.size() != marks.size() * mac_digits / groups) return std::nullopt;
        }
    }
    if (digits.size() != mac_digits || marks.find_first_not_of(":-. ") != std::string::npos ||
        marks != std::string(marks.size(), marks.empty() ? ' ' : marks.front()))
        return std::nullopt;
    std::string address = lower_case(digits);
    for (std::size_t at = mac_digits - 2; at > 0; at -= 2) address.insert(at, 1, ':');
    return address;
}

bool same_device(const std::string& a, const std::string& b) {
    if (::strcasecmp(a.c_str(), b.c_str()) == 0) return true;
    const auto mac = mac_address(a);
    return mac && mac == mac_address(b);
}

std::optional<DeviceFault> device_fault(const std::string& device) {
    const auto blank = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
    if (blank(device.front()) || blank(device.back()))
        return DeviceFault{"begins or ends with a blank", "remove the blank"};
    if (mac_address(device)) return std::nullopt;
    if (is_ipv6_address(device))
        return DeviceFault{"is an IPv6 address, which GigE Vision cameras do not have",
                           other_names};
    if (device.front() == '/' || device.front() == '~')
        return DeviceFault{"is a path, which no camera has", other_names};
    const std::string host = host_of(device);
    if (device.find("://") != std::string::npos && !meant_as_address(host))
        return DeviceFault{"is a URL", other_names};
    const auto address = ipv4_address(host);
    if (address && !is_of_one_device(*address))
        return DeviceFault{"is an address that no camera can have", other_names};
    if (address && host != device)
        return DeviceFault{"is more than an IP address", fmt::format("write \"{}\"", host)};
    if (!address && meant_as_address(host))
        return DeviceFault{"is not an IP address",
                           "an IP address is four numbers from 0 to 255 without leading zeros, "
                           "such as 192.168.1.20"};
    if (is_host_name(host))
        return DeviceFault{"is a host name, which is not looked up", other_names};
    return std::nullopt;
}

}  // namespace versavis::daemon

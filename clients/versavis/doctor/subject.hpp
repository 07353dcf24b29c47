// SPDX-License-Identifier: BSD-3-Clause
// What the doctor looks at: the host, the service's own account of itself, and its configuration.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "doctor/host_files.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// A camera of GigE Vision, as far as its link matters.
struct LinkedCamera {
    std::string name;
    std::string interface;          ///< of the host
    std::uint32_t packet_size = 0;  ///< bytes, with IP header; 0: not known
};

/// The configuration's keys that name something of the host.
struct ConfiguredParts {
    std::string path;
    std::string board_link = "usb";
    std::string board_serial;
    std::string state_directory = "/var/lib/versavis";
    std::string output = "realtime";
    bool sealed_rings = true;
    std::vector<std::pair<std::string, std::string>> cameras;  ///< name and device
};

/// Error: the file cannot be read, or is no TOML.
Expected<ConfiguredParts> read_configured_parts(const std::string& path);

struct Subject {
    HostFiles files;
    std::string instance;
    std::string release;                   ///< of this program
    std::optional<nlohmann::json> status;  ///< none: there is no living service, see `silence`
    Error silence;
    std::optional<Error> unit;  ///< what the service manager says of it
    std::optional<ConfiguredParts> configuration;
    Error configuration_error;
    std::vector<LinkedCamera> cameras;

    /// Process of the service; 0: it does not run.
    int pid() const { return status ? status->value("pid", 0) : 0; }
    /// Something is triggered or sampled by a board.
    bool uses_board() const;
    bool board_on_usb() const { return !configuration || configuration->board_link == "usb"; }
};

/// `configuration`: path of the file; empty: that of the service, else the installed one.
Subject examine(const std::string& instance, const std::string& configuration,
                const std::string& release);

/// The interfaces of the host, and whether an address is in the network of one.
std::string interface_towards(const std::string& ipv4);

}  // namespace versavis::client

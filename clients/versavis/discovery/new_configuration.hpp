// SPDX-License-Identifier: BSD-3-Clause
// A commented configuration of the service, for devices that were found. Its comments are those of
// the service's table of keys.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

struct NewCamera {
    std::string name;
    std::string device;
    std::string description;  ///< for the comment
    std::string problem;      ///< the same; empty: nothing stands in the way
};

struct NewImu {
    std::string name;
    std::string model;
};

struct NewConfiguration {
    std::string instance = "default";
    std::string link = "usb";
    std::string board_serial;
    double rate_hz = 20;
    std::vector<NewCamera> cameras;
    std::optional<NewImu> imu;
};

/// Outputs of the board, each for one camera.
inline constexpr std::size_t most_cameras = 4;

/// As find_devices() has it, without a name; for the service `instance`, as all below.
NewCamera new_camera(const nlohmann::json& camera, const std::string& instance);

/// Nothing stands in the way of this camera, or that service uses it already.
bool usable(const nlohmann::json& camera, const std::string& instance);

/// Names cameras that have none "cam0", "cam1", ..., as far as those are free.
void name_cameras(std::vector<NewCamera>& cameras);

/// Those of `found` that `wanted` names by serial number, address, MAC address or user name, each
/// followed by "=NAME" or not; without any, all that are usable. Error: one is not there, or is
/// wanted twice, or there are too many.
Expected<std::vector<NewCamera>> choose_cameras(const nlohmann::json& found,
                                                const std::vector<std::string>& wanted,
                                                const std::string& instance);

/// "MODEL" or "MODEL=NAME". Error: no such model.
Expected<NewImu> choose_imu(const std::string& text);

/// If there are several, the serial number of the first that no other service uses.
std::string choose_board(const nlohmann::json& boards, const std::string& instance);

/// `keys`: as `versavisd --keys --json` prints them.
std::string to_toml(const NewConfiguration& configuration, const nlohmann::json& keys);

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
// Boards and cameras that this host can see, and the services that use them. docs/user/discover.md
// has the members of the JSON objects.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

/// {"services", "boards", "cameras"}. `addresses`: of cameras that no broadcast reaches.
Expected<nlohmann::json> find_devices(const std::vector<std::string>& addresses);

/// The same of what was found: `boards` and `cameras` as they are seen from outside, and the status
/// documents of all services. A board that only a service sees is added.
nlohmann::json join_devices(nlohmann::json boards, nlohmann::json cameras,
                            const std::vector<nlohmann::json>& statuses);

/// True: there is a board or a camera.
bool anything_found(const nlohmann::json& devices);

/// For a terminal.
std::string devices_text(const nlohmann::json& devices);

/// A configuration may call the camera so.
bool goes_by(const nlohmann::json& camera, const std::string& name);

/// Where a camera is, in a few words.
std::string place_of(const nlohmann::json& camera);

}  // namespace versavis::client

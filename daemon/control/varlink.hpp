// SPDX-License-Identifier: BSD-3-Clause
// Varlink's messages (https://varlink.org/Method-Call): JSON objects, each ended by a NUL byte.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "versavis/error.hpp"

namespace versavis::daemon {

struct VarlinkCall {
    std::string method;  ///< with its interface: "org.varlink.service.GetInfo"
    nlohmann::json parameters = nlohmann::json::object();
    bool more = false;    ///< the caller takes several replies
    bool oneway = false;  ///< the caller takes none

    /// The parameter, if it is a string; else empty.
    std::string text(const char* parameter) const;
};

/// Error: it is no call.
Expected<VarlinkCall> parse_call(std::string_view message);

/// Whole messages, with the NUL byte. `continues`: another reply follows.
std::string varlink_reply(const nlohmann::json& parameters, bool continues = false);
std::string varlink_error(const std::string& error, const nlohmann::json& parameters);

}  // namespace versavis::daemon

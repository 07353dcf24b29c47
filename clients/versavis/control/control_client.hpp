// SPDX-License-Identifier: BSD-3-Clause
// Calls of the service's control socket (docs/contracts/control.md).
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

class ControlClient {
 public:
    /// Errors: the service does not run, or does not let this user control it.
    static Expected<ControlClient> connect(const std::string& instance);

    /// Waits for the reply, and returns its parameters. Errors: what the service refuses, in its
    /// words; it does not answer.
    Expected<nlohmann::json> call(const std::string& method, const nlohmann::json& parameters);

 private:
    ControlClient(std::string path, FileDescriptor socket)
        : path_(std::move(path)), socket_(std::move(socket)) {}

    Expected<std::string> receive();

    std::string path_;
    FileDescriptor socket_;
};

}  // namespace versavis::client

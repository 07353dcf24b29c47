// SPDX-License-Identifier: BSD-3-Clause
// Rewrites an MCAP file with some of its messages changed.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "recording/mcap_reader.hpp"
#include "recording/mcap_writer.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// A message with other times or data; none: it stays as it is.
struct ChangedMessage {
    std::uint64_t log_time = 0;
    std::uint64_t publish_time = 0;
    std::string data{};
    bool dropped = false;
};

struct McapCopySettings {
    /// What a channel becomes; none: it stays.
    std::function<std::optional<McapTopic>(const McapChannel&)> convert;
    /// Gets all messages of a chunk before any of them is changed.
    std::function<void(const McapChannel&, const McapMessage&)> look;
    std::function<std::optional<ChangedMessage>(const McapChannel&, const McapMessage&)> change;
    /// A chunk that is left out.
    std::function<void(const Error&)> damaged;
    McapAttachment added;                     ///< besides those that are there
    std::function<bool(double share)> go_on;  ///< how far it is; false: stop
};

/// `path` appears complete or not at all. Errors: it is there already, the disk is full, the old
/// file is damaged or compressed, stopped.
Expected<> copy_mcap(const McapReader& from, const std::string& path,
                     const McapCopySettings& settings);

}  // namespace versavis::client

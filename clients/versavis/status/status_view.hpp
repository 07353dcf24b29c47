// SPDX-License-Identifier: BSD-3-Clause
// The status document as text for a person.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace versavis::client {

enum class Detail {
    summary,  ///< what fits a terminal, and of the counters those that say something
    full,
};

enum class Colour { none, ansi };

std::string status_text(const nlohmann::json& status, Detail detail, Colour colour = Colour::none);

/// `text` in place of what a terminal shows, without a moment in which it shows nothing.
std::string in_place(const std::string& text);

/// The clock's part alone, one fact per line; keys that this version does not know are shown as
/// they are.
std::string clock_text(const nlohmann::json& status);

}  // namespace versavis::client

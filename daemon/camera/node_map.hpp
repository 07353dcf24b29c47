// SPDX-License-Identifier: BSD-3-Clause
// Features of a GenICam camera by name, with values as text.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::daemon {

/// Used by the camera's control thread only.
class NodeMap {
 public:
    virtual ~NodeMap() = default;

    /// False: the description has no such feature, or it cannot be used on this model or now.
    virtual bool available(const std::string& feature) const = 0;

    /// Values of an enumeration that can be set now; empty for any other feature.
    virtual std::vector<std::string> values(const std::string& feature) const = 0;

    /// The lowest value of a number; none for any other feature, or if the camera does not say.
    virtual std::optional<std::string> lowest(const std::string& feature) const = 0;

    /// Errors name the feature and the values that the camera allows.
    virtual Expected<> set(const std::string& feature, const std::string& value) = 0;

    /// Empty: it cannot be read, as a command.
    virtual std::string read(const std::string& feature) const = 0;
};

/// True when the texts are equal, or both are numbers that are, but for rounding to float.
bool same_value(const std::string& a, const std::string& b);

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
// GenICam features of a camera by name, as text, with errors that name the feature and what it
// allows.
#pragma once

#include <arv.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::daemon {

struct ObjectDeleter {
    void operator()(void* object) const { g_object_unref(object); }
};
template <class T>
using Object = std::unique_ptr<T, ObjectDeleter>;

/// A GError that must be looked at.
class GlibError {
 public:
    GlibError() = default;
    ~GlibError() { g_clear_error(&error_); }
    GlibError(const GlibError&) = delete;
    GlibError& operator=(const GlibError&) = delete;

    GError** out() { return &error_; }
    bool set() const { return error_ != nullptr; }
    std::string text() const { return set() ? error_->message : ""; }

 private:
    GError* error_ = nullptr;
};

/// True when the camera's description has a feature of this name, whether it can be used now or
/// not.
bool has_feature(ArvDevice* device, const std::string& name);

/// The values of an enumeration by the camera's description, used or not; empty for any other
/// feature.
std::vector<std::string> enumeration_entries(ArvDevice* device, const std::string& name);

/// Sets any feature from text. Errors name the feature and the values that the camera allows.
Expected<> set_feature(ArvDevice* device, const std::string& name, const std::string& value);

/// Sets a feature that a camera may lack, or refuse, without harm.
void set_if_available(ArvDevice* device, const std::string& name, const std::string& value);

/// The value of a number, none when the camera has no such feature or does not tell.
std::optional<double> read_number(ArvDevice* device, const std::string& name);

/// The value of a text or an enumeration; empty when there is none.
std::string read_text(ArvDevice* device, const std::string& name);

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
// Features of a camera that Aravis has opened, and owners of what Aravis hands out.
#pragma once

#include <arv.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/description_graph.hpp"
#include "camera/node_map.hpp"

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

/// Features whose registers have a length that the camera may change are as good as absent.
class AravisNodeMap final : public NodeMap {
 public:
    /// The device must outlive it.
    explicit AravisNodeMap(ArvDevice* device);

    bool available(const std::string& feature) const override;
    std::vector<std::string> values(const std::string& feature) const override;
    std::optional<std::string> lowest(const std::string& feature) const override;
    Expected<> set(const std::string& feature, const std::string& value) override;
    std::string read(const std::string& feature) const override;

    /// True when the description has it, whether it can be used now or not.
    bool has(const std::string& feature) const { return node(feature) != nullptr; }

    /// The first of the features that the description has; empty: none.
    std::string first_of(const std::vector<std::string>& features) const;

    bool is_integer(const std::string& feature) const;

    /// The value of a number; none: it is none, or cannot be read now.
    std::optional<double> read_number(const std::string& feature) const;

    ArvDevice* device() const { return device_; }

 private:
    ArvGcNode* node(const std::string& feature) const;

    ArvDevice* device_;
    mutable DescriptionGraph graph_;
};

}  // namespace versavis::daemon

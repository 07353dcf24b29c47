// SPDX-License-Identifier: BSD-3-Clause
#include "camera/aravis_node_map.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace versavis::daemon {

namespace {

struct Range {
    double least = 0;
    double most = 0;
};

/// An enumeration is an integer, too.
bool is_integer_node(ArvGcNode* node) {
    return ARV_IS_GC_INTEGER(node) && !ARV_IS_GC_ENUMERATION(node);
}

/// None: it is no number, or the camera does not say.
std::optional<Range> range_of(ArvDevice* device, ArvGcNode* node, const char* name) {
    GlibError error;
    Range range;
    if (ARV_IS_GC_FLOAT(node)) {
        arv_device_get_float_feature_bounds(device, name, &range.least, &range.most, error.out());
    } else if (is_integer_node(node)) {
        gint64 least = 0;
        gint64 most = 0;
        arv_device_get_integer_feature_bounds(device, name, &least, &most, error.out());
        range = {static_cast<double>(least), static_cast<double>(most)};
    } else {
        return std::nullopt;
    }
    return error.set() || !(range.least <= range.most) ? std::nullopt : std::optional(range);
}

/// The whole text as a number. Throws std::invalid_argument or std::out_of_range.
double to_real(const std::string& text) {
    std::size_t used = 0;
    const double value = std::stod(text, &used);
    if (used != text.size()) throw std::invalid_argument(text);
    return value;
}

gint64 to_integer(const std::string& text) {
    const double value = to_real(text);
    if (value != std::floor(value) || std::abs(value) > 9e15) throw std::invalid_argument(text);
    return static_cast<gint64>(value);
}

bool to_boolean(const std::string& text) {
    if (text != "true" && text != "false") throw std::invalid_argument(text);
    return text == "true";
}

/// Throws what the conversions of the text throw.
void write(ArvDevice* device, ArvGcNode* node, const char* name, const std::string& value,
           GError** error) {
    if (ARV_IS_GC_BOOLEAN(node))
        arv_device_set_boolean_feature_value(device, name, to_boolean(value) ? TRUE : FALSE, error);
    else if (ARV_IS_GC_FLOAT(node))
        arv_device_set_float_feature_value(device, name, to_real(value), error);
    else if (is_integer_node(node))
        arv_device_set_integer_feature_value(device, name, to_integer(value), error);
    else if (ARV_IS_GC_COMMAND(node))
        arv_device_execute_command(device, name, error);
    else  // texts and enumerations
        arv_device_set_string_feature_value(device, name, value.c_str(), error);
}

/// What the feature allows, for errors.
std::string allowed(const NodeMap& nodes, ArvDevice* device, ArvGcNode* node,
                    const std::string& name) {
    if (ARV_IS_GC_ENUMERATION(node)) return fmt::format("{}", fmt::join(nodes.values(name), ", "));
    if (ARV_IS_GC_BOOLEAN(node)) return "true, false";
    const auto range = range_of(device, node, name.c_str());
    return range ? fmt::format("{} to {}", range->least, range->most) : "";
}

}  // namespace

AravisNodeMap::AravisNodeMap(ArvDevice* device)
    : device_(device), graph_(arv_device_get_genicam(device)) {}

ArvGcNode* AravisNodeMap::node(const std::string& feature) const {
    ArvGcNode* node = arv_device_get_feature(device_, feature.c_str());
    return node != nullptr && graph_.lengths_are_constant(feature) ? node : nullptr;
}

std::string AravisNodeMap::first_of(const std::vector<std::string>& features) const {
    const auto found = std::find_if(features.begin(), features.end(),
                                    [&](const std::string& feature) { return has(feature); });
    return found == features.end() ? "" : *found;
}

bool AravisNodeMap::is_integer(const std::string& feature) const {
    return is_integer_node(node(feature));
}

bool AravisNodeMap::available(const std::string& feature) const {
    ArvGcNode* found = node(feature);
    if (!ARV_IS_GC_FEATURE_NODE(found)) return false;
    GlibError error;
    auto* const node = ARV_GC_FEATURE_NODE(found);
    return arv_gc_feature_node_is_implemented(node, error.out()) != FALSE && !error.set() &&
           arv_gc_feature_node_is_available(node, error.out()) != FALSE && !error.set();
}

std::vector<std::string> AravisNodeMap::values(const std::string& feature) const {
    ArvGcNode* found = node(feature);
    if (!ARV_IS_GC_ENUMERATION(found)) return {};
    GlibError error;
    guint count = 0;
    const std::unique_ptr<const char*, decltype(&g_free)> names(
        arv_device_dup_available_enumeration_feature_values_as_strings(device_, feature.c_str(),
                                                                       &count, error.out()),
        g_free);
    if (error.set() || !names) return {};
    return {names.get(), names.get() + count};
}

std::optional<std::string> AravisNodeMap::lowest(const std::string& feature) const {
    const auto range = range_of(device_, node(feature), feature.c_str());
    return range ? std::optional(fmt::format("{}", range->least)) : std::nullopt;
}

Expected<> AravisNodeMap::set(const std::string& feature, const std::string& value) {
    ArvGcNode* found = node(feature);
    const std::string where = "feature " + feature;
    if (found == nullptr)
        return failure(where, "the camera has no such feature",
                       "'arv-tool-0.8 features' lists them");
    if (!available(feature)) return failure(where, "cannot be used on this model, or not now");
    GlibError error;
    try {
        // Some cameras take what is out of range without a word, and do something else.
        const auto range = range_of(device_, found, feature.c_str());
        if (const double number = range ? to_real(value) : 0;
            range && (number < range->least || number > range->most))
            return failure(where, fmt::format("'{}' is out of range", value),
                           "allowed: " + allowed(*this, device_, found, feature));
        write(device_, found, feature.c_str(), value, error.out());
    } catch (const std::exception&) {
        return failure(where, fmt::format("'{}' is of the wrong type", value),
                       "allowed: " + allowed(*this, device_, found, feature));
    }
    if (!error.set()) return {};
    const std::string choice = allowed(*this, device_, found, feature);
    return failure(where, fmt::format("'{}' is refused: {}", value, error.text()),
                   choice.empty() ? "" : "allowed: " + choice);
}

std::optional<double> AravisNodeMap::read_number(const std::string& feature) const {
    ArvGcNode* found = node(feature);
    GlibError error;
    double value = 0;
    if (ARV_IS_GC_FLOAT(found))
        value = arv_device_get_float_feature_value(device_, feature.c_str(), error.out());
    else if (is_integer_node(found))
        value = static_cast<double>(
            arv_device_get_integer_feature_value(device_, feature.c_str(), error.out()));
    else
        return std::nullopt;
    if (error.set()) return std::nullopt;
    return value;
}

std::string AravisNodeMap::read(const std::string& feature) const {
    ArvGcNode* found = node(feature);
    GlibError error;
    if (found == nullptr || ARV_IS_GC_COMMAND(found)) return "";
    if (ARV_IS_GC_BOOLEAN(found)) {
        const bool value =
            arv_device_get_boolean_feature_value(device_, feature.c_str(), error.out()) != FALSE;
        return error.set() ? "" : value ? "true" : "false";
    }
    if (const auto value = read_number(feature)) return fmt::format("{}", *value);
    const char* value = arv_device_get_string_feature_value(device_, feature.c_str(), error.out());
    return error.set() || value == nullptr ? "" : value;
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "camera/genicam.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <stdexcept>

namespace versavis::daemon {

namespace {

std::string range_text(ArvGcNode* node) {
    if (ARV_IS_GC_FLOAT(node))
        return fmt::format("{} to {}", arv_gc_float_get_min(ARV_GC_FLOAT(node), nullptr),
                           arv_gc_float_get_max(ARV_GC_FLOAT(node), nullptr));
    if (ARV_IS_GC_INTEGER(node))
        return fmt::format("{} to {}", arv_gc_integer_get_min(ARV_GC_INTEGER(node), nullptr),
                           arv_gc_integer_get_max(ARV_GC_INTEGER(node), nullptr));
    return "";
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

/// What the feature allows, for errors.
std::string allowed(ArvDevice* device, ArvGcNode* node, const std::string& name) {
    if (ARV_IS_GC_ENUMERATION(node))
        return fmt::format("{}", fmt::join(enumeration_entries(device, name), ", "));
    if (ARV_IS_GC_BOOLEAN(node)) return "true, false";
    return range_text(node);
}

/// Throws what the conversions of the text throw.
void write(ArvDevice* device, ArvGcNode* node, const char* name, const std::string& value,
           GError** error) {
    const bool counts =
        ARV_IS_GC_INTEGER(node) && !ARV_IS_GC_ENUMERATION(node);  // an enumeration is both
    if (ARV_IS_GC_BOOLEAN(node))
        arv_device_set_boolean_feature_value(device, name, to_boolean(value) ? TRUE : FALSE, error);
    else if (ARV_IS_GC_FLOAT(node))
        arv_device_set_float_feature_value(device, name, to_real(value), error);
    else if (counts)
        arv_device_set_integer_feature_value(device, name, to_integer(value), error);
    else if (ARV_IS_GC_COMMAND(node))
        arv_device_execute_command(device, name, error);
    else  // texts and enumerations
        arv_device_set_string_feature_value(device, name, value.c_str(), error);
}

}  // namespace

bool has_feature(ArvDevice* device, const std::string& name) {
    return arv_device_get_feature(device, name.c_str()) != nullptr;
}

std::vector<std::string> enumeration_entries(ArvDevice* device, const std::string& name) {
    std::vector<std::string> names;
    ArvGcNode* node = arv_device_get_feature(device, name.c_str());
    if (!ARV_IS_GC_ENUMERATION(node)) return names;
    for (const GSList* entry = arv_gc_enumeration_get_entries(ARV_GC_ENUMERATION(node));
         entry != nullptr; entry = entry->next)
        names.emplace_back(arv_gc_feature_node_get_name(ARV_GC_FEATURE_NODE(entry->data)));
    return names;
}

Expected<> set_feature(ArvDevice* device, const std::string& name, const std::string& value) {
    ArvGcNode* node = arv_device_get_feature(device, name.c_str());
    const std::string where = "feature " + name;
    if (node == nullptr)
        return failure(where, "the camera has no such feature",
                       "'arv-tool-0.8 features' lists them");
    GlibError error;
    try {
        write(device, node, name.c_str(), value, error.out());
    } catch (const std::exception&) {
        return failure(where, fmt::format("'{}' is of the wrong type", value),
                       "allowed: " + allowed(device, node, name));
    }
    if (!error.set()) return {};
    const std::string choice = allowed(device, node, name);
    return failure(where, fmt::format("'{}' is refused: {}", value, error.text()),
                   choice.empty() ? "" : "allowed: " + choice);
}

void set_if_available(ArvDevice* device, const std::string& name, const std::string& value) {
    if (has_feature(device, name)) static_cast<void>(set_feature(device, name, value));
}

std::optional<double> read_number(ArvDevice* device, const std::string& name) {
    ArvGcNode* node = arv_device_get_feature(device, name.c_str());
    GlibError error;
    double value = 0;
    if (ARV_IS_GC_FLOAT(node))
        value = arv_device_get_float_feature_value(device, name.c_str(), error.out());
    else if (ARV_IS_GC_INTEGER(node))
        value = static_cast<double>(
            arv_device_get_integer_feature_value(device, name.c_str(), error.out()));
    else
        return std::nullopt;
    if (error.set()) return std::nullopt;
    return value;
}

std::string read_text(ArvDevice* device, const std::string& name) {
    if (!has_feature(device, name)) return "";
    GlibError error;
    const char* value = arv_device_get_string_feature_value(device, name.c_str(), error.out());
    return error.set() || value == nullptr ? "" : value;
}

}  // namespace versavis::daemon

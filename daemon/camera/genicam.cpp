// SPDX-License-Identifier: BSD-3-Clause
#include "camera/genicam.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <stdexcept>

namespace versavis::daemon {

namespace {

struct Range {
    double least = 0;
    double most = 0;
};

/// None: it is no number, or the camera does not say.
std::optional<Range> range_of(ArvDevice* device, ArvGcNode* node, const char* name) {
    GlibError error;
    Range range;
    if (ARV_IS_GC_ENUMERATION(node)) return std::nullopt;  // which counts, too
    if (ARV_IS_GC_FLOAT(node)) {
        arv_device_get_float_feature_bounds(device, name, &range.least, &range.most, error.out());
    } else if (ARV_IS_GC_INTEGER(node)) {
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

/// What the feature allows, for errors.
std::string allowed(ArvDevice* device, ArvGcNode* node, const std::string& name) {
    if (ARV_IS_GC_ENUMERATION(node))
        return fmt::format("{}", fmt::join(enumeration_entries(device, name), ", "));
    if (ARV_IS_GC_BOOLEAN(node)) return "true, false";
    const auto range = range_of(device, node, name.c_str());
    return range ? fmt::format("{} to {}", range->least, range->most) : "";
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
        // Some cameras take what is out of range without a word, and do something else.
        const auto range = range_of(device, node, name.c_str());
        if (const double number = range ? to_real(value) : 0;
            range && (number < range->least || number > range->most))
            return failure(where, fmt::format("'{}' is out of range", value),
                           "allowed: " + allowed(device, node, name));
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

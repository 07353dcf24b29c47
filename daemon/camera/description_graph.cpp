// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description_graph.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string_view>

namespace versavis::daemon {

namespace {

/// Steps from a feature down to its registers. Cameras need about ten.
constexpr unsigned deepest_chain = 50;

/// Nodes that are looked at to know one value. Cameras need hundreds at most.
constexpr std::uint64_t most_steps = 20'000;

/// Bytes of one register.
constexpr std::int64_t longest_register = 1 << 20;

/// The name under which an offset of an index is exposed as a variable.
constexpr std::string_view offset_variable = "IndexOffset";

/// What Aravis reads by itself when it opens and streams a camera. All else is read by NodeMap,
/// which refuses features whose length varies.
constexpr std::string_view read_by_aravis[] = {"DeviceVendorName",
                                               "DeviceModelName",
                                               "DeviceSerialNumber",
                                               "DeviceID",
                                               "DeviceFamilyName",
                                               "Width",
                                               "Height",
                                               "OffsetX",
                                               "OffsetY",
                                               "PixelFormat",
                                               "PayloadSize",
                                               "AcquisitionMode",
                                               "AcquisitionStart",
                                               "AcquisitionStop",
                                               "AcquisitionFrameRate",
                                               "AcquisitionFrameRateAbs",
                                               "AcquisitionFrameRateEnable",
                                               "FPS",
                                               "TriggerSelector",
                                               "TriggerMode",
                                               "TLParamsLocked",
                                               "GevSCPSPacketSize",
                                               "GevSCPSFireTestPacket",
                                               "GevSCPSDoNotFragment",
                                               "GevSCPD",
                                               "GevTimestampTickFrequency",
                                               "GevStreamChannelSelector",
                                               "ChunkModeActive",
                                               "ChunkSelector",
                                               "ChunkEnable"};

/// What is needed for a value; the rest says whether, and within what limits, it may be used.
bool needed_for_value(const std::string& tag) {
    static const std::set<std::string> tags{"pValue",        "pVariable",    "pAddress",
                                            "pIndex",        "pLength",      "pValueIndexed",
                                            "pValueDefault", "pCommandValue"};
    return tags.count(tag) != 0;
}

bool needed_for_limits(const std::string& tag) {
    static const std::set<std::string> tags{"pMin",         "pMax",           "pInc",
                                            "pIsAvailable", "pIsImplemented", "pIsLocked"};
    return tags.count(tag) != 0;
}

std::string text_of(ArvDomNode* node) {
    std::string text;
    for (ArvDomNode* child = arv_dom_node_get_first_child(node); child != nullptr;
         child = arv_dom_node_get_next_sibling(child))
        if (ARV_IS_DOM_TEXT(child))
            text += arv_dom_character_data_get_data(ARV_DOM_CHARACTER_DATA(child));
    const auto from = text.find_first_not_of(" \t\r\n");
    return from == std::string::npos
               ? ""
               : text.substr(from, text.find_last_not_of(" \t\r\n") - from + 1);
}

/// Limits of a feature, and whether it may be used: apart from its value, because the limits of
/// width and offset name each other's values.
std::string limits_of(const std::string& feature) { return feature + " (limits)"; }

}  // namespace

DescriptionGraph::DescriptionGraph(ArvGc* description) { add(ARV_DOM_NODE(description), ""); }

void DescriptionGraph::add(ArvDomNode* node, const std::string& owner) {
    for (ArvDomNode* child = arv_dom_node_get_first_child(node); child != nullptr;
         child = arv_dom_node_get_next_sibling(child)) {
        if (ARV_IS_GC_FEATURE_NODE(child))
            add_feature(child, owner);
        else if (ARV_IS_GC_PROPERTY_NODE(child))
            add_property(owner, child);
        else
            add(child, owner);
    }
}

void DescriptionGraph::add_feature(ArvDomNode* node, const std::string& owner) {
    const char* given = arv_gc_feature_node_get_name(ARV_GC_FEATURE_NODE(node));
    const std::string tag = arv_dom_node_get_node_name(node);
    // Structures have no name: each gets one of its own, to be found by its entries.
    const std::string name = given != nullptr     ? given
                             : tag == "StructReg" ? fmt::format("StructReg {}", ++structures_)
                                                  : "";
    if (name.empty() || tag == "EnumEntry" || tag == "Group") return add(node, owner);
    if (tag == "StructEntry")  // its register is that of the structure
        features_[name].parts.push_back(owner);
    else if (!owner.empty())
        features_[owner].parts.push_back(name);
    add(node, name);
}

void DescriptionGraph::add_property(const std::string& owner, ArvDomNode* property) {
    const std::string tag = arv_dom_node_get_node_name(property);
    const std::string text = text_of(property);
    if (needed_for_value(tag)) features_[owner].parts.push_back(text);
    // A variable "X.Max" is a limit of what it names.
    const char* given = tag == "pVariable"
                            ? arv_gc_property_node_get_name(ARV_GC_PROPERTY_NODE(property))
                            : nullptr;
    const std::string_view name = given != nullptr ? given : "";
    if (name.find('.') != std::string_view::npos) features_[owner].parts.push_back(limits_of(text));
    if (name == offset_variable) offsets_.push_back(text);
    if (tag == "pValue") features_[limits_of(owner)].parts.push_back(limits_of(text));
    if (needed_for_limits(tag)) features_[limits_of(owner)].parts.push_back(text);
    if (tag == "Length" || tag == "pLength") features_[owner].lengths.push_back(text);
    const std::string_view parent =
        arv_dom_node_get_node_name(arv_dom_node_get_parent_node(property));
    if (tag == "Value" && parent == "Integer") features_[owner].constant = text;
}

Expected<> DescriptionGraph::check() {
    for (const auto& [name, feature] : features_)
        if (auto steps = cost(name); !steps) return Unexpected(steps.error());
    std::vector<std::string> constant(std::begin(read_by_aravis), std::end(read_by_aravis));
    // These cannot be seen when a feature is used.
    constant.insert(constant.end(), offsets_.begin(), offsets_.end());
    for (const std::string& name : constant)
        if (!lengths_are_constant(name))
            return failure(name, "its length is what another register says");
    return {};
}

bool DescriptionGraph::lengths_are_constant(const std::string& feature) {
    const auto constant = [this](const std::string& name) {
        const auto known = cost(name);
        return known && known->constant_lengths;
    };
    return constant(feature) && constant(limits_of(feature));
}

/// Error: a constant length that no register has.
Expected<bool> DescriptionGraph::has_constant_lengths(const std::string& name,
                                                      const Feature& feature) const {
    for (std::string text : feature.lengths) {
        const auto other = features_.find(text);
        if (other != features_.end()) {
            if (!other->second.parts.empty() || other->second.constant.empty()) return false;
            text = other->second.constant;
        }
        char* end = nullptr;
        const std::int64_t length = g_ascii_strtoll(text.c_str(), &end, 0);
        if (text.empty() || *end != '\0' || length < 1 || length > longest_register)
            return failure(name, fmt::format("a register of '{}' bytes", text));
    }
    return true;
}

Expected<DescriptionGraph::Cost> DescriptionGraph::cost(const std::string& name) {
    const auto known = costs_.find(name);
    if (known != costs_.end() && known->second.steps == 0)
        return failure(name, "its value leads back to itself");
    if (known != costs_.end()) return known->second;
    const auto feature = features_.find(name);
    if (feature == features_.end()) return Cost{};
    const auto constant = has_constant_lengths(name, feature->second);
    if (!constant) return Unexpected(constant.error());
    if (++depth_ > deepest_chain) return failure(name, "its value is nested too deep");
    costs_[name].steps = 0;  // being looked at
    Cost sum;
    sum.constant_lengths = *constant;
    for (const std::string& other : feature->second.parts) {
        auto part = cost(other);
        if (!part) return part;
        sum.steps = std::min(sum.steps + part->steps, most_steps + 1);
        sum.depth = std::max(sum.depth, part->depth + 1);
        sum.constant_lengths = sum.constant_lengths && part->constant_lengths;
    }
    --depth_;
    if (sum.steps > most_steps) return failure(name, "its value takes too many steps");
    if (sum.depth > deepest_chain) return failure(name, "its value is nested too deep");
    return costs_[name] = sum;
}

std::string expose_index_offsets(const std::string& text) {
    constexpr std::string_view attribute = "pOffset";
    constexpr std::string_view space = " \t\r\n";
    // Neither part of a name, such as PtpOffsetFromMaster, nor prose.
    const auto value_of_attribute = [&](std::size_t at) -> std::optional<std::string> {
        if (at == 0 || space.find(text[at - 1]) == std::string_view::npos) return std::nullopt;
        const std::size_t equals = text.find_first_not_of(space, at + attribute.size());
        if (equals == std::string::npos || text[equals] != '=') return std::nullopt;
        const std::size_t quote = text.find_first_not_of(space, equals + 1);
        if (quote == std::string::npos || (text[quote] != '"' && text[quote] != '\''))
            return std::nullopt;
        const std::size_t end = text.find_first_of(std::string{text[quote], '<'}, quote + 1);
        if (end == std::string::npos || text[end] == '<') return std::nullopt;
        return text.substr(quote + 1, end - quote - 1);
    };
    std::string result;
    std::size_t copied = 0;
    for (std::size_t at = text.find(attribute); at != std::string::npos;
         at = text.find(attribute, at + 1)) {
        const auto value = value_of_attribute(at);
        const std::size_t element = text.rfind('<', at);
        if (!value || element == std::string::npos) continue;
        result += text.substr(copied, element - copied) +
                  fmt::format("<pVariable Name=\"{}\">{}</pVariable>", offset_variable, *value);
        copied = element;
    }
    return result + text.substr(copied);
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description_check.hpp"

#include <arv.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <fstream>
#include <map>
#include <set>
#include <string_view>

#include "camera/genicam.hpp"

namespace versavis::daemon {

namespace {

/// The unzipped text. At half, the most verbose cameras are refused; at twice, a hostile one may
/// take twice the memory.
constexpr std::size_t largest_text = 24 << 20;

/// Steps from a feature down to its registers. Cameras need about ten. At half, still twice what is
/// needed; at twice, still far from the end of a stack.
constexpr unsigned deepest_chain = 50;

/// Nodes that are looked at to know one value. Cameras need hundreds at most. At half, elaborate
/// ones might be refused; at twice, one value may take twice the time.
constexpr std::uint64_t most_steps = 20'000;

/// Bytes of one register. At half, tables of cameras could be refused; at twice, twice the memory.
constexpr std::int64_t longest_register = 1 << 20;

/// Memory and time of the probe. At half, large descriptions are refused; at twice, so much more
/// may be needed in the service, which parses what was found good.
constexpr rlim_t probe_memory = 128 << 20;
constexpr rlim_t probe_seconds = 5;

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

struct Feature {
    std::vector<std::string> parts;  ///< what must be known first
    std::vector<std::string> lengths;
    std::string constant;
};

/// Limits of a feature, and whether it may be used: apart from its value, because the limits of
/// width and offset name each other's values.
std::string limits_of(const std::string& feature) { return feature + " (limits)"; }

/// All features by name, and what they refer to.
class Graph {
 public:
    void add(ArvDomNode* node, const std::string& owner) {
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

    Expected<> check() {
        for (const auto& [name, feature] : features_) {
            if (auto good = check_lengths(name, feature); !good) return good;
            if (auto steps = cost(name); !steps) return Unexpected(steps.error());
        }
        return {};
    }

 private:
    struct Cost {
        std::uint64_t steps = 1;
        unsigned depth = 1;
    };

    void add_feature(ArvDomNode* node, const std::string& owner) {
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

    void add_property(const std::string& owner, ArvDomNode* property) {
        const std::string tag = arv_dom_node_get_node_name(property);
        const std::string text = text_of(property);
        if (needed_for_value(tag)) features_[owner].parts.push_back(text);
        // A variable "X.Max" is a limit of what it names.
        const char* name = tag == "pVariable"
                               ? arv_gc_property_node_get_name(ARV_GC_PROPERTY_NODE(property))
                               : nullptr;
        if (name != nullptr && std::string_view(name).find('.') != std::string_view::npos)
            features_[owner].parts.push_back(limits_of(text));
        if (tag == "pValue") features_[limits_of(owner)].parts.push_back(limits_of(text));
        if (needed_for_limits(tag)) features_[limits_of(owner)].parts.push_back(text);
        if (tag == "Length" || tag == "pLength") features_[owner].lengths.push_back(text);
        if (tag == "Value") features_[owner].constant = text;
    }

    /// A length that the camera may change is none: memory is taken by it before it is known.
    Expected<> check_lengths(const std::string& name, const Feature& feature) const {
        for (std::string text : feature.lengths) {
            if (const auto other = features_.find(text); other != features_.end())
                text = other->second.parts.empty() ? other->second.constant : "a variable";
            char* end = nullptr;
            const std::int64_t length = g_ascii_strtoll(text.c_str(), &end, 0);
            if (text.empty() || *end != '\0' || length < 1 || length > longest_register)
                return failure(name, fmt::format("a register of '{}' bytes", text));
        }
        return {};
    }

    Expected<Cost> cost(const std::string& name) {
        const auto known = costs_.find(name);
        if (known != costs_.end() && known->second.steps == 0)
            return failure(name, "its value leads back to itself");
        if (known != costs_.end()) return known->second;
        const auto feature = features_.find(name);
        if (feature == features_.end()) return Cost{};
        if (++depth_ > deepest_chain) return failure(name, "its value is nested too deep");
        costs_[name].steps = 0;  // being looked at
        Cost sum;
        for (const std::string& other : feature->second.parts) {
            auto part = cost(other);
            if (!part) return part;
            sum.steps = std::min(sum.steps + part->steps, most_steps + 1);
            sum.depth = std::max(sum.depth, part->depth + 1);
        }
        --depth_;
        if (sum.steps > most_steps) return failure(name, "its value takes too many steps");
        if (sum.depth > deepest_chain) return failure(name, "its value is nested too deep");
        return costs_[name] = sum;
    }

    std::map<std::string, Feature> features_;
    std::map<std::string, Cost> costs_;
    unsigned depth_ = 0;
    unsigned structures_ = 0;
};

/// What a zip holds, its first file. Aravis trusts the sizes in it: that is why this runs apart.
Expected<std::string> unzip(const Description& description) {
    const std::unique_ptr<ArvZip, decltype(&arv_zip_free)> zip(
        arv_zip_new(description.bytes.data(), description.bytes.size()), arv_zip_free);
    const GSList* files = arv_zip_get_file_list(zip.get());
    if (files == nullptr) return failure("description", "is not a zip archive");
    auto* file = static_cast<ArvZipFile*>(files->data);
    if (arv_zip_file_get_uncompressed_size(file) > largest_text)
        return failure("description",
                       fmt::format("unzips to {} bytes", arv_zip_file_get_uncompressed_size(file)));
    std::size_t size = 0;
    const std::unique_ptr<void, decltype(&g_free)> text(
        arv_zip_get_file(zip.get(), arv_zip_file_get_name(file), &size), g_free);
    if (!text) return failure("description", "is not a zip archive");
    return std::string(static_cast<const char*>(text.get()), size);
}

/// Aravis does not give out the attribute that makes an index depend on another feature: it becomes
/// an element.
std::string with_offsets_as_variables(const std::string& text) {
    constexpr std::string_view attribute = "pOffset";
    std::string result;
    std::size_t copied = 0;
    for (std::size_t at = text.find(attribute); at != std::string::npos;
         at = text.find(attribute, at + 1)) {
        const std::size_t element = text.rfind('<', at);
        const std::size_t from = text.find_first_of("\"'", at);
        const std::size_t to = from == std::string::npos ? from : text.find(text[from], from + 1);
        if (to == std::string::npos || element == std::string::npos || element < copied) continue;
        result += text.substr(copied, element - copied) + "<pVariable>" +
                  text.substr(from + 1, to - from - 1) + "</pVariable>";
        copied = element;
    }
    return result + text.substr(copied);
}

/// `used` bytes are taken already: by the program, and by the sanitizer that it may run under.
void limit_memory() {
    rlim_t used_pages = 0;
    std::ifstream("/proc/self/statm") >> used_pages;
    const rlim_t used = used_pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
    const rlimit memory{used + probe_memory, used + probe_memory};
    ::setrlimit(RLIMIT_AS, &memory);
}

}  // namespace

Expected<> check_description(const Description& description) {
    std::string text(description.bytes.begin(), description.bytes.end());
    if (description.zipped) {
        auto unzipped = unzip(description);
        if (!unzipped) return Unexpected(unzipped.error());
        text = std::move(*unzipped);
    }
    if (text.size() > largest_text) return failure("description", "is too large");
    constexpr std::string_view last = "</RegisterDescription>";
    const auto end = text.find_last_not_of(std::string_view(" \t\r\n\0", 5));
    if (end == std::string::npos || !std::string_view(text).substr(0, end + 1).ends_with(last))
        return failure("description", "is cut off");
    if (text.find("<!ENTITY") != std::string::npos)
        return failure("description", "defines entities");
    text = with_offsets_as_variables(text);
    const Object<ArvGc> parsed(arv_gc_new(nullptr, text.data(), text.size()));
    if (!ARV_IS_GC(parsed.get())) return failure("description", "is not valid XML");
    Graph graph;
    graph.add(ARV_DOM_NODE(parsed.get()), "");
    return graph.check();
}

int run_description_probe(bool zipped) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const rlimit time{probe_seconds, probe_seconds};
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CPU, &time);
    ::setrlimit(RLIMIT_CORE, &none);
    limit_memory();
    Description description;
    description.zipped = zipped;
    std::array<std::uint8_t, 65536> part{};
    for (ssize_t size; (size = ::read(STDIN_FILENO, part.data(), part.size())) > 0;)
        description.bytes.insert(description.bytes.end(), part.begin(), part.begin() + size);
    const auto good = check_description(description);
    if (!good) fmt::print("{}: {}\n", good.error().where, good.error().what);
    return good ? 0 : 1;
}

}  // namespace versavis::daemon

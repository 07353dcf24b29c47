// SPDX-License-Identifier: BSD-3-Clause
// Which nodes of a GenICam description each feature depends on, and whether it can be evaluated in
// bounded time and memory.
#pragma once

#include <arv.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::daemon {

/// Nodes are those of a parsed description, by name. Not thread-safe.
class DescriptionGraph {
 public:
    explicit DescriptionGraph(ArvGc* description);

    /// Errors name a feature that leads back to itself, is nested too deep, takes too many steps,
    /// or has a register of impossible length; and what Aravis reads by itself, if its length
    /// varies.
    Expected<> check();

    /// False: a register that must be read for the feature has a length that the camera may change,
    /// so that nothing bounds the memory it takes.
    bool lengths_are_constant(const std::string& feature);

 private:
    struct Feature {
        std::vector<std::string> parts;  ///< what must be known first
        std::vector<std::string> lengths;
        std::string constant;  ///< value of an integer that has no register
    };
    struct Cost {
        std::uint64_t steps = 1;
        unsigned depth = 1;
        bool constant_lengths = true;
    };

    void add(ArvDomNode* node, const std::string& owner);
    void add_feature(ArvDomNode* node, const std::string& owner);
    void add_property(const std::string& owner, ArvDomNode* property);
    Expected<bool> has_constant_lengths(const std::string& name, const Feature& feature) const;
    Expected<Cost> cost(const std::string& name);

    std::map<std::string, Feature> features_;
    std::map<std::string, Cost> costs_;
    std::vector<std::string> offsets_;  ///< features that are offsets of an index
    unsigned depth_ = 0;
    unsigned structures_ = 0;
};

/// Aravis does not expose the attribute that makes an index depend on another feature. This turns
/// it into an element that DescriptionGraph finds; only for a description that is parsed for a
/// check.
std::string expose_index_offsets(const std::string& text);

}  // namespace versavis::daemon

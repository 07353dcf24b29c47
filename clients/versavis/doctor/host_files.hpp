// SPDX-License-Identifier: BSD-3-Clause
// Reads what the kernel says in /proc and /sys, and what is installed; tests put a tree of their
// own in place of the root.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace versavis::client {

/// The number that a text begins with; none: it begins with something else.
std::optional<std::int64_t> number_in(const std::string& text);

class HostFiles {
 public:
    explicit HostFiles(std::filesystem::path root = "/") : root_(std::move(root)) {}

    /// `absolute`, below the root.
    std::filesystem::path path(const std::string& absolute) const;

    /// Without white space at its end. None: it cannot be read.
    std::optional<std::string> text(const std::string& absolute) const;
    std::optional<std::int64_t> number(const std::string& absolute) const;

    /// Names of what is in a folder, sorted; empty if it cannot be read.
    std::vector<std::string> list(const std::string& absolute) const;

    bool exists(const std::string& absolute) const;

    /// Processes of this name; the kernel keeps its first 15 bytes.
    std::vector<int> processes(const std::string& name) const;

 private:
    std::filesystem::path root_;
};

}  // namespace versavis::client

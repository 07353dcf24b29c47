// SPDX-License-Identifier: BSD-3-Clause
// The figures of one run, for the script that compares them.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

namespace versavis::test {

using Figures = std::vector<std::pair<std::string, double>>;

/// How many times the usual number of worlds is asked for; 1 without an argument.
inline unsigned effort_of(int argc, char** argv) {
    return argc < 2 ? 1 : static_cast<unsigned>(std::strtoul(argv[1], nullptr, 10));
}

inline void print_json(const Figures& figures) {
    std::string text;
    for (const auto& [name, value] : figures)
        text += fmt::format("{}\"{}\": {:.6g}", text.empty() ? "" : ", ", name, value);
    std::printf("{%s}\n", text.c_str());
}

}  // namespace versavis::test

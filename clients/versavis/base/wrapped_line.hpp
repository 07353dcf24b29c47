// SPDX-License-Identifier: BSD-3-Clause
// Text for a terminal of 80 columns.
#pragma once

#include <string>

namespace versavis::client {

inline constexpr std::size_t terminal_columns = 80;

/// In lines that fit, with an end; what follows the first is indented.
inline std::string wrapped(std::string line, std::size_t indent) {
    std::size_t begin = 0;
    while (line.size() - begin > terminal_columns) {
        std::size_t blank = line.rfind(' ', begin + terminal_columns);
        if (blank == std::string::npos || blank <= begin + indent)
            blank = line.find(' ', begin + terminal_columns);
        if (blank == std::string::npos) break;
        line.replace(blank, 1, "\n" + std::string(indent, ' '));
        begin = blank + 1;
    }
    return line + "\n";
}

}  // namespace versavis::client

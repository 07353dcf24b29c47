// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace versavis::client {

/// As text of an element in HTML or SVG.
inline std::string markup_text(const std::string& text) {
    std::string safe;
    for (const char c : text) {
        if (c == '&')
            safe += "&amp;";
        else if (c == '<')
            safe += "&lt;";
        else if (c == '>')
            safe += "&gt;";
        else
            safe += c;
    }
    return safe;
}

}  // namespace versavis::client

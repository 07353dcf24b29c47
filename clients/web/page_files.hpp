// SPDX-License-Identifier: BSD-3-Clause
// The files of the page, from clients/web/page, as they are.
#pragma once

#include <string_view>

namespace versavis::web {

extern const std::string_view page_html;
extern const std::string_view page_script;
extern const std::string_view page_style;
extern const std::string_view page_icon;

}  // namespace versavis::web

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace versavis::client {

/// The text of hardware/wiring.json.
extern const char* const wiring_table;

}  // namespace versavis::client

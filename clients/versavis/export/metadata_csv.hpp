// SPDX-License-Identifier: BSD-3-Clause
// All that an item's metadata say, as a row of CSV. Unknown values are empty.
#pragma once

#include <string>

#include "recording/recording.hpp"

namespace versavis::client {

/// The names of the columns; empty: items of this kind are no rows.
std::string csv_columns(ring::StreamKind kind);

/// Without the end of the line.
std::string csv_row(const RecordedItem& item);

}  // namespace versavis::client

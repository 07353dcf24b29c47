// SPDX-License-Identifier: BSD-3-Clause
// Writes all that a recording says, but for pixels: CSV for frames, samples and events, lines of
// JSON for the rest.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "export/selection.hpp"

namespace versavis::client {

/// One file for each stream, and gaps.csv. Returns what was written. Errors: no such stream, the
/// file is damaged, the disk is full, stopped.
Expected<std::vector<std::string>> export_csv(const Recording& recording,
                                              const std::vector<std::string>& streams,
                                              const std::filesystem::path& directory,
                                              const ExportWatch& watch);

}  // namespace versavis::client

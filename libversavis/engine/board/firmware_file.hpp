// SPDX-License-Identifier: BSD-3-Clause
// Where the firmware for the board is that belongs to the program that runs.
#pragma once

#include <filesystem>

namespace versavis::board {

/// share/versavis/versavis.uf2 beside the folder of the program; if that is not there, the one of
/// its build tree; if neither is, the first.
std::filesystem::path firmware_file();

}  // namespace versavis::board

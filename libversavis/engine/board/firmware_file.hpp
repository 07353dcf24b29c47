// SPDX-License-Identifier: BSD-3-Clause
// Where an installation keeps the firmware of its release for the board.
#pragma once

#include <filesystem>

namespace versavis::board {

/// share/versavis/versavis.uf2 beside the folder of the program that runs.
std::filesystem::path installed_firmware();

}  // namespace versavis::board

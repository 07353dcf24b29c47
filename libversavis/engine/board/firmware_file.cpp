// SPDX-License-Identifier: BSD-3-Clause
#include "engine/board/firmware_file.hpp"

namespace versavis::board {

std::filesystem::path firmware_file() {
    std::error_code error;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
    const auto prefix = program.parent_path().parent_path();
    const auto installed = prefix / "share/versavis/versavis.uf2";
    const auto built = prefix / "firmware/versavis.uf2";
    return !exists(installed, error) && exists(built, error) ? built : installed;
}

}  // namespace versavis::board

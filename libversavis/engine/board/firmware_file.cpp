// SPDX-License-Identifier: BSD-3-Clause
#include "engine/board/firmware_file.hpp"

namespace versavis::board {

std::filesystem::path installed_firmware() {
    std::error_code error;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
    return program.parent_path().parent_path() / "share/versavis/versavis.uf2";
}

}  // namespace versavis::board

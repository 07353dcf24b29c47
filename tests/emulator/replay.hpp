// SPDX-License-Identifier: BSD-3-Clause
// Runs a recorded life of the core again on the chip's instruction set, in the emulator.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace versavis::emulator {

/// In cycles of the core; those of the hardware's calls are not among them.
struct FunctionCost {
    std::string name;
    double self = 0;   ///< its own instructions
    double total = 0;  ///< with what it calls
    double calls = 0;
};

struct Replayed {
    std::vector<std::uint32_t> polls;  ///< cycles of each
    std::uint32_t stack = 0;           ///< most bytes
    std::string deepest;               ///< the function that took them
    std::uint32_t core = 0;            ///< bytes of the core's code and constants
    std::uint32_t library = 0;         ///< and of the compiler's and memory functions
    std::uint32_t board = 0;           ///< bytes of variables
    std::vector<FunctionCost> profile;
};

/// By what the target `emulator` builds. Throws what the emulator says when the core does not ask
/// for exactly what was recorded.
Replayed replay(const std::vector<std::uint32_t>& recording, bool with_profile = false);

}  // namespace versavis::emulator

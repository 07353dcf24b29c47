// SPDX-License-Identifier: BSD-3-Clause
// The emulator's end of a recording: it checks each call, and answers it from the recording.
#pragma once

#include <cstdint>
#include <type_traits>

namespace versavis::firmware::replay {

/// Words where the chip has nothing; firmware/emulator/recording.mjs is behind them.
struct Window {
    volatile std::uint32_t name;           ///< written: address of the text
    volatile std::uint32_t argument;       ///< written, one after the other
    volatile std::uint32_t end_arguments;  ///< written: the call is complete, and is checked
    volatile std::uint32_t result;         ///< read, one after the other
};

/// The linker script says where it lies.
extern "C" Window replay_window;

/// A tape that replays.
class Replayer {
 public:
    void begin(const char* name) { replay_window.name = reinterpret_cast<std::uintptr_t>(name); }
    void argument(std::uint32_t word) { replay_window.argument = word; }
    void end_arguments() { replay_window.end_arguments = 0; }
    std::uint32_t result(std::uint32_t) { return replay_window.result; }
    template <class Result, class Real>
    Result perform(Real) {
        if constexpr (!std::is_void_v<Result>) return Result{};
    }
};

}  // namespace versavis::firmware::replay

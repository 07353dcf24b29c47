// SPDX-License-Identifier: BSD-3-Clause
// Lives the recorded life of a board again, on the chip's instruction set.
#include <new>

#include "../taped_hal.hpp"
#include "board.hpp"
#include "window.hpp"

namespace versavis::firmware::replay {

extern "C" {

/// The linker reports its size, which is that of the board.
alignas(Board) unsigned char board_storage[sizeof(Board)];

void replay_main() {
    Replayer tape;
    TapedHal hal(tape);
    const Identity identity = taped_value<Identity>(tape, "identity");
    const PortFacts facts = taped_value<PortFacts>(tape, "facts");
    auto& board = *new (board_storage) Board(hal.hal(facts), identity);
    Nanoseconds next_wake = never;
    while ((taped_poll(tape, next_wake) & poll_again) != 0) {
        board.poll();
        next_wake = board.next_wake();
    }
}
}

}  // namespace versavis::firmware::replay

// SPDX-License-Identifier: BSD-3-Clause
// Prints at each build how much static memory the core takes: it has no other.
#include <cstdio>

#include "board.hpp"

using namespace versavis::firmware;

int main() {
    const auto kibibytes = [](std::size_t bytes) { return static_cast<double>(bytes) / 1024; };
    std::printf(
        "firmware core: %.1f KiB of static memory (messages for the host %.1f, cameras %.1f, IMUs "
        "%.1f)\n",
        kibibytes(sizeof(Board)), kibibytes(sizeof(Transmitter)),
        kibibytes(4 * sizeof(CameraChannel)), kibibytes(sizeof(SpiImu) + sizeof(Vn100)));
    static_assert(sizeof(Board) <= 64 * 1024,
                  "an RP2040 port has 128 KiB, and needs half of it for itself");
}

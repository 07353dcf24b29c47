// SPDX-License-Identifier: BSD-3-Clause
// Any lines as evidence of a pairing, which is done again.
#include <sstream>

#include "fuzz.hpp"
#include "pairing/pair_replay.hpp"

using namespace versavis::client;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::istringstream recording(std::string(data, data + size));
    std::ostringstream decisions;
    if (const auto summary = replay_pairing(recording, &decisions))
        static_cast<void>(to_text(*summary, true));
    return 0;
}

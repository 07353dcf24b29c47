// SPDX-License-Identifier: BSD-3-Clause
// Any text as the GenICam description of a camera, as the probe process checks it.
#include "camera/description_check.hpp"
#include "fuzz.hpp"

using namespace versavis::daemon;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    // Not zipped: Aravis trusts the sizes in an archive, for which the probe is a process apart.
    static_cast<void>(check_description({{data, data + size}, false}));
    static_cast<void>(parse_description_url({data, data + size}));
    return 0;
}

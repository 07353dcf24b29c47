// SPDX-License-Identifier: BSD-3-Clause
// Any text as configuration file, and what the service and the board would make of it.
#include "fuzz.hpp"
#include "settings/board_configuration.hpp"
#include "settings/configuration_document.hpp"

using namespace versavis;
using namespace versavis::daemon;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const fuzz::MemoryFile file({data, size});
    const auto document = ConfigurationDocument::load(file.path());
    if (!document) return 0;
    static_cast<void>(board_configuration(document->configuration));
    for (const CameraConfiguration& camera : document->configuration.cameras)
        static_cast<void>(document->with(camera.name, {{"rate_hz", "10"}, {"Gain", "\"a\""}}));
    static_cast<void>(document->with_live_keys_of(document->root));
    return 0;
}

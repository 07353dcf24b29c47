// SPDX-License-Identifier: BSD-3-Clause
// The GenICam description of a camera as it lies in the camera: where, and its bytes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "camera/gvcp.hpp"

namespace versavis::daemon {

/// The largest description that is read.
inline constexpr std::uint64_t largest_description = 8 << 20;

/// Of GigE Vision.
struct DescriptionPlace {
    std::uint32_t address = 0;
    std::size_t size = 0;
    bool zipped = false;
};

struct Description {
    std::vector<std::uint8_t> bytes;
    bool zipped = false;
};

/// From a camera's own words, "Local:name.zip;address;size". Errors: it is elsewhere, or too large.
Expected<DescriptionPlace> parse_description_url(const std::string& url);

/// Reads that of a GigE Vision camera without taking control of the camera.
Expected<Description> read_description(GvcpClient& camera, const Cancelled& cancelled);

/// SHA-256 as text: what is known by it was looked at before.
std::string hash_of(const Description& description);

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
// One frame of a stream as a PNG file.
#pragma once

#include <string>

#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

/// Waits for the next frame and writes it. Supports 8 and 16 bit grey, RGB and BGR; Bayer patterns
/// are written as grey. Errors: no such stream, no frame in time, a pixel format that is not
/// supported, the file cannot be written.
Expected<std::string> snapshot(const std::string& instance, const std::string& stream,
                               const std::string& path, Duration timeout);

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
// Writes PNG files in parallel, one per processor. Called by one thread.
#pragma once

#include <cstddef>
#include <deque>
#include <future>
#include <string>
#include <vector>

#include "export/export_image.hpp"

namespace versavis::client {

class PngEncoderPool {
 public:
    PngEncoderPool();

    /// Waits when all are busy. Errors: of files that were given before.
    Expected<> write(const std::string& path, const ExportFormat& format, std::uint32_t width,
                     std::uint32_t height, std::vector<std::byte> pixels);

    /// Waits for all. Error: of the first that failed.
    Expected<> finish();

 private:
    Expected<> wait_for_one();

    std::size_t limit_;
    std::deque<std::future<Expected<>>> busy_;
};

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "export/png_encoder_pool.hpp"

#include <algorithm>
#include <thread>
#include <utility>

namespace versavis::client {

PngEncoderPool::PngEncoderPool() : limit_(std::max(1U, std::thread::hardware_concurrency())) {}

Expected<> PngEncoderPool::write(const std::string& path, const ExportFormat& format,
                                 std::uint32_t width, std::uint32_t height,
                                 std::vector<std::byte> pixels) {
    if (busy_.size() >= limit_)
        if (auto done = wait_for_one(); !done) return done;
    // Without a policy, finish() does the work if no thread can be started.
    busy_.push_back(std::async([=, pixels = std::move(pixels)] {
        return write_png(path, format, width, height, pixels);
    }));
    return {};
}

Expected<> PngEncoderPool::wait_for_one() {
    auto result = busy_.front().get();
    busy_.pop_front();
    return result;
}

Expected<> PngEncoderPool::finish() {
    Expected<> result;
    while (!busy_.empty())
        if (auto done = wait_for_one(); !done && result) result = done;
    return result;
}

}  // namespace versavis::client

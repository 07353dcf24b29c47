// SPDX-License-Identifier: BSD-3-Clause
#include "export/png_crew.hpp"

#include <algorithm>
#include <thread>
#include <utility>

namespace versavis::client {

PngCrew::PngCrew() : limit_(std::max(1U, std::thread::hardware_concurrency())) {}

Expected<> PngCrew::write(const std::string& path, const ExportFormat& format, std::uint32_t width,
                          std::uint32_t height, std::vector<std::byte> pixels) {
    if (busy_.size() >= limit_)
        if (auto done = wait_for_one(); !done) return done;
    // Without a policy it is done by finish() when there is no thread to be had.
    busy_.push_back(std::async([=, pixels = std::move(pixels)] {
        return write_png(path, format, width, height, pixels);
    }));
    return {};
}

Expected<> PngCrew::wait_for_one() {
    auto result = busy_.front().get();
    busy_.pop_front();
    return result;
}

Expected<> PngCrew::finish() {
    Expected<> result;
    while (!busy_.empty())
        if (auto done = wait_for_one(); !done && result) result = done;
    return result;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
// Packs frames as PNG on all processors, and hands them out in the order in which they came.
#pragma once

#include <cstddef>
#include <deque>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "record/png_encoder.hpp"
#include "versavis/ring_reader.hpp"

namespace versavis::client {

struct PackedFrame {
    std::string stream;
    ring::Item item;
    std::vector<std::byte> png;
};

class FramePacker {
 public:
    FramePacker();

    /// As many frames as it takes are under way: take() one first.
    bool full() const { return frames_.size() >= limit_; }

    /// Copies the pixels out of the ring. False: they were overwritten, nothing was taken.
    bool push(const std::string& stream, ring::Item item);

    /// The oldest frame; none if it is not ready, unless `wait`, or if there is none.
    std::optional<PackedFrame> take(bool wait);

 private:
    struct UnderWay {
        std::string stream;
        ring::Item item;
        std::future<std::vector<std::byte>> png;
    };

    std::size_t limit_;
    std::deque<UnderWay> frames_;
};

}  // namespace versavis::client

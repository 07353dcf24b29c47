// SPDX-License-Identifier: BSD-3-Clause
#include "record/frame_packer.hpp"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

namespace versavis::client {

namespace {

/// Frames under way for each processor. Half: one waits while the next is copied. Twice: so much
/// more memory, and a burst is borne a little longer.
constexpr std::size_t frames_for_each = 4;

}  // namespace

FramePacker::FramePacker()
    : limit_(frames_for_each * std::max(1U, std::thread::hardware_concurrency())) {}

bool FramePacker::push(const std::string& stream, ring::Item item) {
    std::vector<std::byte> pixels(item.payload.size());
    if (!item.payload.copy_to(pixels.data())) return false;
    const auto frame = unpack<FrameMetadata>(item.metadata);
    auto png = std::async(std::launch::async, [frame, pixels = std::move(pixels)] {
        return encode_png(frame, pixels);
    });
    frames_.push_back({stream, std::move(item), std::move(png)});
    return true;
}

std::optional<PackedFrame> FramePacker::take(bool wait) {
    if (frames_.empty()) return std::nullopt;
    UnderWay& first = frames_.front();
    const bool ready = first.png.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    if (!ready && !wait) return std::nullopt;
    PackedFrame frame{std::move(first.stream), std::move(first.item), first.png.get()};
    frames_.pop_front();
    return frame;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "record/frame_packer.hpp"

#include <algorithm>
#include <chrono>
#include <memory>
#include <system_error>
#include <thread>
#include <utility>

namespace versavis::client {

namespace {

/// Frames under way for each processor.
constexpr std::size_t frames_for_each = 4;

}  // namespace

FramePacker::FramePacker()
    : limit_(frames_for_each * std::max(1U, std::thread::hardware_concurrency())) {}

bool FramePacker::push(const std::string& stream, ring::Item item) {
    const auto pixels = std::make_shared<std::vector<std::byte>>(item.payload.size());
    if (!item.payload.copy_to(pixels->data())) return false;
    const auto frame = unpack<FrameMetadata>(item.metadata);
    const auto pack = [frame, pixels] { return encode_png(frame, *pixels); };
    std::future<std::vector<std::byte>> png;
    try {
        png = std::async(std::launch::async, pack);
    } catch (const std::system_error&) {  // no more threads are to be had: take() packs it
        png = std::async(std::launch::deferred, pack);
    }
    frames_.push_back({stream, std::move(item), std::move(png)});
    return true;
}

std::optional<PackedFrame> FramePacker::take(bool wait) {
    if (frames_.empty()) return std::nullopt;
    UnderWay& first = frames_.front();
    const bool ready = first.png.wait_for(std::chrono::seconds(0)) != std::future_status::timeout;
    if (!ready && !wait) return std::nullopt;
    PackedFrame frame{std::move(first.stream), std::move(first.item), first.png.get()};
    frames_.pop_front();
    return frame;
}

}  // namespace versavis::client

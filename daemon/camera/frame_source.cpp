// SPDX-License-Identifier: BSD-3-Clause
#include "camera/frame_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::daemon {

namespace {

/// Least time that packets which were lost may take to come again.
constexpr Duration shortest_retention = milliseconds(100);

/// From the end of the exposure to the trailer, for a large sensor.
constexpr Duration readout = milliseconds(50);

}  // namespace

Duration frame_retention(const CameraConfiguration& configuration) {
    const Duration exposure{std::llround(configuration.max_exposure_us * 1e3)};
    return std::max(shortest_retention, exposure + readout);
}

/// Bytes from row to row, by the pixel format; by the size for formats that do not say.
std::uint32_t FrameSource::stride(const Received& frame) const {
    const std::uint32_t bits = frame.pixel_format >> 16U & 0xFFU;
    if (bits == 0)
        return frame.height == 0 ? 0 : static_cast<std::uint32_t>(setup_.payload / frame.height);
    return (frame.width * bits + 7) / 8 + frame.padding_x;
}

/// That all has come is no proof of size: a frame may be cut, or fill only half of the buffer.
EventReason FrameSource::refusal(const Received& frame) const {
    if (!frame.complete) return EventReason::frame_incomplete;
    const bool like_the_first = width_ == 0 || (frame.width == width_ && frame.height == height_);
    const bool whole = frame.size == setup_.payload && frame.width > 0 && frame.height > 0 &&
                       like_the_first && std::uint64_t{stride(frame)} * frame.height <= frame.size;
    return whole ? EventReason::none : EventReason::wrong_size;
}

/// One frame may be cut; two that are alike have another size than was announced.
void FrameSource::note_size(const Received& frame, EventReason refused) {
    if (refused == EventReason::frame_incomplete) return;
    const std::uint64_t now = refused == EventReason::none
                                  ? 0
                                  : std::uint64_t{static_cast<std::uint16_t>(frame.width)} << 48U |
                                        std::uint64_t{static_cast<std::uint16_t>(frame.height)}
                                            << 32U |
                                        (frame.size & 0xFFFFFFFFU);
    if (now == 0 || now == last_mismatch_) changed_ = now;
    last_mismatch_ = now;
}

std::string FrameSource::changed() const {
    const std::uint64_t now = changed_;
    return now == 0
               ? ""
               : fmt::format("frames are {} x {} pixels in {} bytes; announced were {} bytes",
                             now >> 48U, now >> 32U & 0xFFFFU, now & 0xFFFFFFFFU, setup_.payload);
}

void FrameSource::note_clock(CameraTime stamp) {
    const bool equal = setup_.has_clock && stamp.ns == stamp_.ns;
    equal_stamps_ = equal ? equal_stamps_ + 1 : 0;
    stamp_ = stamp;
}

bool FrameSource::hand_over(const Received& frame) {
    const EventReason refused = refusal(frame);
    note_size(frame, refused);
    ++taken_;
    if (refused != EventReason::none) {
        pipeline_.abandon(frame.slot, refused, frame.block_id);
        return false;
    }
    pairing::Arrival arrival;
    arrival.slot = frame.slot;
    arrival.block_id = frame.block_id;
    if (setup_.has_clock) arrival.camera_time = frame.camera_time;
    note_clock(arrival.camera_time);
    arrival.arrived = frame.arrived;
    arrival.exposure = frame.exposure;
    arrival.sensor.gain = frame.gain;
    arrival.width = width_ = frame.width;
    arrival.height = height_ = frame.height;
    arrival.pixel_format = frame.pixel_format;
    arrival.stride = stride(frame);
    arrival.size = arrival.stride * arrival.height;  // without what follows the image
    if (meter_ != nullptr)
        meter_->take({{frame.pixels, frame.size}, frame.width, frame.height, frame.pixel_format},
                     frame.arrived);
    pipeline_.add(arrival);
    return true;
}

}  // namespace versavis::daemon

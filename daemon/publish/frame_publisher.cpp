// SPDX-License-Identifier: BSD-3-Clause
#include "frame_publisher.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/rounding.hpp"
#include "exposure_completion.hpp"
#include "total_sigma.hpp"

namespace versavis::daemon {

namespace {

/// Least descriptors of a ring: a reader that sleeps still learns how many frames it lost.
constexpr std::uint32_t descriptor_floor = 64;

/// What a clock that follows PTP may be off its master without saying so, with hardware stamps.
/// Half: some switches add more. Twice: sigma is twice what good networks keep to.
constexpr Duration closest_follower = microseconds(1);

FrameMetadata describe(const pairing::Exposure& exposure) {
    FrameMetadata metadata{};
    metadata.trigger = exposure.trigger;
    metadata.set_tick(exposure.tick);
    metadata.board_time = middle(exposure.start, exposure.end);
    if (exposure.kind == StampKind::measured_middle || exposure.length_by_camera)
        metadata.exposure = exposure.end - exposure.start;
    metadata.delay_ns = static_cast<std::int32_t>(exposure.delay.ns);
    metadata.flags = static_cast<std::uint32_t>(exposure.kind) |
                     (exposure.length_by_camera ? flag_camera_length : 0U);
    return metadata;
}

}  // namespace

FramePublisher::FramePublisher(const CameraConfiguration& configuration)
    : name_(configuration.name),
      slots_(configuration.slots),
      kept_(configuration.history ? 0 : ring::newest_kept) {}

Expected<std::optional<ring::Writer>> FramePublisher::make_ring(const ring::Place& place,
                                                                std::uint64_t payload_size) const {
    if (ring_ && ring_->slot_size() >= payload_size) return std::nullopt;
    ring::Shape shape;
    shape.name = name_;
    shape.kind = ring::StreamKind::frames;
    shape.slot_count = slots_;
    shape.slot_size = payload_size;
    shape.kept = kept_;
    shape.descriptor_count = kept_ != 0 ? ring::descriptors_of_kept(kept_)
                                        : std::bit_ceil(std::max(2 * slots_, descriptor_floor));
    auto ring = ring::Writer::create(place, shape);
    if (!ring) return Unexpected(ring.error());
    return std::move(*ring);
}

bool FramePublisher::publish_proved(const pairing::Arrival& arrival,
                                    const pairing::Exposure& exposure, const clock::Stamp& middle) {
    FrameMetadata metadata = describe(exposure);
    metadata.sigma_ns =
        total_sigma_ns(middle.sigma_ns, kind_sigma(exposure, arrival.arrived - middle.host));
    return publish(arrival, middle, metadata);
}

void FramePublisher::publish_guessed(const pairing::Arrival& arrival,
                                     const pairing::Exposure& exposure,
                                     const clock::Stamp& middle) {
    FrameMetadata metadata = describe(exposure);
    metadata.flags |= flag_suspect;
    metadata.sigma_ns = sigma_unknown;
    publish(arrival, middle, metadata);
}

bool FramePublisher::publish_by_ptp(const pairing::Arrival& arrival, const PtpExposure& exposure,
                                    const clock::Stamp& middle, Duration offset) {
    FrameMetadata metadata{};
    metadata.trigger = exposure.trigger;
    metadata.set_tick(exposure.tick);
    metadata.flags = static_cast<std::uint32_t>(StampKind::camera_ptp);
    if (exposure.length_known) {
        metadata.exposure = exposure.length;
        metadata.flags |= flag_camera_length;
    }
    const double others = std::hypot(offset.ns, closest_follower.ns, exposure.middle_sigma.ns);
    metadata.sigma_ns = total_sigma_ns(middle.sigma_ns, rounded(others));
    return publish(arrival, middle, metadata);
}

void FramePublisher::publish_arrived(const pairing::Arrival& arrival, const clock::Stamp& arrived,
                                     bool suspect) {
    FrameMetadata metadata{};
    metadata.flags = static_cast<std::uint32_t>(StampKind::arrival) | (suspect ? flag_suspect : 0U);
    metadata.sigma_ns = sigma_unknown;
    publish(arrival, arrived, metadata);
}

bool FramePublisher::publish(const pairing::Arrival& arrival, const clock::Stamp& stamp,
                             FrameMetadata metadata) {
    metadata.block_id = arrival.block_id;
    metadata.host_time = stamp.host;
    metadata.arrival = arrival.arrived;
    metadata.camera_time = arrival.camera_time;
    metadata.width = arrival.width;
    metadata.height = arrival.height;
    metadata.stride = arrival.stride;
    metadata.pixel_format = arrival.pixel_format;
    metadata.epoch = stamp.epoch;
    const bool suspect = (metadata.flags & flag_suspect) != 0;
    const auto guarded = guard_.guard(stamp, metadata.sigma_ns, suspect);
    if (!guarded) return false;
    metadata.flags |= guarded->flags;
    metadata.sigma_ns = guarded->sigma_ns;
    ring_->publish(arrival.slot, arrival.size, guarded->time, pack(metadata), pack(arrival.sensor));
    return true;
}

void FramePublisher::heartbeat(HostTime now) {
    if (ring_) ring_->heartbeat(now);
}

}  // namespace versavis::daemon

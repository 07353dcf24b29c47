// SPDX-License-Identifier: BSD-3-Clause
#include "status_publisher.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/log.hpp"

namespace versavis::daemon {

namespace {

/// Between documents.
constexpr Duration interval = milliseconds(500);

/// Room for one document at first: some 30 cameras and IMUs.
constexpr std::uint64_t first_document_size = 64 * 1024;

/// Documents kept: a reader may take four seconds over one.
constexpr std::uint32_t slots = 8;

/// Uncertainty of "now" as a stamp. To readers it only means that this is no measurement.
constexpr Duration stamp_sigma = microseconds(1);

Expected<ring::Writer> make_ring(const ring::Place& place, std::uint64_t size) {
    return ring::Writer::create(place, {"status", ring::StreamKind::status, slots, slots, size});
}

}  // namespace

Expected<StatusPublisher> StatusPublisher::create(const ring::Place& place) {
    auto ring = make_ring(place, first_document_size);
    if (!ring) return Unexpected(ring.error());
    return StatusPublisher(place, std::move(*ring));
}

/// False: there is no room for a document of this size, and none can be made.
bool StatusPublisher::make_room(std::size_t size) {
    if (size <= ring_.slot_size()) return true;
    auto larger = make_ring(place_, 2 * size);
    if (!std::exchange(too_small_, !larger) && too_small_)
        log(LogLevel::error, "status", "{}", larger.error().message());
    if (larger) ring_ = std::move(*larger);
    return larger.has_value();
}

void StatusPublisher::publish(Status status, clock::Translator& translator) {
    next_ = status.now + interval;
    status.streams.push_back({"status", "status", ring_.head()});
    for (StreamStatus& stream : status.streams) stream.rate_hz = rate_hz(stream, status.now);
    watch_.examine(status);
    summary_ = daemon::summary(status);
    const std::string document = to_json(status);
    if (!make_room(document.size())) return;
    const auto slot = ring_.acquire();
    if (!slot) return;
    std::memcpy(ring_.slot_data(*slot), document.data(), document.size());
    const clock::Stamp stamp = translator.translate(status.now, stamp_sigma);
    ring_.publish(*slot, static_cast<std::uint32_t>(document.size()), stamp.output, {});
}

double StatusPublisher::rate_hz(const StreamStatus& stream, HostTime now) {
    auto& [before, at] = last_items_[stream.name];
    const double seconds = static_cast<double>((now - at).ns) * 1e-9;
    const auto items = static_cast<double>(stream.items - std::min(stream.items, before));
    const double rate = at.ns == 0 ? 0 : items / seconds;
    before = stream.items;
    at = now;
    return rate;
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "stream/status_publisher.hpp"

#include <algorithm>
#include <cstring>

namespace versavis::daemon {

namespace {

/// Between documents. At half, a status costs twice the CPU; at twice, trouble shows a second late.
constexpr Duration interval = milliseconds(500);

/// Room for one document: some 30 cameras and IMUs. At half, large rigs do not fit; at twice, it
/// takes 512 KiB more.
constexpr std::uint64_t document_size = 64 * 1024;

/// Documents kept: a reader may take four seconds over one. At half, it has two; at twice, eight.
constexpr std::uint32_t slots = 8;

/// Uncertainty of "now" as a stamp. It tells readers no more than that this is no measurement.
constexpr Duration stamp_sigma = microseconds(1);

}  // namespace

Expected<StatusPublisher> StatusPublisher::create(const std::filesystem::path& directory) {
    auto ring = ring::Writer::create(
        directory, {"status", ring::StreamKind::status, slots, slots, document_size});
    if (!ring) return Unexpected(ring.error());
    return StatusPublisher(std::move(*ring));
}

void StatusPublisher::publish(Status status, clock::Translator& translator) {
    next_ = status.now + interval;
    status.streams.push_back({"status", "status", ring_.head()});
    for (StreamStatus& stream : status.streams) stream.rate_hz = rate_hz(stream, status.now);
    watch_.examine(status);
    health_ = daemon::health(status);
    const std::string document = to_json(status);
    const auto slot = ring_.acquire();
    if (!slot) return;
    const std::size_t size = std::min<std::size_t>(document.size(), ring_.slot_size());
    std::memcpy(ring_.slot_data(*slot), document.data(), size);
    const clock::Stamp stamp = translator.translate(status.now, stamp_sigma);
    ring_.publish(*slot, static_cast<std::uint32_t>(size), stamp.output, {});
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

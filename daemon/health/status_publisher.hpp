// SPDX-License-Identifier: BSD-3-Clause
// The ring of status documents: one twice a second, with rates and health.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>

#include "engine/clock/translator.hpp"
#include "engine/ring/writer.hpp"
#include "health_watch.hpp"
#include "status.hpp"

namespace versavis::daemon {

/// Not thread-safe.
class StatusPublisher {
 public:
    /// Error: the ring cannot be made.
    static Expected<StatusPublisher> create(const ring::Place& place);

    bool due(HostTime now) const { return now >= next_; }

    /// Adds the status stream itself, the rates of all streams and the health of all devices, and
    /// publishes the document whole: in a larger ring, if need be.
    void publish(Status status, clock::Translator& translator);
    void heartbeat(HostTime now) { ring_.heartbeat(now); }

    /// As of the last document.
    const Summary& summary() const { return summary_; }

 private:
    StatusPublisher(ring::Place place, ring::Writer ring)
        : place_(std::move(place)), ring_(std::move(ring)) {}

    bool make_room(std::size_t size);
    double rate_hz(const StreamStatus& stream, HostTime now);

    ring::Place place_;
    ring::Writer ring_;
    bool too_small_ = false;  ///< the ring, and there is no room for a larger one
    HostTime next_;
    std::map<std::string, std::pair<std::uint64_t, HostTime>> last_items_;
    HealthWatch watch_;
    Summary summary_;
};

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "engine/ring/foreign_segments.hpp"

#include <chrono>
#include <cstdint>
#include <system_error>
#include <thread>
#include <utility>

#include "client/deadline.hpp"
#include "client/process.hpp"
#include "versavis/time.hpp"

namespace versavis::ring {

namespace {

/// Writers update their heartbeat once a second at least. If lower, a living writer is taken for
/// dead, and two serve one instance; if higher, a service starts later where a dead one's container
/// left rings.
constexpr Duration longest_pause = milliseconds(1100);

constexpr auto between_looks = std::chrono::milliseconds(10);

std::int64_t heartbeat_of(const Mapping& mapping) {
    return mapping.header().heartbeat_ns.load(std::memory_order_relaxed);
}

/// A heartbeat that is old by this process's own clock has stopped.
bool may_live(const Mapping& mapping) {
    const auto state = mapping.header().state.load(std::memory_order_relaxed);
    if (state != static_cast<std::uint32_t>(WriterState::live)) return false;
    return mapping.constants().time_namespace != own_namespaces().time ||
           Pulse().beats({heartbeat_of(mapping)}, host_now());
}

/// A writer that may live, and its last heartbeat.
struct Doubtful {
    ForeignSegment* segment;
    std::int64_t heartbeat_ns;
};

void await_heartbeats(std::vector<Doubtful> doubtful) {
    const HostTime deadline = deadline_after(longest_pause);
    while (!doubtful.empty() && !is_over(deadline)) {
        std::this_thread::sleep_for(between_looks);
        std::erase_if(doubtful, [](const Doubtful& one) {
            one.segment->alive = heartbeat_of(one.segment->mapping) != one.heartbeat_ns;
            return one.segment->alive;
        });
    }
}

}  // namespace

std::vector<ForeignSegment> foreign_segments(
    const std::filesystem::path& directory,
    const std::function<Expected<Mapping>(const std::filesystem::path&)>& open) {
    std::vector<ForeignSegment> found;
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(directory, error)) {
        auto mapping = open(entry.path());
        if (mapping && !is_own(mapping->constants()))
            found.push_back({entry.path(), std::move(*mapping)});
    }
    std::vector<Doubtful> doubtful;
    for (ForeignSegment& segment : found) {
        const Liveness seen = liveness(segment.mapping.constants());
        segment.alive = seen == Liveness::alive;
        if (seen == Liveness::unknown && may_live(segment.mapping))
            doubtful.push_back({&segment, heartbeat_of(segment.mapping)});
    }
    await_heartbeats(std::move(doubtful));
    return found;
}

}  // namespace versavis::ring

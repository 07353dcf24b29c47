// SPDX-License-Identifier: BSD-3-Clause
#include "evidence_recorder.hpp"

#include "settings/configuration.hpp"

namespace versavis::daemon {

namespace {

/// Items that the ring keeps: 2 MiB, three minutes of a camera at 30 Hz.
constexpr std::uint32_t evidence_items = 16384;

}  // namespace

Expected<ring::Writer> EvidenceRecorder::make_ring(const ring::Place& place,
                                                   const std::string& camera) {
    return ring::Writer::create(
        place, {camera + evidence_suffix, ring::StreamKind::evidence, evidence_items});
}

void EvidenceRecorder::record(const pairing::Evidence& evidence) {
    if (!ring_) return;
    const clock::Stamp stamp = translator_.translate(host_now(), {});
    ring_->publish(stamp.output, pack(pairing::to_metadata(evidence)));
}

void EvidenceRecorder::heartbeat(HostTime now) {
    if (ring_) ring_->heartbeat(now);
}

}  // namespace versavis::daemon

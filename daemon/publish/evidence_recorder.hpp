// SPDX-License-Identifier: BSD-3-Clause
// The ring of all that a camera's pairing gets, so that the pairing can be done again elsewhere.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "engine/clock/translator.hpp"
#include "engine/pairing/recording.hpp"
#include "engine/ring/writer.hpp"

namespace versavis::daemon {

/// Not thread-safe.
class EvidenceRecorder {
 public:
    explicit EvidenceRecorder(clock::Translator& translator) : translator_(translator) {}

    /// Takes long. Error: the ring cannot be made.
    static Expected<ring::Writer> make_ring(const ring::Place& place, const std::string& camera);

    /// Nothing is recorded before.
    void use(ring::Writer ring) { ring_.emplace(std::move(ring)); }
    bool recording() const { return ring_.has_value(); }

    void record(const pairing::Evidence& evidence);
    void heartbeat(HostTime now);
    std::uint64_t items() const { return ring_ ? ring_->head() : 0; }

 private:
    clock::Translator& translator_;
    std::optional<ring::Writer> ring_;
};

}  // namespace versavis::daemon

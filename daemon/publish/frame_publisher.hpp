// SPDX-License-Identifier: BSD-3-Clause
// The ring of one camera's frames, and the metadata that each frame is published with.
#pragma once

#include <filesystem>
#include <optional>
#include <utility>

#include "engine/clock/translator.hpp"
#include "engine/pairing/evidence.hpp"
#include "engine/ring/writer.hpp"
#include "ptp_exposure.hpp"
#include "settings/configuration.hpp"
#include "stamp_guard.hpp"

namespace versavis::daemon {

/// Not thread-safe. Slots are those of Writer; none can be had before use().
class FramePublisher {
 public:
    explicit FramePublisher(const CameraConfiguration& configuration);

    /// A ring for payloads of that size; none: the one in use has room. Takes long, and changes
    /// nothing here. Error: the ring cannot be made.
    Expected<std::optional<ring::Writer>> make_ring(const ring::Place& place,
                                                    std::uint64_t payload_size) const;

    /// Slots that were acquired are void. Returns the ring before, which takes long to end.
    std::optional<ring::Writer> use(ring::Writer ring) {
        return std::exchange(ring_, std::move(ring));
    }

    std::optional<std::uint32_t> acquire() { return ring_->acquire(); }
    std::byte* slot_data(std::uint32_t slot) { return ring_->slot_data(slot); }
    void abandon(std::uint32_t slot) { ring_->abandon(slot); }

    /// A frame and its exposure; `middle` is the stamp of the middle of that exposure. False: it
    /// cannot follow the frame before in this epoch, and the slot is still the caller's.
    bool publish_proved(const pairing::Arrival& arrival, const pairing::Exposure& exposure,
                        const clock::Stamp& middle);

    /// The same, but that the frame is of this exposure is a guess: its sigma is unknown.
    void publish_guessed(const pairing::Arrival& arrival, const pairing::Exposure& exposure,
                         const clock::Stamp& middle);

    /// A frame of a camera whose clock follows PTP, as far off its master as `offset`.
    bool publish_by_ptp(const pairing::Arrival& arrival, const PtpExposure& exposure,
                        const clock::Stamp& middle, Duration offset);

    /// A frame of which nothing but its arrival is known. `suspect`: it was triggered all the same.
    void publish_arrived(const pairing::Arrival& arrival, const clock::Stamp& arrived,
                         bool suspect);

    /// Frames were refused in a row: the one before was wrong.
    bool stuck() const { return guard_.stuck(); }

    void heartbeat(HostTime now);
    std::uint64_t items() const { return ring_ ? ring_->head() : 0; }

 private:
    bool publish(const pairing::Arrival& arrival, const clock::Stamp& stamp,
                 FrameMetadata metadata);

    std::string name_;
    std::uint32_t slots_;
    std::uint32_t kept_;  ///< newest frames; 0: all
    std::optional<ring::Writer> ring_;
    StampGuard guard_;
};

}  // namespace versavis::daemon

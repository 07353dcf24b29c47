// SPDX-License-Identifier: BSD-3-Clause
// From arrivals and exposures of one camera to stamped frames in its ring.
#pragma once

#include <mutex>
#include <optional>
#include <string>

#include "configuration.hpp"
#include "event_journal.hpp"
#include "stamp_guard.hpp"
#include "versavis/clock/translator.hpp"
#include "versavis/pairing/pairing.hpp"
#include "versavis/ring/writer.hpp"

namespace versavis::daemon {

struct PipelineReport {
    pairing::State pairing = pairing::State::searching;
    std::uint64_t received = 0;    ///< complete frames
    std::uint64_t incomplete = 0;  ///< frames that lost packets on the way
    std::uint64_t published = 0;
    std::uint64_t frames_without_trigger = 0;
    std::uint64_t triggers = 0;
    std::uint64_t triggers_without_frame = 0;
    std::uint64_t unmeasured = 0;  ///< triggers whose exposure was not measured although its line is wired
    bool measured = true;          ///< the newest one was
    std::uint64_t locks = 0;
    std::uint64_t slips = 0;
    HostTime last_frame;
};

/// Thread-safe. Whoever completes a pair publishes it.
class CameraPipeline final : private pairing::Outcome {
 public:
    CameraPipeline(const CameraConfiguration& configuration, std::uint32_t index,
                   clock::Translator& translator, EventJournal& events);

    /// Makes the ring, or one with larger slots: called by the camera once it knows its payload. Slots are
    /// void then.
    Expected<> prepare(const std::filesystem::path& directory, std::uint64_t payload_size);

    std::optional<std::uint32_t> acquire();
    std::byte* slot_data(std::uint32_t slot);
    void abandon(std::uint32_t slot, EventReason reason, std::uint64_t block_id);

    /// A complete frame in an acquired slot; the slot is the pipeline's from here on.
    void add(const pairing::Arrival& arrival);
    void add(const wire::Exposure& record);

    /// Camera or board began a new life.
    void reset();

    /// Gives up what waited too long. True: the board should start this camera with its pattern, because
    /// nothing else can prove the pairing, or because no trigger came although it was asked to.
    bool advance(HostTime now);
    void start_requested(HostTime now);

    bool triggered() const { return configuration_.trigger == TriggerSource::board; }
    std::uint8_t board_mask() const { return static_cast<std::uint8_t>(1U << configuration_.output); }

    /// Triggers since the last frame.
    std::uint64_t unanswered_triggers();
    PipelineReport report();
    std::uint64_t items();

 private:
    void paired(const pairing::Arrival& arrival, const pairing::Exposure& exposure) override;
    void frame_unpaired(const pairing::Arrival& arrival, EventReason reason) override;
    void exposure_unpaired(const pairing::Exposure& exposure, EventReason reason) override;
    void locked(const pairing::Exposure& first) override;
    void slipped(const pairing::Arrival& at) override;

    pairing::Exposure complete(const wire::Exposure& record);
    static Duration kind_sigma(const pairing::Exposure& exposure, Duration to_arrival);
    void publish(const pairing::Arrival& arrival, const clock::Stamp& stamp, FrameMetadata metadata);
    void publish_free_run(const pairing::Arrival& arrival);
    void journal(EventKind kind, EventReason reason, std::int64_t value, std::optional<BoardTime> at = {});

    CameraConfiguration configuration_;
    std::uint32_t index_;
    clock::Translator& translator_;
    EventJournal& events_;

    std::mutex mutex_;
    std::optional<ring::Writer> ring_;
    pairing::Pairing pairing_;
    StampGuard guard_;
    Duration start_patience_;
    Duration last_exposure_;
    std::uint64_t unanswered_ = 0;
    HostTime last_trigger_;  ///< its record came, or it was asked for
    PipelineReport report_;
};

}  // namespace versavis::daemon

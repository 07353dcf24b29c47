// SPDX-License-Identifier: BSD-3-Clause
// From arrivals and exposures of one camera to stamped frames.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "answer_watch.hpp"
#include "base/log.hpp"
#include "camera_event.hpp"
#include "engine/clock/translator.hpp"
#include "engine/pairing/recording.hpp"
#include "event_lengths.hpp"
#include "plausibility/exposure_check.hpp"
#include "ptp_clocks.hpp"
#include "ptp_frames.hpp"
#include "publish/event_journal.hpp"
#include "publish/evidence_recorder.hpp"
#include "publish/exposure_completion.hpp"
#include "publish/frame_publisher.hpp"
#include "settings/configuration.hpp"
#include "start_watchdog.hpp"
#include "strobe_witness.hpp"

namespace versavis::daemon {

/// Reasons are counted by their number; those from here on are not.
constexpr std::size_t counted_reasons = 32;

struct PipelineReport {
    pairing::State pairing = pairing::State::searching;
    std::uint64_t received = 0;    ///< complete frames
    std::uint64_t incomplete = 0;  ///< frames that lost packets on the way
    std::uint64_t no_buffer = 0;   ///< frames that found no slot to go to
    std::uint64_t published = 0;
    std::uint64_t frames_without_trigger = 0;
    std::uint64_t triggers = 0;
    std::uint64_t records_doubted = 0;  ///< their witnesses contradict them: they were not used
    Duration doubted_exposure;          ///< of the newest one, if its length was doubted; else 0
    std::uint64_t triggers_without_frame = 0;
    std::uint64_t triggers_missed = 0;   ///< by the camera's own events
    bool ptp_lost = false;               ///< the same
    std::uint64_t actions_refused = 0;   ///< triggers by PTP time that the camera did not take ...
    std::uint16_t refusal = 0;           ///< ... and the newest GVCP status of one; 0: none
    std::optional<StrobeReport> strobe;  ///< none: the board does not see its exposures
    /// Triggers whose exposure was not measured although its line is wired.
    std::uint64_t unmeasured = 0;
    bool measured = true;       ///< the newest one was
    std::uint64_t suspect = 0;  ///< published although not proved
    std::uint64_t locks = 0;
    std::uint64_t slips = 0;
    pairing::Instant stamp_instant = pairing::Instant::unknown;  ///< by the camera
    std::array<std::uint64_t, counted_reasons> refused{};  ///< frames not proved, by EventReason
    Duration record_delay;        ///< end of the newest exposure to the arrival of its record
    Duration records_late_by;     ///< against those before, as long as frames are withheld for it
    Duration start_delay;         ///< trigger to the start that its record has; 0: it has none
    Duration commanded_exposure;  ///< set in the camera, or read from it; 0: it varies
    HostTime last_record;         ///< the board's record of an exposure arrived, doubted or not
    HostTime last_sign;           ///< a frame arrived, whole or not
    HostTime last_frame;
    HostTime last_proof;       ///< a frame was proved, or the camera was begun anew
    Duration exposure;         ///< measured, of the newest frame; 0: unknown
    Duration camera_exposure;  ///< by the camera's account; 0: unknown
    ExposureSource exposure_source = ExposureSource::none;  ///< of that account
    bool exposure_contradicted = false;                     ///< the two differ
    LineDelays lines;
    EdgeReport edges;
    AnswerReport answers;
};

/// Thread-safe. Whoever completes a pair publishes it.
class CameraPipeline final : private pairing::Outcome {
 public:
    /// `ptp`: for a camera that is triggered by PTP time, and outlives it.
    CameraPipeline(const CameraConfiguration& configuration, std::uint32_t index,
                   clock::Translator& translator, EventJournal& events, PtpClocks* ptp = nullptr);

    /// Makes the rings, or one with larger slots: called by the camera once it knows its payload.
    /// Slots are void then. `has_clock`: its stamps are its own.
    /// `stamp_instant`: what they are of; unknown: it is found out.
    Expected<> prepare(const ring::Place& place, std::uint64_t payload_size, bool has_clock,
                       pairing::Instant stamp_instant = pairing::Instant::unknown);

    /// The same camera is to be paired and stamped by other values. Nothing that came before is
    /// used any more.
    void reconfigure(const CameraConfiguration& configuration);

    std::optional<std::uint32_t> acquire();
    std::byte* slot_data(std::uint32_t slot);
    void abandon(std::uint32_t slot, EventReason reason, std::uint64_t block_id);

    /// Frames that found no slot to go to.
    void buffer_underrun(std::uint64_t frames);

    /// What the camera says that it exposes from now on, about; 0: it changes by itself.
    void set_camera_exposure(Duration exposure, HostTime since);

    /// What the camera's register says that it exposes; to be read while wanted.
    void read_exposure(Duration exposure, HostTime at);
    bool wants_exposure_readings();

    /// Of frames from now on that do not carry it themselves.
    void set_sensor_state(const SensorState& state);

    /// Before frames of these lines come.
    void set_line_delays(const LineDelays& lines);

    /// A complete frame in an acquired slot; the slot is the pipeline's from here on.
    void add(const pairing::Arrival& arrival);

    /// The stamp of the exposure's middle; none: board time cannot be translated yet, or the record
    /// is doubted.
    std::optional<clock::Stamp> add(const wire::Exposure& record, HostTime received,
                                    std::optional<BoardTime> expected = std::nullopt);

    /// By the camera's message channel.
    void add(const CameraEvent& event);

    /// The next trigger of a camera that is triggered by PTP time.
    struct PtpTurn {
        std::optional<PtpTrigger> trigger;  ///< to be sent now: its frame is awaited
        Duration wait;                      ///< until the next turn
    };
    PtpTurn next_ptp_trigger(HostTime now);

    /// The camera acknowledged one, with its GVCP status: 0, or why it does not take it.
    void acknowledge(std::uint64_t trigger, std::uint16_t status);

    /// What a camera that is triggered by PTP time says of its PTP port, and what its clock shows.
    void note_ptp(const PtpStatus& status);
    void read_clock(const clock::ClockReading& reading);

    /// The exposure line of a camera that is triggered by PTP time became active.
    void line_rose(BoardTime at);

    /// Frames wait until its clock is read.
    bool wants_clock_reading();

    /// `callback` is called when they begin to wait, on any thread, while the pipeline is locked;
    /// it may be empty.
    void when_clock_reading_wanted(std::function<void()> callback);

    /// The board sent no trigger for one grid point, and said so.
    void triggers_skipped(std::uint64_t count);

    /// Camera or board began a new life.
    void reset();

    /// Gives up what waited too long. A start: the board should be asked for it, because nothing
    /// else can prove the pairing, or because no trigger came although it was asked to.
    std::optional<pairing::Start> advance(HostTime now);
    pairing::Start first_start();
    void start_requested(pairing::Start start, HostTime now);

    const std::string& name() const { return name_; }
    bool triggered() const { return triggered_; }  ///< by the board
    bool by_ptp() const { return clocks_ != nullptr; }
    const std::string& strobe_input() const { return strobe_input_; }  ///< empty: none
    unsigned output() const { return output_; }                        ///< of the board
    std::uint8_t board_mask() const { return static_cast<std::uint8_t>(1U << output_); }

    /// Number of the newest trigger that the board recorded.
    std::uint64_t newest_trigger();

    /// Triggers since the last frame.
    std::uint64_t unanswered_triggers();
    PipelineReport report();
    std::uint64_t items();
    std::uint64_t evidence_items();

 private:
    struct Line {
        LogLevel level;
        std::string text;
    };

    /// advance() logs it: nothing is written under the lock.
    void log_later(LogLevel level, std::string text);
    void paired(const pairing::Arrival& arrival, const pairing::Exposure& exposure) override;
    void frame_unpaired(const pairing::Arrival& arrival, EventReason reason,
                        const pairing::Exposure* guess) override;
    void exposure_unpaired(const pairing::Exposure& exposure, EventReason reason) override;
    void locked(const pairing::Exposure& first) override;
    void slipped(const pairing::Arrival& at) override;

    void feed(const pairing::Evidence& evidence);
    void restart_pairing();
    void forget_records();
    void pair_without_clock();
    std::optional<Implausibility> doubt(const wire::Exposure& record, HostTime received,
                                        std::optional<BoardTime> expected);
    void count_rejected(const wire::Exposure& record, const Implausibility& doubt);
    void adopt_step(const wire::Exposure& record, const Implausibility& doubt);
    void follow_clock(std::uint32_t life);
    std::optional<pairing::Start> advance_locked(HostTime now);
    pairing::Arrival completed(pairing::Arrival arrival) const;
    void note_chunk_lag();
    void note_missed_trigger();
    void note_ptp_event(bool lost);
    void add_by_ptp(const pairing::Arrival& arrival);
    void settle_ptp();
    void publish_by_ptp(const pairing::Arrival& arrival, const PtpExposure& exposure);
    FrameAccount account_of(const pairing::Arrival& arrival) const;
    void count_refusal(EventReason reason);
    void announce_unpaired(const pairing::Exposure& exposure, EventReason reason);
    void publish_suspect(const pairing::Arrival& arrival, const pairing::Exposure* guess);
    void journal(EventKind kind, EventReason reason, std::int64_t value,
                 std::optional<BoardTime> at = {});

    // These do not change while the service runs.
    const std::string name_;
    const bool triggered_;
    const unsigned output_;
    const std::string strobe_input_;
    const std::uint32_t index_;
    clock::Translator& translator_;
    EventJournal& events_;
    std::size_t stream_;       ///< of the translator's witnesses
    PtpClocks* const clocks_;  ///< none: it is not triggered by PTP time
    const std::size_t clock_;  ///< its own of these

    std::mutex mutex_;
    CameraConfiguration configuration_;
    FramePublisher frames_;
    EvidenceRecorder evidence_;
    pairing::RecordLimits record_limits_;
    pairing::RecordFilter filter_;
    DelayFloor delays_;                        ///< of records
    std::optional<std::uint32_t> clock_life_;  ///< none: no record came yet
    ExposureCompletion completion_;
    ExposureCheck check_;
    AnswerWatch answers_;
    EventLengths event_lengths_;
    SensorState sensor_;
    bool missed_logged_ = false;             ///< in the log, of this stream
    std::vector<Duration> chunk_exposures_;  ///< by slot; 0: the frame has none
    StartWatchdog triggers_;
    PtpFrames by_ptp_;
    StrobeWitness strobe_;
    PtpStatus ptp_status_;
    bool length_by_frame_ = false;  ///< the newest frame said how long it was exposed
    std::string port_logged_;
    std::uint64_t ptp_steps_ = 0;
    std::function<void()> reading_wanted_;
    pairing::Limits limits_;
    pairing::Pairing pairing_;
    /// By trigger: the middle of each exposure that pairing holds, and of the last that it used,
    /// translated once as it came.
    std::map<std::uint64_t, clock::Stamp> middles_;
    std::uint64_t last_used_ = 0;  ///< trigger
    PipelineReport report_;
    std::vector<Line> deferred_log_;  ///< see log_later()
};

}  // namespace versavis::daemon

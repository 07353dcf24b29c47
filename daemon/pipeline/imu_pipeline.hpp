// SPDX-License-Identifier: BSD-3-Clause
// Samples of one IMU: from raw words to SI units with a stamp, into the ring.
#pragma once

#include <mutex>
#include <string>

#include "engine/clock/translator.hpp"
#include "engine/plausibility/delay_floor.hpp"
#include "engine/plausibility/majority_filter.hpp"
#include "engine/ring/writer.hpp"
#include "plausibility/arrival_check.hpp"
#include "plausibility/pulse_history.hpp"
#include "publish/event_journal.hpp"
#include "publish/stamp_guard.hpp"
#include "settings/configuration.hpp"

namespace versavis::daemon {

/// The last failure of a part that the board reported.
struct ImuFailure {
    wire::BoardEventKind kind = wire::BoardEventKind::imu_failed;
    std::uint16_t step = 0;  ///< of its set-up, or imu_step_running
    std::int64_t answer = 0;
    std::uint64_t times = 0;  ///< in a row; 0: none
    HostTime last;
};

/// The step of a failure after the set-up.
constexpr std::uint16_t imu_step_running = 0xFFFF;

struct ImuReport {
    std::string name;
    std::string model;
    std::uint64_t published = 0;
    std::uint64_t lost = 0;      ///< numbers that never arrived
    std::uint64_t no_clock = 0;  ///< withheld: before the clock and its neighbours are known
    std::uint64_t faulty = 0;    ///< published with a sensor error
    std::uint64_t repeated = 0;  ///< published with the data of the sample before
    std::uint64_t doubted = 0;   ///< withheld: witnesses contradict number, time or flags
    HostTime last_sample;        ///< without an error
    imu::FilterDelay filter;
    double rate_hz = 0;  ///< configured
    ImuFailure failure;
    bool working = false;  ///< it was set up, and has not failed since
};

/// Thread-safe.
class ImuPipeline {
 public:
    ImuPipeline(const ImuConfiguration& configuration, ring::Writer ring,
                clock::Translator& translator, EventJournal& events);

    /// False: nothing may be made of the time of its message: it is doubted, not confirmed yet, or
    /// not quite as prompt as usual.
    bool add(const wire::ImuSample& sample, HostTime received);
    void board_restarted();

    /// The part was set up, or failed. True: that is new, or is due to be logged again.
    bool note_state(const wire::Event& event, HostTime now);
    void heartbeat(HostTime now);
    ImuReport report();
    /// IMU port of the board.
    std::uint8_t port() const { return port_; }

 private:
    void restart();
    std::optional<Implausibility> doubt(const wire::ImuSample& sample, HostTime received);
    std::optional<Duration> departure() const;
    bool may_adopt(Promptness promptness, const Implausibility& doubt,
                   std::uint64_t exchanges) const;
    void adopt_number(std::uint32_t number);
    void journal(EventKind kind, const wire::ImuSample& sample, const Implausibility& doubt);
    std::uint64_t extended(std::uint32_t number) const;
    void publish(const wire::ImuSample& sample, std::uint64_t number, const clock::Stamp& stamp);

    std::mutex mutex_;
    const imu::ImuModel& model_;
    std::uint8_t port_;
    bool accel_ready_;
    imu::FilterDelay filter_;
    ring::Writer ring_;
    clock::Translator& translator_;
    EventJournal& events_;
    std::size_t departures_;  ///< of messages, among the translator's streams
    std::size_t samples_;     ///< which may be off alone
    MajorityFilter<PulseHistory> pulse_filter_;
    DelayFloor delays_;  ///< of samples, from their departure
    StepPromptness step_promptness_;
    StepPromptness from_future_;  ///< early: they arrived before the instant that they name
    std::uint32_t clock_life_ = 0;
    std::uint32_t believed_life_ = 0;  ///< of the clock, when a sample was believed last
    StampGuard guard_;
    std::optional<std::uint64_t> last_number_;  ///< published
    std::uint32_t number_shift_ = 0;            ///< from those of the board
    ImuReport report_;
};

}  // namespace versavis::daemon

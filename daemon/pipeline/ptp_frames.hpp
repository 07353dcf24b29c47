// SPDX-License-Identifier: BSD-3-Clause
// Frames of a camera that is triggered at instants of PTP time: which of them are proved, by the
// camera's own stamp, its clock before and after, and the arrival.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "engine/clock/ptp_timescale.hpp"
#include "engine/pairing/evidence.hpp"
#include "plausibility/reported_exposure.hpp"
#include "ptp_grid.hpp"
#include "publish/ptp_exposure.hpp"
#include "settings/configuration.hpp"

namespace versavis::daemon {

/// The camera is to begin an exposure.
struct PtpTrigger {
    std::uint64_t number = 0;  ///< consecutive
    std::uint64_t tick = 0;
    CameraTime at;      ///< when it is to be triggered
    Duration exposure;  ///< as long as it is expected to be
};

/// What became of a frame.
struct PtpVerdict {
    pairing::Arrival arrival;
    std::optional<PtpExposure> exposure;  ///< none: it is not proved
    EventReason reason = EventReason::none;
};

/// The first trigger is sent alone, so that its frame can be no other's. A frame is proved when its
/// stamp is one that a trigger makes, block id and arrival agree with that, and the camera's clock,
/// which must follow PTP, agreed with PTP's time when it was read before the exposure and when it
/// was read after it. So each frame waits for the next reading of its camera's clock. A pure
/// function of what it is fed; not thread-safe.
class PtpFrames {
 public:
    PtpFrames(const CameraConfiguration& configuration, std::size_t most_held);

    /// The trigger to send next, `lead()` before it is due: many cameras keep only one, so the one
    /// before has been taken then.
    PtpTrigger next(CameraTime now) const;
    Duration lead() const;

    /// It is on its way, and `at` will be then.
    void sent(const PtpTrigger& trigger, HostTime then);

    /// The camera has it.
    void acknowledged(std::uint64_t trigger);

    /// What the camera says of a frame's exposure; 0: it does not.
    struct Account {
        Duration event;  ///< by events of this exposure
        Duration chunk;  ///< with the frame's data; some firmware has that of the frame before
    };

    /// `stamped`: the frame's stamp on the host; none: PTP's time is not known.
    void add(const pairing::Arrival& arrival, const Account& length,
             const std::optional<clock::HostEstimate>& stamped);

    /// The camera's clock was read.
    void read_clock(const clock::ClockReading& reading, clock::Agreement agreement);

    /// It does not follow PTP, or shows another time: no frame that waits can be proved.
    void lose_clock();

    /// Gives up what waited too long.
    void advance(HostTime now);

    /// A new stream: what waits is void. `stamped`: what its stamps are of, or unknown.
    void restart(pairing::Instant stamped);

    /// What the camera exposes from now on; 0: it varies.
    void set_exposure(Duration exposure, HostTime since);

    /// What its register says; of one that varies, nothing is known of other moments.
    void read_exposure(Duration exposure, HostTime at);

    /// The same camera by other values. Nothing that waits is used any more.
    void reconfigure(const CameraConfiguration& configuration);

    /// Frames that wait for a reading.
    bool waiting() const { return !held_.empty(); }

    /// What was decided since, in the order of arrival.
    std::vector<PtpVerdict> take_verdicts() { return std::exchange(verdicts_, {}); }
    std::vector<PtpTrigger> take_missed() { return std::exchange(missed_, {}); }

    pairing::Instant stamped() const { return stamped_; }

    bool proved() const { return proved_; }  ///< the newest frame that was decided

    /// By how much the newest stamp was later than the nearest trigger makes it, without latency:
    /// what the camera takes to begin, or, far more, another instant or clock than is taken for it.
    Duration start_delay() const { return start_delay_; }

 private:
    struct Pending {
        PtpTrigger trigger;
        HostTime at;
        bool acknowledged = false;
        bool answered = false;  ///< by a frame
    };
    struct Held {
        pairing::Arrival arrival;
        PtpExposure exposure;
        bool length_may_lag = false;  ///< what the next frame says may be this one's
    };

    EventReason judge(const pairing::Arrival& arrival, const clock::HostEstimate& stamped,
                      PtpExposure& exposure);
    Pending* match(CameraTime start);
    bool lost(const Pending& pending) const;
    bool has_surplus_id(std::uint64_t block_id, std::uint64_t trigger) const;
    EventReason measure(const pairing::Arrival& arrival, const Account& length,
                        PtpExposure& exposure) const;
    bool length_may_lag(const Account& length, HostTime at) const;
    void learn_length(const pairing::Arrival& arrival, const Account& length);
    void refuse(const pairing::Arrival& arrival, EventReason reason);
    void refuse_all(EventReason reason);
    void unlock();

    PtpGrid grid_;
    Duration period_;
    Duration latency_;
    Duration longest_;
    Duration latest_arrival_;
    Duration exposure_;  ///< expected
    std::size_t most_held_;
    ReportedExposure settings_;
    bool varies_ = true;
    pairing::Instant configured_;
    pairing::Instant stamped_;  ///< unknown: taken for the start, and sigma says so
    std::uint64_t numbers_ = 0;
    CameraTime newest_;  ///< trigger sent
    bool proved_ = false;
    std::optional<CameraTime> following_since_;  ///< the clock agrees, and follows PTP
    Duration start_delay_;
    Duration usual_delay_;  ///< the same, of proved frames
    /// The newest frame that fitted a trigger.
    struct Fitted {
        std::uint64_t block_id = 0;
        std::uint64_t trigger = 0;
        std::uint64_t lost = 0;  ///< later triggers that the camera did not get, and are forgotten
    };
    std::optional<Fitted> fitted_;
    std::optional<Duration> usual_arrival_;  ///< after the exposure's end
    bool locked_ = false;                    ///< a trigger that was alone got its frame
    int misfits_ = 0;                        ///< in a row
    bool acknowledges_ = false;
    std::deque<Pending> triggers_;
    std::deque<Held> held_;
    std::vector<PtpVerdict> verdicts_;
    std::vector<PtpTrigger> missed_;
};

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
// Holds the exposure that was measured against the one that the camera reports.
#pragma once

#include "edge_difference.hpp"
#include "engine/pairing/evidence.hpp"
#include "reported_exposure.hpp"
#include "settings/configuration.hpp"

namespace versavis::daemon {

/// Between readings of an exposure that the camera changes by itself.
constexpr Duration exposure_reading_interval = milliseconds(200);

/// Where the camera's account of an exposure comes from.
enum class ExposureSource {
    none,          ///< it gives none, or may just have been changed
    setting,       ///< what it was set to
    reading,       ///< its register, now and then, of an exposure that it changes by itself
    event,         ///< its own events of start and end
    chunk,         ///< data of the frame
    chunk_before,  ///< the same, but what it says is of the frame before
};
const char* to_string(ExposureSource source);

struct ExposureVerdict {
    bool contradicted = false;  ///< the camera exposed for another time
    EdgeCorrection correction;  ///< its sigma contains what no witness has confirmed
    Duration length{};          ///< by the camera, of an exposure that no line shows; 0: unknown
    bool confirmed = false;     ///< that length, by a second account of the camera
};

/// How long the camera says that it exposed one frame; 0: it does not.
struct FrameAccount {
    Duration chunk;
    Duration event;
};

/// Not thread-safe.
class ExposureCheck {
 public:
    explicit ExposureCheck(const CameraConfiguration& configuration);

    /// Of a stream that begins: all that was known is void.
    void set_line_delays(const LineDelays& lines);

    /// The camera exposes for about so long from `since` on, for slow ones some frames later; 0:
    /// its exposure changes by itself.
    void set_camera_exposure(Duration exposure, HostTime since);

    /// What the camera's register says now. `start_delay`: see EdgeDifference.
    void read_exposure(Duration exposure, HostTime at, Duration start_delay);

    /// True while readings are the best witness that there is.
    bool wants_readings() const;

    /// The account of a frame's own data, as far as pairing can use it; 0: not.
    Duration for_pairing(Duration chunk) const;

    /// Of a frame and its exposure, in the order of frames.
    ExposureVerdict judge(const pairing::Arrival& arrival, const FrameAccount& frame,
                          const pairing::Exposure& exposure, Duration start_delay);

    /// What the camera keeps to at that time; 0: it varies, is unknown, or may just have changed.
    Duration reported_at(HostTime at) const;

    Duration measured() const { return newest_.length; }  ///< of the newest frame; 0: unknown
    Duration reported() const { return reported_; }       ///< by the camera; 0: unknown
    bool contradicted() const { return contradicted_; }
    ExposureSource source() const { return source_; }
    EdgeReport edges() const { return edges_.report(); }

 private:
    struct Measured {
        std::uint64_t block_id = 0;
        Duration length;
        HostTime end;
        bool unread = false;  ///< no reading came since
    };
    struct Account {
        ExposureSource source = ExposureSource::none;
        LengthRange range;
    };

    /// Frames in a row whose length fits the neighbour's chunk but not their own.
    static constexpr int votes_to_shift = 5;

    void follow_lag(const Measured& before, Duration chunk);
    Account account_of(const Measured& before, const FrameAccount& frame, Duration start_delay);
    bool certain() const;
    Duration excess(LengthRange range) const;
    ExposureVerdict unwitnessed(const Measured& before) const;
    ExposureVerdict by_camera(const FrameAccount& frame, const pairing::Exposure& exposure);

    bool enabled_;
    ReportedExposure settings_;
    ReportedExposure readings_;
    bool varies_ = true;  ///< the camera changes it by itself
    EdgeDifference edges_;
    Measured newest_;
    Duration reported_;
    ExposureSource source_ = ExposureSource::none;
    bool contradicted_ = false;
    bool lags_ = false;  ///< chunks are of the frame before
    int votes_ = 0;      ///< for the opposite
};

}  // namespace versavis::daemon

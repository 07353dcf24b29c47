// SPDX-License-Identifier: BSD-3-Clause
// A camera at the board's trigger output: exposes after a latency, ignores triggers while it is
// busy, and remembers what it really did.
#pragma once

#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "base/hal.hpp"
#include "nanoseconds.hpp"

namespace versavis::scenario {

using firmware::Nanoseconds;

using test::ms;
using test::second;
using test::us;

/// What is wrong with one exposure.
enum class Fault {
    none,
    ignored,     ///< the camera does not take the trigger
    no_strobe,   ///< neither edge is seen
    start_lost,  ///< the start edge is not seen
    end_lost,    ///< the line falls only with the start of the next exposure, unseen
    stuck,       ///< the line stays active until the end of the next exposure that is not
    late_start,  ///< it starts a millisecond late
};

struct CameraSettings {
    Nanoseconds latency = 20 * us;
    Nanoseconds jitter = 0;   ///< of the latency, to both sides
    Nanoseconds readout = 0;  ///< for this long after an exposure no trigger is accepted
    bool trigger_inverted = false;
    bool strobe_inverted = false;
    bool strobe = true;                  ///< the exposure line is wired
    std::vector<Nanoseconds> bounces{};  ///< after each of its edges the line toggles, twice each
    bool trigger_width = false;          ///< it exposes as long as the trigger is active
    std::uint8_t input = 0;              ///< of the board, for the exposure line
    /// Exposure of pulse 1, 2, ... at a time: constant, or an auto exposure.
    std::function<Nanoseconds(std::uint64_t pulse, Nanoseconds at)> exposure = [](auto, auto) {
        return 3 * ms;
    };
    std::function<Fault(std::uint64_t pulse)> fault = [](auto) { return Fault::none; };
};

struct TruePulse {
    Nanoseconds at = 0;
    bool taken = false;
    bool into_busy = false;  ///< it came while the camera exposed or read out
    Fault fault = Fault::none;
    bool start_seen = false;  ///< the exposure line shows it
    bool end_seen = false;
    Nanoseconds start = 0;
    Nanoseconds end = 0;
    Nanoseconds width = 0;       ///< of the trigger pulse
    Nanoseconds pause = second;  ///< since the pulse before
};

class CameraModel {
 public:
    CameraModel(CameraSettings settings, std::uint64_t seed)
        : settings_(std::move(settings)), random_(seed) {}

    using Edges = std::vector<firmware::Edge>;

    /// The trigger line changed. Returns edges of the exposure line, present and future.
    Edges trigger_line(Nanoseconds at, bool level);

    const CameraSettings& settings() const { return settings_; }
    CameraSettings& settings() { return settings_; }
    const std::vector<TruePulse>& pulses() const { return pulses_; }

 private:
    void emit(Edges& edges, Nanoseconds at, bool exposing) const;
    void show(TruePulse& pulse, Edges& edges);
    Edges begin(Nanoseconds at);

    CameraSettings settings_;
    std::mt19937_64 random_;
    std::vector<TruePulse> pulses_;
    Nanoseconds free_at_ = 0;
    bool stuck_ = false;  ///< the exposure line is active since an exposure that has ended
    std::optional<Nanoseconds> width_start_;
    Nanoseconds inactive_at_ = -second;
};

}  // namespace versavis::scenario

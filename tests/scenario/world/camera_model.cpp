// SPDX-License-Identifier: BSD-3-Clause
#include "camera_model.hpp"

#include <utility>

namespace versavis::scenario {

void CameraModel::emit(Edges& edges, Nanoseconds at, bool exposing) const {
    if (!settings_.strobe) return;
    const bool level = exposing != settings_.strobe_inverted;
    edges.push_back({at, settings_.input, level});
    for (const Nanoseconds bounce : settings_.bounces) {
        edges.push_back({at + bounce, settings_.input, !level});
        edges.push_back({at + bounce + 100, settings_.input, level});
    }
}

CameraModel::Edges CameraModel::trigger_line(Nanoseconds at, bool level) {
    const bool active = level != settings_.trigger_inverted;
    if (active) return begin(at);
    inactive_at_ = at;
    if (!pulses_.empty()) pulses_.back().width = at - pulses_.back().at;
    Edges edges;
    if (settings_.trigger_width && width_start_) {
        TruePulse& pulse = pulses_.back();
        pulse.end = at + settings_.latency;
        free_at_ = pulse.end + settings_.readout;
        emit(edges, pulse.end, false);
        width_start_.reset();
    }
    return edges;
}

void CameraModel::show(TruePulse& pulse, Edges& edges) {
    const bool silent = pulse.fault == Fault::no_strobe;
    const bool stuck = std::exchange(stuck_, pulse.fault == Fault::stuck);
    const bool falls = !silent && !stuck_ && pulse.fault != Fault::end_lost;
    pulse.start_seen = !silent && !stuck && pulse.fault != Fault::start_lost;
    pulse.end_seen = pulse.start_seen && falls;
    if (pulse.start_seen) emit(edges, pulse.start, true);
    if (falls) emit(edges, pulse.end, false);
}

CameraModel::Edges CameraModel::begin(Nanoseconds at) {
    Edges edges;
    TruePulse pulse;
    pulse.at = at;
    pulse.pause = at - inactive_at_;
    pulse.fault = settings_.fault(pulses_.size() + 1);
    pulse.into_busy = at < free_at_;
    pulse.taken = !pulse.into_busy && pulse.fault != Fault::ignored;
    if (pulse.taken) {
        Nanoseconds latency = settings_.latency;
        if (settings_.jitter > 0)
            latency += std::uniform_int_distribution<Nanoseconds>(-settings_.jitter,
                                                                  settings_.jitter)(random_);
        if (pulse.fault == Fault::late_start) latency += ms;
        pulse.start = at + latency;
        if (settings_.trigger_width) {
            width_start_ = pulse.start;
            pulse.start_seen = pulse.end_seen = true;
            free_at_ = firmware::never;
            emit(edges, pulse.start, true);
        } else {
            pulse.end = pulse.start + settings_.exposure(pulses_.size() + 1, pulse.start);
            free_at_ = pulse.end + settings_.readout;
            show(pulse, edges);
        }
    }
    pulses_.push_back(pulse);
    return edges;
}

}  // namespace versavis::scenario

// SPDX-License-Identifier: BSD-3-Clause
#include "exposure_completion.hpp"

#include <algorithm>

namespace versavis::daemon {

namespace {

/// How far the camera's own latency is off when nobody measured it.
constexpr Duration unmeasured_delay = microseconds(100);

/// False: start and end follow from the trigger, or from the exposure line of the master.
bool own_line(const wire::Exposure& record) {
    return (record.flags & (wire::exposure_predicted | wire::exposure_from_master)) == 0;
}

bool started(const wire::Exposure& record) { return record.start_ns != wire::no_time; }
bool ended(const wire::Exposure& record) { return record.end_ns != wire::no_time; }

}  // namespace

bool measured(const wire::Exposure& record) { return started(record) && ended(record); }

ExposureCompletion::ExposureCompletion(const CameraConfiguration& configuration)
    : lines_(configured_delays(configuration)),
      max_exposure_(from_us(configuration.max_exposure_us)),
      last_exposure_(from_us(configuration.exposure_us)) {}

/// The edges of the camera's own line come later than what they show.
void ExposureCompletion::take_off_delays(pairing::Exposure& exposure) const {
    const bool whole = exposure.kind == StampKind::measured_middle;
    const BoardTime seen = middle(exposure.start, exposure.end);
    exposure.start = exposure.start - lines_.start.delay;
    exposure.end = exposure.end - (whole ? lines_.end.delay : lines_.start.delay);
    const BoardTime corrected = middle(exposure.start, exposure.end);
    exposure.delay = seen - corrected;
    exposure.delay_sigma = whole ? middle_sigma(lines_) : lines_.start.sigma;
    // Delays that are longer than the exposure are not those of this line.
    if (exposure.end < exposure.start) exposure.start = exposure.end = corrected;
}

/// How much later than the board's record an exposure is that follows from something else: from the
/// board's own trigger, or from the edges of the master's line, which are triggers then.
Duration ExposureCompletion::not_of_own_line(const wire::Exposure& record) const {
    const bool from_master = (record.flags & wire::exposure_from_master) != 0;
    return lines_.trigger.delay - Duration{from_master ? 0 : record.start_ns - record.trigger_ns};
}

pairing::Exposure ExposureCompletion::complete(const wire::Exposure& record) {
    pairing::Exposure exposure;
    exposure.trigger = record.trigger;
    exposure.tick = record.tick;
    exposure.exposed = started(record) || !own_line(record);
    exposure.start = started(record) ? BoardTime{record.start_ns}
                                     : BoardTime{record.trigger_ns} + lines_.trigger.delay;
    exposure.end = ended(record) ? BoardTime{record.end_ns} : exposure.start + last_exposure_;
    if (measured(record) && own_line(record)) {
        exposure.kind = StampKind::measured_middle;
        take_off_delays(exposure);
        last_exposure_ = exposure.end - exposure.start;
    } else if (started(record) && own_line(record)) {
        // It lasted longer than the board was willing to wait: the middle is at least here.
        exposure.kind = StampKind::predicted_middle;
        exposure.end = exposure.start + std::max(last_exposure_, max_exposure_);
        take_off_delays(exposure);
    } else {
        exposure.kind = StampKind::trigger_edge;
        exposure.delay_sigma = lines_.trigger.sigma;
        if (started(record)) {
            const Duration later = not_of_own_line(record);
            exposure.start = exposure.start + later;
            exposure.end = exposure.end + later;
        }
    }
    return exposure;
}

void ExposureCompletion::place_on_host(pairing::Exposure& exposure, const wire::Exposure& record,
                                       HostTime middle_on_host) {
    const BoardTime middle_on_board = middle(exposure.start, exposure.end);
    exposure.end_on_host = middle_on_host + (exposure.end - middle_on_board);
    // No frame of it can arrive before its end; of an end that nobody saw, before its start.
    const bool end_seen = ended(record) && own_line(record);
    exposure.earliest_on_host =
        end_seen ? exposure.end_on_host : middle_on_host - (middle_on_board - exposure.start);
}

Duration kind_sigma(const pairing::Exposure& exposure, Duration middle_to_arrival) {
    if (exposure.kind == StampKind::measured_middle) return exposure.delay_sigma;
    const Duration start = unmeasured_delay + exposure.delay_sigma;
    if (exposure.length_by_camera) return start;
    const Duration half = (exposure.end - exposure.start) / 2 + start;
    // An end that was not seen lies before the arrival; no more is known.
    return exposure.kind == StampKind::predicted_middle ? std::max(half, middle_to_arrival) : half;
}

}  // namespace versavis::daemon

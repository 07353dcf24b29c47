// SPDX-License-Identifier: BSD-3-Clause
#include "ptp_diagnosis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "status.hpp"

namespace versavis::daemon {

namespace {

/// GVCP's words for an action that a camera does not take as it should.
constexpr std::uint16_t no_reference_time = 0x8013;
constexpr std::uint16_t overflow = 0x8015;
constexpr std::uint16_t action_late = 0x8016;

/// Of actions or frames; fewer may be chance.
constexpr double telling_part = 0.1;

/// An offset of stamps that is nearly as long as the exposure, or half of it.
constexpr Duration nearly = microseconds(200);

std::string in_us(Duration duration) { return fmt::format("{} us", duration.ns / 1000); }

std::string port_hint(const PtpClockReport& clock) {
    const std::string& state = clock.status.state;
    if (state.empty()) return "it does not say whether its clock follows PTP";
    if (state == "Slave") return "its clock is close to no master yet: its PTP servo is not locked";
    if (state == "Uncalibrated") return "its clock begins to follow a PTP master";
    if (state == "Disabled" || state == "Faulty")
        return fmt::format("its PTP port is {}: restart the camera, or power it off and on", state);
    if (state == "Passive")
        return "its PTP port is Passive: it hears a better master on another port, or competes "
               "with "
               "it; set it to slave only";
    return fmt::format(
        "its PTP port is {}: it hears no master; start ptp4l on the interface of this camera, and "
        "check that switches pass PTP (UDP ports 319 and 320)",
        state);
}

/// A camera with another grandmaster that says so explains most.
std::string other_time_hint(const PtpClockReport& clock, const PtpReport& ptp) {
    for (const PtpClockReport& other : ptp.clocks)
        if (other.agreement == clock::Agreement::agrees && !other.status.grandmaster.empty() &&
            !clock.status.grandmaster.empty() &&
            other.status.grandmaster != clock.status.grandmaster)
            return fmt::format(
                "its clock shows another time than that of {}, and it follows another PTP master "
                "({} instead of {}): stop one of the two masters, or give both one domain",
                other.name, clock.status.grandmaster, other.status.grandmaster);
    return "its clock shows another time than those of the other cameras, or than before: is there "
           "a second PTP master, or did the master's time step?";
}

/// Enough for an estimate of PTP's time to begin.
constexpr std::uint64_t few_readings = 20;

std::string unread_hint(const PtpClockReport& clock) {
    return fmt::format(
        "readings of its clock take {}, too long to tell what it shows, or differ from each other: "
        "lower the load of host and network, and check that all cameras have one PTP master",
        in_us(clock.width));
}

std::string refusal_hint(std::uint16_t status) {
    switch (status) {
        case no_reference_time:
            return "the camera refuses scheduled actions: its clock follows no PTP master";
        case overflow: return "the camera cannot keep the next scheduled action: lower 'rate_hz'";
        case action_late:
            return "scheduled actions reach the camera too late: lower the load of host and "
                   "network, or 'rate_hz'";
        default:
            return fmt::format(
                "the camera refuses scheduled actions (GVCP status {:#06x}): update "
                "its firmware, or trigger it by the board",
                status);
    }
}

bool telling(std::uint64_t part, std::uint64_t whole) {
    return part >= 2 && static_cast<double>(part) > telling_part * static_cast<double>(whole);
}

/// From the start of the exposure, as the stamp is taken for.
Duration taken_for(pairing::Instant instant, Duration exposure) {
    switch (instant) {
        case pairing::Instant::middle: return exposure / 2;
        case pairing::Instant::end: return exposure;
        default: return {};
    }
}

/// Its frames' stamps are none that its triggers make.
std::string stamps_hint(const CameraStatus& camera) {
    const Duration off = camera.pipeline.start_delay;
    if (absolute(off) > period_of(camera.configuration))
        return fmt::format(
            "its frames are stamped {:.3f} s off what its own clock shows: they are of another "
            "clock, which PTP does not steer; update its firmware, or trigger it by the board",
            static_cast<double>(off.ns) * 1e-9);
    const Duration exposure = camera.pipeline.commanded_exposure;
    const Duration latency = from_us(camera.configuration.latency_us);
    const Duration after = off + latency + taken_for(camera.pipeline.stamp_instant, exposure);
    const std::string said =
        fmt::format("its frames are stamped {} after the trigger", in_us(after));
    for (const auto& [instant, name] : {std::pair{pairing::Instant::end, "end"},
                                        {pairing::Instant::middle, "middle"},
                                        {pairing::Instant::start, "start"}})
        if (exposure.ns != 0 && instant != camera.pipeline.stamp_instant &&
            absolute(after - latency - taken_for(instant, exposure)) < nearly)
            return fmt::format(
                "{}: is that the {} of the exposure? then set stamp_instant = \"{}\"", said, name,
                name);
    if (after - taken_for(camera.pipeline.stamp_instant, exposure) < Duration{})
        return said + ", before it could expose: is stamp_instant right?";
    return fmt::format("{}: if that is the camera's latency, set latency_us = {}", said,
                       (after - taken_for(camera.pipeline.stamp_instant, exposure)).ns / 1000);
}

/// Why most of the frames are refused; empty: none of these.
std::string refused_hint(const PipelineReport& recent) {
    constexpr std::pair<EventReason, const char*> causes[]{
        {EventReason::no_clock,
         "its clock could not be confirmed in time: lower the load of host "
         "and network"},
        {EventReason::too_old,
         "they arrive too late: lower the load of the network, or raise "
         "'latest_arrival_ms'"},
        {EventReason::not_yet,
         "they arrive before their exposure ends, by their own account: is "
         "stamp_instant right?"},
        {EventReason::wrong_exposure,
         "the exposure that they carry is not the one that was set: "
         "check ExposureTime, or set chunks = false"}};
    for (const auto& [reason, why] : causes) {
        const std::uint64_t refused = recent.refused[static_cast<std::size_t>(reason)];
        if (telling(refused, recent.received))
            return fmt::format("{} of the last {} frames are withheld: {}", refused,
                               recent.received, why);
    }
    return "";
}

/// By one camera's exposure line, which says the same of all of them.
std::string contradicted_hint(const Status& all) {
    const auto camera =
        std::find_if(all.cameras.begin(), all.cameras.end(),
                     [&](const CameraStatus& it) { return it.name == all.ptp->contradicted; });
    const auto error = camera != all.cameras.end() && camera->pipeline.strobe
                           ? camera->pipeline.strobe->error.value_or(Duration{})
                           : Duration{};
    return fmt::format(
        "the board saw the exposures of {} begin {} {} than its clock says: all frames by PTP are "
        "withheld; is its line the exposure, and 'strobe_rising_us' right? else PTP's master or "
        "the board's clock is wrong",
        all.ptp->contradicted, in_us(absolute(error)), error.ns > 0 ? "earlier" : "later");
}

}  // namespace

PtpFinding diagnose_ptp(const CameraStatus& camera, const Status& all) {
    if (camera.configuration.trigger != TriggerSource::ptp || !all.ptp) return {};
    const auto clock = std::find_if(all.ptp->clocks.begin(), all.ptp->clocks.end(),
                                    [&](const auto& it) { return it.name == camera.name; });
    if (clock == all.ptp->clocks.end()) return {};
    if (!all.ptp->master.empty())
        return {Fault::ptp_master,
                fmt::format("{} is a PTP master, and all that follow it are wrong: no camera is "
                            "triggered; make it slave only, and start a better master (ptp4l)",
                            all.ptp->master)};
    if (!clock->status.follows()) return {Fault::ptp_lost, port_hint(*clock)};
    if (clock->agreement == clock::Agreement::differs)
        return {Fault::ptp_other_time, other_time_hint(*clock, *all.ptp)};
    if (clock->agreement == clock::Agreement::unknown && clock->readings > few_readings)
        return {Fault::ptp_unread, unread_hint(*clock)};
    if (!all.ptp->contradicted.empty()) return {Fault::ptp_contradicted, contradicted_hint(all)};
    const PipelineReport& recent = camera.recent;
    if (telling(recent.actions_refused, recent.triggers))
        return {Fault::ptp_refused, refusal_hint(camera.pipeline.refusal)};
    const std::uint64_t misfits = recent.refused[static_cast<std::size_t>(EventReason::mismatch)];
    if (telling(misfits, recent.received)) return {Fault::ptp_stamps, stamps_hint(camera)};
    const std::string refused = refused_hint(recent);
    return refused.empty() ? PtpFinding{} : PtpFinding{Fault::unproved, refused};
}

}  // namespace versavis::daemon

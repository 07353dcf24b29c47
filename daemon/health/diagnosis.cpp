// SPDX-License-Identifier: BSD-3-Clause
#include "diagnosis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "board/board_event.hpp"
#include "engine/board/firmware_file.hpp"
#include "ptp_diagnosis.hpp"
#include "status.hpp"

namespace versavis::daemon {

namespace {

/// A start may take so long, and so many periods on top, before what is missing is a fault.
constexpr Duration start_patience = seconds(4);
constexpr int start_periods = 20;

/// The board answers ten times a second.
constexpr Duration board_silence = milliseconds(1000);

/// Of the frames or triggers lately, what is more than chance.
constexpr double telling_share = 0.08;

/// Of them all, but for what was on its way when it began.
constexpr double nearly_all = 0.9;

/// Records that take so long after the exposure come too late for pairing.
constexpr Duration late_record = milliseconds(200);

/// An exposure that leaves the camera less of its period than this share cannot keep the rate: it
/// reads out, too.
constexpr double shortest_rest = 0.05;

/// What two measures of one exposure may differ by: edges of slow lines.
constexpr Duration edge_delay = microseconds(300);

/// The largest packets that pass every network.
constexpr std::uint32_t common_packet = 1500;

/// Without a frame, whole or not, for so long and so many periods, a camera sends none.
constexpr Duration quiet_time = milliseconds(300);
constexpr int quiet_periods = 5;

/// A camera that restarts is back within so long, mostly.
constexpr Duration restart_time = seconds(6);

/// Setting up takes less, mostly.
constexpr Duration long_set_up = seconds(3);

/// A start so long after a camera was reopened has another cause.
constexpr Duration reopened_lately = seconds(10);

/// On top of the longest pause between two triggers, and of the link's delay, no record for so long
/// is no trigger.
constexpr Duration record_patience = milliseconds(1500);

struct CameraView {
    const CameraStatus& it;
    const Status& all;

    bool triggered() const { return it.triggered(); }
    bool has_triggers() const { return it.configuration.trigger != TriggerSource::free_run; }
    bool streaming() const { return it.camera.state == CameraState::streaming; }
    bool in(CameraState state) const { return it.camera.state == state; }
    bool full() const { return it.delivery.full; }
    bool strobe() const { return it.configuration.strobe != Strobe::none; }
    std::uint64_t frames() const { return it.recent.received + it.recent.incomplete; }
    std::uint64_t refused(EventReason reason) const {
        return it.recent.refused[static_cast<std::size_t>(reason)];
    }
    Duration period() const { return period_of(it.configuration); }
    Duration exposure() const {
        const Duration commanded = it.pipeline.commanded_exposure;
        return commanded.ns != 0 ? commanded : it.pipeline.exposure;
    }
    /// Triggers of which frames are here, and records still on a slow link.
    std::uint64_t on_link() const {
        const std::int64_t delay_ns = std::max(it.pipeline.record_delay.ns, std::int64_t{0});
        return static_cast<std::uint64_t>((delay_ns + period().ns / 2) / period().ns);
    }
    /// Triggers have come without an answer; in a slow start they are far apart.
    bool quiet() const {
        const HostTime asked =
            triggered() ? it.pipeline.last_record - it.pipeline.record_delay : all.now;
        return asked - it.pipeline.last_sign > std::max(quiet_time, period() * quiet_periods);
    }
    bool starting() const {
        return !full() && !it.delivery.fell_short &&
               all.now - it.delivery.began < start_patience + period() * start_periods;
    }
};

double share(std::uint64_t part, std::uint64_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

bool some(std::uint64_t part, std::uint64_t whole) {
    return part >= 2 && share(part, whole) > telling_share;
}

bool all_of(std::uint64_t part, std::uint64_t whole) {
    return part > 0 && share(part, whole) >= nearly_all;
}

template <CameraState state>
bool in(const CameraView& camera) {
    return camera.in(state);
}

std::string own_hint(const CameraView& camera) { return camera.it.camera.hint; }

/// It would be open, did not something hold it that ends by itself.
bool leased(const CameraView& camera) {
    return camera.in(CameraState::opening) && camera.it.camera.held;
}

bool numbers_anew(const CameraView& camera) {
    return camera.it.camera.renumbers && !camera.full() &&
           (camera.in(CameraState::opening) || camera.streaming());
}

bool lost_packets(const CameraView& camera) {
    return !camera.full() && some(camera.refused(EventReason::frame_incomplete), camera.frames());
}

/// Nothing of the size of a full packet passes.
bool packets_too_large(const CameraView& camera) {
    return lost_packets(camera) && camera.it.camera.packet_size > common_packet &&
           all_of(camera.refused(EventReason::frame_incomplete), camera.frames());
}

/// Of the slowest start that any camera or master makes.
Duration longest_trigger_pause(const CameraView& camera) {
    const auto rate_uhz = static_cast<std::uint64_t>(camera.it.configuration.rate_hz * 1e6);
    const std::uint64_t ticks = wire::slow_start_ticks(rate_uhz, wire::camera_count - 1);
    return camera.period() * static_cast<std::int64_t>(ticks);
}

bool no_records(const CameraView& camera) {
    const HostTime since = std::max(camera.it.pipeline.last_record, camera.it.delivery.began);
    return camera.triggered() && !camera.full() &&
           camera.all.now - since >
               longest_trigger_pause(camera) + record_patience + camera.all.clock.round_trip;
}

bool line_leads(const CameraView& camera) {
    return camera.triggered() && camera.strobe() && camera.frames() > 0 &&
           camera.it.pipeline.answers.lead.ns > 0;
}

bool late_records(const CameraView& camera) {
    return camera.triggered() && !camera.full() && camera.it.pipeline.record_delay > late_record;
}

/// Not too late, but the link's delay looks the same as a step of the board's clock.
bool later_records(const CameraView& camera) {
    return camera.triggered() && !camera.full() && camera.it.pipeline.records_late_by.ns > 0;
}

/// By its line, and the board's records of that are doubted.
bool exposure_changed(const CameraView& camera) {
    return camera.triggered() && !camera.full() && camera.it.pipeline.doubted_exposure.ns > 0 &&
           some(camera.it.recent.records_doubted,
                camera.it.recent.records_doubted + camera.it.recent.triggers);
}

bool exposes_too_long(const CameraView& camera) {
    const double rest = 1 - share(static_cast<std::uint64_t>(camera.exposure().ns),
                                  static_cast<std::uint64_t>(camera.period().ns));
    return !camera.full() && rest < shortest_rest;
}

/// The line rises where the exposure ends.
bool strobe_inverted(const CameraView& camera) {
    const Duration latency = from_us(camera.it.configuration.latency_us);
    const Duration exposure = camera.it.pipeline.commanded_exposure;
    const Duration late = camera.it.pipeline.start_delay - latency - exposure;
    return camera.triggered() && camera.strobe() && exposure > edge_delay &&
           some(camera.it.recent.unmeasured + camera.refused(EventReason::wrong_exposure),
                camera.it.recent.triggers) &&
           absolute(late) < edge_delay;
}

bool exposes_not(const CameraView& camera) {
    return camera.triggered() && camera.strobe() && camera.quiet() &&
           !camera.it.pipeline.measured &&
           some(camera.it.recent.unmeasured, camera.it.recent.triggers);
}

/// One that delivered a moment ago may be restarting.
std::string not_exposing_hint(const CameraView& camera) {
    const Duration quiet = camera.all.now - camera.it.pipeline.last_sign;
    if (camera.it.delivery.ever && quiet < restart_time)
        return fmt::format(
            "no response to triggers for {:.1f} s; it may be restarting: if it does not return, "
            "check its power",
            static_cast<double>(quiet.ns) * 1e-9);
    return fmt::format(
        "triggers are sent but it does not expose: check that its trigger cable is on output {}, "
        "and TriggerSource",
        camera.it.configuration.output);
}

/// No frame is of a trigger without a measured exposure.
bool frames_fit(const CameraView& camera) {
    const PipelineReport& recent = camera.it.recent;
    return camera.frames() + recent.unmeasured <= recent.triggers + recent.records_doubted + 2;
}

/// Triggers that the camera did not take: by its exposure line, which is silent and as many frames
/// are missing; or by its own events; or because frames are missing of which it has not counted
/// any.
std::uint64_t ignored_triggers(const CameraView& camera) {
    const PipelineReport& recent = camera.it.recent;
    if (camera.strobe()) return frames_fit(camera) ? recent.answers.ignored : 0;
    const std::uint64_t arrived = camera.frames() + camera.on_link() + recent.answers.ids_skipped;
    const std::uint64_t missing = recent.triggers - std::min(recent.triggers, arrived);
    return std::max(recent.triggers_missed, missing);
}

/// By its own events; lately, or in a start, where triggers are too few.
bool missed(const CameraView& camera) {
    const PipelineReport& all = camera.it.pipeline;
    return some(camera.it.recent.triggers_missed, camera.it.recent.triggers) ||
           (all.pairing == pairing::State::searching && some(all.triggers_missed, all.triggers));
}

bool ignores_triggers(const CameraView& camera) {
    return camera.triggered() && !camera.full() && camera.frames() > 0 &&
           some(ignored_triggers(camera), camera.it.recent.triggers);
}

bool takes_every_nth(const CameraView& camera) {
    return camera.triggered() && !camera.full() && camera.frames() > 0 &&
           camera.it.pipeline.answers.every > 1;
}

std::string ordinal(std::uint64_t number) {
    return fmt::format("{}{}", number, number == 2 ? "nd" : number == 3 ? "rd" : "th");
}

std::string in_ms(Duration duration) {
    return fmt::format("{:.4g} ms", static_cast<double>(duration.ns) * 1e-6);
}

/// It was ready for those that it took, and not for the one before.
std::string every_nth_hint(const CameraView& camera) {
    const AnswerReport& answers = camera.it.pipeline.answers;
    const double rate_hz = camera.it.configuration.rate_hz / static_cast<double>(answers.every);
    return fmt::format(
        "takes every {} trigger: exposure ({}) and readout need more than {}, and at most {}: "
        "lower 'rate_hz' to {:.4g}, shorten ExposureTime, or set TriggerOverlap to ReadOut",
        ordinal(answers.every), in_ms(camera.exposure()),
        in_ms(camera.period() * static_cast<std::int64_t>(answers.every - 1)),
        in_ms(answers.shortest), rate_hz);
}

std::string ignored_hint(const CameraView& camera) {
    const PipelineReport& all = camera.it.pipeline;
    std::uint64_t ignored = ignored_triggers(camera);
    std::uint64_t triggers = camera.it.recent.triggers;
    if (!some(ignored, triggers)) {
        ignored = all.triggers_missed;
        triggers = all.triggers;
    }
    return fmt::format(
        "ignores {:.0f} % of triggers: {} of the last {}; it may still be exposing or reading out, "
        "or miss the pulses: lower 'rate_hz' or ExposureTime, check the trigger cable",
        100 * share(ignored, triggers), ignored, triggers);
}

bool sends_too_many(const CameraView& camera) {
    const std::uint64_t triggers =
        camera.it.recent.triggers + camera.it.recent.records_doubted + camera.on_link();
    return camera.triggered() && !camera.full() && triggers > 0 && camera.frames() > triggers + 1 &&
           some(camera.frames() - triggers, triggers);
}

/// Ids that do not count prove nothing.
bool ids_fail(const CameraView& camera) {
    const AnswerReport& answers = camera.it.recent.answers;
    return camera.triggered() && !camera.full() &&
           (answers.ids_restarted > 0 || some(answers.ids_repeated, camera.frames()));
}

std::string ids_hint(const CameraView& camera) {
    const AnswerReport& answers = camera.it.recent.answers;
    if (all_of(answers.ids_repeated + 1, camera.frames()))
        return fmt::format(
            "{} frames arrived, all with block id {}: they cannot be proved; update the camera's "
            "firmware",
            camera.frames(), answers.block_id);
    return fmt::format(
        "of the last {} frames, {} repeat the previous block id, and ids restarted {} times: these "
        "frames are withheld; update the camera's firmware",
        camera.frames(), answers.ids_repeated, answers.ids_restarted);
}

std::string clock_hint(const CameraView& camera) {
    const double rate = camera.it.pipeline.answers.clock_rate;
    if (rate == 1) return "";
    return fmt::format(
        "its clock runs at {:.4g} times its stated rate, so frames are paired by arrival: set "
        "camera_clock = false, or update its firmware",
        rate);
}

bool frames_missing(const CameraView& camera) {
    const std::uint64_t unmeasured =
        camera.triggered() && camera.strobe() ? camera.it.recent.unmeasured : 0;
    const std::uint64_t exposed = camera.it.recent.triggers - unmeasured;
    const std::uint64_t arrived = camera.frames() + camera.on_link();
    return camera.has_triggers() && !camera.full() && exposed > arrived &&
           some(exposed - arrived, exposed);
}

bool all_frames_missing(const CameraView& camera) {
    return camera.quiet() && frames_missing(camera);
}

std::string missing_hint(const CameraView& camera) {
    const std::uint64_t triggers = camera.it.recent.triggers;
    const std::uint64_t missing = triggers - std::min(camera.frames(), triggers);
    if (!camera.triggered())
        return fmt::format(
            "{} of the last {} triggers sent by network have no frame here: check network and "
            "firewall, for commands to UDP port 3956 and for frames",
            missing, triggers);
    if (!camera.strobe())
        return fmt::format(
            "{} of the last {} triggers have no frame here, and without an exposure line nothing "
            "shows why: check trigger cable, TriggerSource, network and firewall",
            missing, triggers);
    return fmt::format(
        "{} of the last {} exposures have no frame here: check network, firewall and the camera's "
        "bandwidth limit",
        missing, triggers);
}

/// Some triggers are answered, the others come while it is busy.
bool answers_some(const CameraView& camera) {
    const std::uint64_t asked = camera.it.recent.triggers;
    const std::uint64_t answered = camera.frames() + camera.on_link();
    const bool free = !camera.has_triggers() && camera.frames() > 0;
    return !camera.full() &&
           (free || (asked > answered && camera.frames() > 0 && some(asked - answered, asked)));
}

bool strobe_missing(const CameraView& camera) {
    return camera.triggered() && camera.strobe() && camera.frames() > 0 && !frames_fit(camera) &&
           some(camera.it.recent.unmeasured, camera.it.recent.triggers);
}

/// Frames come, and so do exposures, but they are not each other's.
bool not_followed(const CameraView& camera) {
    const PipelineReport& recent = camera.it.recent;
    const bool searching = camera.it.pipeline.pairing != pairing::State::locked &&
                           2 * camera.frames() >= recent.triggers;
    return camera.triggered() && !camera.full() && camera.frames() > 0 &&
           (!camera.strobe() || !some(recent.unmeasured, recent.triggers)) &&
           (searching ||
            some(camera.refused(EventReason::mismatch) + camera.refused(EventReason::unproved),
                 camera.frames()));
}

std::string unproved_hint(const CameraView& c) {
    const std::uint64_t proved = c.it.recent.published - c.it.recent.suspect;
    if (proved == 0)
        return fmt::format(
            "none of the last {} frames was proved: they do not follow the triggers of output {}; "
            "are trigger cables swapped? check TriggerSource",
            c.frames(), c.it.configuration.output);
    return fmt::format(
        "only {} of the last {} frames were proved: frames or the board's records are late or "
        "lost; lower the load of the host, or check network and cables",
        std::min(proved, c.frames()), c.frames());
}

/// Of exposures that the board does not see.
std::string unseen_hint(const CameraView& c) {
    const Duration exposure = c.it.pipeline.commanded_exposure;
    const double glitch_us = c.it.configuration.glitch_us;
    if (exposure.ns > 0 && exposure < from_us(glitch_us))
        return fmt::format(
            "frames arrive, but the board filters out their exposures of {:.1f} us as glitches: "
            "lower 'glitch_us' (now {:g} us), or expose for longer",
            static_cast<double>(exposure.ns) * 1e-3, glitch_us);
    return "frames arrive, but their exposures are not measured: check the exposure line, "
           "'strobe_line' and 'max_exposure_us', or set strobe = \"none\"";
}

std::string count_of(std::uint64_t part, std::uint64_t whole) {
    return fmt::format("{} of the last {} frames", part, whole);
}

std::string rates(const CameraView& camera) {
    return fmt::format("{:.1f} of {:g} Hz", camera.it.delivery.rate_hz,
                       camera.it.configuration.rate_hz);
}

/// Setting up is a few hundred answers.
std::string opening_hint(const CameraView& camera) {
    const Duration lasts = camera.it.camera.setting_up;
    if (lasts < long_set_up && !own_hint(camera).empty()) return own_hint(camera);
    if (lasts < long_set_up) return "it is being opened and set up";
    return fmt::format(
        "it is being set up, which has taken {} s so far: a new description takes up to 10 s, a "
        "slow control channel longer",
        lasts.ns / seconds(1).ns);
}

template <Fault fault>
bool by_ptp(const CameraView& camera) {
    return diagnose_ptp(camera.it, camera.all).fault == fault;
}

std::string ptp_hint(const CameraView& camera) { return diagnose_ptp(camera.it, camera.all).hint; }

struct Rule {
    Fault fault;
    bool (*applies)(const CameraView&);
    std::string (*hint)(const CameraView&);
};

/// The first that applies is the cause.
constexpr Rule camera_rules[] = {
    {Fault::block_ids, numbers_anew,
     [](const CameraView& /*c*/) {
         return std::string(
             "its block ids keep restarting, and it is reopened each time: update its firmware, "
             "and check its power");
     }},
    {Fault::camera_lease, leased, own_hint},
    {Fault::camera_busy, in<CameraState::busy>, own_hint},
    {Fault::camera_unreachable, in<CameraState::unreachable>, own_hint},
    {Fault::camera_absent, in<CameraState::absent>, own_hint},
    {Fault::camera_misconfigured, in<CameraState::misconfigured>, own_hint},
    {Fault::camera_failed, in<CameraState::failed>, own_hint},
    {Fault::board_gone,
     [](const CameraView& c) {
         return c.triggered() && c.all.board_diagnosis.fault == Fault::board_gone;
     },
     [](const CameraView& /*c*/) { return std::string("no triggers: the board is gone"); }},
    {Fault::board_silent,
     [](const CameraView& c) {
         return c.triggered() && c.all.board_diagnosis.fault == Fault::board_silent;
     },
     [](const CameraView& /*c*/) { return std::string("no triggers: the board does not answer"); }},
    {Fault::board_refuses,
     [](const CameraView& c) {
         return c.triggered() && c.all.board_diagnosis.fault == Fault::board_refuses;
     },
     [](const CameraView& /*c*/) {
         return std::string("no triggers: the board refuses, see its own hint");
     }},
    {Fault::board_stamps,
     [](const CameraView& c) {
         return c.triggered() && c.strobe() && c.all.board_diagnosis.fault == Fault::board_stamps;
     },
     [](const CameraView& /*c*/) {
         return std::string("its exposures are not measured: see the board's hint");
     }},
    {Fault::block_ids, [](const CameraView& c) { return c.it.camera.stuck_ids; },
     [](const CameraView& /*c*/) {
         return std::string(
             "packets arrive, but no frame completes: the camera seems to give all frames one "
             "block id; update its firmware, or power it off and on");
     }},
    {Fault::camera_silent, in<CameraState::silent>,
     [](const CameraView& /*c*/) {
         return std::string("the camera does not answer: check its cable and power");
     }},
    {Fault::clock_unknown,
     [](const CameraView& c) {
         return c.triggered() && c.all.clock_diagnosis.fault == Fault::clock_unknown;
     },
     [](const CameraView& /*c*/) {
         return std::string("frames are withheld: the board's clock is not known yet");
     }},
    {Fault::starting, [](const CameraView& c) { return !c.streaming(); }, opening_hint},
    {Fault::ptp_master, by_ptp<Fault::ptp_master>, ptp_hint},
    {Fault::ptp_lost, by_ptp<Fault::ptp_lost>, ptp_hint},
    {Fault::ptp_other_time, by_ptp<Fault::ptp_other_time>, ptp_hint},
    {Fault::ptp_contradicted, by_ptp<Fault::ptp_contradicted>, ptp_hint},
    {Fault::ptp_unread, by_ptp<Fault::ptp_unread>, ptp_hint},
    {Fault::ptp_refused, by_ptp<Fault::ptp_refused>, ptp_hint},
    {Fault::ptp_stamps, by_ptp<Fault::ptp_stamps>, ptp_hint},
    {Fault::link_full,
     [](const CameraView& c) { return lost_packets(c) && !c.it.camera.bandwidth.fits(); },
     own_hint},
    {Fault::packet_size, packets_too_large,
     [](const CameraView& c) {
         return fmt::format(
             "{} lost packets: do packets of {} bytes pass? set the MTU of interface and switches "
             "to 9000, or packet_size = 1500; else check the cable",
             count_of(c.refused(EventReason::frame_incomplete), c.frames()),
             c.it.camera.packet_size);
     }},
    {Fault::packet_loss, lost_packets,
     [](const CameraView& c) {
         return fmt::format(
             "{} lost packets in transit: check cable and switch, raise "
             "net.core.rmem_max, or lower rate or size",
             count_of(c.refused(EventReason::frame_incomplete), c.frames()));
     }},
    {Fault::wrong_size,
     [](const CameraView& c) {
         return !c.full() && some(c.refused(EventReason::wrong_size), c.frames());
     },
     [](const CameraView& c) {
         return fmt::format(
             "{} did not have the announced size: does another program control the camera? restart "
             "the service after a change",
             count_of(c.refused(EventReason::wrong_size), c.frames()));
     }},
    {Fault::no_buffer, [](const CameraView& c) { return !c.full() && c.it.recent.no_buffer > 0; },
     [](const CameraView& c) {
         return fmt::format("{} frames found no free slot: raise 'slots' and 'buffers'",
                            c.it.recent.no_buffer);
     }},
    {Fault::no_exposure, exposes_not, not_exposing_hint},
    {Fault::block_ids, [](const CameraView& c) { return c.streaming() && c.it.camera.deaf; },
     [](const CameraView& /*c*/) {
         return std::string(
             "packets arrive, but no frame completes: its block ids stand still or start over, or "
             "the end of each frame is lost; it is reopened, and if that does not help, update its "
             "firmware");
     }},
    {Fault::triggers_ignored,
     [](const CameraView& c) {
         return c.triggered() && !c.full() && missed(c) && !takes_every_nth(c) &&
                !exposes_too_long(c);
     },
     ignored_hint},
    {Fault::no_frames, all_frames_missing, missing_hint},
    {Fault::camera_clock,
     [](const CameraView& c) { return c.triggered() && !c.full() && !clock_hint(c).empty(); },
     clock_hint},
    {Fault::rate_too_high, takes_every_nth, every_nth_hint},
    // A start in progress looks like what follows.
    {Fault::starting, [](const CameraView& c) { return c.starting(); },
     [](const CameraView& c) {
         return c.it.camera.reopened.empty() || c.all.now - c.it.camera.since > reopened_lately
                    ? std::string("a start is in progress: its frames are being proved")
                    : fmt::format("it was reopened ({}): its frames are being proved",
                                  c.it.camera.reopened);
     }},
    {Fault::no_triggers, no_records,
     [](const CameraView& c) {
         return c.it.configuration.master.empty()
                    ? std::string("the board reports no triggers: see its hint and 'output'")
                    : fmt::format("no triggers: {}, its master, does not expose",
                                  c.it.configuration.master);
     }},
    {Fault::late_records, late_records,
     [](const CameraView& c) {
         return fmt::format(
             "the board's records arrive {} ms after the exposure, too late to prove frames: lower "
             "the load of host and USB",
             c.it.pipeline.record_delay.ns / 1'000'000);
     }},
    {Fault::late_records, later_records,
     [](const CameraView& c) {
         return fmt::format(
             "the board's records arrive {} after the exposure, {} later than before: frames are "
             "withheld until exchanges show that this is the link, and no step of the board's "
             "clock; lower the load of host and USB",
             in_ms(c.it.pipeline.record_delay), in_ms(c.it.pipeline.records_late_by));
     }},
    {Fault::exposure_too_long, exposes_too_long,
     [](const CameraView& c) {
         return fmt::format(
             "it exposes for {} us of the {} us period, so triggers arrive while it is busy ({}): "
             "lower ExposureTime or 'rate_hz'",
             c.exposure().ns / 1000, c.period().ns / 1000, rates(c));
     }},
    {Fault::strobe_inverted, strobe_inverted,
     [](const CameraView& c) {
         return fmt::format(
             "{}: the exposure line rises {} us after the trigger, where the exposure of {} us "
             "ends: its polarity is wrong; change 'strobe' to \"{}\"",
             c.it.pipeline.edges.line.empty() ? c.it.name : c.it.pipeline.edges.line,
             c.it.pipeline.start_delay.ns / 1000, c.it.pipeline.commanded_exposure.ns / 1000,
             c.it.configuration.strobe == Strobe::active_high ? "active_low" : "active_high");
     }},
    {Fault::line_delays, line_leads,
     [](const CameraView& c) {
         return fmt::format(
             "the exposure line rises {} before the trigger: set its delay and pre-delay "
             "(StrobeLinePreDelay) to 0, and check its LineSource",
             in_ms(c.it.pipeline.answers.lead));
     }},
    {Fault::line_delays,
     [](const CameraView& c) { return c.triggered() && !line_hint(c.it.pipeline.edges).empty(); },
     [](const CameraView& c) { return line_hint(c.it.pipeline.edges); }},
    {Fault::wrong_exposure,
     [](const CameraView& c) { return c.triggered() && c.it.pipeline.exposure_contradicted; },
     [](const CameraView& c) {
         return fmt::format(
             "the exposure line shows {} us, but the camera was to expose {} us: unless "
             "ExposureTime was changed, check 'strobe_line' and its LineSource, or set "
             "check_exposure = false",
             c.it.pipeline.exposure.ns / 1000, c.it.pipeline.camera_exposure.ns / 1000);
     }},
    {Fault::wrong_exposure, exposure_changed,
     [](const CameraView& c) {
         return fmt::format(
             "its exposure line suddenly shows {} us: frames are withheld until that lasts; did "
             "another program, or the camera itself, change ExposureTime?",
             c.it.pipeline.doubted_exposure.ns / 1000);
     }},
    {Fault::double_frames, sends_too_many,
     [](const CameraView& c) {
         return fmt::format(
             "sends {} frames for {} triggers: none of the surplus is proved; set "
             "AcquisitionFrameCount and burst count to 1, and check the trigger line for bounces",
             c.frames(), c.it.recent.triggers);
     }},
    {Fault::block_ids, ids_fail, ids_hint},
    {Fault::triggers_ignored, ignores_triggers, ignored_hint},
    {Fault::unproved, not_followed, unproved_hint},
    {Fault::unproved, by_ptp<Fault::unproved>, ptp_hint},
    {Fault::rate_too_high,
     [](const CameraView& c) {
         return answers_some(c) && (!c.strobe() || !c.triggered() || !frames_missing(c));
     },
     [](const CameraView& c) {
         return fmt::format(
             "delivers {}: the camera ignores triggers at this rate; lower 'rate_hz', the exposure "
             "time or the image size",
             rates(c));
     }},
    {Fault::no_frames, frames_missing, missing_hint},
    {Fault::strobe_missing, strobe_missing, unseen_hint},
    {Fault::too_slow, [](const CameraView& c) { return !c.full(); },
     [](const CameraView& c) {
         return fmt::format("{} are delivered: 'versavis tail events' shows what is missing",
                            rates(c));
     }},
};

/// Nothing comes from a board with this fault.
bool cut_off(Fault fault) {
    return fault == Fault::board_gone || fault == Fault::board_silent ||
           fault == Fault::board_refuses;
}

bool young(HostTime since, HostTime now) { return now - since < start_patience; }

/// Whatever is wrong, who never delivered is given its time first.
Health health_of(Fault fault, bool delivered, bool in_time) {
    if (fault == Fault::none) return Health::ok;
    return !delivered && in_time ? Health::starting : Health::degraded;
}

Diagnosis conclude(Fault fault, std::string hint, bool delivered, bool in_time) {
    return {health_of(fault, delivered, in_time), fault, std::move(hint), {}};
}

bool answered_by_nobody(std::int64_t answer) {
    return answer == 0 || answer == 0xFF || answer == 0xFFFF;
}

Fault fault_of(const ImuFailure& failure) {
    if (failure.kind == wire::BoardEventKind::imu_silent) return Fault::imu_silent;
    if (failure.step == imu_step_running) return Fault::imu_failed;
    return answered_by_nobody(failure.answer) ? Fault::imu_missing : Fault::imu_wrong;
}

/// Of a board that runs: what is no fault of it, and to be known all the same.
std::string board_remark(const Status& status) {
    const BoardReport& board = status.board;
    if (!board.hint.empty()) return board.hint;
    if (board.unkept) return unkept_configuration;
    if (board.awaits_sync)
        return "cameras begin with pulses of the sync input: if none come, check the cable, and "
               "that "
               "the sending board runs, with the same 'sync_rate_hz' as this one (without the key "
               "1 Hz is expected)";
    if (board.health.sync_state == wire::SyncState::lost)
        return "the sync input's pulses do not fit the grid: if they fit each other, it goes to "
               "them "
               "by 0.1 % at most; else check the cable, and that 'sync_rate_hz' matches the "
               "sending "
               "board";
    if (firmware_outdated(status))
        return fmt::format(
            "its firmware, {}, is older than this service, {}: stop the service, "
            "then run 'versavis flash {}'",
            board.firmware, status.release, board::firmware_file().string());
    return "";
}

}  // namespace

const char* to_string(Health health) {
    switch (health) {
        case Health::ok: return "ok";
        case Health::starting: return "starting";
        case Health::degraded: return "degraded";
    }
    return "degraded";
}

const char* to_string(Fault fault) {
    switch (fault) {
        case Fault::none: return "";
        case Fault::starting: return "starting";
        case Fault::board_gone: return "board_gone";
        case Fault::board_silent: return "board_silent";
        case Fault::board_refuses: return "board_refuses";
        case Fault::board_stamps: return "board_stamps";
        case Fault::clock_unknown: return "clock_unknown";
        case Fault::clock_holdover: return "clock_holdover";
        case Fault::clock_step: return "clock_step";
        case Fault::seconds_differ: return "seconds_differ";
        case Fault::host_undisciplined: return "host_undisciplined";
        case Fault::camera_absent: return "camera_absent";
        case Fault::camera_unreachable: return "camera_unreachable";
        case Fault::camera_busy: return "camera_busy";
        case Fault::camera_lease: return "camera_lease";
        case Fault::camera_misconfigured: return "camera_misconfigured";
        case Fault::camera_silent: return "camera_silent";
        case Fault::camera_failed: return "camera_failed";
        case Fault::link_full: return "link_full";
        case Fault::packet_size: return "packet_size";
        case Fault::packet_loss: return "packet_loss";
        case Fault::wrong_size: return "wrong_size";
        case Fault::no_buffer: return "no_buffer";
        case Fault::no_triggers: return "no_triggers";
        case Fault::late_records: return "late_records";
        case Fault::exposure_too_long: return "exposure_too_long";
        case Fault::strobe_inverted: return "strobe_inverted";
        case Fault::no_exposure: return "no_exposure";
        case Fault::no_frames: return "no_frames";
        case Fault::camera_clock: return "camera_clock";
        case Fault::rate_too_high: return "rate_too_high";
        case Fault::triggers_ignored: return "triggers_ignored";
        case Fault::double_frames: return "double_frames";
        case Fault::block_ids: return "block_ids";
        case Fault::strobe_missing: return "strobe_missing";
        case Fault::line_delays: return "line_delays";
        case Fault::wrong_exposure: return "wrong_exposure";
        case Fault::unproved: return "unproved";
        case Fault::too_slow: return "too_slow";
        case Fault::ptp_master: return "ptp_master";
        case Fault::ptp_lost: return "ptp_lost";
        case Fault::ptp_other_time: return "ptp_other_time";
        case Fault::ptp_unread: return "ptp_unread";
        case Fault::ptp_refused: return "ptp_refused";
        case Fault::ptp_stamps: return "ptp_stamps";
        case Fault::ptp_contradicted: return "ptp_contradicted";
        case Fault::imu_missing: return "imu_missing";
        case Fault::imu_wrong: return "imu_wrong";
        case Fault::imu_silent: return "imu_silent";
        case Fault::imu_failed: return "imu_failed";
        case Fault::imu_faulty: return "imu_faulty";
        case Fault::time_unknown: return "time_unknown";
        case Fault::time_silent: return "time_silent";
        case Fault::time_wrong: return "time_wrong";
        case Fault::lidar_not_following: return "lidar_not_following";
        case Fault::lidar_unproved: return "lidar_unproved";
    }
    return "";
}

std::string describe_failure(const ImuReport& imu) {
    switch (fault_of(imu.failure)) {
        case Fault::imu_missing:
            return fmt::format(
                "no part answers (0x{:X}): check that the {} is plugged in, its power, its wiring "
                "and 'model'",
                imu.failure.answer, imu.model);
        case Fault::imu_wrong:
            return fmt::format(
                "a part other than the {} answers (0x{:X} in step {} of its set-up): correct "
                "'model', or plug in the right one",
                imu.model, imu.failure.answer, imu.failure.step);
        case Fault::imu_silent:
            return fmt::format(
                "the {} sends nothing: check its power, and its data-ready or serial line",
                imu.model);
        default:
            return fmt::format(
                "the {} failed while sampling and is being set up again: check its power and the "
                "length of its cable",
                imu.model);
    }
}

Diagnosis diagnose_board(const Status& status) {
    const BoardReport& board = status.board;
    const bool in_time = young(status.started, status.now);
    const bool known = board.connections > 0;
    const bool quiet = known && status.clock.since_contact > board_silence;
    const std::string silence =
        fmt::format("silent for {:.1f} s: check its cable and power",
                    static_cast<double>(status.clock.since_contact.ns) * 1e-9);
    if (!status.board_needed) return {};
    switch (board.state) {
        case BoardState::absent: return conclude(Fault::board_gone, board.hint, known, in_time);
        case BoardState::handshake:
            return conclude(quiet ? Fault::board_silent : Fault::starting,
                            quiet ? silence : "found; waiting for its identification", quiet,
                            in_time);
        case BoardState::incompatible:
        case BoardState::refused: return conclude(Fault::board_refuses, board.hint, true, in_time);
        case BoardState::running: break;
    }
    if (quiet) return conclude(Fault::board_silent, silence, known, in_time);
    if (board.health.stamp_test == wire::StampTest::failed)
        return conclude(
            Fault::board_stamps,
            "its stamp self-test fails, so no exposure is measured: disconnect anything at GPIO18 "
            "and power it off and on; if that does not help, replace it",
            true, in_time);
    return conclude(Fault::none, board_remark(status), known, in_time);
}

/// Of a clock whose estimate is good: who names the seconds?
Diagnosis diagnose_seconds(const Status& status) {
    const clock::PpsReport& pps = status.clock.pps;
    if (status.pps_labels == clock::PpsLabels::host && status.clock.kernel.error != 0)
        return conclude(Fault::host_undisciplined,
                        fmt::format("PPS is not used: whether the host's clock, which names its "
                                    "seconds, is disciplined cannot be read ({}); leave the "
                                    "container or remove the drop-in closed.conf that forbids it, "
                                    "or set pps = \"nmea\"",
                                    std::generic_category().message(status.clock.kernel.error)),
                        false, false);
    if (status.pps_labels == clock::PpsLabels::host && !status.clock.kernel.synchronised)
        return conclude(Fault::host_undisciplined,
                        "PPS is not used: the kernel reports that the host's clock, which names "
                        "its seconds, is not disciplined; start chrony, or ptp4l and phc2sys, or "
                        "set pps = \"nmea\"",
                        false, young(status.started, status.now));
    if (pps.second_difference == 0) return {};
    return conclude(Fault::seconds_differ,
                    fmt::format("the receiver at the board is {} s {} the host: has it received "
                                "the leap seconds, and reports UTC? Is the host's clock right? "
                                "Then set 'on_second_conflict' of [clock]",
                                std::abs(pps.second_difference),
                                pps.second_difference > 0 ? "ahead of" : "behind"),
                    true, false);
}

Diagnosis diagnose_clock(const Status& status) {
    const bool in_time = young(status.started, status.now);
    const Fault cause = status.board_diagnosis.fault;
    if (!status.board_needed) return {};
    using clock::ClockState;
    const ClockState state = status.clock.state;
    if (cut_off(cause) && state != ClockState::locked)
        return conclude(cause, "no exchanges: see the board's hint", status.clock.slots > 0,
                        in_time);
    switch (state) {
        case ClockState::locked: return diagnose_seconds(status);
        case ClockState::init:
        case ClockState::reset:
            return conclude(Fault::clock_unknown,
                            "the board's clock is not known yet: it takes a few exchanges", false,
                            in_time);
        case ClockState::converging:
            return conclude(Fault::starting, "the estimate is still converging", false, in_time);
        case ClockState::holdover:
            return conclude(Fault::clock_holdover,
                            "no exchanges for seconds, sigma grows: check the board's cable and "
                            "the host's load",
                            true, in_time);
        case ClockState::step:
            return conclude(Fault::clock_step,
                            "messages contradict the estimate, which restarts if that lasts: was a "
                            "clock set, or the host suspended?",
                            true, in_time);
    }
    return {};
}

Diagnosis diagnose(const CameraStatus& status, const Status& all) {
    const CameraView camera{status, all};
    if (camera.in(CameraState::stopped))
        return conclude(
            Fault::none,
            fmt::format("stopped by request: 'versavis start {}' starts it", status.name), true,
            {});
    const Rule* rule =
        std::find_if(std::begin(camera_rules), std::end(camera_rules),
                     [&](const Rule& candidate) { return candidate.applies(camera); });
    if (rule == std::end(camera_rules)) {
        const std::string& own = status.camera.hint;
        return conclude(Fault::none, own.empty() ? clock_hint(camera) : own, true, {});
    }
    const Duration patience = start_patience + camera.period() * start_periods;
    const bool asked = rule->fault == Fault::starting && all.now - all.changed < patience;
    return conclude(rule->fault, rule->hint(camera), status.delivery.ever && !asked,
                    asked || all.now - all.started < patience);
}

Diagnosis diagnose(const ImuStatus& imu, const Status& all) {
    const auto because = [&](Fault fault, const std::string& hint) {
        const bool asked = fault == Fault::starting && young(all.changed, all.now);
        return conclude(fault, hint, imu.delivery.ever && !asked,
                        asked || young(all.started, all.now));
    };
    const ImuReport& report = imu.report;
    const Fault cause = all.board_diagnosis.fault;
    if (cut_off(cause)) return because(cause, "no samples: the board is gone or silent");
    if (cause == Fault::board_stamps && !imu.delivery.full)
        return because(cause, "its samples are not stamped: see the board's hint");
    if (some(imu.recent.faulty, imu.recent.published))
        return because(Fault::imu_faulty,
                       fmt::format("{} of the last {} samples failed their check: check wiring, "
                                   "ground and the length of its cable",
                                   imu.recent.faulty, imu.recent.published));
    if (report.failure.times > 0 && (!report.working || report.failure.times > 1) &&
        !imu.delivery.full)
        return because(fault_of(report.failure), describe_failure(report));
    if (imu.delivery.full) return {};
    if (young(imu.delivery.began, all.now) && !imu.delivery.fell_short)
        return because(Fault::starting, "it is being set up");
    if (imu.recent.published == 0)
        return because(Fault::imu_silent, "no samples come: check its power and its wiring");
    return because(Fault::too_slow,
                   fmt::format("{:.1f} of {:g} Hz are delivered: lower 'rate_hz', or the load of "
                               "USB and board",
                               imu.delivery.rate_hz, report.rate_hz));
}

Diagnosis diagnose(const TimeOutputStatus& output, const Status& all) {
    const TimeOutputReport& report = output.report;
    const auto because = [&](Fault fault) {
        return conclude(fault, report.hint, report.pulses > 0, young(all.started, all.now));
    };
    const Fault cause = all.board_diagnosis.fault;
    if (cut_off(cause))
        return conclude(cause,
                        "after 'holdover_s' its sentences say that the time is not known: see the "
                        "board's hint",
                        report.pulses > 0, young(all.started, all.now));
    switch (report.state) {
        case TimeOutputState::waiting: return because(Fault::time_unknown);
        case TimeOutputState::silent: return because(Fault::time_silent);
        case TimeOutputState::wrong: return because(Fault::time_wrong);
        case TimeOutputState::sending: break;
    }
    return {};
}

Diagnosis diagnose(const LidarStatus& lidar, const Status& all) {
    const LidarReport& report = lidar.report;
    if (report.verdict == lidar_follows) return {};
    const bool in_time = young(all.started, all.now);
    if (report.verdict == lidar_unproved)
        return conclude(Fault::lidar_unproved, report.hint, false, in_time);
    std::string hint = report.hint;
    for (const TimeOutputStatus& output : all.time_outputs)
        if (output.diagnosis.fault != Fault::none)
            hint += fmt::format("; if its time is that of '{}', see its hint first: it is {}",
                                output.report.name, to_string(output.report.state));
    return conclude(Fault::lidar_not_following, std::move(hint), false, in_time);
}

}  // namespace versavis::daemon

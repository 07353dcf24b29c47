// SPDX-License-Identifier: BSD-3-Clause
#include "genicam_camera.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <iterator>
#include <utility>

#include "bytes.hpp"
#include "gige_registers.hpp"

namespace versavis::rig {

namespace {

std::vector<Fault> faults_of(const Scenario& scenario, const std::string& camera) {
    std::vector<Fault> faults;
    std::copy_if(scenario.faults.begin(), scenario.faults.end(), std::back_inserter(faults),
                 [&](const Fault& fault) { return fault.camera == camera; });
    return faults;
}

/// What its clock shows when it stamps the frame of this exposure.
HostTime stamped(const CameraScenario& camera, HostTime start, HostTime end) {
    switch (camera.stamps) {
        case Stamped::middle: return middle(start, end);
        case Stamped::end: return end;
        case Stamped::readout: return end + Duration{std::llround(camera.readout_us * 1e3)};
        default: return start;
    }
}

/// A scheduled action is taken so much earlier: then the board hears of the line's edges in time.
constexpr Duration action_lead = milliseconds(22);

PtpFollower::Settings ptp_settings(const CameraScenario& camera) {
    return {camera.clock, Duration{std::llround(camera.ptp_lock_s * 1e9)},
            std::llround(camera.ptp_error_ns), std::llround(camera.ptp_swing_ns)};
}

}  // namespace

GenicamCamera::GenicamCamera(const World& world, const CameraScenario& settings,
                             const CameraFamily& family, TransportMemory memory,
                             CameraTransport& transport)
    : settings_(settings),
      faults_(faults_of(world.scenario, settings.name)),
      zero_(world.zero),
      ahead_of_utc_s_(world.scenario.ptp.ahead_of_utc_s),
      truth_(world.truth),
      clock_(world.zero, world.scenario.ptp, ptp_settings(settings)),
      family_(family),
      chunk_order_(memory.chunk_order),
      registers_(settings, family, std::move(memory)),
      view_(world.scenario, settings, world.surroundings),
      transport_(transport),
      random_(world.scenario.seed),
      queue_([this](StreamFrame frame) {
          if (muted()) return frame.done(false);
          transport_.transmit(std::move(frame));
      }) {}

GenicamCamera::Written GenicamCamera::write(std::uint32_t address,
                                            std::span<const std::uint8_t> bytes) {
    {
        const std::lock_guard lock(mutex_);
        if (registers_.locked(address, acquiring_)) return Written::locked;
    }
    if (!registers_.write(address, bytes)) return Written::no_such;
    switch (address) {
        case reg_acquisition_start: start_acquisition(); break;
        case reg_acquisition_stop: stop_acquisition(); break;
        case reg_trigger_software:
            if (registers_.value(reg_trigger_source) == 0) expose(host_now(), nullptr);
            break;
        case reg_ptp_enable:
            clock_.enable(registers_.value(reg_ptp_enable) != 0, host_now());
            latch_ptp();
            break;
        case reg_ptp_latch: latch_ptp(); break;
        case reg_clock_latch: latch_clock(); break;
        default: break;
    }
    return Written::done;
}

/// If the host wants to know of such events.
void GenicamCamera::send_event(CameraEventId id, HostTime at, std::uint64_t block_id) {
    if (registers_.value(reg_event_notification + 4 * event_index(id)) == 0 || muted()) return;
    transport_.send_event(at, {id, block_id, ticks(at), settings_.extended_ids});
}

std::uint64_t GenicamCamera::ticks(HostTime at) const {
    const std::int64_t ns = clock_.device_ns(at);
    if (settings_.clock_rate == 1) return static_cast<std::uint64_t>(ns);
    return static_cast<std::uint64_t>(std::llround(static_cast<double>(ns) * settings_.clock_rate));
}

void GenicamCamera::start_acquisition() {
    const std::lock_guard lock(mutex_);
    acquiring_ = true;
    block_id_ = 0;
    free_run_next_ = host_now();
}

void GenicamCamera::stop_acquisition() {
    {
        const std::lock_guard lock(mutex_);
        acquiring_ = false;
        actions_.clear();
    }
    queue_.clear();
    transport_.forget_frames();
}

void GenicamCamera::restart() {
    stop_acquisition();
    registers_.reset();
    clock_.enable(false, host_now());
}

void GenicamCamera::latch_ptp() {
    const HostTime now = host_now();
    const PtpPort port = clock_.port(now);
    const bool follows = port == PtpPort::slave;
    registers_.write(reg_ptp_status, static_cast<std::uint32_t>(port));
    registers_.write(reg_ptp_offset,
                     follows ? static_cast<std::uint32_t>(clock_.offset_ns(now)) : 0);
    registers_.write(reg_ptp_grandmaster, follows ? 0x00A1B2C3 : 0);
}

void GenicamCamera::latch_clock() {
    std::array<std::uint8_t, sizeof(std::uint64_t)> wire{};
    store_number(wire, ticks(host_now()), std::endian::big);
    registers_.write(std::uint64_t{reg_clock_latched}, wire);
}

GenicamCamera::Action GenicamCamera::schedule(std::uint64_t ticks_then) {
    const HostTime now = host_now();
    if (clock_.port(now) != PtpPort::slave) return Action::no_time;
    const HostTime at = clock_.host(static_cast<std::int64_t>(ticks_then));
    const std::lock_guard lock(mutex_);
    if (registers_.value(reg_trigger_mode) != 1 || registers_.value(reg_trigger_source) != 2)
        return Action::taken;  // and nothing listens to it
    if (at <= now) {
        actions_.push_back(now);
        return Action::late;
    }
    if (actions_.size() >= action_queue_size) return Action::queue_full;
    const double jitter_us =
        std::uniform_real_distribution(0.0, std::max(settings_.action_jitter_us, 1e-9))(random_);
    actions_.push_back(at + Duration{std::llround(jitter_us * 1e3)});
    return Action::taken;
}

bool GenicamCamera::awaits_action() {
    const std::lock_guard lock(mutex_);
    return !actions_.empty();
}

void GenicamCamera::take_actions(HostTime now) {
    for (;;) {
        HostTime due;
        {
            const std::lock_guard lock(mutex_);
            if (actions_.empty() || actions_.front() > now + action_lead) return;
            due = actions_.front();
            actions_.pop_front();
        }
        const auto exposure = expose(due, nullptr);
        const std::lock_guard lock(mutex_);
        const auto line = exposure ? shown({*exposure}) : std::nullopt;
        if (line && show_action_) show_action_(*line);
    }
}

void GenicamCamera::show_actions(std::function<void(const LineActive&)> show) {
    const std::lock_guard lock(mutex_);
    show_action_ = std::move(show);
}

bool GenicamCamera::poll(HostTime now) {
    free_run(now);
    take_actions(now);
    if (muted() || !reboots_.exchange(false)) return false;
    restart();
    return true;
}

void GenicamCamera::free_run(HostTime now) {
    HostTime next;
    {
        const std::lock_guard lock(mutex_);
        const bool triggered = registers_.all(family_.triggered) && !settings_.free_runs;
        if (!acquiring_ || triggered || now < free_run_next_) return;
        next = free_run_next_;
        const double rate = std::max(0.1F, registers_.real(reg_frame_rate));
        free_run_next_ = std::max(now, free_run_next_ + Duration{std::llround(1e9 / rate)});
    }
    expose(next, nullptr);
}

void GenicamCamera::afflict_board(std::function<void(const Fault&)> afflict) {
    const std::lock_guard lock(mutex_);
    afflict_board_ = std::move(afflict);
}

/// The exposures that the trigger makes, one right after the other.
std::vector<GenicamCamera::Interval> GenicamCamera::take_trigger(const TriggerPulse& pulse) {
    const bool listens = registers_.all(family_.triggered) && registers_.all(family_.listens);
    if (!listens || settings_.free_runs || muted()) return {};
    const auto delay = Duration{std::llround(registers_.number(family_.trigger_delay) * 1e3)};
    std::vector<Interval> made;
    auto exposure = expose(pulse.at + delay, &pulse);
    if (!exposure) return {};
    made.push_back(*exposure);
    for (const double wanted = exposures_to_make(); static_cast<double>(made.size()) < wanted;) {
        exposure = expose(made.back().second, &pulse);
        if (!exposure) break;
        made.push_back(*exposure);
    }
    return made;
}

/// By the trigger whose first exposure has just been made.
double GenicamCamera::exposures_to_make() {
    const std::lock_guard lock(mutex_);
    ++triggers_taken_;
    const bool doubled =
        active_fault(FaultKind::double_frame) != nullptr ||
        (settings_.double_every > 0 && triggers_taken_ % settings_.double_every == 0);
    return std::max(registers_.number(family_.burst), doubled ? 2.0 : 1.0);
}

/// What the exposure line makes of it.
std::optional<LineActive> GenicamCamera::shown(const std::vector<Interval>& exposures) const {
    const Interval& exposure = exposures.front();
    if (!family_.shows_exposure.empty() && !registers_.all(family_.shows_exposure))
        return std::nullopt;
    const auto duration_of = [this](const std::optional<Field>& field) {
        return Duration{std::llround(registers_.number(field) * 1e3)};
    };
    const Duration shift = duration_of(family_.line_delay) - duration_of(family_.line_lead);
    const Duration length = duration_of(family_.line_duration);
    const HostTime begin = exposure.first + shift;
    const HostTime end = length.ns > 0 ? begin + length : exposure.second + shift;
    LineActive line{begin, end, registers_.all(family_.line_inverted)};
    line.times = static_cast<unsigned>(exposures.size());
    if (line.times > 1) line.every = exposures[1].first - exposure.first;
    return line;
}

std::optional<LineActive> GenicamCamera::trigger_line(bool level, const TriggerPulse& pulse) {
    const bool falling = registers_.all(family_.falling);
    if (level == (falling != settings_.trigger_inverted)) return std::nullopt;
    const std::vector<Interval> exposures = take_trigger(pulse);
    truth_.add(
        TrueTrigger{settings_.name, pulse.board_life, pulse.trigger, pulse.at, !exposures.empty()});
    const std::lock_guard lock(mutex_);
    const bool cut = active_fault(FaultKind::cut_strobe) != nullptr;
    return !exposures.empty() && !cut ? shown(exposures) : std::nullopt;
}

/// By its own auto exposure.
bool GenicamCamera::exposes_by_itself() const { return registers_.all(family_.exposure_auto); }

Duration GenicamCamera::exposure_at(HostTime at) const {
    double exposure_us = registers_.number(family_.exposure);
    if (exposes_by_itself()) {
        exposure_us = settings_.exposure_us;
        const double seconds = static_cast<double>((at - zero_).ns) * 1e-9;
        const double phase = 2 * 3.14159265358979 * seconds / settings_.exposure_swing_s;
        exposure_us *= 1 + settings_.exposure_swing * std::sin(phase);
        if (family_.exposure_limit)
            exposure_us = std::min(exposure_us, registers_.number(family_.exposure_limit));
        if (family_.chunk_is_integer) exposure_us = std::round(exposure_us);
    }
    return Duration{std::llround(exposure_us * 1e3)};
}

const Fault* GenicamCamera::active_fault(FaultKind kind) const {
    for (const Fault& fault : faults_)
        if (fault.kind == kind && exposures_ >= fault.at_exposure &&
            exposures_ < fault.at_exposure + fault.count)
            return &fault;
    return nullptr;
}

bool GenicamCamera::ignores(const TriggerPulse* pulse) {
    if (active_fault(FaultKind::ignore_trigger) != nullptr) return true;
    return pulse != nullptr && settings_.ignored > 0 &&
           std::uniform_real_distribution(0.0, 1.0)(random_) < settings_.ignored;
}

void GenicamCamera::next_block_id() {
    ++block_id_;
    if (!settings_.extended_ids && block_id_ > 0xFFFF) block_id_ = 1;
}

/// Each chunk is followed by its id and length; those of the image come right after it.
std::vector<std::uint8_t> GenicamCamera::chunks(Duration exposure, std::uint64_t block_id) const {
    std::vector<std::uint8_t> out;
    const auto put_tag = [&](std::uint32_t id, std::uint32_t size) {
        append_number(out, id, sizeof id, chunk_order_);
        append_number(out, size, sizeof size, chunk_order_);
    };
    const auto put_chunk = [&](std::uint32_t id, std::uint32_t value) {
        append_number(out, value, sizeof value, std::endian::big);
        put_tag(id, sizeof value);
    };
    put_tag(family_.image_chunk, registers_.value(reg_width) * registers_.value(reg_height));
    const double us = static_cast<double>(exposure.ns) * 1e-3;
    put_chunk(family_.exposure_chunk,
              family_.chunk_is_integer
                  ? __builtin_bswap32(static_cast<std::uint32_t>(std::llround(us)))
                  : std::bit_cast<std::uint32_t>(static_cast<float>(us)));
    if (family_.gain_chunk == 0) return out;
    put_chunk(family_.gain_chunk,
              registers_.value(reg_gain_auto) != 0
                  ? std::bit_cast<std::uint32_t>(static_cast<float>(block_id % 10))
                  : registers_.value(reg_gain));
    return out;
}

/// Faults that take the whole camera away begin with their exposure.
void GenicamCamera::apply_outages() {
    const Fault* mute = active_fault(FaultKind::camera_mute);
    const Fault* reboot = active_fault(FaultKind::camera_reboot);
    const Fault* outage = reboot != nullptr ? reboot : mute;
    if (outage == nullptr) return;
    const HostTime until = host_now() + Duration{std::llround(outage->seconds * 1e9)};
    muted_until_ns_ = until.ns;
    if (reboot != nullptr) reboots_ = true;
}

void GenicamCamera::suffer_ptp_faults(HostTime at) {
    for (const Fault& fault : faults_) {
        if (fault.at_exposure != exposures_) continue;
        const auto duration = Duration{std::llround(fault.seconds * 1e9)};
        if (fault.kind == FaultKind::lose_ptp) clock_.lose_master(at, duration);
        if (fault.kind == FaultKind::ptp_master) clock_.become_master(at, duration);
        if (fault.kind == FaultKind::ptp_foreign)
            clock_.follow_another(at, Duration{std::llround(fault.delay_ms * 1e6)}, duration);
    }
}

void GenicamCamera::report_ptp(HostTime at) {
    for (const Fault& fault : faults_) {
        if (fault.kind != FaultKind::lose_ptp) continue;
        if (fault.at_exposure == exposures_) send_event(CameraEventId::ptp_lost, at, 0);
        if (fault.at_exposure + fault.count == exposures_)
            send_event(CameraEventId::ptp_locked, at, 0);
    }
}

/// If the camera can take the trigger now. Counts the exposure, and applies what begins with it.
bool GenicamCamera::starts_to_expose(HostTime trigger, const TriggerPulse* pulse) {
    if (acquiring_ && trigger < busy_until_) send_event(CameraEventId::trigger_missed, trigger, 0);
    if (!acquiring_ || trigger < busy_until_ || registers_.any(family_.stalled)) return false;
    ++exposures_;
    for (const Fault& fault : faults_)
        if (of_board(fault.kind) && fault.at_exposure == exposures_ && afflict_board_)
            afflict_board_(fault);
    if (ignores(pulse)) {
        send_event(CameraEventId::trigger_missed, trigger, 0);
        if (settings_.ids_count_ignored) next_block_id();
        return false;
    }
    apply_outages();
    suffer_ptp_faults(trigger);
    report_ptp(trigger);
    if (active_fault(FaultKind::restart_ids) != nullptr) block_id_ = 0;
    if (active_fault(FaultKind::repeat_id) == nullptr) next_block_id();
    if (const Fault* jump = active_fault(FaultKind::jump_clock))
        clock_.jump(Duration{std::llround(jump->seconds * 1e9)});
    if (active_fault(FaultKind::change_size) != nullptr)
        registers_.resize(settings_.width, settings_.height / 2);
    if (active_fault(FaultKind::double_exposure) != nullptr)
        registers_.set_number(family_.exposure, 2 * registers_.number(family_.exposure));
    return true;
}

/// An exposure, if the camera can take the trigger now.
std::optional<GenicamCamera::Interval> GenicamCamera::expose(HostTime trigger,
                                                             const TriggerPulse* pulse) {
    const std::lock_guard lock(mutex_);
    if (!starts_to_expose(trigger, pulse)) return std::nullopt;
    const Duration length = exposure_at(trigger);
    if (exposes_by_itself())
        registers_.set_number(family_.exposure, static_cast<double>(length.ns) * 1e-3);
    TrueExposure truth;
    truth.camera = settings_.name;
    truth.board_life = pulse != nullptr ? pulse->board_life : 0;
    truth.trigger = pulse != nullptr ? pulse->trigger : 0;
    truth.serial = exposures_;
    truth.block_id = block_id_;
    truth.start = trigger + Duration{std::llround(settings_.trigger_latency_us * 1e3)};
    truth.end = truth.start + length;
    busy_until_ =
        std::max(truth.end, trigger + Duration{std::llround(settings_.shortest_period_us * 1e3)});
    send_event(CameraEventId::exposure_start, truth.start, block_id_);
    send_event(CameraEventId::exposure_end, truth.end, block_id_);
    if (active_fault(FaultKind::drop_frame) != nullptr)
        truth_.add(truth);
    else
        send(truth);
    return Interval{truth.start, truth.end};
}

/// By the faults of its exposure.
void GenicamCamera::spoil(StreamFrame& frame) const {
    if (active_fault(FaultKind::half_frame) != nullptr) frame.missing = Missing::second_half;
    if (active_fault(FaultKind::drop_last) != nullptr) frame.missing = Missing::end;
    if (active_fault(FaultKind::drop_leader) != nullptr) frame.missing = Missing::leader;
    frame.after_next = active_fault(FaultKind::swap_frames) != nullptr;
    if (const Fault* loss = active_fault(FaultKind::lose_packets)) frame.loss = loss->share;
    if (active_fault(FaultKind::block_large) != nullptr) frame.largest_packet = 1500;
}

/// Queues the frame of an exposure.
void GenicamCamera::send(TrueExposure exposure) {
    StreamFrame frame;
    spoil(frame);
    frame.block_id = exposure.block_id;
    frame.serial = exposure.serial;
    frame.extended_id = settings_.extended_ids;
    if (active_fault(FaultKind::stop_clock) == nullptr)
        camera_time_ns_ = ticks(stamped(settings_, exposure.start, exposure.end));
    frame.camera_time_ns = camera_time_ns_;
    if (active_fault(FaultKind::utc_stamps) != nullptr)
        frame.camera_time_ns -= static_cast<std::uint64_t>(std::llround(ahead_of_utc_s_ * 1e9));
    frame.width = registers_.value(reg_width);
    frame.height = registers_.value(reg_height);
    if (view_.painted())
        // Only when the exposure is over is it known what it saw, and no trigger waits for it.
        frame.paint = [this, exposure](std::span<std::uint8_t> out) {
            view_.paint(exposure.start, exposure.end, exposure.serial, out);
        };
    else
        frame.pixels = view_.wall(middle(exposure.start, exposure.end))
                           .first(std::size_t{frame.width} * frame.height);
    frame.exposed = exposure.end;
    if (registers_.all(family_.chunks))
        frame.chunks = chunks(exposure.end - exposure.start, frame.block_id);
    frame.due = exposure.end + Duration{std::llround(settings_.readout_us * 1e3)};
    frame.leader_due = settings_.early_leader ? exposure.start : frame.due;
    frame.done = [this, exposure](bool sent) mutable {
        exposure.sent = sent;
        truth_.add(exposure);
    };
    frame.sent = [this, serial = exposure.serial](HostTime at) {
        truth_.add(TrueDeparture{settings_.name, serial, at});
    };
    queue_.send(std::move(frame));
}

}  // namespace versavis::rig

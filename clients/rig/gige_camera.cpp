// SPDX-License-Identifier: BSD-3-Clause
#include "gige_camera.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <system_error>

#include "posix/thread.hpp"

namespace versavis::rig {

namespace {

constexpr std::uint16_t gvcp_port = 3956;
constexpr std::uint8_t gvcp_key = 0x42;
constexpr std::uint8_t acknowledge_wanted = 0x01;
constexpr std::size_t discovery_size = 0xF8;
constexpr std::size_t most_memory = 512;
constexpr int poll_ms = 20;
constexpr std::uint32_t fire_bit = 1U << 31U;

enum Command : std::uint16_t {
    discovery = 0x0002,
    packet_resend = 0x0040,
    read_register = 0x0080,
    write_register_command = 0x0082,
    read_memory = 0x0084,
    write_memory = 0x0086,
    pending_acknowledge = 0x0089,
};

enum Status : std::uint16_t {
    success = 0x0000,
    not_implemented = 0x8001,
    invalid_parameter = 0x8002,
    invalid_address = 0x8003,
    access_denied = 0x8006,
};

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
    return std::uint32_t{bytes[at]} << 24U | std::uint32_t{bytes[at + 1]} << 16U |
           std::uint32_t{bytes[at + 2]} << 8U | bytes[at + 3];
}

std::uint16_t half(std::span<const std::uint8_t> bytes, std::size_t at) {
    return static_cast<std::uint16_t>(bytes[at] << 8U | bytes[at + 1]);
}

void put_word(std::vector<std::uint8_t>& out, std::uint32_t value) {
    for (const unsigned shift : {24U, 16U, 8U, 0U})
        out.push_back(static_cast<std::uint8_t>(value >> shift));
}

void put_half(std::vector<std::uint8_t>& out, std::uint16_t value) {
    out.push_back(static_cast<std::uint8_t>(value >> 8U));
    out.push_back(static_cast<std::uint8_t>(value));
}

bool same(const sockaddr_in& a, const sockaddr_in& b) {
    return a.sin_addr.s_addr == b.sin_addr.s_addr && a.sin_port == b.sin_port;
}

/// Receives broadcasts. Never on loopback: a rig there must not show up on the machine's real
/// networks.
FileDescriptor open_broadcast_socket(sockaddr_in self) {
    if ((ntohl(self.sin_addr.s_addr) >> 24U) == 127) return {};
    self.sin_addr.s_addr = INADDR_BROADCAST;
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    const int yes = 1;
    ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&self), sizeof self);
    return socket;
}

std::vector<Fault> faults_of(const Scenario& scenario, const std::string& camera) {
    std::vector<Fault> faults;
    std::copy_if(scenario.faults.begin(), scenario.faults.end(), std::back_inserter(faults),
                 [&](const Fault& fault) { return fault.camera == camera; });
    return faults;
}

}  // namespace

Expected<std::unique_ptr<GigeCamera>> GigeCamera::create(const Scenario& scenario,
                                                         const CameraScenario& settings,
                                                         HostTime zero,
                                                         const Surroundings& surroundings,
                                                         GroundTruth& truth) {
    const auto family = settings.model.empty() ? rig_family() : load_camera_family(settings.model);
    if (!family) return Unexpected(family.error());
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_in self{};
    self.sin_family = AF_INET;
    self.sin_port = htons(gvcp_port);
    const int yes = 1;
    ::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
    if (inet_pton(AF_INET, settings.address.c_str(), &self.sin_addr) != 1 ||
        ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&self), sizeof self) != 0) {
        const std::string reason = std::generic_category().message(errno);
        return failure(
            fmt::format("camera {}", settings.name),
            fmt::format("cannot listen on {}:{}: {}", settings.address, gvcp_port, reason),
            "is another rig running? use other addresses of 127.0.0.0/8");
    }
    return std::unique_ptr<GigeCamera>(new GigeCamera(scenario, settings, zero, surroundings, truth,
                                                      *family, std::move(socket),
                                                      open_broadcast_socket(self)));
}

GigeCamera::GigeCamera(const Scenario& scenario, const CameraScenario& settings, HostTime zero,
                       const Surroundings& surroundings, GroundTruth& truth,
                       const CameraFamily& family, FileDescriptor socket,
                       FileDescriptor broadcast_socket)
    : settings_(settings),
      faults_(faults_of(scenario, settings.name)),
      zero_(zero),
      truth_(truth),
      clock_(zero, settings.clock),
      family_(family),
      registers_({settings.address, settings.serial, settings.name, settings.width, settings.height,
                  settings.exposure_us, settings.exposure_swing > 0, settings.auto_gain,
                  settings.temperature_c, settings.events, settings.hostility},
                 family),
      view_(scenario, settings, surroundings),
      transmitter_(settings.address, settings.link_mbps, settings.packet_loss, scenario.seed),
      random_(scenario.seed),
      socket_(std::move(socket)),
      broadcast_socket_(std::move(broadcast_socket)),
      events_(socket_.get()) {
    configure_stream();
    server_ = start_thread("camera", [this] { serve(); });
}

GigeCamera::~GigeCamera() {
    stop_ = true;
    server_.join();
}

void GigeCamera::serve() {
    while (!stop_) {
        pollfd readable[] = {{socket_.get(), POLLIN, 0}, {broadcast_socket_.get(), POLLIN, 0}};
        ::poll(readable, 2, poll_ms);
        if (!muted() && power_cycle_pending_.exchange(false)) power_cycle();
        for (const pollfd& entry : readable)
            if ((entry.revents & POLLIN) != 0) receive(entry.fd);
        const Duration silence = host_now() - last_contact_;
        if (controller_.sin_port != 0 && silence > milliseconds(registers_.value(reg_heartbeat_ms)))
            lose_controller();
        free_run(host_now());
    }
}

void GigeCamera::receive(int socket) {
    std::uint8_t buffer[2048];
    sockaddr_in from{};
    socklen_t from_size = sizeof from;
    const ssize_t size = ::recvfrom(socket, buffer, sizeof buffer, 0,
                                    reinterpret_cast<sockaddr*>(&from), &from_size);
    if (size >= 8 && !muted()) handle({buffer, static_cast<std::size_t>(size)}, from);
}

void GigeCamera::handle(std::span<const std::uint8_t> packet, const sockaddr_in& from) {
    if (packet[0] != gvcp_key || packet.size() < 8U + half(packet, 4)) return;
    const std::uint16_t command = half(packet, 2);
    if (same(from, controller_)) last_contact_ = host_now();
    std::uint16_t status = success;
    const bool later = pending(command, packet.subspan(8, half(packet, 4)));
    const std::vector<std::uint8_t> body =
        later ? std::vector<std::uint8_t>{0, 0, 0xFF, 0xFF}
              : answer(command, packet.subspan(8, half(packet, 4)), from, status);
    if ((packet[1] & acknowledge_wanted) == 0) return;
    std::vector<std::uint8_t> reply;
    put_half(reply, status);
    put_half(reply, static_cast<std::uint16_t>(later ? +pending_acknowledge : command + 1));
    put_half(reply, static_cast<std::uint16_t>(body.size()));
    put_half(reply, half(packet, 6));
    reply.insert(reply.end(), body.begin(), body.end());
    ::sendto(socket_.get(), reply.data(), reply.size(), 0, reinterpret_cast<const sockaddr*>(&from),
             sizeof from);
}

/// In milliseconds, the longest that a device may ask for: a host that believes it waits a minute.
bool GigeCamera::pending(std::uint16_t command, std::span<const std::uint8_t> body) const {
    if (settings_.hostility == Hostility::pending_at_all) return command != discovery;
    const bool reads = command == read_register || command == read_memory;
    return settings_.hostility == Hostility::pending && reads && body.size() >= 4 &&
           word(body, 0) == reg_payload_size;
}

std::vector<std::uint8_t> GigeCamera::answer(std::uint16_t command,
                                             std::span<const std::uint8_t> body,
                                             const sockaddr_in& from, std::uint16_t& status) {
    std::vector<std::uint8_t> out;
    switch (command) {
        case discovery:
            out.resize(discovery_size);
            registers_.read(0, out);
            break;
        case read_register:
            for (std::size_t at = 0; at + 4 <= body.size(); at += 4) {
                std::uint32_t value = 0;
                if (!registers_.read(word(body, at), value)) status = invalid_address;
                put_word(out, value);
            }
            break;
        case write_register_command: {
            std::uint16_t done = 0;
            for (std::size_t at = 0; at + 8 <= body.size() && status == success; at += 8, ++done)
                status = write_register(word(body, at), word(body, at + 4), from);
            put_half(out, 0);
            put_half(out, done);
            break;
        }
        case read_memory: {
            const std::size_t size = body.size() >= 8 ? half(body, 6) : 0;
            if (size == 0 || size > most_memory) {
                status = invalid_parameter;
                break;
            }
            out.resize(4 + size);
            std::copy_n(body.begin(), 4, out.begin());
            if (!registers_.read(word(body, 0), std::span(out).subspan(4)))
                status = invalid_address;
            break;
        }
        case write_memory:
            if (body.size() % 4 != 0 || body.size() < 8) status = invalid_parameter;
            for (std::size_t at = 4; at + 4 <= body.size() && status == success; at += 4)
                status = write_register(word(body, 0) + static_cast<std::uint32_t>(at - 4),
                                        word(body, at), from);
            put_half(out, 0);
            put_half(out, static_cast<std::uint16_t>(body.size() - 4));
            break;
        case packet_resend:
            if (body.size() >= 20)
                transmitter_.resend(std::uint64_t{word(body, 12)} << 32U | word(body, 16),
                                    word(body, 4), word(body, 8));
            else if (body.size() >= 12)
                transmitter_.resend(half(body, 2), word(body, 4) & 0xFFFFFFU,
                                    word(body, 8) & 0xFFFFFFU);
            break;
        default: status = not_implemented;
    }
    return out;
}

bool GigeCamera::in_control(const sockaddr_in& from) const {
    return registers_.value(reg_control_privilege) != 0 && same(from, controller_);
}

std::uint16_t GigeCamera::write_register(std::uint32_t address, std::uint32_t value,
                                         const sockaddr_in& from) {
    if (address == reg_control_privilege) {
        const bool taken = registers_.value(reg_control_privilege) != 0 && !same(from, controller_);
        if (taken) return access_denied;
        controller_ = value != 0 ? from : sockaddr_in{};
        last_contact_ = host_now();
        if (value == 0) stop_acquisition();
    } else if (!in_control(from)) {
        return access_denied;
    }
    if (registers_.locked(address, acquiring())) return access_denied;
    const bool fire_test_packet = address == reg_fire_test_packet ||
                                  (address == reg_stream_packet_size && (value & fire_bit) != 0);
    if (address == reg_stream_packet_size)
        value = std::clamp<std::uint32_t>(value & 0xFFFFU, 256, 16000) & ~3U;
    if (!registers_.write(address, value)) return invalid_address;
    switch (address) {
        case reg_stream_port:
        case reg_stream_packet_size:
        case reg_stream_packet_delay:
        case reg_stream_address: configure_stream(); break;
        case reg_message_port:
        case reg_message_address: configure_messages(); break;
        case reg_acquisition_start: start_acquisition(); break;
        case reg_acquisition_stop: stop_acquisition(); break;
        case reg_trigger_software:
            if (registers_.value(reg_trigger_source) == 0) expose(host_now(), nullptr);
            break;
        default: break;
    }
    if (fire_test_packet) transmitter_.send_test_packet();
    return success;
}

void GigeCamera::configure_stream() {
    StreamSettings settings;
    settings.destination.sin_family = AF_INET;
    settings.destination.sin_port =
        htons(static_cast<std::uint16_t>(registers_.value(reg_stream_port)));
    settings.destination.sin_addr.s_addr = htonl(registers_.value(reg_stream_address));
    settings.packet_size = registers_.value(reg_stream_packet_size);
    settings.packet_delay_ns = registers_.value(reg_stream_packet_delay);  // a tick is a nanosecond
    transmitter_.configure(settings);
    registers_.write(reg_stream_source_port, std::uint32_t{transmitter_.source_port()});
}

void GigeCamera::configure_messages() {
    sockaddr_in destination{};
    destination.sin_family = AF_INET;
    destination.sin_port = htons(static_cast<std::uint16_t>(registers_.value(reg_message_port)));
    destination.sin_addr.s_addr = htonl(registers_.value(reg_message_address));
    events_.direct_to(destination);
}

/// If the controller wants to know of such events.
void GigeCamera::send_event(CameraEventId id, HostTime at, std::uint64_t block_id) {
    const auto index =
        static_cast<std::uint32_t>(id) - static_cast<std::uint32_t>(CameraEventId::exposure_start);
    const auto notification = static_cast<Register>(reg_event_notification + 4 * index);
    if (registers_.value(notification) == 0 || muted()) return;
    events_.send(at, {id, block_id, ticks(at), settings_.extended_ids});
}

/// What its clock shows.
std::uint64_t GigeCamera::ticks(HostTime at) const {
    const std::int64_t ns = clock_.device_ns(at) + clock_step_ns_;
    if (settings_.clock_rate == 1) return static_cast<std::uint64_t>(ns);
    return static_cast<std::uint64_t>(std::llround(static_cast<double>(ns) * settings_.clock_rate));
}

bool GigeCamera::acquiring() {
    const std::lock_guard lock(mutex_);
    return acquiring_;
}

void GigeCamera::start_acquisition() {
    const std::lock_guard lock(mutex_);
    acquiring_ = true;
    block_id_ = 0;
    free_run_next_ = host_now();
}

void GigeCamera::stop_acquisition() {
    {
        const std::lock_guard lock(mutex_);
        acquiring_ = false;
    }
    transmitter_.clear();
}

void GigeCamera::lose_controller() {
    registers_.write(reg_control_privilege, std::uint32_t{0});
    registers_.write(reg_message_port, std::uint32_t{0});
    controller_ = {};
    configure_messages();
    stop_acquisition();
}

void GigeCamera::power_cycle() {
    stop_acquisition();
    registers_.reset();
    controller_ = {};
    configure_stream();
    configure_messages();
}

void GigeCamera::free_run(HostTime now) {
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

void GigeCamera::afflict_board(std::vector<Fault> faults,
                               std::function<void(const Fault&)> afflict) {
    const std::lock_guard lock(mutex_);
    board_faults_ = std::move(faults);
    afflict_board_ = std::move(afflict);
}

/// The exposures that the trigger makes, one right after the other.
std::vector<GigeCamera::Interval> GigeCamera::take_trigger(const TriggerPulse& pulse) {
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
double GigeCamera::exposures_to_make() {
    const std::lock_guard lock(mutex_);
    ++triggers_taken_;
    const bool doubled =
        active_fault(FaultKind::double_frame) != nullptr ||
        (settings_.double_every > 0 && triggers_taken_ % settings_.double_every == 0);
    return std::max(registers_.number(family_.burst), doubled ? 2.0 : 1.0);
}

/// What the exposure line makes of it.
std::optional<LineActive> GigeCamera::shown(const std::vector<Interval>& exposures) const {
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

std::optional<LineActive> GigeCamera::trigger_line(bool level, const TriggerPulse& pulse) {
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
bool GigeCamera::exposes_by_itself() const { return registers_.all(family_.exposure_auto); }

Duration GigeCamera::exposure_at(HostTime at) const {
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

const Fault* GigeCamera::active_fault(FaultKind kind) const {
    for (const Fault& fault : faults_)
        if (fault.kind == kind && exposures_ >= fault.at_exposure &&
            exposures_ < fault.at_exposure + fault.count)
            return &fault;
    return nullptr;
}

bool GigeCamera::ignores(const TriggerPulse* pulse) {
    if (active_fault(FaultKind::ignore_trigger) != nullptr) return true;
    return pulse != nullptr && settings_.ignored > 0 &&
           std::uniform_real_distribution(0.0, 1.0)(random_) < settings_.ignored;
}

void GigeCamera::next_block_id() {
    ++block_id_;
    if (!settings_.extended_ids && block_id_ > 0xFFFF) block_id_ = 1;
}

Missing GigeCamera::missing_part() const {
    if (active_fault(FaultKind::drop_leader) != nullptr) return Missing::leader;
    if (active_fault(FaultKind::drop_last) != nullptr) return Missing::end;
    if (active_fault(FaultKind::half_frame) != nullptr) return Missing::second_half;
    return Missing::nothing;
}

/// Each chunk is followed by its id and length; those of the image come right after it.
std::vector<std::uint8_t> GigeCamera::chunks(Duration exposure, std::uint64_t block_id) const {
    std::vector<std::uint8_t> out;
    const auto put_chunk = [&](std::uint32_t id, std::uint32_t value) {
        put_word(out, value);
        put_word(out, id);
        put_word(out, sizeof value);
    };
    put_word(out, family_.image_chunk);
    put_word(out, registers_.value(reg_width) * registers_.value(reg_height));
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
void GigeCamera::apply_outages() {
    const Fault* mute = active_fault(FaultKind::camera_mute);
    const Fault* reboot = active_fault(FaultKind::camera_reboot);
    const Fault* outage = reboot != nullptr ? reboot : mute;
    if (outage == nullptr) return;
    const HostTime until = host_now() + Duration{std::llround(outage->seconds * 1e9)};
    muted_until_ns_ = until.ns;
    transmitter_.mute(until);
    if (reboot != nullptr) power_cycle_pending_ = true;
}

void GigeCamera::report_ptp(HostTime at) {
    for (const Fault& fault : faults_) {
        if (fault.kind != FaultKind::lose_ptp) continue;
        if (fault.at_exposure == exposures_) send_event(CameraEventId::ptp_lost, at, 0);
        if (fault.at_exposure + fault.count == exposures_)
            send_event(CameraEventId::ptp_locked, at, 0);
    }
}

/// An exposure, if the camera can take the trigger now. Counts it, and queues its frame.
std::optional<GigeCamera::Interval> GigeCamera::expose(HostTime trigger,
                                                       const TriggerPulse* pulse) {
    StreamFrame frame;
    TrueExposure truth;
    {
        const std::lock_guard lock(mutex_);
        if (acquiring_ && trigger < busy_until_)
            send_event(CameraEventId::trigger_missed, trigger, 0);
        if (!acquiring_ || trigger < busy_until_ || registers_.any(family_.stalled))
            return std::nullopt;
        ++exposures_;
        for (const Fault& fault : board_faults_)
            if (fault.at_exposure == exposures_) afflict_board_(fault);
        if (ignores(pulse)) {
            send_event(CameraEventId::trigger_missed, trigger, 0);
            if (settings_.ids_count_ignored) next_block_id();
            return std::nullopt;
        }
        apply_outages();
        report_ptp(trigger);
        if (active_fault(FaultKind::restart_ids) != nullptr) block_id_ = 0;
        if (active_fault(FaultKind::repeat_id) == nullptr) next_block_id();
        if (const Fault* jump = active_fault(FaultKind::jump_clock))
            clock_step_ns_ += std::llround(jump->seconds * 1e9);
        if (active_fault(FaultKind::change_size) != nullptr)
            registers_.resize(settings_.width, settings_.height / 2);
        truth.start = trigger + Duration{std::llround(settings_.trigger_latency_us * 1e3)};
        if (active_fault(FaultKind::double_exposure) != nullptr)
            registers_.set_number(family_.exposure, 2 * registers_.number(family_.exposure));
        const Duration exposure = exposure_at(trigger);
        truth.end = truth.start + exposure;
        if (exposes_by_itself())
            registers_.set_number(family_.exposure, static_cast<double>(exposure.ns) * 1e-3);
        busy_until_ = std::max(
            truth.end, trigger + Duration{std::llround(settings_.shortest_period_us * 1e3)});
        send_event(CameraEventId::exposure_start, truth.start, block_id_);
        send_event(CameraEventId::exposure_end, truth.end, block_id_);
        frame.block_id = block_id_;
        frame.serial = exposures_;
        if (active_fault(FaultKind::drop_frame) != nullptr) frame.serial = 0;
        frame.missing = missing_part();
        frame.after_next = active_fault(FaultKind::swap_frames) != nullptr;
        if (const Fault* loss = active_fault(FaultKind::lose_packets)) frame.loss = loss->share;
        if (active_fault(FaultKind::block_large) != nullptr) frame.largest_packet = 1500;
    }
    truth.camera = settings_.name;
    truth.board_life = pulse != nullptr ? pulse->board_life : 0;
    truth.trigger = pulse != nullptr ? pulse->trigger : 0;
    truth.serial = exposures_;
    truth.block_id = frame.block_id;
    if (frame.serial == 0) {
        truth_.add(truth);
        return Interval{truth.start, truth.end};
    }
    frame.extended_id = settings_.extended_ids;
    if (active_fault(FaultKind::stop_clock) == nullptr)
        camera_time_ns_ = ticks(stamped(settings_, truth.start, truth.end));
    frame.camera_time_ns = camera_time_ns_;
    frame.width = registers_.value(reg_width);
    frame.height = registers_.value(reg_height);
    if (view_.painted())
        // Only when the exposure is over is it known what it saw, and no trigger waits for it.
        frame.paint = [this, truth](std::span<std::uint8_t> out) {
            view_.paint(truth.start, truth.end, truth.serial, out);
        };
    else
        frame.pixels = view_.wall(middle(truth.start, truth.end))
                           .first(std::size_t{frame.width} * frame.height);
    frame.exposed = truth.end;
    if (registers_.all(family_.chunks))
        frame.chunks = chunks(truth.end - truth.start, frame.block_id);
    frame.due = truth.end + Duration{std::llround(settings_.readout_us * 1e3)};
    frame.leader_due = settings_.early_leader ? truth.start : frame.due;
    frame.done = [this, truth](bool sent) mutable {
        truth.sent = sent;
        truth_.add(truth);
    };
    frame.sent = [this, serial = truth.serial](HostTime at) {
        truth_.add(TrueDeparture{settings_.name, serial, at});
    };
    transmitter_.send(std::move(frame));
    return Interval{truth.start, truth.end};
}

}  // namespace versavis::rig

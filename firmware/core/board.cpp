// SPDX-License-Identifier: BSD-3-Clause
#include "board.hpp"

#include <cstring>

#include "imu/imu_output.hpp"
#include "port_settings.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds health_interval = 1'000'000'000;

/// Of the watchdog's second. If lower, an idle board wakes more often; if higher, one slow poll is
/// enough for it to bite.
constexpr Nanoseconds feed_interval = 200'000'000;

/// The output hardware makes progress, or the watchdog bites. If lower, a long pulse train may look
/// stuck; if higher, pulses stay away for longer.
constexpr Nanoseconds stuck_limit = 500'000'000;

/// Of the grid: pulse trains need not restart for less.
constexpr Nanoseconds unseen_step = 1'000;

/// For exposures, before a new configuration. If lower, records of long exposures are cut; if
/// higher, a line that is stuck delays a configuration for longer.
constexpr Nanoseconds longest_wait = 200'000'000;

/// Between stray edges that are reported; all are counted.
constexpr Nanoseconds stray_interval = 100'000'000;

constexpr std::uint8_t all_cameras = (1U << camera_count) - 1;

/// Bounds the work of one poll. If lower, bytes of the host wait longer; if higher, polls take
/// longer.
constexpr unsigned packets_a_poll = 4;

constexpr std::uint32_t capabilities =
    wire::capability_exposure_compensation | wire::capability_imu | wire::capability_start_pattern |
    wire::capability_slaves | wire::capability_illumination | wire::capability_pulse_inputs |
    wire::capability_sync | wire::capability_imu_output | wire::capability_host_grid |
    wire::capability_nmea | wire::capability_time_output | wire::capability_sentences |
    wire::capability_camera_change | wire::capability_grid_on_sync;

/// Pulses of PPS and sync that follow closer are echoes; the fastest sync comes at 10 Hz. If lower,
/// contacts that bounce count double.
constexpr EchoFilter pps_echo(1'000'000);

/// Of the auxiliary inputs. If lower, contacts that bounce count double; if higher, pulses of 20
/// kHz are lost.
constexpr EchoFilter aux_echo(10'000);

/// Those that the parts really have.
void use_true_rates(wire::Configuration& configuration) {
    configuration.imus[0].rate_millihertz = SpiImu::true_rate(configuration.imus[0]);
    wire::ImuConfiguration& uart = configuration.imus[1];
    if (uart.kind != wire::ImuKind::none)
        uart.rate_millihertz = Vn100::true_rate(uart.rate_millihertz);
}

}  // namespace

Board::Board(const Hal& hal, const Identity& identity)
    : hal_(hal),
      identity_(identity),
      echoes_{pps_echo, aux_echo, aux_echo, pps_echo},
      sync_(outputs_),
      test_(outputs_),
      noise_(hal_.edges),
      time_outputs_{{outputs_, hal_.imu_uart}, {outputs_, hal_.imu_uart}},
      light_(outputs_, *this),
      uart_imu_(1, hal_.imu_uart, *this),
      spi_imu_(0, hal_.imu_bus, *this),
      cameras_{{0, grid_clock_, outputs_, *this},
               {1, grid_clock_, outputs_, *this},
               {2, grid_clock_, outputs_, *this},
               {3, grid_clock_, outputs_, *this}},
      outputs_(hal_.outputs, *this, hal_.facts),
      transmitter_(hal_.link, hal_.clock, identity.nonce) {
    health_.reset_cause = identity.reset_cause;
    noise_.listen(0);
    restore();
}

void Board::poll() {
    const Nanoseconds began = hal_.clock.now();
    more_ = false;
    // What is overdue leaves before anybody waits for its effect.
    if (began >= timers_) outputs_.commit(began - OutputQueue::horizon / 2);
    // First what happened, then what is wanted: edges belong to what was in force when they
    // arrived.
    spi_imu_.collect(began);
    poll_edges(began);
    if (configuring_) poll_configuration(began);
    poll_link();
    const Nanoseconds now = hal_.clock.now();
    const bool timed = dirty_ || now >= timers_;
    if (timed) {
        poll_cameras(now);
        poll_outputs(now);
    }
    dirty_ = configuring_ || outputs_blocked_;
    poll_imus(now);
    poll_nmea();
    poll_storage(now);
    poll_health(now);
    if (transmitter_.pump()) more_ = true;
    if (configuring_ && may_change(now) && (changing_ != 0 || outputs_.empty())) more_ = true;
    polled_ = hal_.clock.now();
    const Nanoseconds took = polled_ - (due_ < began && due_ != 0 ? due_ : began);
    if (took > health_.loop_max_ns) health_.loop_max_ns = static_cast<std::uint32_t>(took);
    if (timed) timers_ = find_timers();
    due_ = more_ ? polled_ : find_next_wake();
}

void Board::poll_cameras(Nanoseconds now) {
    for (CameraChannel& camera : cameras_) camera.poll(now, settled_);
    light_.poll(now, settled_);
    sync_.poll(now);
    test_.poll(now);
    poll_time_outputs(now);
}

/// When cameras, light and outputs have something to do if nothing stirs them before.
Nanoseconds Board::find_timers() const {
    const Nanoseconds lag = polled_ - settled_;
    Nanoseconds wake = polled_ + feed_interval;
    const auto sooner = [&wake](Nanoseconds at) { wake = at < wake ? at : wake; };
    for (const CameraChannel& camera : cameras_) sooner(camera.next_wake(lag));
    sooner(light_.next_wake(lag));
    // When the hardware's queue is full, the next word that leaves it calls.
    if (outputs_blocked_) return wake;
    sooner(sync_.next_wake());
    sooner(test_.next_wake());
    for (const TimeOutput& each : time_outputs_) sooner(each.next_wake());
    sooner(outputs_.next_wake());
    return wake;
}

Nanoseconds Board::find_next_wake() const {
    Nanoseconds wake = timers_;
    const auto sooner = [&wake](Nanoseconds at) { wake = at < wake ? at : wake; };
    if (greeted_) sooner(next_health_);
    if (configuring_ && configure_at_ > polled_) sooner(configure_at_);
    sooner(spi_imu_.next_wake(polled_ - settled_));
    sooner(uart_imu_.next_wake());
    sooner(noise_.next_wake());
    return wake;
}

template <class T>
void Board::send(const T& message) {
    if (greeted_) transmitter_.send(message);  // silent until the host has said hello
}

void Board::take_sentence() {
    wire::Sentence line{};
    nmea_.copy_to(line);
    send(line);
    UtcLabel label;
    if (nmea_.label(label)) event(wire::BoardEventKind::utc_label, 0, label.pulse, label.utc_s, 0);
}

void Board::poll_link() {
    std::uint8_t bytes[link_packet_size];
    Nanoseconds received = 0;
    for (unsigned i = 0; i < packets_a_poll; ++i) {
        const std::size_t size = hal_.link.read(bytes, received);
        if (size == 0) return;
        dirty_ = true;
        decoder_.feed(bytes, size, [&](const wire::Packet& packet) { handle(packet, received); });
    }
    more_ = true;
}

void Board::handle(const wire::Packet& packet, Nanoseconds received) {
    wire::HostHello hello;
    wire::Configuration configuration;
    wire::Start begin;
    wire::Stop end;
    wire::ClockRequest request;
    wire::ExpectedExposure expected;
    wire::AlignGrid alignment;
    wire::TimeOutput time;
    wire::Reboot reboot;
    if (packet.read(hello)) return greet(hello);
    // A host that asks another life of this board for the time learns of this one at once. Nothing
    // else is answered: it could be an echo.
    const bool asked = packet.read(request);
    if (!greeted_ && asked) transmitter_.send(introduction());
    if (!greeted_) return;
    if (asked) return send(wire::ClockAnswer{request.id, 0, received, 0});
    if (packet.read(configuration)) return configure(configuration);
    if (packet.read(begin)) return start(begin);
    if (packet.read(end)) return stop(end.cameras);
    if (packet.read(alignment)) return align(alignment);
    if (packet.read(time)) return take(time);
    if (packet.read(expected)) {
        if (expected.camera < camera_count && expected.exposure_ns >= 0)
            cameras_[expected.camera].announce(expected.trigger, expected.exposure_ns);
        else
            ++health_.ignored;
    }
    if (packet.read(reboot) && reboot.magic == wire::reboot_magic)
        hal_.rebooter.reboot(reboot.to_boot_loader != 0);
}

void Board::greet(const wire::HostHello& hello) {
    // A board of another major version still identifies itself, so that the host can report what to
    // update.
    greeted_ = true;
    if (configuring_ && changing_ == 0) begin_trains(hal_.clock.now());
    configuring_ = false;
    stop(0xFF);
    transmitter_.begin();
    send(introduction());
    if (hello.major != wire::protocol_major) greeted_ = false;
    next_health_ = hal_.clock.now() + health_interval;
}

wire::BoardHello Board::introduction() const {
    wire::BoardHello answer{};
    answer.major = wire::protocol_major;
    answer.minor = wire::protocol_minor;
    for (unsigned i = 0; i < camera_count; ++i)
        if ((hal_.facts.present & wire::present_camera0 << i) != 0) ++answer.cameras;
    answer.reset_cause = identity_.reset_cause;
    answer.capabilities = capabilities;
    answer.board_time_ns = hal_.clock.now();
    answer.present = hal_.facts.present;
    answer.fastest_imu_millihertz = hal_.facts.fastest_imu_millihertz;
    std::memcpy(answer.serial, identity_.serial, sizeof answer.serial);
    const char version[] = "versavis " VERSAVIS_VERSION;
    static_assert(sizeof version <= sizeof answer.firmware);
    std::memcpy(answer.firmware, version, sizeof version);
    return answer;
}

void Board::configure(const wire::Configuration& configuration) {
    refused_ = 0;
    const bool some = (configuration.flags & wire::configuration_cameras) != 0;
    if (!some && any_running())
        return answer_configuration(configuration.id, wire::ConfigurationStatus::running);
    checked_id_ = configuration.id;
    check(configuration, hal_.facts, *this);
    if (refused_ != 0)
        return answer_configuration(configuration.id, wire::ConfigurationStatus::refused);
    const std::uint8_t cameras = some ? changeable(configuration) : std::uint8_t{0};
    if (some && cameras == 0)
        return answer_configuration(configuration.id, wire::ConfigurationStatus::running);
    wanted_ = configuration;
    on_sync_.cameras = static_cast<std::uint8_t>(some ? on_sync_.cameras & ~cameras : 0);
    // Pulses already decided, and their exposures, end first: none is cut short, and each gets its
    // record.
    if (!some) {
        grid_on_sync_ = false;
        sync_.stop();
        test_.stop();
    }
    changing_ = cameras;
    configuring_ = true;
    more_ = true;
    configure_at_ = hal_.clock.now() + longest_wait;
}

/// Which stopped cameras it changes, if it changes nothing else that is in force, or will be.
std::uint8_t Board::changeable(const wire::Configuration& configuration) const {
    if (configuring_ || (configuration.flags & wire::configuration_store) != 0) return 0;
    wire::Configuration wanted = configuration;
    use_true_rates(wanted);
    const std::uint8_t cameras = wire::changed_cameras(configuration_, wanted);
    for (unsigned i = 0; i < camera_count; ++i)
        if ((cameras >> i & 1U) != 0 && cameras_[i].running()) return 0;
    return cameras;
}

void Board::refuse(const wire::Refusal& refusal) {
    wire::Refusal message = refusal;
    message.id = checked_id_;
    ++refused_;
    send(message);
}

void Board::answer_configuration(std::uint32_t id, wire::ConfigurationStatus status) {
    wire::ConfigurationAnswer answer{};
    answer.id = id;
    answer.status = status;
    answer.refused = refused_;
    answer.origin_ns = grid_clock_.board_time(0);
    answer.taken = configuration_;
    send(answer);
}

void Board::apply(const wire::Configuration& configuration, Nanoseconds now) {
    release_time_outputs(configuration, now);
    apply_imus(configuration, now);
    configuration_ = configuration;
    apply_nmea();
    use_true_rates(configuration_);
    std::uint32_t inputs = std::uint32_t{configuration.ports.inputs} << input_pulse;
    masters_ = 0;
    for (unsigned i = 0; i < camera_count; ++i) {
        cameras_[i].stop();  // a slave may still run
        cameras_[i].give_up();
        configure_camera(i);
        cameras_[i].grid_began();
        // Before any trigger, and not so soon that a port whose words take time is late.
        if (!is_time_output(i))
            outputs_.rest(i, cameras_[i].trigger_inverted(), now + OutputQueue::horizon);
        if (cameras_[i].has_strobe()) inputs |= 1U << i;
        if (cameras_[i].is_slave())
            masters_ = static_cast<std::uint8_t>(masters_ | 1U << cameras_[i].master());
    }
    for (unsigned port = 0; port < wire::imu_count; ++port)
        if ((configuration.imus[port].options & wire::imu_data_ready) != 0)
            inputs |= 1U << (input_imu_ready + port);
    if ((configuration.imus[0].options & wire::imu_accel_ready) != 0)
        inputs |= 1U << input_accel_ready;
    noise_.listen(inputs);
    waiting_.clear();
    exposing_ = 0;
    routed_ = 0;
    light_.configure(configuration.illumination, now);
    grid_clock_.begin(now, 0);
    apply_routes(true);
    begin_trains(now);
}

void Board::configure_camera(unsigned camera) {
    const wire::IlluminationConfiguration& light = configuration_.illumination;
    const bool lit = (light.cameras >> camera & 1U) != 0;
    cameras_[camera].configure(configuration_.cameras[camera], lit ? light.lead_ns : 0);
}

/// The grid and all other cameras go on.
void Board::change_cameras() {
    for (unsigned i = 0; i < camera_count; ++i) {
        if ((changing_ >> i & 1U) == 0) continue;
        configuration_.cameras[i] = wanted_.cameras[i];
        cameras_[i].give_up();
        configure_camera(i);
    }
    configuration_.id = wanted_.id;
}

/// An IMU whose settings did not change keeps sampling.
void Board::apply_imus(const wire::Configuration& configuration, Nanoseconds now) {
    const auto changed = [&](std::size_t port, std::uint32_t true_rate) {
        wire::ImuConfiguration wanted = configuration.imus[port];
        wanted.rate_millihertz = true_rate;
        return std::memcmp(&wanted, &configuration_.imus[port], sizeof wanted) != 0;
    };
    const wire::ImuConfiguration& spi = configuration.imus[0];
    const wire::ImuConfiguration& uart = configuration.imus[1];
    if (changed(0, SpiImu::true_rate(spi))) spi_imu_.configure(spi, now);
    if (changed(1, Vn100::true_rate(uart.rate_millihertz))) uart_imu_.configure(uart, now);
}

Routing::Switched Board::apply_routes(bool force) {
    Routes routes;
    routes.light_cameras = configuration_.illumination.cameras;
    routes.light_limit = configuration_.illumination.max_on_ns;
    routes.light_inverted = (configuration_.illumination.flags & wire::illumination_inverted) != 0;
    for (unsigned i = 0; i < camera_count; ++i) {
        const auto bit = static_cast<std::uint8_t>(1U << i);
        if (!cameras_[i].has_strobe())
            routes.light_cameras = static_cast<std::uint8_t>(routes.light_cameras & ~bit);
        if (!cameras_[i].exposing(true)) routes.inverted_exposures |= bit;
        if ((routed_ >> i & 1U) != 0) routes.master[i] = cameras_[i].master();
        if (cameras_[i].trigger_inverted()) routes.inverted_triggers |= bit;
    }
    const unsigned port = configuration_.ports.test - unsigned{wire::test_imu0};
    if (port < wire::imu_count && (configuration_.imus[port].options & wire::imu_data_ready) != 0)
        routes.test_input = static_cast<std::uint8_t>(input_imu_ready + port);
    return hal_.routing.route(routes, force);
}

void Board::begin_trains(Nanoseconds now) {
    const wire::PortConfiguration& ports = configuration_.ports;
    if (ports.sync_rate_uhz != 0)
        sync_.begin(output_sync, Grid(0, ports.sync_rate_uhz), grid_clock_, ports.pulse_ns, now);
    if (ports.test == wire::test_rate)
        test_.begin(output_of(ports.test_output),
                    Grid(0, std::int64_t{ports.test_rate_millihertz} * 1000), board_clock_,
                    ports.pulse_ns, now);
    const bool paced = (configuration_.imus[0].options & wire::imu_data_ready) == 0;
    if (ports.test == wire::test_imu0 && paced &&
        configuration_.imus[0].kind != wire::ImuKind::none)
        test_.begin(output_test, spi_imu_.grid(), board_clock_, ports.pulse_ns, now);
}

/// Everything on the grid is placed again.
void Board::grid_moved() {
    for (CameraChannel& camera : cameras_) camera.grid_moved();
    sync_.moved();
}

/// The stored configuration is in force from power-up: the IMU and its output need no host.
void Board::restore() {
    wire::Configuration stored{};
    std::uint8_t bytes[sizeof stored];
    if (hal_.persist.load(bytes, sizeof bytes) != sizeof stored) return;
    std::memcpy(&stored, bytes, sizeof stored);
    check(stored, hal_.facts, *this);
    if (refused_ == 0) apply(stored, hal_.clock.now());
}

bool Board::any_running() const {
    for (const CameraChannel& camera : cameras_)
        if (camera.running() && !camera.is_slave()) return true;
    return slaves_ != 0;
}

bool Board::idle(std::uint8_t cameras) const {
    for (unsigned i = 0; i < camera_count; ++i)
        if ((cameras >> i & 1U) != 0 && (!cameras_[i].idle() || cameras_[i].running()))
            return false;
    return true;
}

/// Cameras that a configuration which waits is to change.
std::uint8_t Board::unready() const {
    if (!configuring_) return 0;
    return changing_ != 0 ? changing_ : all_cameras;
}

/// A stuck exposure line is not waited for.
bool Board::may_change(Nanoseconds now) const { return idle(unready()) || now >= configure_at_; }

void Board::start(const wire::Start& start) {
    // What a configuration that has not been answered yet changes cannot start.
    const auto cameras = static_cast<std::uint8_t>(start.cameras & ~unready());
    if ((start.flags & wire::start_on_sync) != 0 && !any_running()) {
        on_sync_.cameras |= cameras;
        on_sync_.flags = start.flags;
        grid_on_sync_ = grid_on_sync_ || start.cameras == 0;
    } else {
        on_sync_.cameras = static_cast<std::uint8_t>(on_sync_.cameras & ~cameras);
        start_cameras(cameras, start.flags);
    }
}

void Board::align(const wire::AlignGrid& wanted) {
    const Nanoseconds now = hal_.clock.now();
    const bool in_reach = wanted.board_ns >= now - wire::align_reach_ns &&
                          wanted.board_ns <= now + wire::align_reach_ns;
    const bool pace_possible = wanted.pace_ppb >= -wire::align_largest_pace_ppb &&
                               wanted.pace_ppb <= wire::align_largest_pace_ppb;
    const bool slew_possible =
        wanted.max_slew_ppb > 0 && wanted.max_slew_ppb <= wire::align_largest_slew_ppb;
    if (!in_reach || !pace_possible || !slew_possible)
        return ignore(wire::Log{wire::LogLevel::warning, "align_grid is out of range: ignored"});
    const Nanoseconds off = grid_clock_.misplaced(wanted.board_ns);
    if (any_running() || (off <= unseen_step && -off <= unseen_step)) {
        grid_clock_.align(wanted.board_ns, wanted.pace_ppb, wanted.max_slew_ppb, now);
        return grid_moved();
    }
    grid_clock_.place(wanted.board_ns, wanted.pace_ppb);
    begin_trains(now);
}

void Board::ignore(const wire::Log& why) {
    ++health_.ignored;
    send(why);
}

void Board::start_cameras(std::uint8_t cameras, std::uint8_t flags) {
    for (unsigned i = 0; i < camera_count; ++i) {
        if ((cameras >> i & 1U) == 0) continue;
        CameraChannel& camera =
            cameras_[i].is_slave() ? cameras_[cameras_[i].master()] : cameras_[i];
        if (cameras_[i].is_slave()) slaves_ = static_cast<std::uint8_t>(slaves_ | 1U << i);
        // The gaps of a slave are its master's.
        const bool other_gaps = flags != 0 || camera.slow();
        if (&camera == &cameras_[i] || (camera.running() && other_gaps))
            camera.start(hal_.clock.now(), flags);
    }
    switch_slaves();
}

/// A slave is switched on and off while its master is not exposing, so that each of its pulses is
/// whole and counted. The port looks at the line itself: an edge may not be known here yet.
void Board::switch_slaves() {
    for (unsigned i = 0; i < camera_count; ++i) {
        CameraChannel& slave = cameras_[i];
        const auto bit = static_cast<std::uint8_t>(1U << i);
        const bool wanted = (slaves_ & bit) != 0;
        if (!slave.is_slave() || slave.running() == wanted ||
            (exposing_ >> slave.master() & 1U) != 0)
            continue;
        routed_ = static_cast<std::uint8_t>(wanted ? routed_ | bit : routed_ & ~bit);
        const Routing::Switched switched = apply_routes(false);
        if (switched.at == never) {
            // The master's next end brings us back.
            routed_ = static_cast<std::uint8_t>(routed_ ^ bit);
        } else if (wanted) {
            slave.route(switched.at, switched.clean);
        } else {
            slave.unroute(switched.at, switched.clean);
        }
    }
}

void Board::stop(std::uint8_t cameras) {
    on_sync_.cameras = static_cast<std::uint8_t>(on_sync_.cameras & ~cameras);
    slaves_ = static_cast<std::uint8_t>(slaves_ & ~cameras);
    for (unsigned i = 0; i < camera_count; ++i)
        if ((cameras >> i & 1U) != 0 && !cameras_[i].is_slave()) cameras_[i].stop();
    switch_slaves();
}

void Board::poll_outputs(Nanoseconds now) {
    outputs_blocked_ = !outputs_.commit(now);
    if (!outputs_blocked_) output_progress_ = now;
    if (now - output_progress_ < stuck_limit) hal_.watchdog.feed();
}

void Board::moved(unsigned output, bool level, Nanoseconds asked, Nanoseconds left) {
    const bool late = outputs_.is_late(asked, left);
    if (output < camera_count && level != cameras_[output].trigger_inverted())
        cameras_[output].moved(asked, left, late);
    const bool gate = output == output_light_gate;
    if (gate) light_.moved(level, asked, left);
    // The gate closes as soon as it can, which is no sooner than the port can.
    if (!late || (gate && !level)) return;
    for (TimeOutput& each : time_outputs_) each.late(output);
    ++health_.late_outputs;
    event(wire::BoardEventKind::output_late, static_cast<std::uint8_t>(output), asked, left - asked,
          0);
}

void Board::poll_configuration(Nanoseconds now) {
    if (!may_change(now)) return;
    if (changing_ == 0) {
        light_.stop(now);
        for (const unsigned output : {output_sync, output_test})
            if (!is_time_output(output)) outputs_.rest(output, false, now);
        if (!outputs_.empty()) return;
        apply(wanted_, now);
    } else {
        change_cameras();
    }
    configuring_ = false;
    if ((wanted_.flags & wire::configuration_store) != 0)
        storing_ =
            hal_.persist.store(reinterpret_cast<const std::uint8_t*>(&wanted_), sizeof wanted_);
    answer_configuration(wanted_.id, wire::ConfigurationStatus::taken);
}

void Board::poll_storage(Nanoseconds now) {
    if (!storing_) return;
    const Persist::Outcome outcome = hal_.persist.take_outcome();
    if (outcome == Persist::Outcome::busy) return;
    storing_ = false;
    event(wire::BoardEventKind::stored, 0, now, outcome == Persist::Outcome::stored ? 1 : 0, 0);
}

void Board::poll_imus(Nanoseconds now) {
    wire::ImuSample sample;
    if (spi_imu_.poll(now, settled_, sample)) {
        send(sample);
        ImuImage image;
        const bool serves = (configuration_.ports.options & wire::port_imu_output) != 0;
        if (serves && adis16448_image(sample, image)) hal_.imu_output.publish(image);
    }
    while (uart_imu_.poll(now, sample)) send(sample);
}

void Board::poll_health(Nanoseconds now) {
    if (!greeted_ || now < next_health_) return;
    next_health_ = now + health_interval;
    health_.board_time_ns = now;
    transmitter_.count_drops(health_);
    health_.receive_errors = decoder_.errors();
    health_.imu_errors[0] = spi_imu_.errors();
    health_.imu_errors[1] = uart_imu_.errors();
    health_.imu_restarts = spi_imu_.restarts() + uart_imu_.restarts();
    health_.skipped_triggers = 0;
    for (const CameraChannel& camera : cameras_) health_.skipped_triggers += camera.skipped();
    health_.output_queue_max = static_cast<std::uint32_t>(outputs_.take_high_water());
    health_.link_queue_max = transmitter_.take_high_water();
    health_.pps_state = pps_.state(now);
    health_.pps_error_ppb = pps_.error_ppb(now);
    health_.sync_state = grid_clock_.sync_state(now);
    health_.stamp_test = hal_.edges.stamp_test();
    for (CameraChannel& camera : cameras_) health_.glitches += camera.take_glitches();
    health_.glitches += spi_imu_.take_glitches();
    send(health_);
    health_.loop_max_ns = 0;
}

void Board::exposure(const wire::Exposure& record) { send(record); }

void Board::exposure_planned(std::uint8_t camera, Nanoseconds start, Nanoseconds duration) {
    const Nanoseconds now = hal_.clock.now();
    light_.plan(camera, start, duration, cameras_[camera].has_strobe(), now);
    for (std::uint8_t i = 0; i < camera_count; ++i)
        if (cameras_[i].running() && cameras_[i].master() == camera)
            light_.plan(i, start, duration, cameras_[i].has_strobe(), now);
    if (configuration_.ports.test == wire::test_camera0 + camera)
        outputs_.pulse(start + duration / 2, output_test, true, configuration_.ports.pulse_ns);
}

void Board::event(wire::BoardEventKind kind, std::uint8_t source, Nanoseconds at,
                  std::int64_t value, std::uint16_t detail) {
    if (kind == wire::BoardEventKind::stray_edge) {
        // A floating line makes many; all are counted, some are reported.
        ++health_.stray_edges;
        if (at < next_stray_) return;
        next_stray_ = at + stray_interval;
    }
    send(wire::Event{kind, source, detail, event_sequence_++, at, value});
}

}  // namespace versavis::firmware

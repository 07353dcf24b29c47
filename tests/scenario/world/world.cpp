// SPDX-License-Identifier: BSD-3-Clause
#include "world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string_view>

namespace versavis::scenario {

using firmware::never;

namespace {

std::string_view port_name() {
    const char* variable = std::getenv("VERSAVIS_PORT");
    return variable == nullptr ? "" : variable;
}

/// The firmware as it is flashed.
bool is_emulated() { return port_name() == "rp2040"; }

/// What VERSAVIS_PORT names: a port without limits whose calls take no time, one whose calls take
/// "2us", "4us" or a "random" time, one that is as coarse as a "chip" as well, or the "rp2040"
/// itself.
firmware::PortModel named_model(std::uint64_t seed) {
    const std::string_view name = port_name();
    if (name.empty()) return {};
    if (name == "2us") return firmware::slow_model(2 * us, seed);
    if (name == "4us") return firmware::slow_model(4 * us, seed);
    if (name == "chip" || is_emulated()) return firmware::chip_model(2 * us, seed);
    if (name != "random") throw std::runtime_error(fmt::format("no port is called '{}'", name));
    std::mt19937_64 random(seed);
    const auto draw = [&random](std::uint64_t below) {
        return static_cast<Nanoseconds>(random() % below);
    };
    firmware::PortModel model = firmware::slow_model(1 + draw(5000), seed);
    model.interrupt_ns = draw(20'000);
    model.wake_ns = draw(20'000);
    return model;
}

}  // namespace

Nanoseconds PulseSource::next() const {
    return origin + std::llround(static_cast<double>(count) * period_ns);
}

World::World(std::uint64_t seed, std::optional<firmware::PortModel> model, firmware::CoreTap* tap)
    : seed_(seed), model_(model.value_or(named_model(seed))), tap_(tap) {
    make_board(wire::ResetCause::power_on);
}

devices::Inertial World::motion(Nanoseconds at) {
    const double t = static_cast<double>(at) * 1e-9;
    devices::Inertial felt;
    felt.gyro_deg_s = {40 * std::sin(t), -60 * std::cos(0.7 * t), 20};
    felt.accel_g = {0.1 * std::cos(t), -0.2, 1};
    felt.magnetic_gauss = {0.2, -0.1, 0.4};
    felt.temperature_c = 30;
    return felt;
}

void World::make_board(wire::ResetCause cause) {
    firmware::Environment environment;
    environment.outputs_changed = [this](auto at, auto pins) { outputs_changed(at, pins); };
    environment.imu_transfer = [this](auto at, const auto& transfer, auto received) {
        const bool spi = transfer.bus == firmware::ImuTransfer::Bus::spi;
        if (spi_imu_ && !dead_bus_ && !spi) return spi_imu_->i2c(at, transfer, received);
        if (spi_imu_ && !dead_bus_) {
            spi_imu_->transfer(at, transfer, received);
            const devices::UpdateTimes times = spi_imu_->updates();
            if (imu_updates_.empty() || imu_updates_.rbegin()->second != times)
                imu_updates_[at] = times;
            return true;
        }
        std::fill(received.begin(), received.end(), dead_bus_.value_or(0xFF));
        return false;
    };
    environment.uart_sent = [this](auto at, auto baud, auto bytes) { uart_sent(at, baud, bytes); };
    environment.reboot = [this](bool) { ++reboots_; };
    environment.next_event = [this] { return next_event(); };
    environment.fire = [this](auto at) { fire_events(at); };
    environment.flash = &flash_;
    environment.tap = tap_;
    pins_ = 0;
    const auto nonce =
        static_cast<std::uint32_t>(seed_ * 1000 + static_cast<std::uint64_t>(now_ / ms) + 1);
    if (is_emulated()) {
        if (board_)
            throw std::logic_error(
                "the clock of a chip that restarts begins anew: not with "
                "VERSAVIS_PORT=rp2040");
        auto chip = rig::EmulatedChip::create(rig::EmulatedChip::default_image());
        if (!chip) throw std::runtime_error(chip.error().message());
        chip_ = std::move(*chip);
        board_ = std::make_unique<rig::EmulatedBoard>(*chip_, std::move(environment));
        stamp_error_ = 48;
        now_ = board_->time();
        next_read_ = now_ + ms;
    } else {
        board_ = std::make_unique<firmware::NativeBoard>(firmware::Identity{nonce, cause, "TEST"},
                                                         std::move(environment), now_, model_);
    }
    board_->set_link_capacity(link_capacity_);
    for (const auto& [output, camera] : cameras_)
        if (camera->settings().strobe_inverted) board_->set_level(camera->settings().input, true);
}

void World::reboot(wire::ResetCause cause) { make_board(cause); }

CameraModel& World::add_camera(unsigned output, CameraSettings settings, std::uint32_t rate_uhz) {
    settings.input = static_cast<std::uint8_t>(output);
    wire::CameraConfiguration& camera = configuration.cameras[output];
    camera.flags = wire::camera_enabled;
    if (settings.trigger_inverted) camera.flags |= wire::camera_trigger_inverted;
    if (settings.strobe_inverted) camera.flags |= wire::camera_strobe_inverted;
    if (!settings.strobe) camera.flags |= wire::camera_no_strobe;
    camera.rate_uhz = rate_uhz;
    camera.pulse_ns = 100'000;
    camera.latency_ns = static_cast<std::uint32_t>(settings.latency);
    camera.gap_ns = static_cast<std::uint32_t>(settings.readout + settings.jitter);
    camera.exposure_ns = 3 * ms;
    camera.max_exposure_ns = 40 * ms;
    if (settings.strobe_inverted) board_->set_level(settings.input, true);
    cameras_[output] = std::make_unique<CameraModel>(std::move(settings), seed_ + output);
    return *cameras_[output];
}

void World::add_imu(std::unique_ptr<devices::SpiImuDevice> device, wire::ImuKind kind,
                    double rate_hz, bool data_ready) {
    spi_imu_ = std::move(device);
    configuration.imus[0] = {kind, 0,
                             data_ready ? std::uint8_t{wire::imu_data_ready} : std::uint8_t{0}, 0,
                             static_cast<std::uint32_t>(std::lround(rate_hz * 1e3))};
    if (data_ready) next_ready_ = now_ + ms;
    next_accel_ready_ = now_ + ms;
}

devices::Vn100Device& World::add_vn100(double rate_hz, bool data_ready) {
    uart_imu_.emplace(&World::motion);
    configuration.imus[1] = {wire::ImuKind::vn100, 0,
                             data_ready ? std::uint8_t{wire::imu_data_ready} : std::uint8_t{0}, 0,
                             static_cast<std::uint32_t>(std::lround(rate_hz * 1e3))};
    return *uart_imu_;
}

void World::add_pulses(wire::PulseInput input, Nanoseconds origin, double period_ns,
                       Nanoseconds width) {
    pulses_.push_back({static_cast<std::uint8_t>(unsigned{firmware::input_pulse} + input), origin,
                       period_ns, width});
    configuration.ports.inputs |= static_cast<std::uint8_t>(1U << input);
}

void World::add_noise(std::uint8_t input, Nanoseconds period, Nanoseconds from, Nanoseconds to) {
    bool level = true;
    for (Nanoseconds at = from; at < to; at += period, level = !level)
        board_->schedule_edge({at, input, level});
}

void World::show(const std::string& line, Nanoseconds at, bool level) {
    if (tracing_) trace_.set(line, at, level);
}

void World::outputs_changed(Nanoseconds at, std::uint32_t pins) {
    const std::uint32_t changed = pins ^ pins_;
    pins_ = pins;
    for (unsigned pin = 0; pin < 8; ++pin) {
        if ((changed >> pin & 1U) == 0) continue;
        const bool level = (pins >> pin & 1U) != 0;
        if (level) rises_[pin].push_back(at);
        static constexpr const char* names[] = {"trigger0", "trigger1", "trigger2", "trigger3",
                                                "light",    "",         "sync",     "test"};
        show(names[pin], at, level);
        const auto found = cameras_.find(pin);
        if (found == cameras_.end()) continue;
        for (const firmware::Edge& edge : found->second->trigger_line(at, level)) {
            board_->schedule_edge(edge);
            show(fmt::format("exposure{}", edge.input), edge.at,
                 edge.level != found->second->settings().strobe_inverted);
        }
    }
    if ((changed >> firmware::pin_light & 1U) == 0) return;
    if ((pins >> firmware::pin_light & 1U) != 0)
        lights_.push_back({at, never});
    else if (!lights_.empty())
        lights_.back().off = at;
}

void World::send_bytes(std::span<const std::uint8_t> bytes) {
    board_->receive(bytes, now_);
    board_->run_until(now_);
}

void World::set_link(Nanoseconds interval, std::size_t bytes, std::size_t capacity) {
    read_interval_ = interval;
    read_size_ = bytes;
    link_capacity_ = capacity;
    board_->set_link_capacity(capacity);
}

void World::connect() {
    send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
    run(5 * ms);
}

bool World::configure() {
    ++configuration.id;
    const std::size_t before = inbox().answers.size();
    const Nanoseconds sent = now_;
    send(configuration);
    run(20 * ms);
    if (inbox().answers.size() != before + 1 ||
        inbox().answers.back().status != wire::ConfigurationStatus::taken)
        return false;
    grid_origin_ = inbox().answers.back().origin_ns;
    if (grid_origin_ < sent || grid_origin_ > now_)
        throw std::runtime_error("the grid did not begin when the configuration was taken");
    return true;
}

void World::start(std::uint8_t cameras, std::uint8_t flags) {
    send(wire::Start{cameras, flags, {}});
}
void World::stop(std::uint8_t cameras) { send(wire::Stop{cameras, {}}); }

bool World::begin(std::uint8_t flags) {
    connect();
    if (!configure()) return false;
    start(0xF, flags);
    return true;
}

void World::read_link() {
    if (now_ < host_reads_from_) return;
    const auto bytes = board_->transmitted();
    const std::size_t size = std::min(bytes.size(), read_size_);
    host_.take(bytes.subspan(0, size));
    board_->consume(size, now_);
}

Nanoseconds World::next_event() const {
    Nanoseconds next = std::min({next_read_, next_ready_, next_accel_ready_, next_sample_});
    for (const PulseSource& source : pulses_) next = std::min(next, source.next());
    return next;
}

void World::fire_spi_ready() {
    if (now_ < next_ready_) return;
    if (ready_fires_ && spi_imu_->signals(now_)) {
        const double period = spi_imu_->updates().period_ns;
        pulse_ready(firmware::input_imu_ready, std::llround(std::min(1e5, period / 4)));
        ready_times_[0].push_back(now_);
        show("imu_ready", now_, true);
        show("imu_ready", now_ + std::llround(std::min(1e5, period / 4)), false);
    }
    ready_fires_ = spi_imu_->signals(now_);
    const devices::UpdateTimes times = spi_imu_->updates();
    next_ready_ = ready_fires_ ? times.time(times.index_at(now_) + 1) : now_ + ms;
}

/// A pulse of a data-ready line, with its echo.
void World::pulse_ready(std::uint8_t input, Nanoseconds width) {
    board_->schedule_edge({now_, input, true});
    if (ready_echo_ != 0) {
        board_->schedule_edge({now_ + ready_echo_ / 2, input, false});
        board_->schedule_edge({now_ + ready_echo_, input, true});
    }
    board_->schedule_edge({now_ + std::max(width, 2 * ready_echo_), input, false});
}

void World::fire_accel_ready() {
    if (now_ < next_accel_ready_) return;
    if (accel_ready_fires_ && spi_imu_->accel_signals(now_) && accel_ready_wired_)
        pulse_ready(firmware::input_accel_ready, 50 * us);
    accel_ready_fires_ = spi_imu_->accel_signals(now_);
    const devices::UpdateTimes times = spi_imu_->accel_updates();
    next_accel_ready_ = accel_ready_fires_ ? times.time(times.index_at(now_) + 1) : now_ + ms;
}

void World::fire_uart_sample() {
    if (!uart_imu_ || now_ < next_sample_) return;
    const Nanoseconds at = now_;
    if (uart_imu_->pulses(at)) {
        board_->schedule_edge({at, firmware::input_imu_ready + 1, true});
        board_->schedule_edge({at + 100 * us, firmware::input_imu_ready + 1, false});
    }
    if (uart_imu_->sends(at)) {
        ready_times_[1].push_back(at);
        const devices::Vn100Device::Burst packet = uart_imu_->packet(at);
        board_->uart_receive(packet.bytes, packet.complete);
    }
    next_sample_ = uart_imu_->next_sample(at).value_or(never);
}

void World::uart_sent(Nanoseconds at, std::uint32_t baud, std::span<const std::uint8_t> bytes) {
    if (!uart_imu_) return;
    for (const devices::Vn100Device::Burst& answer : uart_imu_->receive(at, baud, bytes))
        board_->uart_receive(answer.bytes, answer.complete);
    next_sample_ = uart_imu_->next_sample(at).value_or(never);
}

void World::fire_events(Nanoseconds at) {
    now_ = std::max(now_, at);
    if (now_ >= next_read_) {
        read_link();
        next_read_ += read_interval_;
    }
    fire_spi_ready();
    fire_accel_ready();
    fire_uart_sample();
    for (PulseSource& source : pulses_) {
        const Nanoseconds pulse = source.next();
        if (pulse > now_) continue;
        static constexpr const char* names[] = {"pps", "aux0", "aux1", "sync_in"};
        show(names[source.input - firmware::input_pulse], pulse, !source.falling);
        show(names[source.input - firmware::input_pulse], pulse + source.width, source.falling);
        board_->schedule_edge({pulse, source.input, !source.falling});
        board_->schedule_edge({pulse + source.width, source.input, source.falling});
        source.fired.push_back(pulse);
        ++source.count;
    }
}

void World::run(Nanoseconds duration) {
    const Nanoseconds end = now_ + duration;
    board_->run_until(end);
    now_ = std::max(now_, end);
}

firmware::NativeBoard& World::native_board() {
    auto* native = dynamic_cast<firmware::NativeBoard*>(board_.get());
    if (native == nullptr)
        throw std::logic_error("the emulated chip cannot do that: not with VERSAVIS_PORT=rp2040");
    return *native;
}

void World::stall_board(Nanoseconds duration) {
    native_board().set_stalled(true);
    run(duration);
    native_board().set_stalled(false);
}

void World::finish() {
    stop();
    run(100 * ms);
    host_reads_from_ = 0;
    run(500 * ms);
}

Nanoseconds World::grid_time(unsigned camera, std::uint64_t tick) const {
    const wire::CameraConfiguration& c = configuration.cameras[camera];
    const std::uint32_t rate =
        (c.flags & wire::camera_slave) != 0 ? configuration.cameras[c.master].rate_uhz : c.rate_uhz;
    return grid_origin_ + c.phase_ns +
           static_cast<Nanoseconds>(static_cast<__int128>(tick) * 1'000'000'000'000'000 / rate);
}

Nanoseconds World::rounding() const {
    if (model_.edge_grain_ns == 1) return 0;
    return (Nanoseconds{1} << model_.output_grain_bits) / 2 + model_.output_step_ns +
           model_.edge_grain_ns + stamp_error_;
}

Nanoseconds World::grid_error(const wire::Exposure& record) const {
    if (is_slow() && (record.flags & wire::exposure_late) != 0) return 0;
    const Nanoseconds error = record.start_ns + (record.end_ns - record.start_ns) / 2 -
                              grid_time(record.camera, record.tick);
    if (rounding() == 0) return error;
    const Nanoseconds whole = (error + (error < 0 ? -us : us) / 2) / us * us;
    return std::abs(error - whole) <= rounding() ? whole : error;
}

const wire::Exposure& World::record(unsigned camera, std::uint64_t trigger) {
    for (const wire::Exposure& record : inbox().exposures[camera])
        if (record.trigger == trigger) return record;
    throw std::runtime_error(fmt::format("camera {} has no record of trigger {}", camera, trigger));
}

}  // namespace versavis::scenario

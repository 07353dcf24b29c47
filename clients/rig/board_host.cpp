// SPDX-License-Identifier: BSD-3-Clause
#include "board_host.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <random>
#include <system_error>

#include "../../firmware/native/native_board.hpp"
#include "engine/clock/output_clock.hpp"
#include "posix/thread.hpp"
#include "sample_mark.hpp"

namespace versavis::rig {

namespace {

constexpr Duration longest_wait = milliseconds(20);  // a reset or a stop is noticed after this time

devices::Inertial felt(const Motion& motion, HostTime at, std::uint32_t serial) {
    constexpr double degrees = 180 / 3.14159265358979;
    constexpr double standard_gravity = 9.80665;
    const Eigen::Vector3d rate = motion.rate_rad_s(at) * degrees;
    const Eigen::Vector3d force = motion.specific_force_m_s2(at) / standard_gravity;
    devices::Inertial felt;
    felt.gyro_deg_s = {rate.x(), rate.y(), rate.z()};
    felt.accel_g = {force.x(), force.y(), force.z()};
    felt.magnetic_gauss = SampleMark::field_gauss(serial);
    felt.temperature_c = 36;
    return felt;
}

constexpr Duration marked_ahead = milliseconds(500);
/// Edges of the IMU's data-ready line are scheduled so long before they are due.
constexpr Duration signalled_ahead = milliseconds(2);
constexpr Duration ready_width = microseconds(100);
constexpr Duration shortest_time_pulse = milliseconds(1);
constexpr Duration sentence_after = milliseconds(150);
constexpr Duration byte_at_9600_baud = nanoseconds(1'041'667);

Duration sync_period(const BoardScenario& board) {
    if (board.sync_hz == 0) return {};
    return Duration{std::llround(1e9 / board.sync_hz / (1 + board.sync_skew_ppm * 1e-6))};
}

std::string sentence(const std::string& body) {
    unsigned sum = 0;
    for (const char c : body) sum ^= static_cast<unsigned char>(c);
    return fmt::format("${}*{:02X}\r\n", body, sum);
}

/// RMC and GGA as a receiver in Zurich sends them.
std::string sentences(std::int64_t utc_s) {
    const std::time_t seconds = utc_s;
    std::tm utc{};
    gmtime_r(&seconds, &utc);
    const std::string time = fmt::format("{:02}{:02}{:02}.00", utc.tm_hour, utc.tm_min, utc.tm_sec);
    const std::string date =
        fmt::format("{:02}{:02}{:02}", utc.tm_mday, utc.tm_mon + 1, utc.tm_year % 100);
    const std::string_view place = "4722.6,N,00832.9,E";
    return sentence(fmt::format("GPRMC,{},A,{},0.0,0.0,{},,,A", time, place, date)) +
           sentence(fmt::format("GPGGA,{},{},1,08,1.0,420.0,M,47.0,M,,", time, place));
}

}  // namespace

Expected<std::unique_ptr<BoardHost>> BoardHost::create(const World& world,
                                                       const std::string& socket_path,
                                                       std::vector<GenicamCamera*> cameras) {
    const BoardScenario& settings = world.scenario.board;
    std::unique_ptr<EmulatedChip> chip;
    if (!settings.image.empty()) {
        auto emulated = EmulatedChip::create(settings.image);
        if (!emulated) return Unexpected(emulated.error());
        chip = std::move(*emulated);
    }
    sockaddr_un self{};
    self.sun_family = AF_UNIX;
    if (socket_path.size() >= sizeof self.sun_path)
        return failure(socket_path, "the path of the socket is too long",
                       "choose a shorter one with --socket");
    std::memcpy(self.sun_path, socket_path.c_str(), socket_path.size() + 1);
    ::unlink(socket_path.c_str());
    FileDescriptor listener(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (::bind(listener.get(), reinterpret_cast<const sockaddr*>(&self), sizeof self) != 0 ||
        ::listen(listener.get(), 1) != 0) {
        const std::string reason = std::generic_category().message(errno);
        return failure(socket_path, fmt::format("cannot listen: {}", reason),
                       "choose another with --socket");
    }
    try {
        return std::unique_ptr<BoardHost>(new BoardHost(world, socket_path, std::move(cameras),
                                                        std::move(chip), std::move(listener)));
    } catch (const std::exception& error) {
        return failure(settings.image, error.what(),
                       "see the line before; ./dev firmware builds an image that starts");
    }
}

BoardHost::BoardHost(const World& world, std::string socket_path,
                     std::vector<GenicamCamera*> cameras, std::unique_ptr<EmulatedChip> chip,
                     FileDescriptor listener)
    : serial_(world.scenario.board.serial),
      seed_(world.scenario.seed),
      clock_errors_(world.scenario.board.clock),
      sync_period_{sync_period(world.scenario.board)},
      link_delay_{std::llround(world.scenario.board.link_ms * 1e6)},
      imu_name_(world.scenario.imu),
      socket_path_(std::move(socket_path)),
      imu_(devices::AdisModel::adis16448b,
           [this, &motion = world.surroundings.motion](firmware::Nanoseconds at) {
               return felt(motion, HostTime{at}, imu_serial_);
           }),
      leds_(world.surroundings.leds.get()),
      truth_(world.truth),
      cameras_(std::move(cameras)),
      listener_(std::move(listener)),
      chip_(std::move(chip)) {
    if (world.scenario.board.gnss)
        utc_ = *clock::OutputClock::create(clock::OutputClockKind::realtime);
    boot({}, clock_errors_, world.zero);
    thread_ = start_thread("board", [this] { run(); });
}

BoardHost::~BoardHost() {
    stop_ = true;
    thread_.join();
    if (leds_ != nullptr) leds_->settle(HostTime{INT64_MAX});  // nobody waits for the rest
    drop_host();
    ::unlink(socket_path_.c_str());
}

void BoardHost::boot(firmware::Identity identity, const ClockErrors& clock, HostTime zero) {
    ++life_;
    identity.nonce = static_cast<std::uint32_t>(std::mt19937_64(seed_ + life_)() ^
                                                static_cast<std::uint64_t>(host_now().ns));
    serial_.copy(identity.serial, sizeof identity.serial - 1);
    pins_ = 0;
    next_utc_s_ = 0;
    signalled_ = host_now();
    std::fill(std::begin(pulses_), std::end(pulses_), 0);
    firmware::Environment environment;
    environment.outputs_changed = [this](auto at, auto pins) { outputs_changed(at, pins); };
    environment.imu_transfer = [this](auto at, const auto& transfer, auto received) {
        imu_transfer(at, transfer, received);
        return true;
    };
    environment.uart_sent = [this](auto at, auto baud, auto bytes) {
        truth_.add(TrueSerial{clock_->host(at), baud, {bytes.begin(), bytes.end()}});
    };
    environment.reboot = [this](bool) { reset(); };
    if (chip_) {
        // Its time begins with it, and it says itself who it is.
        board_ = std::make_unique<EmulatedBoard>(*chip_, std::move(environment));
        ClockErrors from_start = clock;
        from_start.offset_ns = board_->time();
        clock_ = std::make_unique<SkewedClock>(host_now(), from_start);
        return;
    }
    clock_ = std::make_unique<SkewedClock>(zero, clock);
    board_ = std::make_unique<firmware::NativeBoard>(identity, std::move(environment), board_now());
}

void BoardHost::restart() {
    drop_host();
    ClockErrors from_zero = clock_errors_;
    from_zero.offset_ns = 0;
    boot({0, wire::ResetCause::software, {}}, from_zero, host_now());
}

void BoardHost::imu_transfer(firmware::Nanoseconds at, const firmware::ImuTransfer& transfer,
                             std::span<std::uint8_t> received) {
    const HostTime instant = clock_->host(at);
    if (suffers(FaultKind::imu_missing)) {
        std::fill(received.begin(), received.end(), std::uint8_t{0xFF});
        return;
    }
    if (suffers(FaultKind::imu_noisy)) imu_.corrupt(1);
    // Register accesses have gaps, and come word by word where the chip makes them.
    const bool sample = transfer.word_gap_ns == 0 && transfer.size > 2;
    if (sample) ++imu_serial_;
    imu_.transfer(instant.ns, transfer, received);
    if (sample)
        truth_.add(
            TrueImuSample{imu_name_, life_, imu_serial_, HostTime{imu_.motion_shown(instant.ns)}});
}

void BoardHost::outputs_changed(firmware::Nanoseconds at, std::uint32_t pins) {
    const std::uint32_t changed = pins ^ pins_;
    pins_ = pins;
    const HostTime instant = clock_->host(at);
    if (leds_ != nullptr && (changed & pins) >> leds_->output() & 1U) leds_->pulse(instant);
    for (auto& [pin, name, rise] : time_pins_) {
        if ((changed >> pin & 1U) == 0) continue;
        if ((pins >> pin & 1U) != 0)
            rise = instant;
        else if (instant - rise >= shortest_time_pulse)
            truth_.add(TruePulse{name, rise, instant});
    }
    for (GenicamCamera* camera : cameras_) {
        const unsigned output = camera->settings().output;
        if ((changed >> output & 1U) == 0) continue;
        const bool level = (pins >> output & 1U) != 0;
        if (level) ++pulses_[output];
        const auto line = camera->trigger_line(level, {life_, pulses_[output], instant});
        if (camera->settings().line == LineShows::trigger)
            line_changes(camera->settings(), instant, level);
        else if (line)
            show_exposure(camera->settings(), *line);
    }
}

void BoardHost::show_exposure(const CameraScenario& camera, const LineActive& line) {
    const auto late = [](double us) { return Duration{std::llround(us * 1e3)}; };
    HostTime end = line.end;
    if (camera.line == LineShows::fixed) end = line.begin + milliseconds(1);
    if (camera.line == LineShows::readout) end = end + late(camera.readout_us);
    for (unsigned i = 0; i < line.times; ++i) {
        const Duration shift = line.every * static_cast<std::int64_t>(i);
        line_changes(camera, line.begin + shift + late(camera.line_rising_us), !line.inverted);
        line_changes(camera, end + shift + late(camera.line_falling_us), line.inverted);
    }
}

void BoardHost::line_changes(const CameraScenario& camera, HostTime at, bool active) {
    const int input = camera.input < 0 ? static_cast<int>(camera.output) : camera.input;
    for (const int wired : {input, camera.second_input})
        if (wired >= 0)
            board_->schedule_edge({clock_->device_ns(at), static_cast<std::uint8_t>(wired),
                                   active != camera.line_inverted});
}

void BoardHost::run() {
    try {
        live();
    } catch (const std::exception& error) {
        fmt::print(stderr, "versavis-rig: {}\n", error.what());
        ::kill(::getpid(), SIGTERM);
    }
}

void BoardHost::live() {
    while (!stop_) {
        if (reset_pending_.exchange(false)) restart();
        const HostTime now = host_now();
        if (utc_) hear_gnss(now);
        if (sync_period_.ns != 0) hear_sync(now);
        hear_auxiliaries();
        const HostTime next_sample = signal_samples(now);
        board_->set_imu_bus_stuck(suffers(FaultKind::imu_stuck));
        // No further, however late it is by now: later edges are not scheduled yet.
        board_->run_until(clock_->device_ns(now));
        if (leds_ != nullptr) leds_->settle(now);
        plug(!suffers(FaultKind::board_gone));
        if (!suffers(FaultKind::board_mute)) exchange_bytes();
        const HostTime wake =
            clock_->host(std::min(board_->next_wake(), board_now() + longest_wait.ns));
        const HostTime leaves = late_.empty() ? wake : late_.front().first;
        const HostTime comes = coming_.empty() ? wake : coming_.front().first;
        wait(std::min({wake, leaves, comes, next_sample, host_now() + longest_wait}));
    }
}

void BoardHost::show_auxiliary(const CameraScenario& camera, const LineActive& line) {
    const auto late = [](double us) { return Duration{std::llround(us * 1e3)}; };
    const auto input =
        static_cast<std::uint8_t>(firmware::input_pulse + unsigned{wire::pulse_aux0} +
                                  static_cast<unsigned>(camera.aux_input));
    const bool active = line.inverted == camera.line_inverted;
    const std::lock_guard lock(auxiliary_mutex_);
    auxiliary_edges_.push_back({line.begin + late(camera.line_rising_us), input, active});
    auxiliary_edges_.push_back({line.end + late(camera.line_falling_us), input, !active});
}

void BoardHost::hear_auxiliaries() {
    const std::lock_guard lock(auxiliary_mutex_);
    for (const AuxiliaryEdge& edge : auxiliary_edges_)
        board_->schedule_edge({clock_->device_ns(edge.at), edge.input, edge.level});
    auxiliary_edges_.clear();
}

/// The pulse at each second, and its sentences.
void BoardHost::hear_gnss(HostTime now) {
    constexpr std::int64_t second_ns = 1'000'000'000;
    const Duration offset = utc_->offset();
    if (next_utc_s_ == 0) next_utc_s_ = (now + offset + marked_ahead).ns / second_ns + 1;
    const HostTime pulse = HostTime{next_utc_s_ * second_ns} - offset;
    if (pulse - now > marked_ahead) return;
    const auto input = static_cast<std::uint8_t>(firmware::input_pulse + unsigned{wire::pulse_pps});
    board_->schedule_edge({clock_->device_ns(pulse), input, true});
    board_->schedule_edge({clock_->device_ns(pulse + milliseconds(100)), input, false});
    const std::string text = sentences(next_utc_s_++);
    const HostTime complete =
        pulse + sentence_after + byte_at_9600_baud * static_cast<std::int64_t>(text.size());
    board_->uart_receive({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()},
                         clock_->device_ns(complete));
}

/// The pulses of a board whose clock runs at a rate of its own.
void BoardHost::hear_sync(HostTime now) {
    if (next_sync_.ns == 0) next_sync_ = now + marked_ahead;
    if (next_sync_ - now > marked_ahead) return;
    const auto input =
        static_cast<std::uint8_t>(firmware::input_pulse + unsigned{wire::pulse_sync});
    board_->schedule_edge({clock_->device_ns(next_sync_), input, true});
    board_->schedule_edge({clock_->device_ns(next_sync_ + microseconds(100)), input, false});
    next_sync_ = next_sync_ + sync_period_;
}

/// Edges of the data-ready line, where the part is set to use it. Returns when to come again.
HostTime BoardHost::signal_samples(HostTime now) {
    if (!imu_.signals(now.ns) || suffers(FaultKind::imu_missing)) {
        signalled_ = now;
        return now + longest_wait;
    }
    const devices::UpdateTimes times = imu_.updates();
    for (auto index = times.index_at(signalled_.ns) + 1;; ++index) {
        const HostTime sample{times.time(index)};
        if (sample - now > signalled_ahead) return sample - signalled_ahead;
        board_->schedule_edge({clock_->device_ns(sample), firmware::input_imu_ready, true});
        board_->schedule_edge(
            {clock_->device_ns(sample + ready_width), firmware::input_imu_ready, false});
        signalled_ = sample;
    }
}

void BoardHost::wait(HostTime until) const {
    const std::int64_t left_ns = std::max<std::int64_t>(0, (until - host_now()).ns);
    const timespec timeout{left_ns / 1'000'000'000, left_ns % 1'000'000'000};
    pollfd readable{(host_ ? host_ : listener_).get(), POLLIN, 0};
    ::ppoll(&readable, 1, &timeout, nullptr);
}

void BoardHost::accept_host() {
    if (!host_)
        host_ = FileDescriptor(
            ::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
}

void BoardHost::drop_host() {
    host_ = {};
    late_.clear();
    coming_.clear();
}

void BoardHost::suffer(const Fault& fault) {
    if (fault.kind == FaultKind::board_reset) return reset();
    const HostTime until = host_now() + Duration{std::llround(fault.seconds * 1e9)};
    if (fault.kind == FaultKind::late_records) lateness_ns_ = std::llround(fault.delay_ms * 1e6);
    suffers_until_ns_[static_cast<std::size_t>(fault.kind)] = until.ns;
}

bool BoardHost::suffers(FaultKind kind) const {
    return host_now().ns < suffers_until_ns_[static_cast<std::size_t>(kind)];
}

/// Without its name nobody finds the socket.
void BoardHost::plug(bool in) {
    if (in == plugged_) return;
    plugged_ = in;
    const std::string unplugged = socket_path_ + ".unplugged";
    std::rename((in ? unplugged : socket_path_).c_str(), (in ? socket_path_ : unplugged).c_str());
    if (!in) drop_host();
}

/// What the board wrote leaves when it is due, in its order.
void BoardHost::write_late(HostTime now) {
    const auto out = board_->transmitted();
    if (!out.empty()) {
        const Duration delay =
            suffers(FaultKind::late_records) ? Duration{lateness_ns_} : link_delay_;
        late_.emplace_back(now + delay, std::vector(out.begin(), out.end()));
        board_->consume(out.size(), board_now());
    }
    for (; !late_.empty() && late_.front().first <= now; late_.pop_front())
        ::send(host_.get(), late_.front().second.data(), late_.front().second.size(), MSG_NOSIGNAL);
}

void BoardHost::exchange_bytes() {
    accept_host();
    if (!host_) {
        board_->consume(board_->transmitted().size(), board_now());
        return;
    }
    std::uint8_t buffer[4096];
    ssize_t size = 0;
    while ((size = ::recv(host_.get(), buffer, sizeof buffer, 0)) > 0)
        coming_.emplace_back(host_now() + link_delay_, std::vector(buffer, buffer + size));
    if (size == 0 || errno != EAGAIN) return drop_host();
    for (; !coming_.empty() && coming_.front().first <= host_now(); coming_.pop_front()) {
        const firmware::Nanoseconds at = board_now();
        board_->run_until(at);  // nothing answers before it is asked
        board_->receive(coming_.front().second, at);
        board_->run_until(at);
    }
    if (suffers(FaultKind::late_records) || link_delay_.ns > 0 || !late_.empty())
        return write_late(host_now());
    const auto out = board_->transmitted();
    // Stamped before writing: the host may receive the bytes before this process continues.
    const firmware::Nanoseconds leaving = board_now();
    const ssize_t sent =
        out.empty() ? 0 : ::send(host_.get(), out.data(), out.size(), MSG_NOSIGNAL);
    if (sent > 0) board_->consume(static_cast<std::size_t>(sent), leaving);
}

}  // namespace versavis::rig

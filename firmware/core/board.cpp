// SPDX-License-Identifier: BSD-3-Clause
#include "board.hpp"

#include <cstring>

#include "configuration_check.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds commit_ahead = 1'000'000;
constexpr Nanoseconds health_interval = 1'000'000'000;
constexpr Nanoseconds start_delay = 5'000'000;  // from the command to the grid's origin

}  // namespace

Board::Board(const Hal& hal, const Identity& identity)
    : hal_(hal),
      identity_(identity),
      outputs_(hal_.outputs),
      cameras_{{0, outputs_, *this}, {1, outputs_, *this}, {2, outputs_, *this}, {3, outputs_, *this}},
      imu_(hal_.imu_bus) {}

void Board::poll() {
    poll_link();
    poll_edges();
    const Nanoseconds now = hal_.clock.now();
    for (CameraChannel& camera : cameras_) camera.poll(now);
    outputs_.commit(now + commit_ahead);
    poll_imu(now);
    poll_health(now);
}

Nanoseconds Board::next_wake() const {
    Nanoseconds wake = greeted_ ? next_health_ : INT64_MAX;
    const auto sooner = [&wake](Nanoseconds at) { wake = at < wake ? at : wake; };
    for (const CameraChannel& camera : cameras_) sooner(camera.next_wake());
    sooner(imu_.next_wake());
    if (outputs_.next() != INT64_MAX) sooner(outputs_.next() - commit_ahead + 1);
    return wake;
}

template <class T>
void Board::send(const T& message) {
    if (!greeted_) return;  // silent until the host has said hello
    wire::encode(message, identity_.nonce, sequence_++, frame_);
    // A number that is never sent shows the host that something was dropped here.
    if (hal_.link.free_space() < frame_.size)
        ++health_.dropped_packets;
    else
        hal_.link.write(frame_.bytes, frame_.size);
}

void Board::poll_link() {
    std::uint8_t bytes[64];
    Nanoseconds received = 0;
    while (const std::size_t size = hal_.link.read(bytes, sizeof bytes, received))
        decoder_.feed(bytes, size, [&](const wire::Packet& packet) { handle(packet, received); });
}

void Board::handle(const wire::Packet& packet, Nanoseconds received) {
    wire::HostHello hello;
    wire::Configuration configuration;
    wire::Start begin;
    wire::Stop end;
    wire::ClockRequest request;
    wire::ExpectedExposure expected;
    wire::Reboot reboot;
    if (packet.read(hello)) return greet(hello);
    if (!greeted_) return;
    if (packet.read(request)) return answer_clock(request, received);
    if (packet.read(configuration)) return configure(configuration);
    if (packet.read(begin)) return start(begin);
    if (packet.read(end)) return stop(end.cameras);
    if (packet.read(expected)) {
        if (expected.camera < camera_count && expected.exposure_ns >= 0)
            cameras_[expected.camera].announce(expected.trigger, expected.exposure_ns);
        return;
    }
    if (packet.read(reboot) && reboot.magic == wire::reboot_magic)
        hal_.rebooter.reboot(reboot.to_boot_loader != 0);
}

void Board::greet(const wire::HostHello& hello) {
    // A board of another major version still says who it is: the host then tells the user what to update.
    greeted_ = true;
    stop(0xFF);
    wire::BoardHello answer{};
    answer.major = wire::protocol_major;
    answer.minor = wire::protocol_minor;
    answer.cameras = camera_count;
    answer.reset_cause = identity_.reset_cause;
    answer.capabilities =
        wire::capability_exposure_compensation | wire::capability_imu | wire::capability_start_pattern;
    answer.board_time_ns = hal_.clock.now();
    std::memcpy(answer.serial, identity_.serial, sizeof answer.serial);
    const char version[] = "versavis 0.1.0";
    std::memcpy(answer.firmware, version, sizeof version);
    send(answer);
    if (hello.major != wire::protocol_major) greeted_ = false;
    next_health_ = hal_.clock.now() + health_interval;
}

void Board::configure(const wire::Configuration& configuration) {
    wire::ConfigurationAnswer answer{};
    answer.id = configuration.id;
    if (any_running())
        answer.status = wire::ConfigurationStatus::running;
    else
        check(configuration, answer);
    if (answer.status == wire::ConfigurationStatus::taken) {
        const Nanoseconds now = hal_.clock.now();
        configuration_ = configuration;
        for (std::size_t i = 0; i < camera_count; ++i) cameras_[i].configure(configuration.cameras[i], now);
        imu_.configure(configuration.imu, now);
    }
    answer.taken = configuration_;
    send(answer);
}

bool Board::any_running() const {
    for (const CameraChannel& camera : cameras_)
        if (camera.running()) return true;
    return false;
}

void Board::start(const wire::Start& start) {
    const Nanoseconds now = hal_.clock.now();
    // One grid for all: it begins with the first camera and goes on while any runs.
    if (!any_running()) grid_origin_ = now + start_delay;
    for (unsigned i = 0; i < camera_count; ++i)
        if ((start.cameras >> i & 1U) != 0)
            cameras_[i].start(grid_origin_, now, (start.flags & wire::start_pattern) != 0);
}

void Board::stop(std::uint8_t cameras) {
    for (unsigned i = 0; i < camera_count; ++i)
        if ((cameras >> i & 1U) != 0) cameras_[i].stop();
}

void Board::answer_clock(const wire::ClockRequest& request, Nanoseconds received) {
    wire::ClockAnswer answer{};
    answer.id = request.id;
    answer.received_ns = received;
    answer.sent_ns = hal_.clock.now();
    send(answer);
}

void Board::poll_edges() {
    if (const std::uint32_t lost = hal_.edges.take_lost()) {
        health_.lost_edges += lost;
        for (CameraChannel& camera : cameras_) camera.edges_lost();
        event(wire::EventKind::edge_overflow, 0, hal_.clock.now(), lost);
    }
    Edge edge{};
    while (hal_.edges.pop(edge))
        if (edge.input < camera_count) cameras_[edge.input].edge(edge.at, edge.level);
    if (const Nanoseconds late = hal_.outputs.take_lateness()) {
        ++health_.late_outputs;
        event(wire::EventKind::output_late, 0, hal_.clock.now(), late);
    }
}

void Board::poll_imu(Nanoseconds now) {
    wire::ImuSample sample;
    if (imu_.poll(now, sample)) send(sample);
}

void Board::poll_health(Nanoseconds now) {
    if (!greeted_ || now < next_health_) return;
    next_health_ += health_interval;
    health_.board_time_ns = now;
    health_.receive_errors = decoder_.errors();
    health_.imu_errors = imu_.errors();
    health_.output_queue_max = static_cast<std::uint32_t>(outputs_.high_water());
    send(health_);
}

void Board::exposure(const wire::Exposure& record) { send(record); }

void Board::event(wire::EventKind kind, std::uint8_t source, Nanoseconds at, std::int64_t value) {
    wire::Event message{};
    message.kind = kind;
    message.source = source;
    message.sequence = event_sequence_++;
    message.time_ns = at;
    message.value = value;
    send(message);
}

}  // namespace versavis::firmware

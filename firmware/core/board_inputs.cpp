// SPDX-License-Identifier: BSD-3-Clause
// The part of the board that handles what arrives at its pins.
#include "board.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds default_sync_period = 1'000'000'000;
constexpr Nanoseconds sync_tolerance = 2000;  // 500 ppm: two crystals differ by less
constexpr std::uint32_t default_nmea_baud = 9'600;
constexpr Nanoseconds uhz_ns = 1'000'000'000'000'000;

}  // namespace

void Board::poll_edges(Nanoseconds now) {
    noise_.poll(now);
    // Of the edges still to be read, some came before the lost ones and some after.
    const std::uint32_t lost = hal_.edges.take_lost();
    if (lost != 0) edges_lost();
    Edge edge{};
    while (hal_.edges.pop(edge)) {
        if (noise_.take(edge)) {
            take_edge(edge, now);
            continue;
        }
        ++health_.noisy_inputs;
        if (edge.input < camera_count) edges_lost();
        event(wire::EventKind::input_noisy, edge.input, edge.at, 0, 0);
    }
    if (lost == 0) return;
    edges_lost();
    health_.lost_edges += lost;
    event(wire::EventKind::edge_overflow, 0, now, lost, 0);
}

void Board::edges_lost() {
    for (CameraChannel& camera : cameras_) camera.edges_lost();
    light_.edges_lost();
    exposing_ = 0;
}

void Board::take_edge(const Edge& edge, Nanoseconds now) {
    if (edge.input < camera_count) return take_exposure_edge(edge, now);
    if (edge.input >= input_pulse) {
        const auto input = static_cast<wire::PulseInput>(edge.input - input_pulse);
        const bool falling = (configuration_.ports.falling >> input & 1U) != 0;
        if (edge.level != falling) take_pulse(input, edge.at);
    } else if (edge.level && edge.input == input_imu_ready) {
        spi_imu_.ready_edge(edge.at, now);
    } else if (edge.level) {
        uart_imu_.ready_edge(edge.at);
    }
}

void Board::take_exposure_edge(const Edge& edge, Nanoseconds now) {
    CameraChannel& master = cameras_[edge.input];
    const bool exposing = master.exposing(edge.level);
    const std::uint64_t tick = master.tick_at(edge.at);
    master.edge(edge.at, edge.level);
    for (CameraChannel& slave : cameras_)
        if (slave.enabled() && slave.master() == edge.input)
            slave.master_edge(edge.at, exposing, tick);
    light_.edge(edge.input, exposing, now);
    const auto bit = static_cast<std::uint8_t>(1U << edge.input);
    exposing_ = static_cast<std::uint8_t>(exposing ? exposing_ | bit : exposing_ & ~bit);
    if (!exposing) switch_slaves();
}

void Board::take_pulse(wire::PulseInput input, Nanoseconds at) {
    const std::uint32_t number = ++pulses_[input];
    switch (input) {
        case wire::pulse_pps:
            pps_.pulse(at);
            nmea_.pulse(at);
            return event(wire::EventKind::pps, 0, at, number, 0);
        case wire::pulse_aux0:
        case wire::pulse_aux1:
            return event(wire::EventKind::aux_pulse,
                         static_cast<std::uint8_t>(input - wire::pulse_aux0), at, number, 0);
        case wire::pulse_sync: break;
    }
    event(wire::EventKind::sync_pulse, 0, at, number, 0);
    const Nanoseconds since = at - last_sync_;
    last_sync_ = at;
    if (on_sync_.cameras == 0 || configuring_) {
        grid_clock_.sync_pulse(at);
        return;
    }
    if (!any_running()) {
        // Two edges a period apart are pulses; a single one may be anything.
        const std::uint32_t rate = configuration_.ports.sync_rate_uhz;
        const Nanoseconds period = rate == 0 ? default_sync_period : uhz_ns / rate;
        if (since < period - period / sync_tolerance || since > period + period / sync_tolerance)
            return;
        grid_clock_.begin(at, period);
        for (CameraChannel& camera : cameras_) camera.grid_began();
        begin_trains(hal_.clock.now());
    }
    start_cameras(on_sync_.cameras, on_sync_.flags);
    on_sync_ = {};
}

void Board::apply_nmea() {
    if ((configuration_.ports.options & wire::port_nmea) == 0) return;
    const std::uint32_t baud = configuration_.ports.nmea_baud;
    nmea_.begin(baud == 0 ? default_nmea_baud : baud);
    hal_.imu_uart.set_baud(baud == 0 ? default_nmea_baud : baud);
}

void Board::poll_nmea() {
    if ((configuration_.ports.options & wire::port_nmea) == 0) return;
    std::uint8_t bytes[32];
    Nanoseconds received = 0;
    UtcLabel label;
    while (const std::size_t size = hal_.imu_uart.read(bytes, sizeof bytes, received))
        for (std::size_t i = 0; i < size; ++i) {
            const Nanoseconds at =
                received - static_cast<Nanoseconds>(size - 1 - i) * nmea_.byte_duration();
            if (nmea_.take(bytes[i], at, label))
                event(wire::EventKind::utc_label, 0, label.pulse, label.utc_s, 0);
        }
}

}  // namespace versavis::firmware

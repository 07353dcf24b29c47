// SPDX-License-Identifier: BSD-3-Clause
// The part of the board that handles what arrives at its pins.
#include "board.hpp"
#include "port_settings.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds default_sync_period = 1'000'000'000;
constexpr Nanoseconds sync_tolerance = 2000;  // 500 ppm: two crystals differ by less
constexpr Nanoseconds uhz_ns = 1'000'000'000'000'000;

/// Bounds the work of one poll. If lower, a burst of edges takes more polls; if higher, other work
/// waits longer.
constexpr unsigned edges_a_poll = 24;

constexpr std::uint32_t all_lines = (1U << camera_count) - 1;

}  // namespace

void Board::poll_edges(Nanoseconds now) {
    noise_.poll(now);
    Edge edge{settled_, 0, false};
    unsigned count = 0;
    for (; count < edges_a_poll; ++count) {
        if (!hal_.edges.pop(edge)) {
            const std::uint32_t lost = hal_.edges.take_lost();
            if (lost == 0) break;
            edges_lost(all_lines);
            spi_imu_.edges_lost();
            health_.lost_edges += lost;
            event(wire::BoardEventKind::edge_overflow, 0, now, lost, 0);
        } else if (noise_.take(edge)) {
            take_edge(edge, now);
        } else {
            ++health_.noisy_inputs;
            if (edge.input < camera_count) edges_lost(1U << edge.input);
            event(wire::BoardEventKind::input_noisy, edge.input, edge.at, 0, 0);
        }
    }
    Nanoseconds settled = edge.at;
    if (count == edges_a_poll)
        more_ = true;
    else
        settled = hal_.edges.settled();
    if (unsettled_ != 0)
        settle_exposures(settled);
    else if (settled > settled_)
        settled_ = settled;
}

/// Edges of these exposure lines are unknown, and so are pulses of the slaves that follow them.
void Board::edges_lost(std::uint32_t lines) {
    for (std::uint8_t i = 0; i < camera_count; ++i) {
        CameraChannel& camera = cameras_[i];
        const bool follows = camera.is_slave() && (lines >> camera.master() & 1U) != 0;
        if ((lines >> i & 1U) == 0 && !follows) continue;
        camera.edges_lost();
        waiting_.drop(i);
    }
    light_.edges_lost(lines);
    exposing_ = static_cast<std::uint8_t>(exposing_ & ~lines);
    dirty_ = true;
}

void Board::take_edge(const Edge& edge, Nanoseconds now) {
    if (edge.input < camera_count) {
        take_exposure_edge(edge);
    } else if (edge.input == input_imu_ready) {
        spi_imu_.ready_edge(edge.at, now);
    } else if (edge.input == input_imu_ready + 1) {
        uart_imu_.ready_edge(edge.at);
    } else if (edge.input == input_accel_ready) {
        spi_imu_.accel_edge(edge.at);
    } else {
        const auto input = static_cast<wire::PulseInput>(edge.input - input_pulse);
        const bool falling = (configuration_.ports.falling >> input & 1U) != 0;
        if (edge.level == falling) return;
        dirty_ = true;
        if (echoes_[input].take(edge.at))
            take_pulse(input, edge.at);
        else
            ++health_.glitches;
    }
}

/// Light and slaves follow the line itself, bounces included; records wait until it has settled.
void Board::take_exposure_edge(const Edge& edge) {
    CameraChannel& camera = cameras_[edge.input];
    if (camera.is_bouncing()) {
        settle_exposures(edge.at);
        Edge before = edge;  // another line bounces
        if (camera.take_edge(edge.at, before.at, before.level) && !waiting_.add(before))
            edges_lost(all_lines);
    }
    camera.edge(edge.at, edge.level);
    dirty_ = true;
    const bool exposing = camera.exposing(edge.level);
    light_.edge(edge.input, exposing);
    const auto bit = static_cast<std::uint8_t>(1U << edge.input);
    exposing_ = static_cast<std::uint8_t>(exposing ? exposing_ | bit : exposing_ & ~bit);
    unsettled_ = static_cast<std::uint8_t>(unsettled_ | bit);
    if (!exposing) switch_slaves();
}

/// All edges before `known` are. What counts of them is judged in one order over all lines: a
/// slave's exposure may be over before its master's line has settled. Of two edges with one stamp,
/// the slave's follows from the other one.
void Board::settle_exposures(Nanoseconds known) {
    Nanoseconds settled = known;
    for (;; settled = known) {
        unsigned first = camera_count;
        for (unsigned i = 0; unsettled_ >> i != 0; ++i) {
            if ((unsettled_ >> i & 1U) == 0) continue;
            const Nanoseconds at = cameras_[i].settled(known);
            if (at > settled || (at == settled && cameras_[i].is_slave())) continue;
            settled = at;
            first = i;
        }
        Edge edge;
        while (waiting_.take(settled, edge)) judge_exposure_edge(edge);
        if (first == camera_count) break;
        edge.input = static_cast<std::uint8_t>(first);
        const bool counts = cameras_[first].take_edge(known, edge.at, edge.level);
        if (cameras_[first].is_bouncing()) break;
        unsettled_ = static_cast<std::uint8_t>(unsettled_ & ~(1U << first));
        if (counts) judge_exposure_edge(edge);
    }
    if (settled > settled_) settled_ = settled;
}

void Board::judge_exposure_edge(const Edge& edge) {
    CameraChannel& master = cameras_[edge.input];
    dirty_ = true;
    master.exposure_edge(edge.at, edge.level);
    if ((masters_ >> edge.input & 1U) == 0) return;
    for (CameraChannel& slave : cameras_)
        if (slave.master() == edge.input)
            slave.master_edge(edge.at, edge.level, master.tick_at(edge.at));
}

void Board::take_pulse(wire::PulseInput input, Nanoseconds at) {
    const std::uint32_t number = ++pulses_[input];
    switch (input) {
        case wire::pulse_pps:
            pps_.pulse(at);
            nmea_.pulse(at);
            return event(wire::BoardEventKind::pps, 0, at, number, 0);
        case wire::pulse_aux0:
        case wire::pulse_aux1:
            return event(wire::BoardEventKind::aux_pulse,
                         static_cast<std::uint8_t>(input - wire::pulse_aux0), at, number, 0);
        case wire::pulse_sync: break;
    }
    event(wire::BoardEventKind::sync_pulse, 0, at, number, 0);
    const Nanoseconds since = at - last_sync_;
    last_sync_ = at;
    if ((on_sync_.cameras & ~unready()) == 0 && !grid_on_sync_) return follow_sync(at);
    if (!any_running()) {
        // Two edges a period apart are pulses; a single one may be anything.
        const std::uint32_t rate = configuration_.ports.sync_rate_uhz;
        const Nanoseconds period = rate == 0 ? default_sync_period : uhz_ns / rate;
        if (since < period - period / sync_tolerance || since > period + period / sync_tolerance)
            return;
        grid_clock_.begin(at, period, since);
        grid_on_sync_ = false;
        for (CameraChannel& camera : cameras_) camera.grid_began();
        begin_trains(hal_.clock.now());
    }
    start_cameras(on_sync_.cameras, on_sync_.flags);
    on_sync_ = {};
}

void Board::follow_sync(Nanoseconds at) {
    const GridClock::SyncPulse pulse = grid_clock_.sync_pulse(at, any_running());
    if (pulse.what == GridClock::Sync::lost)
        event(wire::BoardEventKind::sync_lost, 0, at, pulse.off, 0);
    if (pulse.what == GridClock::Sync::taken)
        event(wire::BoardEventKind::sync_taken, 0, at, pulse.off, 0);
    if (pulse.what == GridClock::Sync::followed || pulse.what == GridClock::Sync::taken)
        grid_moved();
}

void Board::apply_nmea() {
    if ((configuration_.ports.options & wire::port_nmea) == 0) return;
    nmea_.begin(nmea_baud(configuration_.ports));
    hal_.imu_uart.set_baud(nmea_baud(configuration_.ports));
}

void Board::poll_nmea() {
    if ((configuration_.ports.options & wire::port_nmea) == 0) return;
    std::uint8_t bytes[32];
    Nanoseconds received = 0;
    while (const std::size_t size = hal_.imu_uart.read(bytes, sizeof bytes, received))
        for (std::size_t i = 0; i < size; ++i) {
            const Nanoseconds at =
                received - static_cast<Nanoseconds>(size - 1 - i) * nmea_.byte_duration();
            if (nmea_.take(bytes[i], at)) take_sentence();
        }
}

}  // namespace versavis::firmware

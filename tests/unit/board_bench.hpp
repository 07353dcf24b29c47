// SPDX-License-Identifier: BSD-3-Clause
// The board at a port that does what a test says, and does it at once.
#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "board.hpp"

namespace versavis::firmware {

struct BenchUart final : ImuUart {
    void set_baud(std::uint32_t wanted) override { baud = wanted; }
    void invert_transmitter(bool wanted) override { inverted = wanted; }
    void write(const std::uint8_t* data, std::size_t size) override {
        sent.append(reinterpret_cast<const char*>(data), size);
    }
    std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) override {
        const std::size_t size = std::min(capacity, bytes.size());
        std::copy_n(bytes.begin(), size, data);
        bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
        received = until - static_cast<Nanoseconds>(bytes.size()) * byte;
        return size;
    }

    std::uint32_t baud = 0;
    bool inverted = false;
    std::string sent;
    std::vector<std::uint8_t> bytes;
    Nanoseconds until = 0;  ///< when the last byte has arrived
    Nanoseconds byte = 0;   ///< how long one takes
};

/// A port whose time and edges are those of the test.
struct BenchPort final : Clock64,
                         OutputSchedule,
                         EdgeStream,
                         Routing,
                         ImuBus,
                         ImuOutput,
                         ByteLink,
                         Persist,
                         Rebooter,
                         Watchdog {
    BenchPort() {
        facts.present = wire::present_all;
        facts.fastest_imu_millihertz = 8'000'000;
    }
    Nanoseconds now() override { return time; }
    Nanoseconds push(Nanoseconds at, std::uint32_t levels) override {
        if (outputs_full) return never;
        words.emplace_back(at + late, levels);
        pushed.push_back(time);
        return at + late;
    }
    void listen(std::uint32_t mask) override { inputs = mask; }
    bool pop(Edge& edge) override {
        if (edges.empty()) return false;
        edge = edges.front();
        edges.pop_front();
        time += edge_takes;
        return true;
    }
    Nanoseconds settled() override { return time - edge_lag; }
    std::uint32_t take_lost() override { return std::exchange(lost, 0); }
    versavis::wire::StampTest stamp_test() override { return test; }
    Switched route(const Routes& wanted, bool force) override {
        if (master_exposes && !force) return {};
        routes = wanted;
        levels_when_routed = words.empty() ? 0 : words.back().second;
        forced = force;
        return {time, clean};
    }
    bool arm(const ImuJob& /*job*/) override { return true; }
    bool take_reply(ImuReply& /*reply*/) override { return false; }
    void disarm() override { ++disarmed; }
    void write(const std::uint8_t* data, std::size_t size) override {
        sent.insert(sent.end(), data, data + size);
    }
    void publish(const ImuImage& /*image*/) override {}
    std::size_t free_space() override { return room; }
    std::size_t read(std::uint8_t* data, Nanoseconds& received) override {
        if (packets.empty()) return 0;
        const std::vector<std::uint8_t> packet = packets.front();
        packets.pop_front();
        std::copy(packet.begin(), packet.end(), data);
        received = time;
        return packet.size();
    }
    std::size_t load(std::uint8_t* data, std::size_t capacity) override {
        std::copy_n(stored.begin(), std::min(capacity, stored.size()), data);
        return stored.size();
    }
    bool store(const std::uint8_t* data, std::size_t size) override {
        stored.assign(data, data + size);
        return true;
    }
    Outcome take_outcome() override { return outcome; }
    void reboot(bool to_boot_loader) override { reboots.push_back(to_boot_loader); }
    void feed() override { ++fed; }

    PortFacts facts;
    Nanoseconds time = 0;
    std::vector<std::pair<Nanoseconds, std::uint32_t>> words;
    std::vector<Nanoseconds> pushed;  ///< when each word came
    bool outputs_full = false;
    Nanoseconds late = 0;  ///< words leave so much later than they should
    std::deque<Edge> edges;
    Nanoseconds edge_takes = 0;  ///< to pop one
    Nanoseconds edge_lag = 0;    ///< until an edge is known
    std::uint32_t lost = 0;
    versavis::wire::StampTest test = versavis::wire::StampTest::none;
    std::uint32_t inputs = ~0U;
    Routes routes;
    bool forced = false;
    std::uint32_t levels_when_routed = 0;
    bool clean = true;
    bool master_exposes = false;  ///< routes do not change unless by force
    unsigned disarmed = 0;        ///< each time that an IMU is configured, for one
    BenchUart uart;
    std::vector<std::uint8_t> sent;
    std::size_t room = 100'000;  ///< of the link
    std::deque<std::vector<std::uint8_t>> packets;
    std::vector<std::uint8_t> stored;
    Outcome outcome = Outcome::stored;
    std::vector<bool> reboots;
    unsigned fed = 0;
};

/// A board, and a host that greets it.
struct BoardBench {
    BoardBench() : BoardBench(BenchPort()) { greet(); }
    /// Not greeted.
    explicit BoardBench(const BenchPort& of, const Identity& identity = {})
        : port(of),
          board(Hal{port, port, port, port, port, port.uart, port, port, port, port, port,
                    port.facts},
                identity) {
        configuration.ports.inputs = 0xF;
        configuration.ports.pulse_ns = 1'000'000;
    }
    void greet(std::uint8_t major = wire::protocol_major) { send(wire::HostHello{major, 0, {}}); }
    /// Its packets wait until the board is polled.
    template <class T>
    void queue(const T& message) {
        wire::Frame frame{};
        wire::encode(message, 1, sequence++, frame);
        for (std::size_t at = 0; at < frame.size; at += link_packet_size)
            port.packets.emplace_back(frame.bytes + at,
                                      frame.bytes + std::min(frame.size, at + link_packet_size));
    }
    template <class T>
    void send(const T& message) {
        queue(message);
        while (!port.packets.empty()) poll();
    }
    /// Returns the answer.
    wire::ConfigurationAnswer configure() {
        const std::size_t before = all<wire::ConfigurationAnswer>().size();
        send(configuration);
        while (board.next_wake() <= port.time) poll();
        const auto answers = all<wire::ConfigurationAnswer>();
        REQUIRE(answers.size() == before + 1);
        REQUIRE(answers.back().status == wire::ConfigurationStatus::taken);
        return answers.back();
    }
    void add_camera(unsigned camera, std::uint32_t flags = 0) {
        wire::CameraConfiguration& wanted = configuration.cameras[camera];
        wanted.flags = wire::camera_enabled | flags;
        wanted.rate_uhz = 20'000'000;
        wanted.pulse_ns = 100'000;
        wanted.exposure_ns = 4'000'000;
        wanted.max_exposure_ns = 30'000'000;
    }
    void add_slave(unsigned camera, std::uint8_t master) {
        add_camera(camera, wire::camera_slave | wire::camera_no_strobe);
        configuration.cameras[camera].master = master;
    }
    void poll() { board.poll(); }
    void poll(Nanoseconds at) {
        port.time = at;
        poll();
    }
    /// Polls when the board asks for it.
    void run(Nanoseconds until) {
        while (board.next_wake() <= until) poll(std::max(port.time, board.next_wake()));
        do poll(until);
        while (board.next_wake() <= until);
    }
    void edge(std::uint8_t input, Nanoseconds at, bool level = true) {
        port.edges.push_back({at, input, level});
    }
    /// When the pulses of an output began.
    std::vector<Nanoseconds> pulses(unsigned output) const {
        std::vector<Nanoseconds> begins;
        bool before = false;
        for (const auto& [at, levels] : port.words) {
            const bool level = (levels >> output & 1U) != 0;
            if (level && !before) begins.push_back(at);
            before = level;
        }
        return begins;
    }
    /// When the newest pulse of camera 0 began.
    Nanoseconds trigger() const {
        const auto begins = pulses(0);
        return begins.empty() ? 0 : begins.back();
    }
    /// All messages of a type that the board has sent.
    template <class T>
    std::vector<T> all() const {
        std::vector<T> out;
        wire::Decoder decoder;
        decoder.feed(port.sent.data(), port.sent.size(), [&](const wire::Packet& packet) {
            T message{};
            if (packet.read(message)) out.push_back(message);
        });
        return out;
    }
    std::vector<wire::Event> events(wire::BoardEventKind kind) const {
        std::vector<wire::Event> out = all<wire::Event>();
        out.erase(std::remove_if(out.begin(), out.end(),
                                 [kind](const wire::Event& event) { return event.kind != kind; }),
                  out.end());
        for (const wire::Event& event : out) CHECK(event.detail == 0);
        return out;
    }
    wire::Health health() {
        const std::size_t before = all<wire::Health>().size();
        while (all<wire::Health>().size() == before) run(board.next_wake());
        return all<wire::Health>().back();
    }

    wire::Configuration configuration{};
    std::uint32_t sequence = 0;
    BenchPort port;
    Board board;
};

/// Everything but the answers to a start is at its default: cameras at 20 Hz, on the same grid.
struct Cameras : BoardBench {
    explicit Cameras(unsigned count, std::uint32_t flags = 0) {
        for (unsigned i = 0; i < count; ++i) add_camera(i, flags);
    }
    /// A bit for each output that had a pulse since the last call.
    unsigned pulsed() {
        unsigned outputs = 0;
        for (unsigned i = 0; i < output_count; ++i) outputs |= pulses(i).empty() ? 0 : 1U << i;
        port.words.clear();
        return outputs;
    }
    void run_for(Nanoseconds duration) { run(port.time + duration); }
};

/// A VN-100 at the UART, and an ADIS16448 at the SPI.
inline void add_imus(BoardBench& bench, std::uint8_t options) {
    bench.configuration.imus[0] = {wire::ImuKind::adis16448b, 0, options, 0, 400'000};
    bench.configuration.imus[1] = {wire::ImuKind::vn100, 0, options, 0, 300'000};
}

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// The HAL on a tape: each call with what it was given and what it returned. One list of the methods
// serves who records them and who replays them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "board.hpp"
#include "taped.hpp"

namespace versavis::firmware::replay {

// Structs that calls pass; a new one needs a line.
template <class Visit>
void each_field(Edge& edge, Visit visit) {
    visit(edge.at, edge.input, edge.level);
}
template <class Visit>
void each_field(Routing::Switched& switched, Visit visit) {
    visit(switched.at, switched.clean);
}
template <class Visit>
void each_field(Routes& r, Visit visit) {
    visit(r.master, r.inverted_triggers, r.inverted_exposures, r.light_cameras, r.light_inverted,
          r.light_limit, r.test_input);
}
template <class Visit>
void each_field(ImuTransfer& t, Visit visit) {
    visit(t.bus, t.chip, t.size, t.clock_hz, t.word_gap_ns, t.bytes);
}
template <class Visit>
void each_field(ImuJob& job, Visit visit) {
    visit(job.input, job.after, job.pause, job.count, job.transfers);
}
template <class Visit>
void each_field(ImuReply& reply, Visit visit) {
    visit(reply.started, reply.ended, reply.refused, reply.bytes);
}
template <class Visit>
void each_field(ImuImage& image, Visit visit) {
    visit(image.burst, image.product);
}
template <class Visit>
void each_field(Identity& identity, Visit visit) {
    visit(identity.nonce, identity.reset_cause, identity.serial);
}
template <class Visit>
void each_field(PortFacts& facts, Visit visit) {
    visit(facts.present, facts.fastest_imu_millihertz, facts.output_grain_bits, facts.output_step);
}

// Interfaces and their methods; a new method needs a line.
template <class Tape>
struct TapedClock final : Taped<Clock64, Tape> {
    using Taped<Clock64, Tape>::Taped;
    Nanoseconds now() override { return this->call("clock.now", &Clock64::now); }
};

template <class Tape>
struct TapedOutputs final : Taped<OutputSchedule, Tape> {
    using Taped<OutputSchedule, Tape>::Taped;
    Nanoseconds push(Nanoseconds at, std::uint32_t levels) override {
        return this->call("outputs.push", &OutputSchedule::push, at, levels);
    }
};

template <class Tape>
struct TapedEdges final : Taped<EdgeStream, Tape> {
    using Taped<EdgeStream, Tape>::Taped;
    void listen(std::uint32_t inputs) override {
        this->call("edges.listen", &EdgeStream::listen, inputs);
    }
    bool pop(Edge& edge) override { return this->call("edges.pop", &EdgeStream::pop, edge); }
    Nanoseconds settled() override { return this->call("edges.settled", &EdgeStream::settled); }
    std::uint32_t take_lost() override {
        return this->call("edges.take_lost", &EdgeStream::take_lost);
    }
    wire::StampTest stamp_test() override {
        return this->call("edges.stamp_test", &EdgeStream::stamp_test);
    }
};

template <class Tape>
struct TapedRouting final : Taped<Routing, Tape> {
    using Taped<Routing, Tape>::Taped;
    Routing::Switched route(const Routes& routes, bool force) override {
        return this->call("routing.route", &Routing::route, routes, force);
    }
};

template <class Tape>
struct TapedImuBus final : Taped<ImuBus, Tape> {
    using Taped<ImuBus, Tape>::Taped;
    bool arm(const ImuJob& job) override { return this->call("imu_bus.arm", &ImuBus::arm, job); }
    bool take_reply(ImuReply& reply) override {
        return this->call("imu_bus.take_reply", &ImuBus::take_reply, reply);
    }
    void disarm() override { this->call("imu_bus.disarm", &ImuBus::disarm); }
};

template <class Tape>
struct TapedImuUart final : Taped<ImuUart, Tape> {
    using Taped<ImuUart, Tape>::Taped;
    void set_baud(std::uint32_t baud) override {
        this->call("imu_uart.set_baud", &ImuUart::set_baud, baud);
    }
    void invert_transmitter(bool inverted) override {
        this->call("imu_uart.invert_transmitter", &ImuUart::invert_transmitter, inverted);
    }
    void write(const std::uint8_t* data, std::size_t size) override {
        this->call("imu_uart.write", &ImuUart::write, data, size);
    }
    std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) override {
        return this->call("imu_uart.read", &ImuUart::read, data, capacity, received);
    }
};

template <class Tape>
struct TapedImuOutput final : Taped<ImuOutput, Tape> {
    using Taped<ImuOutput, Tape>::Taped;
    void publish(const ImuImage& image) override {
        this->call("imu_output.publish", &ImuOutput::publish, image);
    }
};

template <class Tape>
struct TapedLink final : Taped<ByteLink, Tape> {
    using Taped<ByteLink, Tape>::Taped;
    std::size_t free_space() override {
        return this->call("link.free_space", &ByteLink::free_space);
    }
    void write(const std::uint8_t* data, std::size_t size) override {
        this->call("link.write", &ByteLink::write, data, size);
    }
    std::size_t read(std::uint8_t* data, Nanoseconds& received) override {
        return this->call("link.read", &ByteLink::read, data, received);
    }
    void watch_departure() override {
        this->call("link.watch_departure", &ByteLink::watch_departure);
    }
    bool take_departure(Nanoseconds& at) override {
        return this->call("link.take_departure", &ByteLink::take_departure, at);
    }
};

template <class Tape>
struct TapedPersist final : Taped<Persist, Tape> {
    using Taped<Persist, Tape>::Taped;
    std::size_t load(std::uint8_t* data, std::size_t capacity) override {
        return this->call("persist.load", &Persist::load, data, capacity);
    }
    bool store(const std::uint8_t* data, std::size_t size) override {
        return this->call("persist.store", &Persist::store, data, size);
    }
    Persist::Outcome take_outcome() override {
        return this->call("persist.take_outcome", &Persist::take_outcome);
    }
};

template <class Tape>
struct TapedRebooter final : Taped<Rebooter, Tape> {
    using Taped<Rebooter, Tape>::Taped;
    void reboot(bool to_boot_loader) override {
        this->call("rebooter.reboot", &Rebooter::reboot, to_boot_loader);
    }
};

template <class Tape>
struct TapedWatchdog final : Taped<Watchdog, Tape> {
    using Taped<Watchdog, Tape>::Taped;
    void feed() override { this->call("watchdog.feed", &Watchdog::feed); }
};

/// All of them. Who replays has no `real` hardware.
template <class Tape>
class TapedHal {
 public:
    explicit TapedHal(Tape& tape, const Hal* real = nullptr)
        : clock_(tape, real != nullptr ? &real->clock : nullptr),
          outputs_(tape, real != nullptr ? &real->outputs : nullptr),
          edges_(tape, real != nullptr ? &real->edges : nullptr),
          routing_(tape, real != nullptr ? &real->routing : nullptr),
          imu_bus_(tape, real != nullptr ? &real->imu_bus : nullptr),
          imu_uart_(tape, real != nullptr ? &real->imu_uart : nullptr),
          imu_output_(tape, real != nullptr ? &real->imu_output : nullptr),
          link_(tape, real != nullptr ? &real->link : nullptr),
          persist_(tape, real != nullptr ? &real->persist : nullptr),
          rebooter_(tape, real != nullptr ? &real->rebooter : nullptr),
          watchdog_(tape, real != nullptr ? &real->watchdog : nullptr) {}

    Hal hal(const PortFacts& facts) {
        return {clock_,      outputs_, edges_,   routing_,  imu_bus_,  imu_uart_,
                imu_output_, link_,    persist_, rebooter_, watchdog_, facts};
    }

 private:
    TapedClock<Tape> clock_;
    TapedOutputs<Tape> outputs_;
    TapedEdges<Tape> edges_;
    TapedRouting<Tape> routing_;
    TapedImuBus<Tape> imu_bus_;
    TapedImuUart<Tape> imu_uart_;
    TapedImuOutput<Tape> imu_output_;
    TapedLink<Tape> link_;
    TapedPersist<Tape> persist_;
    TapedRebooter<Tape> rebooter_;
    TapedWatchdog<Tape> watchdog_;
};

/// What the board is given before its life begins, such as its identity.
template <class T, class Tape>
T taped_value(Tape& tape, const char* name, T value = {}) {
    tape.begin(name);
    tape.end_arguments();
    pass_results(tape, value);
    return value;
}

/// Bits of what taped_poll() returns.
enum PollMark : std::uint8_t {
    poll_again = 1U << 0U,     ///< a poll follows; else the recording is over
    poll_measured = 1U << 1U,  ///< its cycles are part of the load's figures
};

/// Between two polls: the first was followed by this wake, and the second follows if the result
/// says so.
template <class Tape>
std::uint8_t taped_poll(Tape& tape, Nanoseconds next_wake, std::uint8_t mark = 0) {
    tape.begin("poll");
    pass_argument(tape, next_wake);
    tape.end_arguments();
    pass_results(tape, mark);
    return mark;
}

}  // namespace versavis::firmware::replay

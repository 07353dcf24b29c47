// SPDX-License-Identifier: BSD-3-Clause
// The board in a host process: runs the core event by event, in the time that its owner gives it;
// time passes in its calls as a model of a port has it.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <queue>
#include <random>
#include <span>
#include <vector>

#include "base/hal.hpp"
#include "board.hpp"
#include "port_model.hpp"
#include "virtual_board.hpp"

namespace versavis::firmware {

/// Stands between the core and its hardware, and sees each poll.
struct CoreTap {
    /// Returns the hardware that the core of this board gets instead of `hal`.
    virtual Hal tap(const Hal& hal, const Identity& identity) = 0;
    virtual void poll_begins(Nanoseconds now) = 0;
    /// The core wants the next one at `next_wake`.
    virtual void poll_ended(Nanoseconds next_wake) = 0;

 protected:
    ~CoreTap() = default;
};

/// Events happen at the instants of the model, not when the process wakes up: a late call of
/// run_until() catches up on everything in between, in order. Not thread-safe.
class NativeBoard final : public VirtualBoard,
                          Clock64,
                          OutputSchedule,
                          EdgeStream,
                          Routing,
                          ImuBus,
                          ImuOutput,
                          ByteLink,
                          Persist,
                          Rebooter,
                          Watchdog {
 public:
    NativeBoard(const Identity& identity, Environment environment, Nanoseconds boot = 0,
                const PortModel& model = {});

    void schedule_edge(const Edge& edge) override { edges_.push(edge); }

    void set_level(std::uint8_t input, bool level) override;
    void receive(std::span<const std::uint8_t> bytes, Nanoseconds at) override;
    void uart_receive(std::span<const std::uint8_t> bytes, Nanoseconds at) override;
    void run_until(Nanoseconds until) override;

    /// From now on the code stalls while the hardware continues, or both continue.
    void set_stalled(bool stalled) { stalled_ = stalled; }
    bool watchdog_bit() const override { return watchdog_bit_; }

    void set_imu_bus_stuck(bool stuck) override { imu_bus_stuck_ = stuck; }
    void set_i2c_held(bool held) override { i2c_held_ = held; }

    Nanoseconds next_wake() const override;
    Nanoseconds time() const override { return now_; }
    std::span<const std::uint8_t> transmitted() const override { return transmitted_; }
    void consume(std::size_t size, Nanoseconds at) override;
    void set_link_capacity(std::size_t bytes) override { link_capacity_ = bytes; }

    /// What another SPI master reads from the second port in one selection.
    std::vector<std::uint16_t> read_imu_output(std::span<const std::uint16_t> words);

    static constexpr Nanoseconds routing_latency = 50;
    /// If lower, a part that stretches its clock is given up; if higher, it is more than the HAL
    /// says.
    static constexpr Nanoseconds i2c_patience = 10'000'000;
    static constexpr Nanoseconds watchdog_limit = 1'000'000'000;

 private:
    struct Later {
        bool operator()(const Edge& a, const Edge& b) const { return a.at > b.at; }
    };
    struct Word {
        Nanoseconds at;
        std::uint32_t levels;
    };
    /// A job of the IMU's bus; `at`: when it starts; never: it waits for its edge.
    struct ArmedJob {
        Nanoseconds at;  ///< when its first transfer without a taken reply starts; never: unknown
        ImuJob job;
        unsigned taken = 0;
    };
    struct Packet {
        Nanoseconds at;
        std::vector<std::uint8_t> bytes;
    };
    struct UartBytes {
        Nanoseconds at;
        std::vector<std::uint8_t> bytes;
    };
    Nanoseconds now() override;
    Nanoseconds push(Nanoseconds at, std::uint32_t levels) override;
    void listen(std::uint32_t inputs) override;
    bool pop(Edge& edge) override;
    Nanoseconds settled() override;
    std::uint32_t take_lost() override;
    wire::StampTest stamp_test() override { return wire::StampTest::none; }
    Switched route(const Routes& routes, bool force) override;
    bool arm(const ImuJob& job) override;
    bool take_reply(ImuReply& reply) override;
    void disarm() override;
    std::size_t read(std::uint8_t* data, Nanoseconds& received) override;
    void write(const std::uint8_t* data, std::size_t size) override;
    std::size_t free_space() override;
    void watch_departure() override;
    bool take_departure(Nanoseconds& at) override;
    void publish(const ImuImage& image) override;
    std::size_t load(std::uint8_t* data, std::size_t capacity) override;
    bool store(const std::uint8_t* data, std::size_t size) override;
    Outcome take_outcome() override;
    void reboot(bool to_boot_loader) override;
    void feed() override;

    /// A class of its own, because its functions have the same names as the link's.
    struct Uart final : ImuUart {
        explicit Uart(NativeBoard& of) : board(of) {}
        void set_baud(std::uint32_t baud) override;
        void invert_transmitter(bool inverted) override;
        void write(const std::uint8_t* data, std::size_t size) override;
        std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) override;
        NativeBoard& board;
    };

    Hal hardware(const Identity& identity);
    void spend();
    Nanoseconds draw(Nanoseconds most);
    Nanoseconds next_attention() const;
    Nanoseconds next_in_hardware() const;
    void advance_to(Nanoseconds until);
    void poll_core();
    Nanoseconds transfer_end(Nanoseconds at, const ImuTransfer& transfer) const;
    void begin_job(Nanoseconds at);
    Nanoseconds job_end() const;
    struct StampedEdge {
        Edge edge;
        std::uint32_t lost_before;  ///< between the one before and this one
    };
    bool visible(const Edge& edge) const { return edge.at + model_.edge_lag_ns <= now_; }
    void set_input(std::uint8_t input, bool level);
    void apply(const Edge& edge);
    Nanoseconds light_cut() const;
    void drive_pins(Nanoseconds at);
    bool exposing(unsigned camera) const;

    Environment environment_;
    PortModel model_;
    std::mt19937_64 random_;
    Uart uart_{*this};
    Nanoseconds now_;
    Nanoseconds fed_;
    bool watchdog_bit_ = false;
    bool attention_ = true;  ///< the core has something to do at once
    std::deque<Word> words_;
    bool words_full_ = false;  ///< and the core was notified
    Nanoseconds last_word_ = INT64_MIN / 2;
    std::uint32_t levels_ = 0;  ///< of the schedule
    bool driven_ = false;       ///< the outputs drive their pins
    Routes routes_;
    std::uint32_t inputs_ = 0;  ///< levels
    std::uint32_t pins_ = 0;
    Nanoseconds lit_since_ = never;  ///< never: it is dark
    bool light_cut_ = false;         ///< the limit was reached
    std::uint32_t listened_ = 0;
    std::priority_queue<Edge, std::vector<Edge>, Later> edges_;
    std::deque<StampedEdge> stamped_;
    std::uint32_t lost_edges_ = 0;
    std::optional<ArmedJob> armed_;
    Nanoseconds imu_free_at_ = 0;             ///< when the newest transfer ended
    Nanoseconds ready_at_[input_count] = {};  ///< newest edges of data-ready inputs
    bool imu_bus_stuck_ = false;
    bool i2c_held_ = false;
    bool stalled_ = false;
    std::uint32_t baud_ = 115'200;
    std::deque<UartBytes> uart_bytes_;
    ImuImage image_;
    std::deque<Packet> received_;
    std::vector<std::uint8_t> transmitted_;
    std::size_t link_capacity_ = std::size_t{64} * 1024;
    bool link_full_ = false;      ///< and the core was notified
    std::uint64_t written_ = 0;   ///< bytes for the host since boot
    std::uint64_t consumed_ = 0;  ///< of them
    std::optional<std::uint64_t> watched_;
    std::optional<Nanoseconds> departure_;
    std::vector<std::uint8_t> storing_;
    Nanoseconds stored_at_ = never;  ///< never: nothing is being stored
    Board board_;
};

}  // namespace versavis::firmware

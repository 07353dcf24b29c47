// SPDX-License-Identifier: BSD-3-Clause
// The board as a host process: runs the core event by event, in whatever time its owner gives it.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <queue>
#include <span>
#include <vector>

#include "board.hpp"
#include "hal.hpp"

namespace versavis::firmware {

/// What is connected to the board. Called from run_until(), with the instants at which the hardware would
/// act.
struct Surroundings {
    std::function<void(Nanoseconds at, std::uint32_t levels)> outputs_changed;
    /// A burst that started at `at`: fills `received`, as long as `transmitted`.
    std::function<void(Nanoseconds at, std::span<const std::uint8_t> transmitted,
                       std::span<std::uint8_t> received)>
        imu_burst;
    std::function<void(bool to_boot_loader)> reboot;
};

/// Events happen at the instants of the model, not when the process wakes up: after a late call of
/// run_until() all that lies in between is made up for, in order. Not thread-safe.
class NativeBoard final : Clock64, OutputSchedule, EdgeStream, ImuBus, ByteLink, Rebooter {
 public:
    NativeBoard(const Identity& identity, Surroundings surroundings);
    NativeBoard(const NativeBoard&) = delete;
    NativeBoard& operator=(const NativeBoard&) = delete;

    /// An edge of an exposure line, not before the current time.
    void schedule_edge(const Edge& edge) { edges_.push(edge); }

    /// Bytes of the host that entered the board at `at`; handled by the next run_until().
    void receive(std::span<const std::uint8_t> bytes, Nanoseconds at);

    /// Runs everything up to and including `until`.
    void run_until(Nanoseconds until);

    /// When run_until() has something to do next, if no bytes come.
    Nanoseconds next_wake() const;

    /// Bytes for the host that were not consumed yet; at `link_capacity` of them the core drops packets.
    std::span<const std::uint8_t> transmitted() const { return transmitted_; }
    void consume(std::size_t size);

    static constexpr std::size_t link_capacity = 64 * 1024;

 private:
    struct Later {
        bool operator()(const Edge& a, const Edge& b) const { return a.at > b.at; }
    };
    struct Word {
        Nanoseconds at;
        std::uint32_t levels;
    };
    struct Burst {
        Nanoseconds at;
        std::vector<std::uint8_t> transmitted;
    };
    static constexpr std::size_t word_capacity = 64;

    Nanoseconds now() override { return now_; }
    bool push(Nanoseconds at, std::uint32_t levels) override;
    Nanoseconds take_lateness() override;
    bool pop(Edge& edge) override;
    std::uint32_t take_lost() override { return 0; }
    bool start(Nanoseconds at, const std::uint8_t* transmit, std::size_t size) override;
    bool complete(Transfer& transfer) override;
    std::size_t free_space() override { return link_capacity - transmitted_.size(); }
    void write(const std::uint8_t* data, std::size_t size) override;
    std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) override;
    void reboot(bool to_boot_loader) override { surroundings_.reboot(to_boot_loader); }

    Nanoseconds burst_end() const;

    Surroundings surroundings_;
    Nanoseconds now_ = 0;
    Nanoseconds lateness_ = 0;
    std::deque<Word> words_;
    std::priority_queue<Edge, std::vector<Edge>, Later> edges_;
    std::optional<Burst> burst_;
    std::deque<std::uint8_t> received_;
    Nanoseconds received_at_ = 0;
    std::vector<std::uint8_t> transmitted_;
    Board board_;
};

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// The board as the chip runs it: the very image that is flashed, on the emulated RP2040, in
// lock-step with its owner.
#pragma once

#include <deque>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "../../firmware/native/virtual_board.hpp"
#include "posix/child_process.hpp"
#include "versavis/error.hpp"

namespace versavis::rig {

/// The chip on its desk: a process that keeps the flash through restarts.
class EmulatedChip {
 public:
    /// With the firmware of `image`, an .elf or .uf2. Error: there is no such file, or no node.
    static Expected<std::unique_ptr<EmulatedChip>> create(const std::string& image);

    /// Throws std::runtime_error when the emulator ends, which says why on standard error.
    nlohmann::json read();
    void write(const nlohmann::json& line);

    /// The firmware that this build makes.
    static std::string default_image();

 private:
    explicit EmulatedChip(ChildProcess process) : process_(std::move(process)) {}

    ChildProcess process_;
    std::string text_;  ///< received, and not read
};

/// One life of it, from its start to a restart. Its time begins at 0 when it starts; the
/// constructor returns when USB is set up. Of Environment it has no flash, tap and IMU output.
class EmulatedBoard final : public firmware::VirtualBoard {
 public:
    /// When an edge that is scheduled for `at` reaches the chip's pins: in the next cycle.
    static firmware::Nanoseconds edge_time(firmware::Nanoseconds at);
    EmulatedBoard(EmulatedChip& chip, firmware::Environment environment);
    ~EmulatedBoard() override;

    void schedule_edge(const firmware::Edge& edge) override;
    void receive(std::span<const std::uint8_t> bytes, firmware::Nanoseconds at) override;
    void uart_receive(std::span<const std::uint8_t> bytes, firmware::Nanoseconds at) override;
    void run_until(firmware::Nanoseconds until) override;
    void set_imu_bus_stuck(bool stuck) override { stuck_ = stuck; }
    void set_i2c_held(bool held) override { i2c_held_ = held; }
    bool watchdog_bit() const override { return bitten_; }
    void set_level(std::uint8_t input, bool level) override { schedule_edge({0, input, level}); }
    void set_link_capacity(std::size_t bytes) override { link_capacity_ = bytes; }
    firmware::Nanoseconds next_wake() const override;
    firmware::Nanoseconds time() const override { return now_; }
    std::span<const std::uint8_t> transmitted() const override { return transmitted_; }
    void consume(std::size_t size, firmware::Nanoseconds at) override;

 private:
    struct Packet {
        firmware::Nanoseconds at;  ///< when it arrives
        std::vector<std::uint8_t> bytes;
    };

    void deliver(firmware::Nanoseconds at);
    void step_to(firmware::Nanoseconds until);
    void run_to(firmware::Nanoseconds until);
    void answer_transfer(const nlohmann::json& transfer);
    void take(const nlohmann::json& answer);
    void take_pins(const nlohmann::json& pins);

    EmulatedChip& chip_;
    firmware::Environment environment_;
    firmware::Nanoseconds now_ = 0;
    std::deque<Packet> on_its_way_;            ///< to the host
    std::unique_ptr<nlohmann::json> pending_;  ///< the next command
    std::uint32_t pins_ = 0;
    firmware::Nanoseconds way_;  ///< of bytes, between the board and its owner
    std::size_t link_capacity_ = std::size_t{64} * 1024;
    bool stuck_ = false;
    bool i2c_held_ = false;
    bool stopped_ = false;  ///< its life is over
    bool bitten_ = false;   ///< by the watchdog
    std::vector<std::uint8_t> transmitted_;
};

}  // namespace versavis::rig

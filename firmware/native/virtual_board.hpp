// SPDX-License-Identifier: BSD-3-Clause
// A board that lives in its owner's time, wired to models of what is around it: whatever runs its
// firmware.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/hal.hpp"

namespace versavis::firmware {

/// Pins that are outputs, as Environment sees them. The triggers of cameras 0 to 3 are bits 0
/// to 3.
enum Pin : std::uint8_t { pin_light = 4, pin_sync = 6, pin_test = 7 };

struct CoreTap;

/// What is connected to the board. Called from run_until(), with the instants at which the hardware
/// would act. A function that is not set is not connected.
struct Environment {
    std::function<void(Nanoseconds at, std::uint32_t pins)> outputs_changed;
    /// A transfer that started at `at`: fills `received`, as long as what was transmitted.
    /// False: no part acknowledged; it counts on I2C only.
    std::function<bool(Nanoseconds at, const ImuTransfer& transfer,
                       std::span<std::uint8_t> received)>
        imu_transfer;
    std::function<void(Nanoseconds at, std::uint32_t baud, std::span<const std::uint8_t> bytes)>
        uart_sent;
    std::function<void(Nanoseconds at)> imu_output_ready;
    std::function<void(bool to_boot_loader)> reboot;
    /// What else happens around the board, and when next: it also comes while the core works.
    std::function<Nanoseconds()> next_event;
    std::function<void(Nanoseconds at)> fire;
    /// What the board stores, and finds when it starts.
    std::vector<std::uint8_t>* flash = nullptr;
    CoreTap* tap = nullptr;
};

/// All times are the board's own. Not thread-safe.
class VirtualBoard {
 public:
    VirtualBoard() = default;
    virtual ~VirtualBoard() = default;
    VirtualBoard(const VirtualBoard&) = delete;
    VirtualBoard& operator=(const VirtualBoard&) = delete;

    /// An edge at an input, not before the current time.
    virtual void schedule_edge(const Edge& edge) = 0;

    /// Bytes of the host that entered the board at `at`; handled by the next run_until().
    virtual void receive(std::span<const std::uint8_t> bytes, Nanoseconds at) = 0;

    /// Bytes of the IMU on the UART whose last one arrives at `at`, in the order of time.
    virtual void uart_receive(std::span<const std::uint8_t> bytes, Nanoseconds at) = 0;

    /// Runs everything up to and including `until`.
    virtual void run_until(Nanoseconds until) = 0;

    /// From now on no IMU transfer completes, or all of them do again.
    virtual void set_imu_bus_stuck(bool stuck) = 0;
    /// From now on another part holds the I2C bus, or has released it.
    virtual void set_i2c_held(bool held) = 0;

    /// True: the code stalled for longer than the watchdog allows.
    virtual bool watchdog_bit() const = 0;

    /// Level of an input at rest, before its first edge.
    virtual void set_level(std::uint8_t input, bool level) = 0;

    /// Bytes that the host's side holds; when it is full, the board has to wait.
    virtual void set_link_capacity(std::size_t bytes) = 0;

    /// When run_until() has something to do next, if no bytes come.
    virtual Nanoseconds next_wake() const = 0;
    /// How far it has run; it may be beyond what run_until() was asked for.
    virtual Nanoseconds time() const = 0;

    /// Bytes for the host not consumed yet.
    virtual std::span<const std::uint8_t> transmitted() const = 0;
    /// They left at `at`, or later.
    virtual void consume(std::size_t size, Nanoseconds at) = 0;
};

}  // namespace versavis::firmware

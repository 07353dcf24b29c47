// SPDX-License-Identifier: BSD-3-Clause
// The firmware in real time on a simulated bus, with wires from its outputs to its inputs.
#pragma once

#include <umockdev.h>

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "native_board.hpp"
#include "simulated_usb_device.hpp"
#include "versavis/time.hpp"

namespace versavis::test {

/// From a pin that is an output to an input; late by so much, as a line with much load is.
struct LoopWire {
    unsigned pin = 0;  ///< 0 to 3: triggers; else of firmware::Pin
    std::uint8_t input = 0;
    firmware::Nanoseconds late_rise = 0;
    firmware::Nanoseconds late_fall = 0;
};

struct OutputChange {
    firmware::Nanoseconds at;
    std::uint32_t pins;  ///< levels from then on
};

class LoopedBoard {
 public:
    LoopedBoard(UMockdevTestbed* testbed, std::string serial, std::vector<LoopWire> wires);
    ~LoopedBoard();
    LoopedBoard(const LoopedBoard&) = delete;
    LoopedBoard& operator=(const LoopedBoard&) = delete;

    /// It was asked to reboot, which it did.
    unsigned reboots() const;
    std::vector<OutputChange> output_changes() const;

    /// Returns once its outputs have changed so many times since it was plugged in.
    void wait_for_changes(std::size_t count) const;

 private:
    void run();
    void boot(wire::ResetCause cause);
    void outputs_changed(firmware::Nanoseconds at, std::uint32_t pins);
    void exchange_bytes();
    firmware::Nanoseconds now() const { return (host_now() - booted_).ns; }

    UMockdevTestbed* testbed_;
    const std::string serial_;
    const std::vector<LoopWire> wires_;

    mutable std::mutex mutex_;
    mutable std::condition_variable changed_;
    std::condition_variable heard_;
    std::vector<std::uint8_t> received_;
    unsigned reboots_ = 0;
    std::vector<OutputChange> output_changes_;
    bool stop_ = false;

    // Of the thread.
    HostTime booted_;
    std::uint32_t nonce_ = 0;
    std::uint32_t pins_ = 0;
    bool rebooting_ = false;
    std::unique_ptr<firmware::NativeBoard> board_;
    std::unique_ptr<SimulatedUsbDevice> device_;

    std::condition_variable plugged_;
    std::thread thread_;
};

}  // namespace versavis::test

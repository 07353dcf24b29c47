// SPDX-License-Identifier: BSD-3-Clause
// A board on a Pico as USB sees it: what its flash holds decides whether firmware or the boot
// loader runs, and one turns into the other on the same port.
#pragma once

#include <umockdev.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "boot_loader.hpp"
#include "simulated_usb_device.hpp"
#include "wire/packet.hpp"

namespace versavis::test {

/// Firmware for it: `pages` of an image that names this version.
std::vector<std::uint8_t> pico_firmware(const std::string& version, std::size_t pages = 40);

struct PicoSettings {
    std::string serial = "PICO0001";
    std::string port = "1-1";
    std::string version = "versavis 0.0.1";  ///< of its first firmware; empty: its flash is empty
    bool hangs = false;                      ///< that firmware hears nothing but a touch
    std::uint8_t protocol = wire::protocol_major;  ///< that this firmware speaks
    bool obeys = true;                             ///< it reboots on request, or when touched
    BootLoaderFaults faults{};                     ///< of its boot loader
};

/// Its firmware says hello, reboots, and does nothing else; one without a version does not even
/// that.
class SimulatedPico {
 public:
    SimulatedPico(UMockdevTestbed* testbed, PicoSettings settings);
    ~SimulatedPico();
    SimulatedPico(const SimulatedPico&) = delete;
    SimulatedPico& operator=(const SimulatedPico&) = delete;

    Flash& flash() { return flash_; }
    const Flash& flash() const { return flash_; }
    void set_faults(const BootLoaderFaults& faults);
    /// As a user does, with the button or without.
    void plug(bool boot_loader);
    void unplug();
    /// See BootLoader.
    void release();
    unsigned touches() const;
    /// How often it started something, its boot loader included.
    unsigned boots() const;

 private:
    enum class Mode { absent, firmware, boot_loader };
    using Task = std::function<void()>;

    void post(Task task);
    void become(Mode mode);
    void wait_until_idle();
    void run();
    void enter(Mode mode);
    void start_firmware();
    void start_boot_loader();
    void heard(std::span<const std::byte> bytes);
    void obey(const wire::Packet& packet);
    void say_hello();

    UMockdevTestbed* testbed_;
    const PicoSettings settings_;
    Flash flash_;

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    BootLoaderFaults faults_;
    std::deque<Task> tasks_;  ///< of the thread; the first one may be under way
    unsigned touches_ = 0;
    unsigned boots_ = 0;
    bool stop_ = false;

    // Of the thread, on which devices come and go.
    std::unique_ptr<SimulatedUsbDevice> firmware_;
    std::shared_ptr<BootLoader> boot_loader_;
    std::unique_ptr<SimulatedDevice> boot_loader_device_;
    std::uint32_t nonce_ = 0;
    std::uint32_t sequence_ = 0;
    std::uint8_t protocol_ = wire::protocol_major;
    // Of the testbed's thread while firmware runs.
    wire::Decoder decoder_;
    bool hangs_ = false;

    std::thread thread_;
};

}  // namespace versavis::test

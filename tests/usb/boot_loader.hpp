// SPDX-License-Identifier: BSD-3-Clause
// A model of the RP2040's boot loader on USB: its PICOBOOT interface over a flash that behaves as
// one, with the faults that a test asks for.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "usbfs_node.hpp"

namespace versavis::test {

/// Writing clears bits, erasing sets all of a sector.
class Flash {
 public:
    explicit Flash(std::size_t size = 2 << 20) : bytes_(size, 0xFF) {}

    /// Puts an image at its begin.
    void load(const std::vector<std::uint8_t>& image);
    void erase(std::size_t at, std::size_t size);
    void write(std::size_t at, std::span<const std::uint8_t> page);
    std::vector<std::uint8_t> read(std::size_t at, std::size_t size) const;
    /// From now on this bit reads as 0, whatever is written.
    void wear_out(std::size_t at, std::uint8_t bit);
    /// What the chip asks before it starts what is there.
    bool starts() const;
    std::size_t size() const { return bytes_.size(); }

 private:
    mutable std::mutex mutex_;
    std::vector<std::uint8_t> bytes_;
    std::map<std::size_t, std::uint8_t> worn_;
};

struct BootLoaderFaults {
    std::uint16_t product = 0x0003;        ///< 0x000F: it is a Pico 2's
    std::uint8_t refused_command = 0;      ///< by its id
    std::uint8_t held_command = 0;         ///< is done, but not answered until release()
    std::optional<std::size_t> gone_at{};  ///< is pulled out while it writes this page
};

/// What happens to the chip while its boot loader runs; called on the testbed's GLib thread.
struct BootLoaderEvents {
    std::function<void(unsigned delay_ms)> reboot;
    std::function<void()> gone;
};

class BootLoader final : public UsbFunction {
 public:
    BootLoader(Flash& flash, const BootLoaderFaults& faults, BootLoaderEvents events);

    const UsbDescription& description() const override { return description_; }
    int control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                Bytes& reply) override;
    void receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
    /// Answers all that are held, now and later. From any thread.
    void release();

 private:
    struct Command {
        std::uint32_t token = 0;
        std::uint8_t id = 0;
        std::uint8_t arguments_size = 0;
        std::uint32_t transfer_size = 0;
        std::uint32_t argument[4] = {};
    };

    void begin(std::span<const std::uint8_t> bytes);
    std::uint32_t check(const Command& command) const;
    std::uint32_t check_range(const Command& command, std::uint32_t grain) const;
    void act();
    void write_pages();
    void acknowledge();
    void refuse(std::uint32_t status);
    void reset();

    const UsbDescription description_;
    Flash& flash_;
    const BootLoaderFaults faults_;
    const BootLoaderEvents events_;
    Command command_;
    std::uint32_t status_ = 0;
    std::atomic<bool> released_{false};
    bool left_xip_ = false;
    bool takes_data_ = false;
    bool awaits_end_ = false;  ///< the empty packet of the host after it has read
    Bytes data_;
};

}  // namespace versavis::test

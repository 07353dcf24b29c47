// SPDX-License-Identifier: BSD-3-Clause
// The board as a device on USB: control requests, and the link's packets at its data endpoints.
#pragma once

#include "usb_link.hpp"

namespace versavis::rp2040 {

/// Enumerates the board and moves packets between the endpoints and UsbLink. After begin() it runs
/// in interrupts only.
class UsbDevice {
 public:
    explicit UsbDevice(UsbLink& link) : link_(link) {}

    /// `serial` must outlive it.
    void begin(const char* serial);

    /// From the interrupt of the controller, which nothing delays: notes when what has happened.
    void note();
    /// From an interrupt that note() asks for: does it.
    void work();
    /// From the interrupt of an alarm that it sets itself, as urgent as work(): takes the board off
    /// the bus, resets the controller and comes back when the controller no longer works.
    void watch();

 private:
    struct Setup {
        std::uint8_t type;
        std::uint8_t request;
        std::uint16_t value;
        std::uint16_t index;
        std::uint16_t length;
    };
    /// What the host has done since the controller was started.
    enum class Host { silent, has_reset, asks };

    void start();
    unsigned evidence();
    void reset_bus();
    void handle_setup();
    std::uint32_t take_done();
    void handle_buffers(std::uint32_t done);
    bool answer(const Setup& setup);
    bool answer_class(const Setup& setup);
    bool describe(const Setup& setup);
    void describe_text(unsigned index);
    bool halt(std::uint16_t index, bool halted);
    void configure(bool configured);
    void reply(const void* data, std::size_t size, std::size_t wanted);
    void send_more();
    void take_control_data();
    void receive_data();
    void send_data();
    void hand_in();

    UsbLink& link_;
    const char* serial_ = nullptr;
    volatile std::uint32_t done_ = 0;  ///< buffers, by the bits of the controller
    volatile bool has_setup_ = false;
    volatile bool was_reset_ = false;
    volatile bool awaits_frame_ = false;  ///< to send
    bool configured_ = false;
    bool receiving_ = false;   ///< the controller waits for a packet of the host
    bool sending_ = false;     ///< the controller has a packet for the host
    bool has_failed_ = false;  ///< a packet, and none has succeeded since
    bool detached_ = false;
    volatile std::uint32_t data_in_at_us_ = 0;
    volatile std::uint32_t data_out_at_us_ = 0;
    volatile std::uint32_t frame_at_us_ = 0;  ///< its begin, which was seen last

    std::size_t sent_size_ = 0;      ///< of that packet, or of the last
    std::uint32_t toggles_[3] = {};  ///< of the next packet: control in, data in, data out
    Host host_ = Host::silent;
    unsigned evidence_ = 0;      ///< of looks in a row
    std::uint8_t address_ = 0;   ///< to be taken on
    bool takes_coding_ = false;  ///< the data stage of the request is a line coding
    bool ready_ = false;         ///< DTR
    const std::uint8_t* more_ = nullptr;
    std::size_t more_size_ = 0;
    bool ends_short_ = false;
    std::uint8_t coding_[7] = {0x00, 0xC2, 0x01, 0x00, 0, 0, 8};  // 115200 8N1, which means nothing
    std::uint8_t answer_[64] = {};
};

}  // namespace versavis::rp2040

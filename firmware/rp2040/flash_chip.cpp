// SPDX-License-Identifier: BSD-3-Clause
#include "flash_chip.hpp"

#include "registers.hpp"

namespace versavis::rp2040 {

namespace {

// The commands that all of these chips share.
constexpr std::uint8_t write_page_command = 0x02;
constexpr std::uint8_t read_command = 0x03;
constexpr std::uint8_t read_status_command = 0x05;
constexpr std::uint8_t allow_write_command = 0x06;
constexpr std::uint8_t erase_sector_command = 0x20;
constexpr std::uint8_t read_id_command = 0x4B;
constexpr std::uint8_t status_busy = 1;

constexpr unsigned command_size = 4;  ///< and its address

/// Bytes in the FIFOs at once; their depth is 16.
constexpr std::size_t in_flight = 8;

void select_chip(bool selected) {
    io_qspi().select.control = function_flash | (selected ? override_low : override_high)
                                                    << output_override_shift;
}

void put_address(std::uint8_t* head, std::uint8_t command, std::uint32_t address) {
    head[0] = command;
    head[1] = static_cast<std::uint8_t>(address >> 16U);
    head[2] = static_cast<std::uint8_t>(address >> 8U);
    head[3] = static_cast<std::uint8_t>(address);
}

}  // namespace

void FlashChip::begin() {
    constexpr std::uint32_t frames_of_8_bits = 7U << 16U;
    select_chip(false);
    io_qspi().clock.control = function_flash;
    for (Gpio& data : io_qspi().data) data.control = function_flash;
    FlashInterface& flash = flash_interface();
    flash.enable = 0;
    flash.baud = 6;  // 20.8 MHz
    flash.control0 = frames_of_8_bits;
    flash.select = 1;
    flash.enable = 1;
}

void FlashChip::command(const std::uint8_t* head, std::size_t head_size, const std::uint8_t* out,
                        std::uint8_t* in, std::size_t size) {
    constexpr std::uint32_t received = 1U << 3U;
    FlashInterface& flash = flash_interface();
    const std::size_t all = head_size + size;
    select_chip(true);
    for (std::size_t sent = 0, got = 0; got < all;) {
        if (sent < all && sent - got < in_flight) {
            flash.data = sent < head_size ? head[sent] : out != nullptr ? out[sent - head_size] : 0;
            ++sent;
        }
        if ((flash.status & received) == 0) continue;
        const auto byte = static_cast<std::uint8_t>(flash.data);
        if (in != nullptr && got >= head_size) in[got - head_size] = byte;
        ++got;
    }
    select_chip(false);
}

void FlashChip::read_id(std::uint8_t* id) {
    const std::uint8_t head[5] = {read_id_command};
    command(head, sizeof head, nullptr, id, id_size);
}

void FlashChip::read(std::uint32_t address, std::uint8_t* data, std::size_t size) {
    std::uint8_t head[command_size];
    put_address(head, read_command, address);
    command(head, sizeof head, nullptr, data, size);
}

bool FlashChip::busy() {
    std::uint8_t status = 0;
    command(&read_status_command, 1, nullptr, &status, 1);
    return (status & status_busy) != 0;
}

void FlashChip::allow_write() { command(&allow_write_command, 1, nullptr, nullptr, 0); }

void FlashChip::erase_sector(std::uint32_t address) {
    std::uint8_t head[command_size];
    put_address(head, erase_sector_command, address);
    allow_write();
    command(head, sizeof head, nullptr, nullptr, 0);
}

void FlashChip::write_page(std::uint32_t address, const std::uint8_t* data, std::size_t size) {
    std::uint8_t head[command_size];
    put_address(head, write_page_command, address);
    allow_write();
    command(head, sizeof head, data, nullptr, size);
}

}  // namespace versavis::rp2040

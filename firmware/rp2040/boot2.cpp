// SPDX-License-Identifier: BSD-3-Clause
// The second stage of booting: the boot ROM copies it to the end of RAM, checks it and runs it. It
// copies the firmware from the flash to RAM, where it runs.
#include "registers.hpp"

extern "C" {

extern const std::uint32_t image_in_flash[];
extern std::uint32_t image_begin[];
extern std::uint32_t image_end[];

/// First function of the stage, and the only one: it has no variables but these.
[[gnu::section(".boot2"), gnu::used, noreturn]] void boot2() {
    using namespace versavis::rp2040;
    // The slowest read command, which each flash chip knows: 03h, address of 24 bits, one data
    // line.
    constexpr std::uint32_t words_of_32_bits = 31U << 16U;
    constexpr std::uint32_t command_then_data = 3U << 8U;
    constexpr std::uint32_t read_command = 3U << 24U;
    constexpr std::uint32_t command_of_8_bits = 2U << 8U;
    constexpr std::uint32_t address_of_24_bits = 6U << 2U;
    FlashInterface& flash = flash_interface();
    flash.enable = 0;
    flash.baud = 4;  // of clk_sys, which is the ring oscillator's here: 3 MHz at most
    flash.control0 = words_of_32_bits | command_then_data;
    block_at<Register>(0x180000F4) = read_command | command_of_8_bits | address_of_24_bits;
    flash.control1 = 0;
    flash.select = 1;
    flash.enable = 1;
    const std::uint32_t* from = image_in_flash;
    for (std::uint32_t* to = image_begin; to != image_end; ++to, ++from) *to = *from;
    vector_table_address() = reinterpret_cast<std::uint32_t>(image_begin);
    __asm__ volatile("msr msp, %0\n bx %1" ::"r"(image_begin[0]), "r"(image_begin[1]));
    __builtin_unreachable();
}
}

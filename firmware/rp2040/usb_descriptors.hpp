// SPDX-License-Identifier: BSD-3-Clause
// The board's USB descriptors: a serial line of class CDC-ACM.
#pragma once

#include <cstdint>

#include "wire/usb_identity.hpp"

namespace versavis::rp2040::usb {

inline constexpr std::uint8_t data_interface = 1;
inline constexpr std::uint8_t data_endpoint = 1;
inline constexpr std::uint8_t notice_endpoint = 2;
inline constexpr std::uint8_t packet_size = 64;
inline constexpr std::uint8_t notice_size = 8;

enum Text : std::uint8_t { text_languages, text_vendor, text_product, text_serial };

constexpr std::uint8_t low(std::uint16_t value) { return value & 0xFFU; }
constexpr std::uint8_t high(std::uint16_t value) { return static_cast<std::uint8_t>(value >> 8U); }

// One line for each group of fields.
// clang-format off
inline constexpr std::uint8_t device[18] = {
    18, 1, 0x00, 0x02,       // USB 2.0
    2, 0, 0, packet_size,    // class CDC; of endpoint 0
    low(wire::usb_vendor), high(wire::usb_vendor),
    low(wire::usb_product), high(wire::usb_product),
    0x00, 0x03,              // release
    text_vendor, text_product, text_serial,
    1,                       // configuration
};

inline constexpr std::uint8_t configuration[67] = {
    9, 2, 67, 0, 2, 1, 0, 0x80, 125,  // two interfaces; at most 250 mA from the bus
    // Interface 0: control, by the notice endpoint.
    9, 4, 0, 0, 1, 2, 2, 0, 0,
    5, 0x24, 0, 0x10, 0x01,
    5, 0x24, 1, 0, 1,
    4, 0x24, 2, 2,
    5, 0x24, 6, 0, 1,
    7, 5, 0x80 | notice_endpoint, 3, notice_size, 0, 255,
    // Interface 1: data.
    9, 4, 1, 0, 2, 10, 0, 0, 0,
    7, 5, data_endpoint, 2, packet_size, 0, 0,
    7, 5, 0x80 | data_endpoint, 2, packet_size, 0, 0,
};
// clang-format on

}  // namespace versavis::rp2040::usb

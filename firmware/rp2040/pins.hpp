// SPDX-License-Identifier: BSD-3-Clause
// Which pin of the chip is what. Firmware, documents and the board's design use this map.
#pragma once

#include <cstdint>

#include "base/hal.hpp"

namespace versavis::rp2040 {

/// A Raspberry Pi Pico leads GPIO 0 to 22 and 26 to 28 out. The others belong to its own circuits:
/// regulator, USB's supply, LED, a divider with a capacitor; on a Pico W to the radio, which is off
/// while 23 is low.
inline constexpr unsigned own_pins[] = {23, 24, 25, 29};

enum Pin : unsigned {
    pin_uart_transmit = 0,  ///< to the second IMU
    pin_uart_receive = 1,   ///< from it, or from a GNSS receiver
    // An IMU is on SPI or on I2C, by the same wires.
    pin_spi_clock = 2,
    pin_i2c_data = 2,
    pin_spi_transmit = 3,
    pin_i2c_clock = 3,
    pin_spi_receive = 4,
    pin_spi_select0 = 5,
    pin_spi_select1 = 6,

    pin_imu_ready0 = 7,
    pin_imu_ready1 = 8,
    pin_accel_ready = 9,
    pin_pps = 10,
    pin_aux0 = 11,
    pin_aux1 = 12,
    pin_sync_input = 13,
    pin_exposure0 = 14,  ///< of camera 0; 15 to 17 of the others

    pin_loop = 18,      ///< free: what is sent there comes back and is stamped
    pin_trigger0 = 19,  ///< of camera 0; 20 to 22 of the others
    pin_sync_output = 26,
    pin_test_output = 27,
    pin_light = 28,
    pin_count = 30,
};

// What the state machines rely on: their pins lie side by side.
inline constexpr unsigned first_input = pin_imu_ready0;
inline constexpr unsigned watched_inputs = 11;
inline constexpr unsigned watched_pins = watched_inputs + 1;  ///< with the loop
inline constexpr unsigned first_output = pin_loop;
inline constexpr unsigned scheduled_outputs = 10;  ///< three of which no pin shows
static_assert(pin_exposure0 + firmware::camera_count == first_input + watched_inputs);
static_assert(first_input + watched_inputs == pin_loop);
static_assert(pin_loop + 1 == pin_trigger0);
static_assert(first_output + scheduled_outputs == pin_light);

struct SignalPin {
    std::uint8_t signal;  ///< of the HAL
    std::uint8_t pin;
};
inline constexpr SignalPin input_pins[firmware::input_count] = {
    {0, pin_exposure0},
    {1, pin_exposure0 + 1},
    {2, pin_exposure0 + 2},
    {3, pin_exposure0 + 3},
    {firmware::input_imu_ready, pin_imu_ready0},
    {firmware::input_imu_ready + 1, pin_imu_ready1},
    {firmware::input_pulse + 0, pin_pps},
    {firmware::input_pulse + 1, pin_aux0},
    {firmware::input_pulse + 2, pin_aux1},
    {firmware::input_pulse + 3, pin_sync_input},
    {firmware::input_accel_ready, pin_accel_ready},
};

constexpr unsigned pin_of_input(std::uint8_t input) {
    for (const SignalPin& each : input_pins)
        if (each.signal == input) return each.pin;
    return pin_count;
}

/// The gate and the lead of the light have none: what they do is seen at the light.
inline constexpr SignalPin output_pins[] = {
    {0, pin_trigger0},
    {1, pin_trigger0 + 1},
    {2, pin_trigger0 + 2},
    {3, pin_trigger0 + 3},
    {firmware::output_sync, pin_sync_output},
    {firmware::output_test, pin_test_output},
};

}  // namespace versavis::rp2040

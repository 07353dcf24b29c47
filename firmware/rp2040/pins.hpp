// SPDX-License-Identifier: BSD-3-Clause
// Which pin of the chip is what. Firmware, documents and the board's design use this map.
#pragma once

#include <cstdint>

#include "hal.hpp"

namespace versavis::rp2040 {

/// A Raspberry Pi Pico leads GPIO 0 to 22 and 26 to 28 out. The other four carry what one state
/// machine tells another.
enum Pin : unsigned {
    pin_uart_transmit = 0,  ///< to the second IMU
    pin_uart_receive = 1,   ///< from it, or from a GNSS receiver
    pin_i2c_data = 2,
    pin_i2c_clock = 3,    ///< and, with an IMU on SPI,
    pin_spi_select1 = 3,  ///< its second select
    pin_spi_receive = 4,
    pin_spi_select0 = 5,
    pin_spi_clock = 6,
    pin_spi_transmit = 7,

    pin_imu_ready0 = 8,
    pin_imu_ready1 = 9,
    pin_accel_ready = 10,
    pin_pps = 11,
    pin_aux0 = 12,
    pin_aux1 = 13,
    pin_sync_input = 14,
    pin_exposure0 = 15,  ///< of camera 0; 16 to 18 of the others

    pin_trigger0 = 19,  ///< of camera 0; 20 to 22 of the others
    pin_exposing = 23,  ///< internal: a camera of the light exposes
    pin_lead = 24,      ///< internal
    pin_gate = 25,      ///< internal, and the LED of a Pico: the light may be on
    pin_sync_output = 26,
    pin_test_output = 27,
    pin_light = 28,
    pin_strobe = 29,  ///< internal: an input has changed
    pin_count = 30,
};

// What the state machines rely on: their pins lie side by side.
inline constexpr unsigned first_input = pin_imu_ready0;
inline constexpr unsigned watched_inputs = 11;
inline constexpr unsigned first_output = pin_trigger0;
inline constexpr unsigned scheduled_outputs = 9;
static_assert(pin_exposure0 + firmware::camera_count == first_input + watched_inputs);
static_assert(first_input + watched_inputs == first_output);
static_assert(pin_trigger0 + firmware::camera_count == pin_exposing);
static_assert(pin_lead == pin_exposing + 1 && pin_gate == pin_exposing + 2);
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

inline constexpr SignalPin output_pins[firmware::output_count] = {
    {0, pin_trigger0},
    {1, pin_trigger0 + 1},
    {2, pin_trigger0 + 2},
    {3, pin_trigger0 + 3},
    {firmware::output_light_gate, pin_gate},
    {firmware::output_light_lead, pin_lead},
    {firmware::output_sync, pin_sync_output},
    {firmware::output_test, pin_test_output},
};

}  // namespace versavis::rp2040

// SPDX-License-Identifier: BSD-3-Clause
// How long the calls of the native port take, and how far its hardware goes: ideal by default, or
// as a chip has it.
#pragma once

#include "base/hal.hpp"
#include "wire/messages.hpp"

namespace versavis::firmware {

struct PortModel {
    Nanoseconds call_ns = 0;       ///< that each call of the HAL takes, and the code before it
    Nanoseconds jitter_ns = 0;     ///< up to so much longer
    Nanoseconds interrupt_ns = 0;  ///< up to so long an interrupt before one of eight calls
    Nanoseconds wake_ns = 0;       ///< up to so long from an interrupt to the poll that it asks for
    std::uint64_t seed = 1;

    std::size_t words = 64;        ///< of outputs that wait
    Nanoseconds word_lead_ns = 0;  ///< a word leaves no sooner after push()
    std::uint8_t output_grain_bits = 0;
    Nanoseconds output_step_ns = 1;
    std::size_t edges = 256;        ///< that wait
    Nanoseconds edge_lag_ns = 0;    ///< until an edge can be popped
    Nanoseconds edge_grain_ns = 1;  ///< stamps are multiples
    Nanoseconds imu_start_ns = 0;   ///< from a data-ready edge to the transfer
    Nanoseconds store_ns = 0;       ///< to erase and write the memory
    Nanoseconds departure_ns = 0;   ///< up to so much sooner a byte is said to have left

    std::uint32_t present = wire::present_all;
    std::uint32_t fastest_imu_millihertz = 8'000'000;
};

/// A port whose calls take `call_ns`, with the delays and the room of an RP2040, but exact to the
/// nanosecond. At 2 us a call, a poll takes some 40 us.
inline PortModel slow_model(Nanoseconds call_ns, std::uint64_t seed) {
    PortModel model;
    model.call_ns = call_ns;
    model.jitter_ns = call_ns / 2;
    model.interrupt_ns = 5'000;
    model.wake_ns = 2'000;
    model.seed = seed;
    model.word_lead_ns = 380'000;
    model.edge_lag_ns = 2'000;
    model.imu_start_ns = 2'000;
    model.store_ns = 400'000'000;
    model.departure_ns = 20'000;
    return model;
}

/// The same, as fine as an RP2040 at 125 MHz.
inline PortModel chip_model(Nanoseconds call_ns, std::uint64_t seed) {
    PortModel model = slow_model(call_ns, seed);
    model.output_grain_bits = 3;
    model.output_step_ns = 24;
    model.edge_grain_ns = 16;
    return model;
}

}  // namespace versavis::firmware

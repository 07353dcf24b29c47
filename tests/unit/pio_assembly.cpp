// SPDX-License-Identifier: BSD-3-Clause
#include "pio_assembly.hpp"

#include <catch2/catch.hpp>

#include "pio_programs.hpp"

using namespace versavis::rp2040;
using namespace versavis::rp2040::pio_assembly;

TEST_CASE("pio_assembly: instructions are those of the data sheet's examples") {
    CHECK(set(To::pin_directions, 1) == 0xE081);
    CHECK(set(To::pins, 0) == 0xE000);
    CHECK(jump(1) == 0x0001);
    CHECK(jump(2, When::x_counts_down) == 0x0042);
    CHECK(jump(8, When::pin_is_high) == 0x00C8);
    CHECK(jump(3, When::x_is_zero) == 0x0023);
    CHECK(out(To::x, 1) == 0x6021);
    CHECK(out(To::pins, 1) == 0x6001);
    CHECK(in(From::pins, 1) == 0x4001);
    CHECK(in(From::x, 32) == 0x4020);
    CHECK(wait_for_pin(false, 0) == 0x2020);
    CHECK(wait_for_pin(true, 2) == 0x20A2);
    CHECK(pull() == 0x80A0);
    CHECK(pull_or_x() == 0x8080);
    CHECK(mov(To::y, From::y) == 0xA042);
    CHECK(mov(To::osr, From::pins) == 0xA0E0);
    CHECK(mov_inverted(To::pins, From::pins) == 0xA008);
    CHECK(raise_flag(4) == 0xC004);
    CHECK(optional_side(jump(7), true) == 0x1807);
    CHECK(optional_side(jump(7), false) == 0x1007);
}

namespace {

/// One round of what the light does for these cameras, while those expose: how many cycles it took,
/// and whether it is lit at the end. Written from the data sheet's description of the instructions.
struct Round {
    unsigned cycles = 0;
    bool lit = false;
};

Round round_of(const light::Following& program, unsigned exposing) {
    std::uint32_t y = 0;
    std::uint32_t isr = 0;
    std::uint32_t osr = 0;
    const auto shift_out = [&](unsigned bits) {
        const std::uint32_t value = osr & ((1U << bits) - 1U);
        osr >>= bits;
        return value;
    };
    Round round;
    for (unsigned at = light::follow;;) {
        const Code code = program.code.at(at - light::follow);
        const unsigned bits = code & 31U;
        ++round.cycles;
        ++at;
        if (code == 0xA0E0)
            osr = exposing;  // MOV OSR, PINS
        else if (code == 0xA046)
            y = isr;  // MOV Y, ISR
        else if (code >> 5U == 0x6060 >> 5U)
            shift_out(bits);  // OUT NULL
        else if (code >> 5U == 0x6040 >> 5U)
            y = shift_out(bits);  // OUT Y
        else if (code >> 5U == 0x60C0 >> 5U)
            isr = shift_out(bits);  // OUT ISR
        else if (code >> 5U == 0x40E0 >> 5U)
            isr = isr << bits | (osr & ((1U << bits) - 1U));  // IN
        else if (code >> 5U == 0x0060 >> 5U)
            at = y == 0 ? bits : at;            // JMP !Y
        else if ((code & 0xF7E0U) == 0x1040) {  // JMP X--, with the side pin
            round.lit = (code & 0x0800U) != 0;
            REQUIRE(bits == light::follow);
            return round;
        } else {
            FAIL("an unexpected instruction " << code);
        }
    }
}

}  // namespace

TEST_CASE("pio_programs: the light follows any cameras, in rounds of one length") {
    for (unsigned cameras = 1; cameras < 16; ++cameras) {
        const light::Following program = light::following(cameras);
        CAPTURE(cameras);
        CHECK(program.size <= light::most_follow);
        for (unsigned exposing = 0; exposing < 32; ++exposing) {
            const Round round = round_of(program, exposing);
            CHECK(round.lit == ((exposing & cameras) != 0));
            CHECK(round.cycles == program.round_cycles);
        }
    }
}

TEST_CASE(
    "pio_programs: the watcher samples as often as it says, whether there was a change or not") {
    constexpr unsigned sample = watcher::place.first + 6;  // the instruction that does
    constexpr unsigned decision = sample + 2;
    CHECK(watcher::code[6] == mov(To::osr, From::pins));
    CHECK(watcher::code[8] == jump(watcher::place.first, When::x_differs_from_y));
    CHECK(watcher::place.wrap_top - watcher::place.wrap_bottom + 1 == watcher::sample_cycles);
    const unsigned through_change = decision - sample + 1 + (sample - watcher::place.first);
    CHECK(through_change == watcher::sample_cycles + watcher::change_cycles);
    CHECK(sample - watcher::place.wrap_bottom == watcher::first_sample);
}

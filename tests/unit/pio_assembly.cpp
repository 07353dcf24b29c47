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
    CHECK(push() == 0x8000);
    CHECK(mov(To::y, From::y) == 0xA042);
    CHECK(mov(To::osr, From::pins) == 0xA0E0);
    CHECK(raise_flag(4) == 0xC004);
    CHECK(side(jump(0), 1, 1) == 0x1000);
    CHECK(side(mov(To::y, From::y), 1, 0) == 0xA042);
    CHECK(side(mov(To::program_counter, From::pins), 5, 0x15) == 0xB5A0);
    CHECK(optional_side(jump(7), true) == 0x1807);
    CHECK(optional_side(jump(7), false) == 0x1007);
}

TEST_CASE("pio_programs: the light's table is where its address says") {
    for (unsigned levels = 0; levels < 8; ++levels) {
        const unsigned address = light::table << 3U | levels;
        const bool on = (levels >> light::gate & 1U) != 0 && (levels & 3U) != 0;
        CHECK(light::code[address - light::place.first] ==
              optional_side(jump(on ? light::lit : light::dark), on));
    }
}

TEST_CASE("pio_programs: the stamper counts once every two cycles on each way through it") {
    // From the look at the strobe back to it: the look, then all up to it, of which three count.
    CHECK(stamper::place.wrap_bottom - stamper::place.first + 1 ==
          stamper::tick_cycles * (stamper::code.size() - 4));
    CHECK(stamper::place.wrap_top - stamper::place.wrap_bottom + 1 == stamper::tick_cycles);
    // A change is at least as far from the next as a stamp takes.
    CHECK(watcher::code.size() >= stamper::place.wrap_bottom - stamper::place.first + 1);
}

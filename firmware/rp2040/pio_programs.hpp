// SPDX-License-Identifier: BSD-3-Clause
// What the state machines do: send words at their times, stamp changes of inputs, drive the light,
// and make outputs copies of inputs. None of them communicates with another.
#pragma once

#include <array>

#include "pins.hpp"
#include "pio_assembly.hpp"

namespace versavis::rp2040 {

/// Where in the memory of its block a program begins and ends.
struct Place {
    unsigned first;
    unsigned wrap_bottom;
    unsigned wrap_top;
};

// Block 0. Its three machines start in the same cycle.

/// Each word is a time to wait, and the levels that follow.
namespace sequencer {
using namespace pio_assembly;
inline constexpr unsigned machine = 0;
inline constexpr Place place{0, 0, 2};
inline constexpr unsigned delay_bits = 32 - scheduled_outputs;
/// The waits of two words differ by as many cycles as their numbers. This is the wait of 0, and so
/// the shortest.
inline constexpr unsigned shortest_cycles = 3;
inline constexpr std::array<Code, 3> code{
    out(To::x, delay_bits),
    jump(place.first + 1, When::x_counts_down),
    out(To::pins, scheduled_outputs),
};
}  // namespace sequencer

/// Samples the pins every six cycles and counts down each time. When they differ from what they
/// were, the count and the levels leave in one word, and the next sample comes three cycles later
/// than it would. From the number of words before it and its count follows when a sample was taken,
/// to the cycle.
namespace watcher {
using namespace pio_assembly;
inline constexpr unsigned machine = 1;
inline constexpr Place place{3, 7, 12};
inline constexpr unsigned flag = 0;  ///< asks for attention
inline constexpr unsigned first_sample = 2;
inline constexpr unsigned sample_cycles = 6;
inline constexpr unsigned change_cycles = 3;
inline constexpr unsigned count_bits = 32 - watched_pins;
inline constexpr std::array<Code, 10> code{
    mov(To::y, From::x),       mov(To::x, From::isr),
    in(From::y, watched_pins),  // which sends the word, and empties the ISR
    raise_flag(flag),          jump(place.wrap_bottom + 1, When::x_counts_down),
    mov(To::isr, From::x),     mov(To::osr, From::pins),
    out(To::x, watched_pins),  jump(place.first, When::x_differs_from_y),
    mov(To::x, From::isr),
};
static_assert(place.first + code.size() == place.wrap_top + 1);
}  // namespace watcher

/// Each word is how many rounds a state lasts, and the address of the state: waiting, lit, lit
/// while a camera of the light exposes (which `following` makes), and asleep, which is dark until
/// the next word comes. A machine that is left without a word takes X for one, which is all ones:
/// it falls asleep.
namespace light {
using namespace pio_assembly;
inline constexpr unsigned machine = 2;
inline constexpr unsigned address_bits = 5;
inline constexpr unsigned round_bits = 32 - address_bits;
inline constexpr unsigned waiting = 13;
inline constexpr unsigned fetch = waiting + 1;
inline constexpr unsigned lit = fetch + 3;
inline constexpr unsigned follow = lit + 2;
inline constexpr unsigned asleep = (1U << address_bits) - 1;
inline constexpr Place place{waiting, fetch + 1, asleep};
inline constexpr unsigned fetch_cycles = 3;
inline constexpr std::array<Code, 6> code{
    optional_side(jump(waiting, When::x_counts_down), false),
    pull_or_x(),
    out(To::x, round_bits),
    out(To::program_counter, address_bits),
    optional_side(jump(lit, When::x_counts_down), true),
    jump(fetch),
};
static_assert(waiting + code.size() == follow);
inline constexpr std::array<Code, 1> asleep_code{optional_side(pull(), false)};

inline constexpr unsigned most_follow = 11;
struct Following {
    std::array<Code, most_follow> code{};
    unsigned size = 0;
    unsigned round_cycles = 0;

    constexpr void add(Code each) { code[size++] = each; }
};

/// Lit while one of these cameras exposes, of which there is one at least. A round takes as long
/// with light as without.
constexpr Following following(unsigned cameras) {
    Following made;
    const auto skip_others = [&] {
        unsigned others = 0;
        for (; (cameras & 1U) == 0; cameras >>= 1U) ++others;
        if (others > 0) made.add(out(To::null, others));
    };
    const auto side_by_side = [&] {
        unsigned these = 0;
        for (; (cameras & 1U) != 0; cameras >>= 1U) ++these;
        return these;
    };
    made.add(mov(To::osr, From::pins));
    skip_others();
    const unsigned these = side_by_side();
    made.add(out(cameras == 0 ? To::y : To::isr, these));
    if (cameras != 0) {
        skip_others();
        made.add(in(From::osr, side_by_side()));
        made.add(mov(To::y, From::isr));
    }
    made.add(jump(follow + made.size + 3, When::y_is_zero));
    made.round_cycles = made.size + 1;
    for (const bool on : {true, false}) {
        made.add(optional_side(jump(follow, When::x_counts_down), on));
        made.add(jump(fetch));
    }
    return made;
}
}  // namespace light

/// An output is a copy of an input. In block 0 the test output; in block 1, whose machines are the
/// cameras', the trigger of a slave copies its master's exposure line.
namespace copier {
using namespace pio_assembly;
inline constexpr unsigned machine = 3;
inline constexpr unsigned address = light::follow + light::most_follow;
inline constexpr Place place{address, address, address};
static_assert(address < light::asleep);
inline constexpr std::array<Code, 1> code{mov(To::pins, From::pins)};

inline constexpr Place slave_place[2]{{0, 0, 0}, {1, 1, 1}};  ///< plain, inverted
inline constexpr std::array<Code, 2> slave_code{mov(To::pins, From::pins),
                                                mov_inverted(To::pins, From::pins)};
}  // namespace copier

}  // namespace versavis::rp2040

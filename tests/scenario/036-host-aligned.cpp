// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "scenario.hpp"

using namespace versavis;
using namespace versavis::scenario;

namespace {

/// A board with a clock of its own that learns once a second where the host's next whole second
/// lies.
struct Aligned {
    Aligned(std::uint64_t seed, double skew_ppm, Nanoseconds offset)
        : world(seed), ppm(skew_ppm), zero(offset) {
        world.add_camera(0);
        world.add_camera(1, {}, 50'000'000);
        world.configuration.cameras[1].phase_ns = 7'000'000;
    }

    Nanoseconds to_board(Nanoseconds host) const {
        return host + zero + std::llround(static_cast<double>(host) * ppm * 1e-6);
    }
    Nanoseconds to_host(Nanoseconds board) const {
        return std::llround(static_cast<double>(board - zero) / (1 + ppm * 1e-6));
    }

    void run_to(Nanoseconds host) {
        world.run(std::max<Nanoseconds>(to_board(host) - world.now(), 0));
    }

    void align_grid(Nanoseconds host_second, std::uint32_t slew_ppb) {
        world.send(wire::AlignGrid{to_board(host_second),
                                   static_cast<std::int32_t>(std::lround(ppm * 1e3)), slew_ppb});
    }

    /// Middles of the exposures in host time.
    std::vector<Nanoseconds> middles(unsigned camera) {
        std::vector<Nanoseconds> out;
        for (const TruePulse& pulse : world.camera(camera).pulses())
            if (pulse.taken) out.push_back(to_host(pulse.start + (pulse.end - pulse.start) / 2));
        return out;
    }

    Scenario world;
    double ppm;
    Nanoseconds zero;
};

/// Distance from the nearest multiple of the period, apart from the phase.
Nanoseconds off_grid(Nanoseconds at, Nanoseconds phase, Nanoseconds period) {
    const Nanoseconds past = (at - phase) % period;
    return past > period / 2 ? past - period : past;
}

}  // namespace

TEST_CASE(
    "036-host-aligned: a board that is aligned before its cameras start exposes on the host's "
    "seconds") {
    const double ppm = GENERATE(-60.0, 0.0, 35.0);
    Aligned board(1, ppm, 2 * second + 345'678'901);
    board.run_to(321 * ms);
    board.world.connect();
    REQUIRE(board.world.configure());
    board.align_grid(second, 20'000);
    board.world.start();
    for (Nanoseconds host = second; host < 60 * second; host += second) {
        board.run_to(host + 400 * ms);
        board.align_grid(host + second, 20'000);
    }
    board.world.finish();
    CHECK(board.world.judge() == "");
    REQUIRE(board.middles(0).size() > 1'000);
    REQUIRE(board.middles(1).size() > 2'500);
    for (const Nanoseconds middle : board.middles(0))
        REQUIRE(std::abs(off_grid(middle, 0, 50 * ms)) <= 20 + board.world.rounding());
    for (const Nanoseconds middle : board.middles(1))
        REQUIRE(std::abs(off_grid(middle, 7 * ms, 20 * ms)) <= 20 + board.world.rounding());
}

TEST_CASE(
    "036-host-aligned-late: boards that run already slew to the same seconds, and no interval "
    "jumps") {
    Aligned first(1, -60.0, 3 * second);
    Aligned other(2, 35.0, 11 * second + 30 * ms);
    const std::uint32_t slew_ppb = 500'000;
    for (Aligned* board : {&first, &other}) {
        board->run_to(100 * ms);
        REQUIRE(board->world.begin());  // the grid begins here, off the seconds of the host
        for (Nanoseconds host = second; host < 400 * second; host += second) {
            board->run_to(host + 400 * ms);
            if (host > 10 * second) board->align_grid(host + second, slew_ppb);
        }
        board->world.finish();
        CHECK(board->world.judge() == "");
        for (const unsigned camera : {0U, 1U}) {
            const auto middles = board->middles(camera);
            const Nanoseconds period = camera == 0 ? 50 * ms : 20 * ms;
            // An exposure is placed by the one before: the first of them may lie elsewhere.
            for (std::size_t i = 5; i < middles.size(); ++i)
                REQUIRE(std::abs(middles[i] - middles[i - 1] - period) <= period / 1000);
        }
    }
    // 0.1 s at 500 ppm takes 200 s.
    for (const unsigned camera : {0U, 1U}) {
        const auto theirs = first.middles(camera);
        std::size_t together = 0;
        for (const Nanoseconds middle : other.middles(camera)) {
            if (middle < 260 * second || middle > 390 * second) continue;
            const auto nearest = std::lower_bound(theirs.begin(), theirs.end(), middle - ms);
            REQUIRE(nearest != theirs.end());
            REQUIRE(std::abs(*nearest - middle) <= 100);
            ++together;
        }
        CHECK(together > 2'500);
    }
}

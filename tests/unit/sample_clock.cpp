// SPDX-License-Identifier: BSD-3-Clause
// Words of a watcher that was written from its documentation (docs/design/firmware.md), looked at
// now and then: each edge is stamped within 48 ns.
#include "sample_clock.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <random>

using versavis::rp2040::SampleClock;

namespace {

struct Word {
    std::uint32_t count;
    double edge_ns;  ///< true time of the change that it shows
};

/// Samples one line every six cycles, three later after a change; the synchroniser's first
/// flip-flop has taken a level in one cycle before.
class Watcher {
 public:
    /// The word of the change at this time, which is after the word before and its next sample.
    Word change(double at_ns) {
        const double seen = at_ns / 8 + 1;
        const double samples = std::max(0.0, std::ceil((seen - sample_) / 6));
        sample_ += samples * 6;
        counts_ += static_cast<std::uint64_t>(samples);
        const Word word{static_cast<std::uint32_t>(0 - counts_) & 0xFFFFFU, at_ns};
        sample_ += 9;
        ++counts_;
        return word;
    }
    /// A change after this one is seen by another sample.
    double last_sample_ns() const { return (sample_ - 9 - 1) * 8; }

 private:
    double sample_ = 2;
    std::uint64_t counts_ = 1;
};

std::uint32_t low(double ns) { return static_cast<std::uint32_t>(static_cast<std::uint64_t>(ns)); }
std::uint32_t clock_at(double ns) {
    return low(static_cast<double>(static_cast<std::uint64_t>(ns) / 1000 * 1000));
}

}  // namespace

TEST_CASE(
    "sample_clock: edges at any distance are stamped within 40 ns, however long it was quiet") {
    std::mt19937_64 random(5);
    Watcher watcher;
    SampleClock clock;
    const double gaps_ns[] = {1, 60, 80, 300, 5e3, 1e6, 12e6, 49.9e6, 50.4e6, 333e6, 1.1e9, 7e9};
    std::uniform_int_distribution<std::size_t> which(0, std::size(gaps_ns) - 1);
    std::uniform_real_distribution<double> part(0.0, 1.0);
    std::deque<Word> waiting;
    double worst = 0;
    double worst_after_loss = 0;  // the word before, which was lost, may be close
    bool lost = false;
    const auto look = [&](double at_ns) {
        for (; !waiting.empty(); waiting.pop_front()) {
            clock.next(waiting.front().count, clock_at(at_ns));
            const auto off = static_cast<std::int32_t>(clock.edge() - low(waiting.front().edge_ns));
            double& most = lost ? worst_after_loss : worst;
            most = std::max<double>(most, std::abs(off));
            lost = false;
        }
    };
    double now = 1000;
    double looked = 0;
    for (int i = 0; i < 50'000; ++i) {
        const double gap = gaps_ns[which(random)] * (0.5 + part(random));
        // The board looks every 21 ms at least.
        while (looked + 21e6 < now + gap) {
            looked += 21e6;
            look(looked);
            clock.pass(clock_at(looked));
        }
        now = std::max(now + gap, watcher.last_sample_ns() + 0.1);
        waiting.push_back(watcher.change(now));
        now = std::max(now, watcher.last_sample_ns());
        const double then = part(random);
        if (then < 0.3) continue;  // it looks when some words are there
        if (then < 0.35) {         // or loses them
            clock.skip(static_cast<std::uint32_t>(waiting.size()));
            waiting.clear();
            lost = true;
            continue;
        }
        now += 100 + 20e3 * part(random);
        look(now);
        looked = now;
    }
    CHECK(worst <= 40);
    CHECK(worst > 30);  // some were close together
    CHECK(worst_after_loss <= 48);
}

TEST_CASE("sample_clock: a word that is not the next one disturbs those after it no longer") {
    Watcher watcher;
    SampleClock clock;
    const Word first = watcher.change(1e6);
    const Word second = watcher.change(2e6);
    const Word third = watcher.change(3e6);
    clock.next(first.count, clock_at(3.1e6));
    clock.next(third.count, clock_at(3.1e6));  // overwritten while it was read
    clock.next(second.count, clock_at(3.1e6));
    clock.next(third.count, clock_at(3.1e6));
    CHECK(static_cast<std::int32_t>(clock.edge() - low(third.edge_ns)) == Approx(0).margin(100));
}

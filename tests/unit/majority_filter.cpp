// SPDX-License-Identifier: BSD-3-Clause
#include "engine/plausibility/majority_filter.hpp"

#include <catch2/catch.hpp>

using namespace versavis;
using namespace versavis;

namespace {

/// Believes that each number is the one before and one.
struct Counting {
    std::optional<int> newest;

    std::optional<Implausibility> doubt(int number) const {
        if (!newest || number == *newest + 1) return std::nullopt;
        return Implausibility{EventReason::implausible_number, number, *newest + 1};
    }
    void learn(int number) { newest = number; }
    bool repeats(int number) const { return newest == number; }
    void rebase() { newest.reset(); }
};

}  // namespace

TEST_CASE("majority_filter: what does not follow is doubted and not remembered") {
    MajorityFilter<Counting> witness{Counting{}};
    CHECK_FALSE(witness.judge(1, 0));
    const auto doubt = witness.judge(7, 0);
    REQUIRE(doubt);
    CHECK(doubt->said == 7);
    CHECK(doubt->expected == 2);
    CHECK_FALSE(witness.judge(2, 0));
}

TEST_CASE("majority_filter: where neighbours are asked for, the first message is not confirmed") {
    MajorityFilter<Counting> witness{Counting{}, 2};
    CHECK_FALSE(witness.judge(50, 0));
    CHECK_FALSE(witness.confirmed());
    CHECK_FALSE(witness.judge(1, 0));
    CHECK_FALSE(witness.confirmed());
    CHECK_FALSE(witness.judge(2, 0));
    CHECK(witness.confirmed());
    CHECK(witness.judge(50, 0));
    CHECK(witness.confirmed());
    witness.forget();
    CHECK_FALSE(witness.confirmed());
}

TEST_CASE("majority_filter: among the first messages the majority is believed") {
    MajorityFilter<Counting> witness{Counting{}, 3};
    CHECK_FALSE(witness.judge(1, 0));
    CHECK_FALSE(witness.overturned());
    CHECK(witness.judge(1, 0));  // once more is not against it
    CHECK_FALSE(witness.overturned());
    CHECK_FALSE(witness.judge(50, 0));
    CHECK(witness.overturned());
    CHECK_FALSE(witness.judge(51, 0));
    CHECK_FALSE(witness.overturned());
    CHECK(witness.judge(7, 0));
    CHECK_FALSE(witness.overturned());
    CHECK_FALSE(witness.judge(52, 0));
    CHECK_FALSE(witness.confirmed());
    CHECK_FALSE(witness.judge(53, 0));
    CHECK(witness.confirmed());
}

TEST_CASE(
    "majority_filter: lies among those that agree do not keep a step out, nor does one make it") {
    MajorityFilter<Counting> witness{Counting{}};
    witness.judge(1, 0);
    int number = 50;
    for (std::uint64_t exchanges = 0; exchanges < 8; ++exchanges) {
        for (int i = 0; i < 4; ++i) CHECK(witness.judge(number++, exchanges));
        CHECK(witness.judge(-1000 * number, exchanges));
        CHECK_FALSE(witness.stepped(exchanges));
    }
    CHECK(witness.judge(number, 8));
    CHECK(witness.stepped(8));
}

TEST_CASE("majority_filter: lies that agree among themselves, in between the truth, are no step") {
    MajorityFilter<Counting> witness{Counting{}};
    witness.judge(1, 0);
    for (int i = 2; i < 40; i += 2) {
        CHECK(witness.judge(100 + i, 10ULL * i));
        CHECK(witness.judge(101 + i, 10ULL * i));
        CHECK_FALSE(witness.stepped(10ULL * i));
        CHECK_FALSE(witness.judge(i, 0));
        CHECK_FALSE(witness.judge(i + 1, 0));
    }
}

TEST_CASE(
    "majority_filter: what contradicts the usual is doubted although nothing is known before it") {
    struct Positive : Counting {
        std::optional<Implausibility> doubt(int number) const {
            if (number < 0) return Implausibility{EventReason::implausible_number, number, 0};
            return Counting::doubt(number);
        }
    };
    MajorityFilter<Positive> witness{Positive{}, GENERATE(1, 3)};
    CHECK(witness.judge(-5, 0));
    CHECK_FALSE(witness.judge(1, 0));
}

TEST_CASE("majority_filter: what arrival contradicts is never believed, but may be of a step") {
    MajorityFilter<Counting> witness{Counting{}};
    const Implausibility late{EventReason::implausible_time, 0, 0};
    CHECK(witness.judge(50, 0, late));
    CHECK_FALSE(witness.judge(1, 0));
    CHECK(witness.judge(2, 0, late));
    CHECK_FALSE(witness.judge(2, 0));
    for (const int number : {60, 61, 62}) CHECK(witness.judge(number, 0, late));
    CHECK(witness.stepped(4));
}

TEST_CASE(
    "majority_filter: three in a row that agree are a step, once the clock was compared again") {
    MajorityFilter<Counting> witness{Counting{}};
    witness.judge(1, 10);
    for (const int number : {50, 51, 52}) CHECK(witness.judge(number, 10));
    CHECK_FALSE(witness.stepped(13));
    CHECK(witness.stepped(14));
    witness.adopt(52);
    CHECK_FALSE(witness.judge(53, 13));
    CHECK_FALSE(witness.stepped(99));
}

TEST_CASE("majority_filter: accidents that do not agree, or not in a row, are no step") {
    MajorityFilter<Counting> witness{Counting{}};
    witness.judge(1, 0);
    for (const int number : {50, 60, 70, 80}) CHECK(witness.judge(number, 0));
    CHECK_FALSE(witness.stepped(9));
    for (const int number : {50, 51}) CHECK(witness.judge(number, 0));
    CHECK_FALSE(witness.judge(2, 0));
    CHECK(witness.judge(52, 0));
    CHECK_FALSE(witness.stepped(9));
}

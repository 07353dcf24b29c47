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
    MajorityFilter<Counting> filter{Counting{}};
    CHECK_FALSE(filter.judge(1, 0));
    const auto implausible = filter.judge(7, 0);
    REQUIRE(implausible);
    CHECK(implausible->said == 7);
    CHECK(implausible->expected == 2);
    CHECK_FALSE(filter.judge(2, 0));
}

TEST_CASE("majority_filter: where neighbours are asked for, the first message is not confirmed") {
    MajorityFilter<Counting> filter{Counting{}, 2};
    CHECK_FALSE(filter.judge(50, 0));
    CHECK_FALSE(filter.confirmed());
    CHECK_FALSE(filter.judge(1, 0));
    CHECK_FALSE(filter.confirmed());
    CHECK_FALSE(filter.judge(2, 0));
    CHECK(filter.confirmed());
    CHECK(filter.judge(50, 0));
    CHECK(filter.confirmed());
    filter.forget();
    CHECK_FALSE(filter.confirmed());
}

TEST_CASE("majority_filter: among the first messages the majority is believed") {
    MajorityFilter<Counting> filter{Counting{}, 3};
    CHECK_FALSE(filter.judge(1, 0));
    CHECK_FALSE(filter.overturned());
    CHECK(filter.judge(1, 0));  // once more is not against it
    CHECK_FALSE(filter.overturned());
    CHECK_FALSE(filter.judge(50, 0));
    CHECK(filter.overturned());
    CHECK_FALSE(filter.judge(51, 0));
    CHECK_FALSE(filter.overturned());
    CHECK(filter.judge(7, 0));
    CHECK_FALSE(filter.overturned());
    CHECK_FALSE(filter.judge(52, 0));
    CHECK_FALSE(filter.confirmed());
    CHECK_FALSE(filter.judge(53, 0));
    CHECK(filter.confirmed());
}

TEST_CASE(
    "majority_filter: lies among those that agree do not keep a step out, nor does one make it") {
    MajorityFilter<Counting> filter{Counting{}};
    filter.judge(1, 0);
    int number = 50;
    for (std::uint64_t exchanges = 0; exchanges < 8; ++exchanges) {
        for (int i = 0; i < 4; ++i) CHECK(filter.judge(number++, exchanges));
        CHECK(filter.judge(-1000 * number, exchanges));
        CHECK_FALSE(filter.stepped(exchanges));
    }
    CHECK(filter.judge(number, 8));
    CHECK(filter.stepped(8));
}

TEST_CASE("majority_filter: lies that agree among themselves, in between the truth, are no step") {
    MajorityFilter<Counting> filter{Counting{}};
    filter.judge(1, 0);
    for (int i = 2; i < 40; i += 2) {
        CHECK(filter.judge(100 + i, 10ULL * i));
        CHECK(filter.judge(101 + i, 10ULL * i));
        CHECK_FALSE(filter.stepped(10ULL * i));
        CHECK_FALSE(filter.judge(i, 0));
        CHECK_FALSE(filter.judge(i + 1, 0));
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
    MajorityFilter<Positive> filter{Positive{}, GENERATE(1, 3)};
    CHECK(filter.judge(-5, 0));
    CHECK_FALSE(filter.judge(1, 0));
}

TEST_CASE("majority_filter: what arrival contradicts is never believed, but may be of a step") {
    MajorityFilter<Counting> filter{Counting{}};
    const Implausibility late{EventReason::implausible_time, 0, 0};
    CHECK(filter.judge(50, 0, late));
    CHECK_FALSE(filter.judge(1, 0));
    CHECK(filter.judge(2, 0, late));
    CHECK_FALSE(filter.judge(2, 0));
    for (const int number : {60, 61, 62}) CHECK(filter.judge(number, 0, late));
    CHECK(filter.stepped(4));
}

TEST_CASE(
    "majority_filter: three in a row that agree are a step, once the clock was compared again") {
    MajorityFilter<Counting> filter{Counting{}};
    filter.judge(1, 10);
    for (const int number : {50, 51, 52}) CHECK(filter.judge(number, 10));
    CHECK_FALSE(filter.stepped(13));
    CHECK(filter.stepped(14));
    filter.adopt(52);
    CHECK_FALSE(filter.judge(53, 13));
    CHECK_FALSE(filter.stepped(99));
}

TEST_CASE("majority_filter: accidents that do not agree, or not in a row, are no step") {
    MajorityFilter<Counting> filter{Counting{}};
    filter.judge(1, 0);
    for (const int number : {50, 60, 70, 80}) CHECK(filter.judge(number, 0));
    CHECK_FALSE(filter.stepped(9));
    for (const int number : {50, 51}) CHECK(filter.judge(number, 0));
    CHECK_FALSE(filter.judge(2, 0));
    CHECK(filter.judge(52, 0));
    CHECK_FALSE(filter.stepped(9));
}

// SPDX-License-Identifier: BSD-3-Clause
#include "announcements.hpp"

#include <catch2/catch.hpp>

using namespace versavis::firmware;

namespace {

/// With one announcement for each of these triggers: of as many milliseconds.
Announcements announced(std::initializer_list<std::uint64_t> triggers) {
    Announcements announcements;
    for (const std::uint64_t trigger : triggers)
        announcements.add({trigger, static_cast<Nanoseconds>(trigger), false});
    return announcements;
}

/// That applies to a trigger; 0: none.
Nanoseconds announced_exposure(const Announcements& announcements, std::uint64_t trigger) {
    const Announcement* found = announcements.find(trigger);
    return found == nullptr ? 0 : found->exposure;
}

}  // namespace

TEST_CASE("announcements: each holds from its trigger on, until the next one does") {
    const Announcements some = announced({10, 20});
    CHECK(some.find(9) == nullptr);
    CHECK(announced_exposure(some, 10) == 10);
    CHECK(announced_exposure(some, 19) == 10);
    CHECK(announced_exposure(some, 20) == 20);
    CHECK(announced_exposure(some, 1'000) == 20);
    CHECK(announced({}).find(1'000) == nullptr);
}

TEST_CASE("announcements: a new one replaces those of its trigger and of later ones") {
    Announcements some = announced({10, 20, 30});
    some.add({20, 7, true});
    CHECK(announced_exposure(some, 19) == 10);
    CHECK(announced_exposure(some, 20) == 7);
    CHECK(announced_exposure(some, 30) == 7);
    CHECK(some.find(30)->clipped);
    CHECK_FALSE(some.find(19)->clipped);
    some.add({1, 8, false});
    CHECK(announced_exposure(some, 1) == 8);
    CHECK(announced_exposure(some, 30) == 8);
}

TEST_CASE("announcements: one that is repeated takes the room of one") {
    const Announcements some = announced({1, 1, 2, 2, 3, 4, 5, 6, 7});
    CHECK(announced_exposure(some, 6) == 6);
    CHECK(announced_exposure(some, 7) == 7);
}

TEST_CASE("announcements: a used one is gone, with those before it, and later ones remain") {
    Announcements some = announced({10, 20, 30});
    some.used(9);
    CHECK(announced_exposure(some, 10) == 10);
    some.used(20);
    CHECK(some.find(29) == nullptr);
    CHECK(announced_exposure(some, 30) == 30);
    some.used(30);
    CHECK(some.find(1'000) == nullptr);
    some.used(30);
    some.add({40, 40, false});
    CHECK(announced_exposure(some, 40) == 40);
}

TEST_CASE("announcements: of nine, the last but one is dropped") {
    Announcements some = announced({1, 2, 3, 4, 5, 6, 7, 8});
    CHECK(announced_exposure(some, 8) == 8);
    some.add({9, 9, false});
    CHECK(announced_exposure(some, 7) == 7);
    CHECK(announced_exposure(some, 8) == 7);
    CHECK(announced_exposure(some, 9) == 9);
    for (std::uint64_t trigger = 1; trigger < 10; ++trigger) {
        CHECK(announced_exposure(some, trigger) ==
              static_cast<Nanoseconds>(trigger == 8 ? 7 : trigger));
        if (trigger != 7) some.used(trigger);
    }
}

TEST_CASE("announcements: cleared, nothing is announced") {
    Announcements some = announced({1, 2});
    some.clear();
    CHECK(some.find(1'000) == nullptr);
}

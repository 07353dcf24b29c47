// SPDX-License-Identifier: BSD-3-Clause
#include "client/deadline.hpp"

#include <catch2/catch.hpp>
#include <cstdint>

using namespace versavis;

TEST_CASE("deadline: any time to wait has an end, and the past is now") {
    for (const Duration timeout : {seconds(100), Duration{}, seconds(-100), Duration{INT64_MIN}}) {
        const HostTime before = host_now();
        const HostTime deadline = deadline_after(timeout);
        const Duration real = timeout < Duration{} ? Duration{} : timeout;
        CHECK(deadline >= before + real);
        CHECK(deadline <= host_now() + real);
    }
    CHECK(deadline_after(Duration{INT64_MAX}).ns == INT64_MAX);
}

TEST_CASE("deadline: what is left of it is never less than nothing") {
    const HostTime later = host_now() + seconds(1000);
    CHECK(left_until(later) > seconds(500));
    CHECK(left_until(later) <= seconds(1000));
    CHECK_FALSE(is_over(later));
    CHECK_FALSE(is_over(HostTime{INT64_MAX}));
    const HostTime past = host_now() - seconds(1000);
    CHECK(left_until(past) == Duration{});
    CHECK(is_over(past));
    CHECK(is_over(deadline_after({})));
}

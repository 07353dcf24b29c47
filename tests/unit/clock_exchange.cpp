// SPDX-License-Identifier: BSD-3-Clause
#include "board/clock_exchange.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

struct ExchangeBench : test::Pipelines {
    ExchangeBench() { exchange.begin(); }

    /// An answer to `request` that took `trip` there and back, of which nothing on the board.
    void answer(const wire::ClockRequest& request, Duration trip) {
        const HostTime now = host_now();
        exchange.take(wire::ClockAnswer{request.id, 0, now.ns, now.ns}, now + trip);
    }
    std::uint64_t exchanges() { return translator.report().exchanges; }

    ClockRecorder recorder{writer({"clock", ring::StreamKind::clock, 64}), translator};
    ClockExchange exchange{10, translator, recorder};
};

}  // namespace

TEST_CASE("clock_exchange: an answer counts when its follow-up came, or with the next request") {
    ExchangeBench bench;
    bench.answer(bench.exchange.request(), milliseconds(1));
    CHECK(bench.exchange.answers() == 1);
    CHECK(bench.exchange.expects_follow_up());
    CHECK(bench.exchanges() == 0);
    const auto second = bench.exchange.request();
    CHECK(bench.exchanges() == 1);
    bench.answer(second, milliseconds(1));
    bench.exchange.take(wire::ClockFollowUp{second.id, 0, host_now().ns});
    CHECK_FALSE(bench.exchange.expects_follow_up());
    CHECK(bench.exchanges() == 2);
}

TEST_CASE("clock_exchange: answers that are late, of no request or repeated are ignored") {
    ExchangeBench bench;
    const auto first = bench.exchange.request();
    bench.answer(first, milliseconds(501));
    wire::ClockRequest unasked{};
    unasked.id = first.id + 1;
    bench.answer(unasked, milliseconds(1));
    CHECK(bench.exchange.answers() == 0);
    const auto third = bench.exchange.request();
    bench.answer(third, milliseconds(1));
    bench.answer(third, milliseconds(1));
    CHECK(bench.exchange.answers() == 1);
    static_cast<void>(bench.exchange.request());
    CHECK(bench.exchanges() == 1);
}

TEST_CASE("clock_exchange: a link that holds several requests loses no answer") {
    ExchangeBench bench;
    const auto first = bench.exchange.request();
    const auto second = bench.exchange.request();
    const auto third = bench.exchange.request();
    bench.answer(first, milliseconds(200));
    bench.answer(second, milliseconds(200));
    bench.exchange.take(wire::ClockFollowUp{first.id, 0, host_now().ns});  // too late
    CHECK(bench.exchange.expects_follow_up());
    bench.exchange.take(wire::ClockFollowUp{second.id, 0, host_now().ns});
    CHECK_FALSE(bench.exchange.expects_follow_up());
    CHECK(bench.exchange.answers() == 2);
    CHECK(bench.exchanges() == 2);
    bench.exchange.begin();
    bench.answer(third, milliseconds(200));  // of the conversation before
    CHECK(bench.exchange.answers() == 0);
}

TEST_CASE("clock_exchange: an answer that overtakes another makes that one void") {
    ExchangeBench bench;
    const auto first = bench.exchange.request();
    const auto second = bench.exchange.request();
    bench.answer(second, milliseconds(1));
    bench.answer(first, milliseconds(2));
    CHECK(bench.exchange.answers() == 1);
}

TEST_CASE("clock_exchange: an answer cannot have left before it was written") {
    ExchangeBench bench;
    const auto request = bench.exchange.request();
    bench.answer(request, milliseconds(1));
    bench.exchange.take(wire::ClockFollowUp{request.id, 0, 1});
    CHECK(bench.exchange.expects_follow_up());
    CHECK(bench.exchanges() == 0);
}

TEST_CASE("clock_exchange: a sample is used for the clock only if it says when it left") {
    ExchangeBench bench;
    wire::ImuSample sample{};
    sample.time_ns = ExchangeBench::to_board(host_now()).ns;
    bench.exchange.take(sample, host_now());
    auto reader = bench.reader("clock");
    CHECK(reader.head() == 0);
    sample.departure_ns = 1000;
    bench.exchange.take(sample, host_now());
    CHECK(reader.head() > 0);
}

TEST_CASE("clock_exchange: requests come at the interval, a quarter more or less") {
    ExchangeBench bench;
    for (int i = 0; i < 100; ++i) {
        const HostTime before = host_now();
        static_cast<void>(bench.exchange.request());
        CHECK(bench.exchange.next_request() >= before + milliseconds(75));
        CHECK(bench.exchange.next_request() <= host_now() + milliseconds(125));
    }
}

TEST_CASE("clock_exchange: what contradicts causality is doubted and not used") {
    ExchangeBench bench;
    const auto request = bench.exchange.request();
    const HostTime now = host_now();
    const auto times = GENERATE(std::pair<std::int64_t, std::int64_t>{1000, 999},  // left too early
                                std::pair<std::int64_t, std::int64_t>{1000, 1000 + 40'000'000},
                                std::pair<std::int64_t, std::int64_t>{1000, 1LL << 60});
    const wire::ClockAnswer answer{request.id, 0, times.first, times.second};
    CHECK(bench.exchange.take(answer, now + milliseconds(20)));
    CHECK(bench.exchange.answers() == 1);
    static_cast<void>(bench.exchange.request());
    CHECK(bench.exchanges() == 0);
}

TEST_CASE("clock_exchange: a follow-up that cannot be true leaves the answer as it was") {
    ExchangeBench bench;
    const auto request = bench.exchange.request();
    const HostTime now = host_now();
    CHECK_FALSE(
        bench.exchange.take(wire::ClockAnswer{request.id, 0, 1000, 2000}, now + milliseconds(20)));
    const std::int64_t sent_ns = GENERATE(1000LL, 60'000'000LL, 1LL << 60);
    CHECK(bench.exchange.take(wire::ClockFollowUp{request.id, 0, sent_ns}));
    static_cast<void>(bench.exchange.request());
    CHECK(bench.exchanges() == 1);
}

// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_replay.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

#include "../support/temporary_directory.hpp"

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;
using clock::ClockState;
using test::content_of;

namespace {

constexpr std::int64_t lowest_ns = std::numeric_limits<std::int64_t>::min();
constexpr std::int64_t highest_ns = std::numeric_limits<std::int64_t>::max();

/// Exchanges at 10 Hz with a board that runs 20 ppm fast; delays 0.1 to 0.6 ms.
std::vector<clock::Exchange> exchanges(std::size_t count, bool board_begins = false) {
    std::mt19937_64 random(7);
    std::uniform_int_distribution<std::int64_t> delay(100'000, 600'000);
    const auto board = [](std::int64_t host) {
        return BoardTime{host - 5'000'000'000 + host / 50'000};
    };
    std::vector<clock::Exchange> all;
    for (std::size_t i = 0; i < count; ++i) {
        const std::int64_t t = 10'000'000'000 + static_cast<std::int64_t>(i) * 100'000'000;
        const std::int64_t out = t + delay(random);
        if (board_begins)
            all.push_back({{t}, board(out), board(t - delay(random)), {t}});
        else
            all.push_back({{t}, board(out), board(out + 20'000), {out + 20'000 + delay(random)}});
    }
    return all;
}

double error_us(const clock::HostEstimate& estimate, std::int64_t host_ns) {
    return std::abs(static_cast<double>(estimate.time.ns - host_ns)) * 1e-3;
}

std::vector<TimedMessage> timed(const std::vector<clock::Exchange>& all) {
    std::vector<TimedMessage> messages;
    for (const clock::Exchange& e : all) messages.push_back({e.arrived, e});
    return messages;
}

/// Queries at random instants, in no order, some of them about the past or the future.
std::vector<ClockQuery> random_queries(std::size_t count) {
    std::mt19937_64 random(9);
    std::uniform_int_distribution<std::int64_t> at(9'000'000'000, 41'000'000'000);
    std::uniform_int_distribution<std::int64_t> off(-3'000'000'000, 3'000'000'000);
    std::vector<ClockQuery> queries;
    for (std::size_t i = 0; i < count; ++i) {
        const std::int64_t t = at(random);
        queries.push_back({{t}, {t - 5'000'000'000 + off(random)}});
    }
    return queries;
}

ClockAnswers answers(const std::vector<TimedMessage>& messages,
                     const std::vector<ClockQuery>& queries, EstimatorKind kind) {
    return replayed_answers(messages, queries, *make_estimator(kind));
}

bool same(const clock::HostEstimate& a, const clock::HostEstimate& b) {
    return a.time == b.time && a.sigma == b.sigma && a.state == b.state;
}

std::string csv(const std::vector<clock::Exchange>& all) {
    std::ostringstream out;
    out << "h1_ns,m2_ns,m3_ns,h4_ns\n";
    for (const clock::Exchange& e : all)
        out << e.sent.ns << ',' << e.received.ns << ',' << e.answered.ns << ',' << e.arrived.ns
            << '\n';
    return out.str();
}

std::size_t files_in(const test::TemporaryDirectory& directory) {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(directory.path()), {}));
}

const std::vector<EstimatorKind> every_kind{EstimatorKind::envelope, EstimatorKind::ekf,
                                            EstimatorKind::ekf_fair};

}  // namespace

TEST_CASE("clock_replay: later messages change no earlier answer") {
    const auto kind = GENERATE(from_range(every_kind));
    const auto all = timed(exchanges(300));
    const auto queries = random_queries(200);
    const auto with_all = answers(all, queries, kind);
    for (const std::size_t count : {0U, 1U, 2U, 50U, 299U}) {
        const std::vector<TimedMessage> some(all.begin(),
                                             all.begin() + static_cast<std::ptrdiff_t>(count));
        const auto with_some = answers(some, queries, kind);
        std::size_t compared = 0;
        for (std::size_t i = 0; i < queries.size(); ++i)
            if (queries[i].available < all[count].available) {
                CHECK(same(with_some[i], with_all[i]));
                ++compared;
            }
        CHECK(compared > 0);
    }
}

TEST_CASE("clock_replay: answers are in the order of the queries") {
    const auto messages = timed(exchanges(300));
    auto queries = random_queries(100);
    const auto unsorted = answers(messages, queries, EstimatorKind::envelope);
    for (std::size_t i = 0; i < queries.size(); ++i) {
        const auto alone = answers(messages, {queries[i]}, EstimatorKind::envelope);
        CHECK(same(unsorted[i], alone[0]));
    }
}

TEST_CASE("clock_replay: a message is used from the instant on at which it is available") {
    const auto all = timed(exchanges(1));
    const HostTime at = all[0].available;
    const BoardTime board{5'000'000'000};
    const auto answer =
        answers(all, {{at - nanoseconds(1), board}, {at, board}}, EstimatorKind::envelope);
    CHECK(answer[0].state == ClockState::init);
    CHECK(answer[1].state == ClockState::converging);
}

TEST_CASE("clock_replay: exchanges that the board began are as good") {
    const test::TemporaryDirectory directory;
    const auto kind = GENERATE(EstimatorKind::envelope, EstimatorKind::ekf_fair);
    const auto all = exchanges(300, true);
    CHECK(all[0].received > all[0].answered);
    const auto recording = read_clock_recording(directory.write("x.csv", csv(all)), "");
    REQUIRE(recording);
    CHECK(recording->messages.size() == 300);
    const std::int64_t host = 40'000'000'000;
    const BoardTime board{host - 5'000'000'000 + host / 50'000};
    CHECK(error_us(answers(recording->messages, {{{host}, board}}, kind)[0], host) < 200);
}

TEST_CASE(
    "clock_replay: messages are fed as they became available, exchanges before one-way ones") {
    const test::TemporaryDirectory directory;
    const std::string x = directory.write(
        "x.csv", "available_ns,h4_ns,m3_ns,m2_ns,h1_ns\n300,110,57,53,100\n200,130,77,73,120\n");
    const std::string y = directory.write("y.csv", "h_ns,m_ns\n200,150\n100,50\n300,250\n");
    const auto recording = read_clock_recording(x, y);
    REQUIRE(recording);
    REQUIRE(recording->messages.size() == 5);
    std::string order;
    for (const TimedMessage& m : recording->messages)
        order += std::holds_alternative<clock::Exchange>(m.message) ? 'x' : 'y';
    CHECK(order == "yxyxy");
    CHECK(std::get<clock::Exchange>(recording->messages[1].message).sent == HostTime{120});
    CHECK(std::get<clock::Exchange>(recording->messages[3].message).received == BoardTime{53});
    CHECK(std::get<clock::OneWay>(recording->messages[0].message).sent == BoardTime{50});
}

TEST_CASE("clock_replay: absurd stamps are left out, and absurd questions not answered") {
    const test::TemporaryDirectory directory;
    auto all = exchanges(50);
    for (const std::int64_t bad : {lowest_ns, highest_ns}) {
        all.push_back({{bad}, {bad}, {bad}, {bad}});
        all.push_back({{0}, {bad}, {0}, {1}});
    }
    const auto recording = read_clock_recording(directory.write("x.csv", csv(all)), "");
    REQUIRE(recording);
    CHECK(recording->ignored == 4);
    CHECK(recording->messages.size() == 50);
    const auto answer = answers(recording->messages,
                                {{{highest_ns}, {lowest_ns}},
                                 {{highest_ns}, {highest_ns}},
                                 {{highest_ns}, {9'000'000'000}},
                                 {{lowest_ns}, {0}}},
                                GENERATE(from_range(every_kind)));
    CHECK(answer[0].state == ClockState::init);
    CHECK(answer[1].state == ClockState::init);
    CHECK(answer[2].state != ClockState::init);
    CHECK(answer[3].state == ClockState::init);
}

TEST_CASE("clock_replay: stamps that go back and forth do not stop it") {
    auto all = exchanges(200);
    std::shuffle(all.begin(), all.end(), std::mt19937_64(3));
    for (std::size_t i = 0; i < all.size(); i += 7) std::swap(all[i].sent, all[i].arrived);
    const auto queries = random_queries(50);
    CHECK(answers(timed(all), queries, GENERATE(from_range(every_kind))).size() == 50);
}

TEST_CASE("clock_replay: the file of answers is whole or not there") {
    const test::TemporaryDirectory directory;
    ClockReplaySettings settings;
    settings.exchanges = directory.write("x.csv", csv(exchanges(20)));
    settings.queries = directory.write("q.csv", "available_ns,board_ns\n20000000000,7\n0,8\n");
    settings.out = (directory.path() / "r.csv").string();
    const auto done = replay_clock(settings);
    REQUIRE(done);
    CHECK(done->answers == 2);
    CHECK(done->unanswered == 1);
    CHECK_THAT(content_of(settings.out), Catch::StartsWith("board_ns,host_ns,sigma_ns,state\n7,") &&
                                             Catch::EndsWith("\n8,0,9223372036854775807,init\n"));
    CHECK(files_in(directory) == 3);

    const std::string before = content_of(settings.out);
    directory.write("q.csv", "available_ns,board_ns\n1,x\n");
    REQUIRE_FALSE(replay_clock(settings));
    CHECK(content_of(settings.out) == before);
    CHECK(files_in(directory) == 3);
}

TEST_CASE("clock_replay: what cannot be done is said") {
    const test::TemporaryDirectory directory;
    ClockReplaySettings settings;
    settings.exchanges = directory.write("x.csv", csv(exchanges(20)));
    settings.queries = directory.write("q.csv", "available_ns,board_ns\n");
    settings.out = (directory.path() / "r.csv").string();
    const auto message = [&] {
        const auto done = replay_clock(settings);
        REQUIRE_FALSE(done);
        return done.error().message();
    };
    SECTION("no exchanges") {
        settings.exchanges = directory.write("empty.csv", "h1_ns,m2_ns,m3_ns,h4_ns\n");
        CHECK_THAT(message(), Contains("empty.csv: contains no exchanges"));
    }
    SECTION("the output is an input") {
        settings.out = settings.queries;
        CHECK_THAT(message(), Contains("would be overwritten"));
    }
    SECTION("nowhere to write") {
        settings.out = "/nowhere/r.csv";
        CHECK_THAT(message(), Contains("/nowhere/r.csv: cannot be written"));
    }
    SECTION("smoothing by a filter that has none") {
        settings.smoothed = true;
        settings.estimator = EstimatorKind::ekf;
        CHECK_THAT(message(), Contains("--smoothed"));
    }
    SECTION("no questions are no error") {
        CHECK(replay_clock(settings)->answers == 0);
        CHECK(content_of(settings.out) == "board_ns,host_ns,sigma_ns,state\n");
    }
}

// SPDX-License-Identifier: BSD-3-Clause
#include "explorer.hpp"

#include <catch2/catch.hpp>
#include <set>

using namespace versavis::model;

namespace {

using Outcomes = std::set<std::vector<int>>;

/// What the two last threads may have in their first two registers at the end.
Outcomes outcomes(const Model& model) {
    Outcomes found;
    const Result result = explore(model, [&found](const State& state) {
        std::vector<int> outcome;
        for (std::size_t i = state.thread_count - 2U; i < state.thread_count; ++i)
            for (std::size_t j = 0; j < 2; ++j) outcome.push_back(state.threads[i].registers[j]);
        found.insert(outcome);
    });
    REQUIRE(result.holds());
    return found;
}

/// The newest values of the two first locations at the end.
Outcomes memories(const Model& model) {
    Outcomes found;
    REQUIRE(explore(model, [&found](const State& state) {
                found.insert({state.newest(0), state.newest(1)});
            }).holds());
    return found;
}

Program thread(const char* name) { return Program(name); }

Outcomes message_passing(Order out, Order in) {
    Model model;
    const int data = model.place("data");
    const int flag = model.place("flag");
    model.run(thread("a").store(data, 1, relaxed).store(flag, 1, out));
    model.run(thread("b").load(0, flag, in).load(1, data, relaxed));
    return outcomes(model);
}

Outcomes message_passing_by_fences(bool out, bool in) {
    Model model;
    const int data = model.place("data");
    const int flag = model.place("flag");
    auto a = thread("a").store(data, 1, relaxed);
    if (out) a.fence(release);
    auto b = thread("b").load(0, flag, relaxed);
    if (in) b.fence(acquire);
    model.run(a.store(flag, 1, relaxed));
    model.run(b.load(1, data, relaxed));
    return outcomes(model);
}

const std::vector<int> stale{0, 0, 1, 0};

Outcomes release_sequence(bool by_addition) {
    Model model;
    const int data = model.place("data");
    const int flag = model.place("flag");
    model.run(thread("a").store(data, 1, relaxed).store(flag, 1, release));
    auto other = thread("b")
                     .label("again")
                     .load(0, flag, relaxed)
                     .go_if([](const Registers& r) { return r[0] == 0; }, "again");
    if (by_addition)
        other.add(flag, 1, relaxed);
    else
        other.store(flag, 2, relaxed);
    model.run(other.set(0, 0));
    model.run(thread("c").load(0, flag, acquire).load(1, data, relaxed));
    return outcomes(model);
}

/// One sleeps unless the word is set; the other sets it and wakes.
Result sleeper(bool set_first) {
    Model model;
    const int word = model.place("word");
    model.run(thread("sleeper")
                  .label("again")
                  .load(0, word, acquire)
                  .go_if([](const Registers& r) { return r[0] != 0; }, "done")
                  .wait(word, 0)
                  .go("again")
                  .label("done"));
    auto waker = thread("waker");
    if (set_first)
        waker.store(word, 1, release).wake(word, 1, 0);
    else
        waker.wake(word, 1, 0).store(word, 1, release);
    model.run(waker);
    return explore(model);
}

}  // namespace

TEST_CASE("model: a message passes by release and acquire, and by nothing less") {
    CHECK(message_passing(release, acquire).count(stale) == 0);
    CHECK(message_passing(relaxed, acquire).count(stale) == 1);
    CHECK(message_passing(release, relaxed).count(stale) == 1);
    CHECK(message_passing(release, acquire).size() == 3);
}

TEST_CASE("model: a message passes by two fences, and not by one") {
    CHECK(message_passing_by_fences(true, true).count(stale) == 0);
    CHECK(message_passing_by_fences(false, true).count(stale) == 1);
    CHECK(message_passing_by_fences(true, false).count(stale) == 1);
}

TEST_CASE("model: stores are buffered, release and acquire or not") {
    Model model;
    const int x = model.place("x");
    const int y = model.place("y");
    model.run(thread("a").store(x, 1, release).load(0, y, acquire));
    model.run(thread("b").store(y, 1, release).load(0, x, acquire));
    CHECK(outcomes(model) == Outcomes{{0, 0, 0, 0}, {0, 0, 1, 0}, {1, 0, 0, 0}, {1, 0, 1, 0}});
}

TEST_CASE("model: no load reads what is written because of it") {
    Model model;
    const int x = model.place("x");
    const int y = model.place("y");
    model.run(thread("a").load(0, x, relaxed).store(y, 1, relaxed));
    model.run(thread("b").load(0, y, relaxed).store(x, 1, relaxed));
    CHECK(outcomes(model) == Outcomes{{0, 0, 0, 0}, {0, 0, 1, 0}, {1, 0, 0, 0}});
}

TEST_CASE("model: reads of one location do not go back") {
    Model model;
    const int x = model.place("x");
    model.run(thread("a").store(x, 1, relaxed).store(x, 2, relaxed));
    model.run(thread("b").load(0, x, relaxed).load(1, x, relaxed));
    CHECK(outcomes(model) ==
          Outcomes{
              {0, 0, 0, 0}, {0, 0, 0, 1}, {0, 0, 0, 2}, {0, 0, 1, 1}, {0, 0, 1, 2}, {0, 0, 2, 2}});
}

TEST_CASE("model: two readers agree on the order of one location's writes") {
    Model model;
    const int x = model.place("x");
    model.run(thread("a").store(x, 1, relaxed));
    model.run(thread("b").store(x, 2, relaxed));
    model.run(thread("c").load(0, x, relaxed).load(1, x, relaxed));
    model.run(thread("d").load(0, x, relaxed).load(1, x, relaxed));
    const Outcomes found = outcomes(model);
    CHECK(found.count({1, 2, 1, 2}) == 1);
    CHECK(found.count({1, 2, 2, 1}) == 0);
}

TEST_CASE("model: independent reads of independent writes may disagree") {
    Model model;
    const int x = model.place("x");
    const int y = model.place("y");
    model.run(thread("a").store(x, 1, release));
    model.run(thread("b").store(y, 1, release));
    model.run(thread("c").load(0, x, acquire).load(1, y, acquire));
    model.run(thread("d").load(0, y, acquire).load(1, x, acquire));
    CHECK(outcomes(model).count({1, 0, 1, 0}) == 1);
}

TEST_CASE("model: a write may go before one that was made earlier (2+2W)") {
    Model model;
    const int x = model.place("x");
    const int y = model.place("y");
    model.run(thread("a").store(x, 1, release).store(y, 2, release));
    model.run(thread("b").store(y, 1, release).store(x, 2, release));
    CHECK(memories(model) == Outcomes{{1, 1}, {1, 2}, {2, 1}, {2, 2}});
}

TEST_CASE("model: an addition goes on with a release sequence, a store ends it") {
    CHECK(release_sequence(true).count({0, 0, 2, 0}) == 0);
    CHECK(release_sequence(false).count({0, 0, 2, 0}) == 1);
}

TEST_CASE("model: no addition is lost, and no write comes between its halves") {
    Model model;
    const int x = model.place("x");
    model.place("unused");
    model.run(thread("a").add(x, 1, relaxed));
    model.run(thread("b").add(x, 1, relaxed));
    model.run(thread("c").store(x, 5, relaxed));
    CHECK(memories(model) == Outcomes{{5, 0}, {6, 0}, {7, 0}});
}

TEST_CASE("model: a wake-up after the store is not lost, one before it is") {
    CHECK(sleeper(true).holds());
    const Result lost = sleeper(false);
    CHECK(lost.violation == "sleeper sleeps, and nobody will wake it");
    CHECK(lost.trace.size() == 4);
}

TEST_CASE("model: a system call does not order other words") {
    Model model;
    const int data = model.place("data");
    const int word = model.place("word");
    model.run(thread("a").store(data, 1, relaxed).store(word, 1, relaxed).wake(word, 1, 0));
    model.run(thread("b").wait(word, 0).load(0, word, relaxed).load(1, data, relaxed));
    CHECK(outcomes(model).count({0, 0, 1, 0}) == 1);
}

TEST_CASE("model: some of the sleepers are woken, any of them") {
    Model model;
    const int word = model.place("word");
    model.run(thread("a").wait(word, 0).set(0, 1));
    model.run(thread("b").wait(word, 0).set(0, 1));
    model.run(thread("c").wake(word, 1, 0).wake(word, 1, 1).store(word, 1, relaxed));
    CHECK_FALSE(explore(model).holds());
}

TEST_CASE("model: between lock and unlock nobody else is, and what was written there is seen") {
    const auto ends = [](bool locked) {
        Model model;
        const int mutex = model.object("mutex");
        const int count = model.place("count");
        for (const char* name : {"a", "b"}) {
            auto adder = thread(name);
            if (locked) adder.lock(mutex);
            adder.load(0, count, relaxed)
                .store(
                    count, [](const Registers& r) { return r[0] + 1; }, relaxed)
                .set(0, 0);
            if (locked) adder.unlock(mutex);
            model.run(adder);
        }
        std::set<int> counts;
        REQUIRE(
            explore(model, [&](const State& state) { counts.insert(state.newest(1)); }).holds());
        return counts;
    };
    CHECK(ends(true) == std::set<int>{2});
    CHECK(ends(false) == std::set<int>{1, 2});
}

TEST_CASE("model: a mutex that is not given back is found") {
    Model model;
    const int mutex = model.object("mutex");
    model.run(thread("a").lock(mutex));
    model.run(thread("b").lock(mutex).unlock(mutex));
    const Result result = explore(model);
    CHECK_FALSE(result.holds());
    CHECK(result.violation == "b waits for what never comes");
}

TEST_CASE("model: who sleeps on two words is woken by either, and by no third") {
    const auto wakes = [](int which) {
        Model model;
        const std::vector<int> words{model.place("x"), model.place("y"), model.place("z")};
        model.run(thread("sleeper").wait_any({{words[0], 0}, {words[1], 0}}));
        model.run(thread("waker")
                      .add(words[static_cast<std::size_t>(which)], 1, release)
                      .wake(words[static_cast<std::size_t>(which)], 1, 0));
        return explore(model).holds();
    };
    CHECK(wakes(0));
    CHECK(wakes(1));
    CHECK_FALSE(wakes(2));
}

TEST_CASE("model: a killed thread goes on elsewhere, from any of its steps") {
    Model model;
    const int x = model.place("x");
    model.place("unused");
    model.run(thread("a")
                  .label("begin")
                  .store(x, 1, relaxed)
                  .store(x, 2, relaxed)
                  .label("end")
                  .go("out")
                  .label("killed")
                  .set(0, 1)
                  .label("out")
                  .mortal("begin", "end", "killed"));
    CHECK(memories(model) == Outcomes{{0, 0}, {1, 0}, {2, 0}});
}

TEST_CASE("model: a thread may wait for ever only where it may rest") {
    for (const bool may : {false, true}) {
        Model model;
        const int word = model.place("word");
        auto sleeper = thread("a").wait(word, 0);
        if (may) sleeper.may_rest([](const State&, const Registers&) { return true; });
        model.run(sleeper);
        CHECK(explore(model).holds() == may);
    }
}

TEST_CASE("model: a loop that cannot be left is found") {
    Model model;
    const int x = model.place("x");
    model.run(thread("a").label("again").load(0, x, relaxed).go("again"));
    CHECK(explore(model).violation == "no good end can be reached");
}

TEST_CASE("model: the first trace is a shortest one") {
    Model model;
    const int x = model.place("x");
    model.run(thread("a").store(x, 1, relaxed).store(x, 2, relaxed).store(x, 3, relaxed));
    model.run(thread("b")
                  .load(0, x, relaxed)
                  .check([](const State&, const Registers& r) { return r[0] != 2; }, "two"));
    const Result result = explore(model);
    CHECK(result.violation == "two");
    CHECK(result.trace == std::vector<std::string>{"a stores x = 1 (relaxed)",
                                                   "a stores x = 2 (relaxed)",
                                                   "b loads x = 2 (relaxed)"});
}

TEST_CASE("model: a state survives being encoded") {
    State state = make_state({1, 2, 3}, 2);
    store(state, 0, 1, 1, 7, Order::release);
    update(state, 1, 1, 1, 8, Order::both);
    fence(state, 1, Order::both);
    const std::string code = encode(state);
    CHECK(encode(decode(code)) == code);
    CHECK(decode(code).newest(1) == 8);
}

// SPDX-License-Identifier: BSD-3-Clause
// A file descriptor for several streams: whoever sleeps in epoll misses no item, whatever the
// thread behind it does meanwhile. As client/watch.cpp, and WaitSet::wait() with a time-out of 0.
#include "models.hpp"

namespace versavis::model {

namespace {

constexpr int both_streams = 2;  // less: only the silent one

/// One stream that stays silent, and one with items, which the set gets to know later.
struct Words {
    int silent_wake;
    int head;
    int wake;
    int event;  ///< the descriptor: readable unless 0
    int mutex;
    int idle;  ///< and what the thread is armed with: under the mutex
    int streams;
    int silent_seen;
    int seen;
    int version;

    explicit Words(Model& model)
        : silent_wake(model.place("wake of the silent stream")),
          head(model.place("head")),
          wake(model.place("wake")),
          event(model.object("event", 1)),
          mutex(model.object("mutex")),
          idle(model.place("idle", 1)),
          streams(model.place("streams")),
          silent_seen(model.place("seen of the silent stream")),
          seen(model.place("seen")),
          version(model.place("version")) {}
};

enum : std::size_t { woken };

Program writer(const Words& words, int items) {
    Program program("writer");
    for (int number = 1; number <= items; ++number)
        program.store(words.head, number, release)
            .add(words.wake, 1, release)
            .wake(words.wake, everybody, woken)
            .set(woken, 0);
    return program;
}

/// Registers of the program that sleeps in epoll.
enum : std::size_t { value, known, next, silent_seen, seen, count };

/// As Watch::signal(): whoever writes to the descriptor wakes who polls it.
void signal(Program& program, const Words& words, std::size_t woken_here) {
    program.exchange(words.event, 1, both).wake(words.event, everybody, woken_here);
    program.set(woken_here, 0);
}

/// As Watch::arm().
void arm(Program& user, const Words& words, const Twist& twist) {
    user.lock(words.mutex)
        .store(
            words.streams, [](const Registers& r) { return r[known]; }, relaxed)
        .store(
            words.silent_seen, [](const Registers& r) { return r[silent_seen]; }, relaxed)
        .store(
            words.seen, [](const Registers& r) { return r[seen]; }, relaxed)
        .store(words.idle, 0, relaxed);
    if (!twist("arming does not change the version")) user.add(words.version, 1, both);
    user.unlock(words.mutex);
    if (!twist("arming does not wake who sleeps")) user.wake(words.version, everybody, count);
    user.set(count, 0);
}

void look(Program& user, const Words& words, const Twist& twist) {
    const auto read = [&] {
        user.load(silent_seen, words.silent_wake, acquire).load(seen, words.wake, acquire);
    };
    const bool late = twist("wake is read after the look");
    if (!late) read();
    user.go_if([](const Registers& r) { return r[known] < both_streams; }, "nothing")
        .load(value, words.head, acquire)
        .go_if([](const Registers& r) { return r[value] > r[next]; }, "found")
        .label("nothing");
    if (late) read();
}

/// Sleeps on the descriptor; once or twice other things wake it up, and it has one stream more.
Program user(const Words& words, const Twist& twist, int items) {
    Program program("user");
    const auto calm = [&] { program.exchange(words.event, 0, both); };
    const char* const when = "the descriptor is calmed after it is armed";
    program.choose(known, both_streams)
        .label("sleep")
        .set(value, 0)
        .set(seen, 0)
        .set(silent_seen, 0)
        .wait(words.event, 0,
              [](const State&, const Registers& r) { return r[known] < both_streams; })
        .go_if([](const Registers& r) { return r[known] == both_streams; }, "turn")
        .set(known, [](const Registers& r) { return r[known] + 1; })
        .label("turn");
    if (!twist(when)) calm();
    look(program, words, twist);
    arm(program, words, twist);
    if (twist(when)) calm();
    program.go("sleep").label("found").set(next, [](const Registers& r) { return r[next] + 1; });
    if (!twist("what is found does not signal")) signal(program, words, count);
    return program.go_if([items](const Registers& r) { return r[next] == items; }, "done")
        .go("sleep")
        .label("done");
}

/// Registers of the thread; `streams` is what it was armed with.
enum : std::size_t { loaded, version, streams, silent_known, known_wake };

/// What the thread watches beside the silent stream: that one again, if it was armed with no other.
int watched(const Words& words, const Registers& r) {
    return r[streams] == both_streams ? words.wake : words.silent_wake;
}

int seen_of_watched(const Registers& r) {
    return r[streams] == both_streams ? r[known_wake] : r[silent_known];
}

/// As Watch::keep().
void keep(Program& thread, const Words& words, const Twist& twist) {
    const auto other = [words](const Registers& r) { return watched(words, r); };
    const Order reading = twist.order("the thread reads wake relaxed", acquire);
    thread.label("keep").load(loaded, words.version, both);
    if (!twist("the thread does not look whether it is armed anew"))
        thread.go_if([](const Registers& r) { return r[loaded] != r[version]; }, "again");
    thread.load(loaded, words.silent_wake, reading)
        .go_if([](const Registers& r) { return r[loaded] != r[silent_known]; }, "stirred")
        .load(loaded, other, reading)
        .go_if([](const Registers& r) { return r[loaded] != seen_of_watched(r); }, "stirred");
    std::vector<Word> futexes{
        {words.silent_wake, [](const Registers& r) { return r[silent_known]; }},
        {other, seen_of_watched}};
    if (!twist("the thread does not sleep on the version"))
        futexes.push_back({words.version, [](const Registers& r) { return r[version]; }});
    thread.wait_any(futexes).go("keep");
}

/// As Watch::run().
Program thread(const Words& words, const Twist& twist) {
    Program thread("thread");
    const auto read_version = [&] { thread.load(version, words.version, both); };
    const bool late = twist("the version is read without the mutex");
    thread.may_rest([](const State&, const Registers&) { return true; })
        .label("again")
        .lock(words.mutex)
        .label("locked");
    if (!late) read_version();
    thread.load(loaded, words.idle, relaxed)
        .load(streams, words.streams, relaxed)
        .load(silent_known, words.silent_seen, relaxed)
        .load(known_wake, words.seen, relaxed)
        .unlock(words.mutex);
    if (late) read_version();
    thread.go_if([](const Registers& r) { return r[loaded] == 0; }, "keep")
        .wait(words.version, [](const Registers& r) { return r[version]; })
        .go("again");
    keep(thread, words, twist);
    thread.label("stirred").lock(words.mutex).load(loaded, words.version, both);
    if (!twist("the thread signals though it is armed anew"))
        thread.go_if([](const Registers& r) { return r[loaded] != r[version]; }, "locked");
    thread.store(words.idle, 1, relaxed);
    const bool after = twist("it signals without the mutex");
    const bool mute = twist("the thread does not signal");
    if (!after && !mute) signal(thread, words, loaded);
    if (!after) return thread.go("locked");
    thread.unlock(words.mutex);
    signal(thread, words, loaded);
    return thread.go("again");
}

Model watch(const Twist& twist, int items) {
    Model model;
    const Words words(model);
    model.run(writer(words, items));
    model.run(user(words, twist, items));
    model.run(thread(words, twist));
    return model;
}

}  // namespace

Collection watching() {
    constexpr auto breaks = Effect::breaks;
    constexpr auto none = Effect::none;
    return {{{"watch", "a descriptor for two streams, one of which comes later",
              [](const Twist& twist) { return watch(twist, 2); }}},
            {
                {"watch", "wake is read after the look", "SYNC 5", breaks},
                {"watch", "the descriptor is calmed after it is armed", "watch", breaks},
                {"watch", "what is found does not signal", "watch", breaks},
                {"watch", "the thread does not signal", "watch", breaks},
                {"watch", "arming does not change the version", "watch", breaks},
                {"watch", "arming does not wake who sleeps", "watch", breaks},
                {"watch", "the thread does not look whether it is armed anew", "watch", breaks},
                {"watch", "the thread does not sleep on the version", "watch", breaks},
                {"watch", "the version is read without the mutex", "watch", breaks},
                {"watch", "the thread reads wake relaxed", "watch", none},
                {"watch", "the thread signals though it is armed anew", "watch", none},
                {"watch", "it signals without the mutex", "watch", none},
            }};
}

}  // namespace versavis::model

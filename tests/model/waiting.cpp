// SPDX-License-Identifier: BSD-3-Clause
// Sleep, the end of a segment, its successor, and crowds: no reader sleeps over an item, and none
// is skipped. Items are light here, a sequence and nothing else: `publishing.cpp` has their words.
#include <algorithm>

#include "models.hpp"

namespace versavis::model {

namespace {

constexpr int state_live = 1;
constexpr int state_closed = 2;
constexpr int state_superseded = 3;
constexpr int complete(int number) { return 2 * number + 2; }

/// A segment; the words of a second one lie right behind those of the first.
struct Segment {
    int sequences = 0;
    int descriptors = 1;
    int head = 0;
    int wake = 0;
    int state = 0;
    int stride = 0;  ///< to the same word of the next segment
};

Segment add_segment(Model& model, const std::string& suffix, int descriptors) {
    Segment segment;
    segment.descriptors = descriptors;
    segment.sequences = model.place("sequence" + suffix);
    for (int i = 1; i < descriptors; ++i) model.place("next sequence" + suffix);
    segment.head = model.place("head" + suffix);
    segment.wake = model.place("wake" + suffix);
    segment.state = model.place("state" + suffix, state_live);
    segment.stride = segment.state + 1 - segment.sequences;
    return segment;
}

/// The writer's registers. `deaths` counts how often the service was killed.
enum : std::size_t { woken, deaths, choice };

void bump_and_wake(Program& writer, const Twist& twist, int wake) {
    const bool late = twist("FUTEX_WAKE before the word changes");
    if (late) writer.wake(wake, everybody, woken);
    if (!twist("the word does not change"))
        writer.add(wake, 1, twist.order("wake's add relaxed", release));
    if (!late && !twist("no FUTEX_WAKE")) writer.wake(wake, everybody, woken);
    writer.set(woken, 0);
}

/// As Writer::write_descriptor().
void publish(Program& writer, const Segment& to, const Twist& twist, int number) {
    const int sequence = to.sequences + number % to.descriptors;
    const bool early = twist("wake before the sequence");
    writer.store(sequence, complete(number) - 1, relaxed).fence(release);
    if (early) bump_and_wake(writer, twist, to.wake);
    writer.store(sequence, complete(number), release);
    const bool early_for_head = twist("wake before head");
    if (early_for_head) bump_and_wake(writer, twist, to.wake);
    writer.store(to.head, number + 1, release);
    if (!early && !early_for_head) bump_and_wake(writer, twist, to.wake);
}

void set_state(Program& writer, const Segment& of, const Twist& twist, int state) {
    writer.store(of.state, state, twist.order("state's store relaxed", release));
}

/// As end().
void close(Program& writer, const Segment& segment, const Twist& twist) {
    const bool late = twist("state after the wake");
    if (!late) set_state(writer, segment, twist, state_closed);
    if (!twist("no wake after the state")) bump_and_wake(writer, twist, segment.wake);
    if (late) set_state(writer, segment, twist, state_closed);
}

/// A reader's registers.
enum : std::size_t { next, seen, value, state, which, silent, name };

Value in_segment(int place, int stride) {
    return [place, stride](const Registers& r) { return place + stride * r[which]; };
}

/// Items of the reader's segment that it can ask for.
int published(const Segment& segment, Reading reading, const State& memory, const Registers& r) {
    const auto newest = [&](int place) {
        return memory.newest(static_cast<std::size_t>(place + segment.stride * r[which]));
    };
    if (reading == Reading::head) return newest(segment.head);
    int most = 0;
    for (int i = 0; i < segment.descriptors; ++i)
        most = std::max(most, newest(segment.sequences + i) / 2);
    return most;
}

/// It has read all there is, and the segment lives.
Test at_rest(const Segment& segment, Reading reading) {
    return [segment, reading](const State& memory, const Registers& r) {
        const auto place = static_cast<std::size_t>(segment.state + segment.stride * r[which]);
        return r[next] >= published(segment, reading, memory, r) &&
               memory.newest(place) == state_live;
    };
}

/// From here on the writer may have nothing more to say.
void pause(Program& writer) {
    writer.choose(choice, 2)
        .go_if([](const Registers& r) { return r[choice] == 0; }, "done")
        .set(choice, 0);
}

/// Goes to `found` if item `next` is there.
void look(Program& reader, const Segment& in, const Twist& twist, Reading reading) {
    if (reading == Reading::head) {
        reader.load(value, in_segment(in.head, in.stride),
                    twist.order("head's load relaxed", acquire));
        reader.go_if([](const Registers& r) { return r[value] > r[next]; }, "found");
        return;
    }
    const auto place = [in](const Registers& r) {
        return in.sequences + r[next] % in.descriptors + in.stride * r[which];
    };
    reader.load(value, place, twist.order("sequence's load relaxed", acquire));
    reader.go_if([](const Registers& r) { return r[value] >= complete(r[next]); }, "found");
}

void begin_turn(Program& reader, const Segment& in, const Twist& twist, Reading reading) {
    const auto wake = [&] {
        reader.load(seen, in_segment(in.wake, in.stride),
                    twist.order("wake's load relaxed", acquire));
    };
    reader.label("turn").set(value, 0).set(state, 0).set(silent, 0).set(name, 0).set(seen, 0);
    const bool late = twist("wake is read after the look");
    if (!late) wake();
    look(reader, in, twist, reading);
    if (late) wake();
}

/// As Reader::writer_seen(): a glance, and a second load only when it shows the end.
void look_at_state(Program& reader, const Segment& in, const Twist& twist) {
    const Value place = in_segment(in.state, in.stride);
    reader.load(state, place, relaxed)
        .go_if([](const Registers& r) { return r[state] == state_live; }, "lives")
        .load(state, place, twist.order("state's load relaxed", acquire))
        .go("ended")
        .label("lives");
}

/// What a reader that finds the segment ended does first.
void look_again(Program& reader, const Segment& in, const Twist& twist, Reading reading) {
    reader.label("ended").set(value, 0);
    if (!twist("no second look for an item")) look(reader, in, twist, reading);
    reader.check(
        [in, reading](const State& memory, const Registers& r) {
            return r[silent] != 0 || r[next] >= published(in, reading, memory, r);
        },
        "the service is called gone, though an item is unread");
}

void sleep(Program& reader, const Segment& in, const Test& may_time_out) {
    reader.label("sleep")
        .wait(
            in_segment(in.wake, in.stride), [](const Registers& r) { return r[seen]; },
            may_time_out)
        .go("turn");
}

/// Two items and the end, without any time-out.
Model sleep_and_end(const Twist& twist, Reading reading) {
    constexpr int items = 2;
    Model model;
    const Segment segment = add_segment(model, "", items);
    Program writer("writer");
    publish(writer, segment, twist, 0);
    pause(writer);
    if (twist("state before the last item")) set_state(writer, segment, twist, state_closed);
    publish(writer, segment, twist, 1);
    pause(writer);
    close(writer, segment, twist);
    writer.label("done");
    Program reader("reader");
    reader.may_rest(at_rest(segment, reading));
    begin_turn(reader, segment, twist, reading);
    look_at_state(reader, segment, twist);
    sleep(reader, segment, {});
    look_again(reader, segment, twist, reading);
    reader.end().label("found");
    reader.set(next, [](const Registers& r) { return r[next] + 1; }).go("turn");
    model.run(writer);
    model.run(reader);
    return model;
}

enum class Ending : std::uint8_t { superseded, closed, killed, stalled };

/// Two items in the first segment, then a second one with an item of its own.
struct Succession {
    Segment first;
    int name;   ///< which segment has the name: 1, 2 or, without a file, 0
    int death;  ///< of how many services the kernel says that they are no more
    Ending ending;
    Reading reading;

    Succession(Model& model, Ending how, Reading by) : ending(how), reading(by) {
        first = add_segment(model, "", 2);
        add_segment(model, " of the successor", 2);
        name = model.place("name", 1);
        death = model.place("death");
    }
    Segment second() const {
        Segment segment = first;
        for (int* place : {&segment.sequences, &segment.head, &segment.wake, &segment.state})
            *place += first.stride;
        return segment;
    }
};

/// As Writer::create() where an old file has the name.
void supersede(Program& writer, const Succession& all, const Twist& twist) {
    const auto rename = [&] { writer.exchange(all.name, 2, both); };
    const bool late = twist("state after the wake");
    const bool late_name = twist("wake before the new name");
    const bool name_first = twist("the new name before the state");
    if (name_first) rename();
    if (!late) set_state(writer, all.first, twist, state_superseded);
    if (!late_name && !name_first) rename();
    if (!twist("no wake after the new name")) bump_and_wake(writer, twist, all.first.wake);
    if (late_name) rename();
    if (late) set_state(writer, all.first, twist, state_superseded);
}

void die(Program& writer, const Succession& all, int count) {
    writer.store(all.death, count, release).set(deaths, count).set(woken, 0);
}

/// How the first service ends; after it, perhaps another one comes.
void end_first(Program& writer, const Succession& all, const Twist& twist) {
    if (all.ending == Ending::superseded || all.ending == Ending::stalled) return pause(writer);
    if (all.ending == Ending::closed) {
        close(writer, all.first, twist);
        writer.exchange(all.name, 0, both);
    } else {
        writer.label("killed");
        die(writer, all, 1);
    }
    writer.choose(choice, 2).go_if([](const Registers& r) { return r[choice] == 0; }, "done");
}

Program services(const Succession& all, const Twist& twist) {
    Program writer("service");
    writer.label("first");
    publish(writer, all.first, twist, 0);
    publish(writer, all.first, twist, 1);
    writer.label("first ends");
    end_first(writer, all, twist);
    writer.label("second").set(choice, 0);
    if (all.ending == Ending::closed)
        writer.exchange(all.name, 2, both);
    else
        supersede(writer, all, twist);
    if (all.ending != Ending::killed) pause(writer);
    publish(writer, all.second(), twist, 0);
    writer.label("second ends").go("done");
    if (all.ending == Ending::killed) {
        writer.label("killed again");
        die(writer, all, 2);
        writer.mortal("first", "first ends", "killed");
        writer.mortal("second", "second ends", "killed again");
    }
    return writer.label("done").set(choice, 0);
}

/// Whether the writer lives, as far as `state` does not show: as writer_lives().
void look_for_life(Program& reader, const Succession& all, const Twist& twist) {
    if (all.ending == Ending::killed && !twist("no look for a dead writer"))
        reader.load(value, all.death, acquire)
            .go_if([](const Registers& r) { return r[value] > r[which]; }, "ended");
    if (all.ending == Ending::stalled)
        reader.choose(silent, 2).go_if([](const Registers& r) { return r[silent]; }, "ended");
}

bool nobody_comes(const Succession& all, const State& memory, const Registers& r) {
    if (all.ending == Ending::superseded || all.ending == Ending::stalled) return false;
    const bool over = memory.threads[0].activity == Activity::ended;
    return over && (r[which] == 1 || memory.newest(static_cast<std::size_t>(all.name)) != 2);
}

/// As Reader::hand_over().
void hand_over(Program& reader, const Succession& all, const Twist& twist) {
    reader.set(value, 0)
        .load(name, all.name, acquire)
        .go_if([](const Registers& r) { return r[which] == 1 || r[name] != 2; }, "gone");
    if (!twist("no look at the old segment after the new one is found"))
        look(reader, all.first, twist, all.reading);
    reader
        .check(
            [all](const State& memory, const Registers& r) {
                return r[next] >= published(all.first, all.reading, memory, r);
            },
            "an item is skipped, and nobody notices")
        .set(which, 1)
        .set(next, 0)
        .go("turn")
        .label("gone")
        .set(value, 0)
        .go_when(
            [all](const State& memory, const Registers& r) { return nobody_comes(all, memory, r); },
            "done");
}

/// Only a service that was killed, or left no name to wake by, leaves readers to their time-outs.
Test time_out(const Succession& all, const Twist& twist) {
    if (twist("no time-out")) return {};
    const auto state = static_cast<std::size_t>(all.first.state);
    if (all.ending == Ending::closed)
        return [state](const State& memory, const Registers& r) {
            return r[which] == 0 && memory.newest(state) == state_closed;
        };
    return [](const State& memory, const Registers&) {
        return memory.threads[0].registers[deaths] > 0;
    };
}

Program follower(const Succession& all, const Twist& twist) {
    Program reader("reader");
    reader.may_rest(at_rest(all.first, all.reading));
    begin_turn(reader, all.first, twist, all.reading);
    look_at_state(reader, all.first, twist);
    look_for_life(reader, all, twist);
    sleep(reader, all.first, time_out(all, twist));
    look_again(reader, all.first, twist, all.reading);
    hand_over(reader, all, twist);
    reader.go("sleep").label("found");
    reader.go_if([](const Registers& r) { return r[which] == 1; }, "done")
        .set(next, [](const Registers& r) { return r[next] + 1; })
        .go("turn");
    return reader.label("done");
}

Model succession(const Twist& twist, Ending ending, Reading reading) {
    Model model;
    const Succession all(model, ending, reading);
    model.run(services(all, twist));
    model.run(follower(all, twist));
    return model;
}

/// Of WaiterWaker: the word that readers sleep on, and what its writer and its thread share.
struct CrowdWords {
    int wake = 0;
    int calls = 0;
    int present = 0;  ///< the thread found a crowd when it was last called
};

constexpr int at_once = 1;  ///< readers that the writer wakes by itself

/// As WaiterWaker::wake().
void wake_crowd(Program& writer, const Twist& twist, const CrowdWords& words) {
    const bool early = twist("the crowd is woken before the word changes");
    const std::string item = std::to_string(writer.length());
    const std::string call = "call " + item;
    const std::string done = "called " + item;
    if (!early) writer.add(words.wake, 1, release);
    writer.load(choice, words.present, relaxed)
        .go_if([](const Registers& r) { return r[choice] != 0; },
               twist("a crowd that was there is not called") ? done : call)
        .wake(words.wake, at_once, woken)
        .go_if([](const Registers& r) { return r[woken] < at_once; }, done)
        .label(call);
    if (!twist("the rest is not called")) {
        if (!twist("the call is not counted")) writer.add(words.calls, 1, release);
        writer.wake(words.calls, 1, choice);
    }
    writer.label(done).set(woken, 0).set(choice, 0);
    if (early) writer.add(words.wake, 1, release);
}

/// As WaiterWaker::run().
Program helper(const Twist& twist, const CrowdWords& words) {
    Program thread("helper");
    const int most = twist("the helper wakes one") ? 1 : everybody;
    thread.may_rest([](const State&, const Registers&) { return true; })
        .label("again")
        .load(value, words.calls, acquire)
        .go_if([](const Registers& r) { return r[value] != r[seen]; }, "called")
        .wait(words.calls, [](const Registers& r) { return r[seen]; })
        .go("again")
        .label("called")
        .set(seen, [](const Registers& r) { return r[value]; })
        .wake(words.wake, most, next);
    if (twist("calls that come while it wakes are forgotten"))
        thread.load(seen, words.calls, acquire);
    return thread
        .store(
            words.present, [](const Registers& r) { return r[next] > at_once ? 1 : 0; }, relaxed)
        .set(next, 0)
        .set(value, 0)
        .go("again");
}

Program sleeper(const std::string& name, int items, int head, int wake) {
    Program reader(name);
    reader.may_rest([head](const State& memory, const Registers& r) {
        return r[next] == memory.newest(static_cast<std::size_t>(head));
    });
    return reader.label("turn")
        .set(value, 0)
        .set(seen, 0)
        .load(seen, wake, acquire)
        .load(value, head, acquire)
        .go_if([items](const Registers& r) { return r[value] == items; }, "done")
        .go_if([](const Registers& r) { return r[value] > r[next]; }, "found")
        .wait(wake, [](const Registers& r) { return r[seen]; })
        .go("turn")
        .label("found")
        .set(next, [](const Registers& r) { return r[value]; })
        .go("turn")
        .label("done")
        .set(next, 0)
        .set(seen, 0)
        .set(value, 0);
}

/// Readers who each want the last item, and are woken in part by a helper.
Model crowd(const Twist& twist, int items, int readers) {
    Model model;
    const int head = model.place("head");
    CrowdWords words;
    words.wake = model.place("wake");
    words.calls = model.place("calls");
    words.present = model.place("present");
    Program writer("writer");
    for (int number = 0; number < items; ++number) {
        writer.store(head, number + 1, release);
        wake_crowd(writer, twist, words);
        pause(writer);
    }
    model.run(writer.label("done"));
    model.run(helper(twist, words));
    for (int i = 0; i < readers; ++i)
        model.run(sleeper("reader " + std::to_string(i), items, head, words.wake));
    return model;
}

const char* name_of(Reading reading) { return reading == Reading::head ? "head" : "sequence"; }

Subject ending(const std::string& name, const std::string& what, Ending how, Reading reading) {
    return {name + "-" + name_of(reading), what,
            [how, reading](const Twist& twist) { return succession(twist, how, reading); }};
}

std::vector<Subject> subjects() {
    std::vector<Subject> all;
    for (const Reading by : {Reading::sequence, Reading::head}) {
        all.push_back({std::string("sleep-") + name_of(by), "two items and the end, no time-out",
                       [by](const Twist& twist) { return sleep_and_end(twist, by); }});
        all.push_back(
            ending("supersede", "a successor takes the name, no time-out", Ending::superseded, by));
        all.push_back(
            ending("close", "the service ends; perhaps another one comes", Ending::closed, by));
        all.push_back(
            ending("kill", "service and successor are killed at any step", Ending::killed, by));
        all.push_back(ending("stall", "a living writer is taken for dead", Ending::stalled, by));
    }
    all.push_back({"crowd-2", "2 readers, 3 items, one is woken at once",
                   [](const Twist& twist) { return crowd(twist, 3, 2); }});
    all.push_back({"crowd-3", "3 readers, 2 items, one is woken at once",
                   [](const Twist& twist) { return crowd(twist, 2, 3); }});
    return all;
}

std::vector<Change> waiting_changes() {
    constexpr auto breaks = Effect::breaks;
    return {
        {"sleep-sequence", "wake's add relaxed", "SYNC 5", breaks},
        {"sleep-sequence", "wake's load relaxed", "SYNC 5", breaks},
        {"sleep-sequence", "wake before the sequence", "SYNC 5", breaks},
        {"sleep-head", "wake before head", "SYNC 5", breaks},
        {"sleep-sequence", "wake is read after the look", "SYNC 5", breaks},
        {"sleep-sequence", "FUTEX_WAKE before the word changes", "SYNC 5", breaks},
        {"sleep-sequence", "the word does not change", "SYNC 5", breaks},
        {"sleep-sequence", "no FUTEX_WAKE", "SYNC 5", breaks},
        {"sleep-sequence", "state after the wake", "SYNC 5", breaks},
        {"sleep-sequence", "no wake after the state", "SYNC 5", breaks},
        {"crowd-3", "the crowd is woken before the word changes", "SYNC 5", breaks},
        {"crowd-3", "the rest is not called", "crowd", breaks},
        {"crowd-3", "the helper wakes one", "crowd", breaks},
        {"crowd-3", "the call is not counted", "crowd", breaks},
        {"crowd-3", "a crowd that was there is not called", "crowd", breaks},
        {"crowd-2", "calls that come while it wakes are forgotten", "crowd", breaks},
    };
}

std::vector<Change> ending_changes() {
    constexpr auto breaks = Effect::breaks;
    constexpr auto none = Effect::none;
    const char* const third_look = "no look at the old segment after the new one is found";
    return {
        {"sleep-sequence", "state's store relaxed", "SYNC 6", breaks},
        {"sleep-sequence", "state's load relaxed", "SYNC 6", breaks},
        {"sleep-head", "state's store relaxed", "SYNC 6", breaks},
        {"sleep-head", "state's load relaxed", "SYNC 6", breaks},
        {"sleep-sequence", "state before the last item", "SYNC 6", breaks},
        {"sleep-sequence", "no second look for an item", "SYNC 6", breaks},
        {"supersede-sequence", "state's store relaxed", "SYNC 6", breaks},
        {"supersede-sequence", "state's load relaxed", "SYNC 6", breaks},
        {"supersede-sequence", "no second look for an item", "SYNC 6", breaks},
        {"supersede-sequence", "state after the wake", "SYNC 5", breaks},
        {"supersede-sequence", "wake before the new name", "SYNC 5", breaks},
        {"supersede-sequence", "no wake after the new name", "SYNC 5", breaks},
        {"kill-sequence", "no look for a dead writer", "life", breaks},
        {"kill-sequence", "no second look for an item", "life", breaks},
        {"kill-sequence", "no time-out", "life", breaks},
        {"close-sequence", "no time-out", "life", breaks},
        {"stall-sequence", third_look, "life", breaks},
        {"stall-head", third_look, "life", breaks},
        {"supersede-sequence", third_look, "life", none},
        {"kill-sequence", third_look, "life", none},
        {"close-sequence", third_look, "life", none},
        {"supersede-sequence", "the new name before the state", "none", none},
        {"kill-sequence", "the new name before the state", "none", none},
    };
}

}  // namespace

Collection waiting() {
    Collection all{subjects(), waiting_changes()};
    const auto changes = ending_changes();
    all.changes.insert(all.changes.end(), changes.begin(), changes.end());
    return all;
}

}  // namespace versavis::model

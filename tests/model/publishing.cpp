// SPDX-License-Identifier: BSD-3-Clause
// Descriptors, slots and the header: what a reader accepts is what was published.
#include <algorithm>

#include "models.hpp"

namespace versavis::model {

namespace {

/// A reader's registers.
enum : std::size_t { next, sequence, first, second, head, generation, slot };

constexpr int word_of(int number) { return number + 1; }
constexpr int complete(int number) { return 2 * number + 2; }
constexpr int garbage = 99;

/// Where a ring lies in a model. Slots are there in some models only.
struct Ring {
    int descriptors;
    int slots;
    int sequences = 0;    ///< one for each descriptor
    int words = 0;        ///< two for each descriptor
    int generations = 0;  ///< one for each slot
    int payloads = 0;     ///< two for each slot
    int head = 0;

    Ring(Model& model, int descriptor_count, int slot_count);
    int at(int number) const { return number % descriptors; }
    int retained() const { return slots == 0 ? descriptors : std::min(slots, descriptors); }
};

int row(Model& model, const std::string& name, int count) {
    const auto place = [&](int i) { return model.place(name + "[" + std::to_string(i) + "]"); };
    const int begin = count > 0 ? place(0) : 0;
    for (int i = 1; i < count; ++i) place(i);
    return begin;
}

Ring::Ring(Model& model, int descriptor_count, int slot_count)
    : descriptors(descriptor_count), slots(slot_count) {
    sequences = row(model, "sequence", descriptors);
    words = row(model, "word", 2 * descriptors);
    generations = row(model, "generation", slots);
    payloads = row(model, "payload", 2 * slots);
    head = model.place("head");
}

/// As Writer::write_descriptor().
void write_descriptor(Program& writer, const Ring& ring, const Twist& twist, int number, int one,
                      int two) {
    const int at = ring.at(number);
    const bool late = twist("odd sequence after the words");
    const bool early = twist("even sequence before the words");
    const Order even = twist.order("even sequence relaxed", release);
    const auto count = [&] {
        writer.store(ring.head, number + 1, twist.order("head's store relaxed", release));
    };
    if (!late && !twist("no odd sequence"))
        writer.store(ring.sequences + at, complete(number) - 1, relaxed);
    if (!twist("no release fence after the odd sequence")) writer.fence(release);
    if (early) writer.store(ring.sequences + at, complete(number), even);
    writer.store(ring.words + 2 * at, one, relaxed).store(ring.words + 2 * at + 1, two, relaxed);
    if (late) writer.store(ring.sequences + at, complete(number) - 1, relaxed);
    const bool swapped = twist("head before the sequence");
    if (swapped) count();
    if (!early) writer.store(ring.sequences + at, complete(number), even);
    if (!swapped) count();
}

Value sequence_of(const Ring& ring) {
    return [ring](const Registers& r) { return ring.sequences + ring.at(r[next]); };
}

Value word_of(const Ring& ring, int which) {
    return [ring, which](const Registers& r) { return ring.words + 2 * ring.at(r[next]) + which; };
}

/// What a reader looks at until item `next` is there, then the first look at its sequence.
void look(Program& reader, const Ring& ring, const Twist& twist, Reading reading) {
    reader.label("look").set(sequence, 0).set(first, 0).set(second, 0).set(head, 0);
    reader.set(generation, 0).set(slot, 0);
    if (reading == Reading::head)
        reader.load(head, ring.head, twist.order("head's load relaxed", acquire))
            .go_if([](const Registers& r) { return r[head] <= r[next]; }, "look")
            .set(head, 0);
    reader.load(sequence, sequence_of(ring), twist.order("sequence's load relaxed", acquire));
    if (reading == Reading::sequence)
        reader.go_if([](const Registers& r) { return r[sequence] < complete(r[next]); }, "look");
    reader.go_if([](const Registers& r) { return r[sequence] != complete(r[next]); }, "lost");
}

/// The words, and the second look at the sequence.
void read_words(Program& reader, const Ring& ring, const Twist& twist, std::size_t one,
                std::size_t two) {
    reader.load(one, word_of(ring, 0), relaxed).load(two, word_of(ring, 1), relaxed);
    if (twist("no second look at the sequence")) return;
    if (!twist("no acquire fence after the words")) reader.fence(acquire);
    reader.load(sequence, sequence_of(ring), relaxed)
        .go_if([](const Registers& r) { return r[sequence] != complete(r[next]); }, "lost");
}

void lose(Program& reader, const Ring& ring, const Twist& twist) {
    const int retained = ring.retained();
    reader.load(head, ring.head, twist.order("head's load relaxed", acquire))
        .set(next, [retained](const Registers& r) {
            return next_after_loss(r[next], r[head], retained);
        });
}

bool overwritten(const Ring& ring, const State& state, const Registers& r) {
    const auto at = static_cast<std::size_t>(ring.sequences + ring.at(r[next]));
    return state.newest(at) > complete(r[next]);
}

Program descriptor_reader(const Ring& ring, const Twist& twist, Reading reading, int items) {
    Program reader("reader");
    reader.label("begin").go_if([items](const Registers& r) { return r[next] >= items; }, "done");
    look(reader, ring, twist, reading);
    read_words(reader, ring, twist, first, second);
    reader
        .check(
            [](const State&, const Registers& r) {
                return r[first] == word_of(r[next]) && r[second] == word_of(r[next]);
            },
            "words of another item are accepted")
        .set(next, [](const Registers& r) { return r[next] + 1; })
        .go("begin")
        .label("lost")
        .check(
            [ring](const State& state, const Registers& r) { return overwritten(ring, state, r); },
            "an item is taken for lost that is there");
    lose(reader, ring, twist);
    return reader.go("begin").label("done");
}

Model descriptors(const Twist& twist, Reading reading, int count, int items) {
    Model model;
    const Ring ring(model, count, 0);
    Program writer("writer");
    for (int number = 0; number < items; ++number)
        write_descriptor(writer, ring, twist, number, word_of(number), word_of(number));
    model.run(writer);
    model.run(descriptor_reader(ring, twist, reading, items));
    return model;
}

/// As Writer: what it does with its slots, one call for each of its functions.
class SlotWriter {
 public:
    SlotWriter(const Ring& ring, const Twist& twist) : ring_(ring), twist_(twist) {}

    void acquire(int slot) {
        if (!twist_("odd generation after the payload")) make_odd(slot);
    }
    void fill(int slot, int value) {
        for (int i = 0; i < 2; ++i) program_.store(ring_.payloads + 2 * slot + i, value, relaxed);
        if (twist_("odd generation after the payload")) make_odd(slot);
    }
    void publish(int slot, int number) {
        const Order order = twist_.order("even generation relaxed", release);
        program_.add(ring_.generations + slot, 1, order);
        write_descriptor(program_, ring_, twist_, number, ++generations_[slot], slot);
    }
    void abandon(int slot) {
        program_.add(ring_.generations + slot, 1, twist_.order("abandoned relaxed", release));
        ++generations_[slot];
    }
    const Program& program() const { return program_; }

 private:
    void make_odd(int slot) {
        ++generations_[slot];
        program_.add(ring_.generations + slot, 1, relaxed);
        if (!twist_("no release fence after the odd generation")) program_.fence(release);
    }

    const Ring& ring_;
    const Twist& twist_;
    Program program_{"writer"};
    int generations_[2] = {0, 0};
};

/// As Payload::valid().
void validate(Program& reader, const Ring& ring, const Twist& twist, const char* otherwise) {
    if (!twist("no acquire fence before the generation")) reader.fence(acquire);
    reader
        .load(
            head, [ring](const Registers& r) { return ring.generations + r[slot]; }, relaxed)
        .go_if([](const Registers& r) { return r[head] != r[generation]; }, otherwise)
        .set(head, 0);
}

void read_payload(Program& reader, const Ring& ring) {
    const auto payload = [ring](int i) -> Value {
        return [ring, i](const Registers& r) { return ring.payloads + 2 * r[slot] + i; };
    };
    reader.load(first, payload(0), relaxed).load(second, payload(1), relaxed);
}

Program slot_reader(const Ring& ring, const Twist& twist, Reading reading, int items) {
    Program reader("reader");
    reader.label("begin").go_if([items](const Registers& r) { return r[next] >= items; }, "done");
    look(reader, ring, twist, reading);
    read_words(reader, ring, twist, generation, slot);
    if (!twist("no look at the generation before")) validate(reader, ring, twist, "no payload");
    read_payload(reader, ring);
    if (!twist("no look at the generation after")) validate(reader, ring, twist, "no payload");
    reader
        .check(
            [](const State&, const Registers& r) {
                return r[first] == word_of(r[next]) && r[second] == word_of(r[next]);
            },
            "a payload of another item is accepted")
        .set(next, [](const Registers& r) { return r[next] + 1; })
        .go("begin")
        .label("no payload")
        .check(
            [ring](const State& state, const Registers& r) {
                const auto at = static_cast<std::size_t>(ring.generations + r[slot]);
                return state.newest(at) != r[generation];
            },
            "a payload is taken for lost that is there")
        .go("jump")
        .label("lost")
        .check(
            [ring](const State& state, const Registers& r) { return overwritten(ring, state, r); },
            "an item is taken for lost that is there")
        .label("jump");
    lose(reader, ring, twist);
    return reader.go("begin").label("done");
}

using Script = void (*)(SlotWriter&);

Model slots(const Twist& twist, Reading reading, int descriptor_count, int slot_count, int items,
            Script script) {
    Model model;
    const Ring ring(model, descriptor_count, slot_count);
    SlotWriter writer(ring, twist);
    script(writer);
    model.run(writer.program());
    model.run(slot_reader(ring, twist, reading, items));
    return model;
}

/// Slot 0 is written again while a descriptor still names its last payload.
void reuse_slot(SlotWriter& writer) {
    for (int number = 0; number < 4; ++number) {
        writer.acquire(0);
        writer.fill(0, word_of(number));
        writer.publish(0, number);
    }
}

/// The one descriptor is written again, each time with the other slot.
void reuse_descriptor(SlotWriter& writer) {
    for (int number = 0; number < 4; ++number) {
        writer.acquire(number % 2);
        writer.fill(number % 2, word_of(number));
        writer.publish(number % 2, number);
    }
}

/// Two frames are under way, and the second one is complete first. Later one is abandoned, and its
/// slot used for another one, which lies in the first descriptor again.
void out_of_order(SlotWriter& writer) {
    writer.acquire(0);
    writer.acquire(1);
    writer.fill(1, word_of(0));
    writer.publish(1, 0);
    writer.fill(0, word_of(1));
    writer.publish(0, 1);
    writer.acquire(1);
    writer.fill(1, garbage);
    writer.abandon(1);
    writer.acquire(1);
    writer.fill(1, word_of(2));
    writer.publish(1, 2);
}

/// A slot goes back unpublished, and is the next to be used.
void abandon(SlotWriter& writer) {
    writer.acquire(0);
    writer.fill(0, word_of(0));
    writer.publish(0, 0);
    writer.acquire(0);
    writer.fill(0, garbage);
    writer.abandon(0);
    writer.acquire(0);
    writer.fill(0, word_of(1));
    writer.publish(0, 1);
}

/// A header of two words. The file may be met before its name says that it is complete, or not.
Model header(const Twist& twist, bool by_name) {
    Model model;
    const int fields = row(model, "field", 2);
    const int magic = model.place("magic");
    const int name = model.place("name");
    const Order store = twist.order("magic's store relaxed", release);
    Program writer("writer");
    if (twist("magic before the fields")) writer.store(magic, 1, store);
    writer.store(fields, 1, relaxed).store(fields + 1, 1, relaxed);
    writer.store(magic, 1, store).store(name, 1, by_name ? release : relaxed);
    Program reader("reader");
    reader.label("again").set(first, 0);
    if (by_name)
        reader.load(first, name, acquire)
            .go_if([](const Registers& r) { return r[first] == 0; }, "again");
    reader.load(first, magic, twist.order("magic's load relaxed", acquire))
        .go_if([](const Registers& r) { return r[first] == 0; }, "again")
        .load(first, fields, relaxed)
        .load(second, fields + 1, relaxed)
        .check([](const State&, const Registers& r) { return r[first] == 1 && r[second] == 1; },
               "a header is used half filled");
    model.run(writer);
    model.run(reader);
    return model;
}

std::vector<Subject> descriptor_subjects() {
    std::vector<Subject> subjects;
    for (const int count : {1, 2, 4}) {
        const std::string suffix = "-" + std::to_string(count);
        const int items = 2 * count + 3;
        const std::string in =
            std::to_string(items) + " items in a ring of " + std::to_string(count);
        subjects.push_back({"sequence" + suffix, in + ", read by sequence alone",
                            [count, items](const Twist& twist) {
                                return descriptors(twist, Reading::sequence, count, items);
                            }});
        subjects.push_back(
            {"head" + suffix, in + ", read by head first", [count, items](const Twist& twist) {
                 return descriptors(twist, Reading::head, count, items);
             }});
    }
    return subjects;
}

Subject slot_subject(const char* name, const char* what, int descriptor_count, int slot_count,
                     int items, Script script, Reading reading = Reading::sequence) {
    return {name, what, [=](const Twist& twist) {
                return slots(twist, reading, descriptor_count, slot_count, items, script);
            }};
}

std::vector<Change> descriptor_changes() {
    constexpr auto breaks = Effect::breaks;
    constexpr auto none = Effect::none;
    return {
        {"head-1", "head's store relaxed", "SYNC 1", breaks},
        {"head-1", "head's load relaxed", "SYNC 1", breaks},
        {"head-1", "head before the sequence", "SYNC 1", breaks},
        {"sequence-1", "even sequence relaxed", "SYNC 2", breaks},
        {"sequence-1", "sequence's load relaxed", "SYNC 2", breaks},
        {"sequence-1", "even sequence before the words", "SYNC 2", breaks},
        {"sequence-1", "no odd sequence", "SYNC 3", breaks},
        {"sequence-1", "odd sequence after the words", "SYNC 3", breaks},
        {"sequence-1", "no release fence after the odd sequence", "SYNC 3", breaks},
        {"sequence-1", "no acquire fence after the words", "SYNC 3", breaks},
        {"sequence-1", "no second look at the sequence", "SYNC 3", breaks},
        {"head-1", "no release fence after the odd sequence", "SYNC 3", breaks},
        {"head-1", "no acquire fence after the words", "SYNC 3", breaks},
        {"sequence-1", "head's store relaxed", "SYNC 1", none},
        {"sequence-1", "head's load relaxed", "SYNC 1", none},
        {"sequence-1", "head before the sequence", "SYNC 1", none},
        {"sequence-2", "head's store relaxed", "SYNC 1", none},
        {"sequence-2", "head's load relaxed", "SYNC 1", none},
        {"head-1", "even sequence relaxed", "SYNC 2", none},
        {"head-1", "sequence's load relaxed", "SYNC 2", none},
    };
}

std::vector<Change> slot_changes() {
    constexpr auto breaks = Effect::breaks;
    constexpr auto none = Effect::none;
    return {
        {"slot-reuse", "no release fence after the odd generation", "SYNC 4", breaks},
        {"slot-reuse", "odd generation after the payload", "SYNC 4", breaks},
        {"slot-reuse", "no acquire fence before the generation", "SYNC 4", breaks},
        {"slot-reuse", "no look at the generation after", "SYNC 4", breaks},
        {"slot-order-head", "no acquire fence before the generation", "SYNC 4", breaks},
        {"slot-order-head", "no release fence after the odd generation", "SYNC 4", breaks},
        {"slot-order", "even sequence relaxed", "SYNC 2", breaks},
        {"slot-order", "sequence's load relaxed", "SYNC 2", breaks},
        {"slot-descriptor", "no acquire fence after the words", "SYNC 3", breaks},
        {"slot-order-head", "even sequence relaxed", "SYNC 2", none},
        {"slot-order-head", "sequence's load relaxed", "SYNC 2", none},
        {"slot-reuse", "even generation relaxed", "none", none},
        {"slot-order", "even generation relaxed", "none", none},
        {"slot-abandon", "abandoned relaxed", "none", none},
        {"slot-reuse", "no look at the generation before", "none", none},
        {"header", "magic's store relaxed", "SYNC 7", breaks},
        {"header", "magic's load relaxed", "SYNC 7", breaks},
        {"header", "magic before the fields", "SYNC 7", breaks},
        {"header-by-name", "magic's store relaxed", "SYNC 7", none},
        {"header-by-name", "magic's load relaxed", "SYNC 7", none},
    };
}

}  // namespace

Collection publishing() {
    Collection all{descriptor_subjects(), descriptor_changes()};
    const auto changes = slot_changes();
    all.changes.insert(all.changes.end(), changes.begin(), changes.end());
    const std::vector<Subject> more{
        slot_subject("slot-reuse", "one slot, two descriptors", 2, 1, 4, reuse_slot),
        slot_subject("slot-descriptor", "two slots, one descriptor", 1, 2, 4, reuse_descriptor),
        slot_subject("slot-order", "two slots, published out of order", 2, 2, 3, out_of_order),
        slot_subject("slot-order-head", "the same, read by head first", 2, 2, 3, out_of_order,
                     Reading::head),
        slot_subject("slot-abandon", "a slot is abandoned and used again", 2, 1, 2, abandon),
        {"header", "a file is met while its header is filled",
         [](const Twist& twist) { return header(twist, false); }},
        {"header-by-name", "a file is met by its final name",
         [](const Twist& twist) { return header(twist, true); }}};
    all.subjects.insert(all.subjects.end(), more.begin(), more.end());
    return all;
}

}  // namespace versavis::model

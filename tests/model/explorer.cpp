// SPDX-License-Identifier: BSD-3-Clause
#include "explorer.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <unordered_map>
#include <utility>

namespace versavis::model {

namespace {

// Far beyond any program's longest run without an access: more is an endless loop.
constexpr int most_silent_steps = 1000;

struct Successor {
    State state;
    std::string text;  ///< only for the report
    std::string violation;
};

/// All that can happen next.
class Stepper {
 public:
    Stepper(const Model& model, bool telling) : model_(model), telling_(telling) {}

    State start();
    const std::vector<Successor>& successors(const State& state);
    bool is_good_end(const State& state) const;
    /// Of a state without successors: who cannot go on.
    std::string stuck(const State& state) const;
    const std::string& violation_at_start() const { return start_violation_; }

 private:
    const Instruction& instruction(const State& state) const;
    std::size_t location(const State& state, const Value& value) const;
    int value(const State& state) const;
    std::string place(std::size_t location) const { return model_.places()[location]; }
    void step(const State& state);
    void kill(const State& state);
    void load(const State& state);
    void store(const State& state);
    void update(const State& state);
    void wait(const State& state);
    void wait_on(const State& state, const std::vector<Word>& words, std::size_t which);
    void lock(const State& state);
    void time_out(const State& state);
    void wake(const State& state);
    void choose(const State& state);
    void wake_these(const State& state, std::size_t word, unsigned sleepers, int count);
    void advance(State next, const std::string& text);
    void settle(Successor& successor);
    bool silent_step(Successor& successor);
    void describe(Successor& successor, const std::string& text) const;

    const Model& model_;
    bool telling_;
    std::size_t thread_ = 0;  ///< whose turn it is
    std::vector<Successor> found_;
    std::string start_violation_;
};

std::string number(int value) { return std::to_string(value); }

State Stepper::start() {
    Successor first{
        make_state(model_.initial(), model_.programs().size(), model_.is_object()), {}, {}};
    for (thread_ = 0; thread_ < model_.programs().size(); ++thread_) settle(first);
    start_violation_ = first.violation;
    forget(first.state);
    return first.state;
}

const Instruction& Stepper::instruction(const State& state) const {
    return model_.programs()[thread_].at(state.threads[thread_].counter);
}

std::size_t Stepper::location(const State& state, const Value& value) const {
    const int place = value(state.threads[thread_].registers);
    if (place < 0 || place >= state.location_count)
        throw std::out_of_range("model: no such location");
    return static_cast<std::size_t>(place);
}

int Stepper::value(const State& state) const {
    return instruction(state).value(state.threads[thread_].registers);
}

void Stepper::describe(Successor& successor, const std::string& text) const {
    if (telling_) successor.text += text;
}

bool Stepper::silent_step(Successor& successor) {
    Thread& thread = successor.state.threads[thread_];
    const Instruction& now = instruction(successor.state);
    switch (now.action) {
        case Action::fence:
            fence(successor.state, thread_, now.order);
            describe(successor, std::string("; fence (") + name_of(now.order) + ")");
            break;
        case Action::set:
            thread.registers[now.into] = static_cast<std::int8_t>(now.value(thread.registers));
            break;
        case Action::branch:
            if (now.test(successor.state, thread.registers)) {
                thread.counter = static_cast<std::uint8_t>(now.target);
                return true;
            }
            break;
        case Action::check:
            if (!now.test(successor.state, thread.registers)) successor.violation = now.text;
            break;
        case Action::end: thread.activity = Activity::ended; return false;
        default: return false;
    }
    ++thread.counter;
    return true;
}

/// Runs what touches nobody else, up to the next access.
void Stepper::settle(Successor& successor) {
    int steps = 0;
    while (successor.violation.empty() && silent_step(successor))
        if (++steps > most_silent_steps) throw std::logic_error("model: an endless silent loop");
}

void Stepper::advance(State next, const std::string& text) {
    ++next.threads[thread_].counter;
    Successor successor{next, {}, {}};
    describe(successor, model_.programs()[thread_].name() + " " + text);
    settle(successor);
    forget(successor.state);
    found_.push_back(std::move(successor));
}

void Stepper::load(const State& state) {
    const Instruction& now = instruction(state);
    const std::size_t from = location(state, now.location);
    for (auto i = oldest_readable(state, thread_, from); i < state.locations[from].size; ++i) {
        State next = state;
        const std::int8_t value = model::load(next, thread_, from, i, now.order);
        next.threads[thread_].registers[now.into] = value;
        advance(next, "loads " + place(from) + " = " + number(value) + " (" + name_of(now.order) +
                          ")" + (i + 1 < state.locations[from].size ? ", not the newest" : ""));
    }
}

void Stepper::store(const State& state) {
    const Instruction& now = instruction(state);
    const std::size_t to = location(state, now.location);
    const int value = this->value(state);
    for (std::size_t i = oldest_readable(state, thread_, to) + 1U; i <= state.locations[to].size;
         ++i) {
        const auto at = static_cast<std::uint8_t>(i);
        if (!can_insert(state, to, at)) continue;
        State next = state;
        model::store(next, thread_, to, at, static_cast<std::int8_t>(value), now.order);
        advance(next, "stores " + place(to) + " = " + number(value) + " (" + name_of(now.order) +
                          ")" + (at < state.locations[to].size ? ", before another" : ""));
    }
}

void Stepper::update(const State& state) {
    const Instruction& now = instruction(state);
    const std::size_t to = location(state, now.location);
    const bool adds = now.action == Action::add;
    for (auto i = oldest_readable(state, thread_, to); i < state.locations[to].size; ++i) {
        if (!can_insert(state, to, static_cast<std::uint8_t>(i + 1))) continue;
        const int before = adds ? state.locations[to].messages[i].value : 0;
        const int value = before + this->value(state);
        State next = state;
        model::update(next, thread_, to, i, static_cast<std::int8_t>(value), now.order);
        advance(next, (adds ? "adds, " : "exchanges, ") + place(to) + " = " + number(value) + " (" +
                          name_of(now.order) + ")");
    }
}

void get_up(Thread& thread) {
    thread.activity = Activity::running;
    thread.beds = 0;
}

/// The kernel compares under the bucket's lock: it sees the word at least as new as all who woke
/// sleepers on it before, and nothing else is ordered. Of several words, those compared first may
/// be woken while it compares the others: then it does not sleep, as if it had compared them last.
void Stepper::wait(const State& state) {
    const Instruction& now = instruction(state);
    std::vector<Word> words = now.more;
    words.insert(words.begin(), {now.location, now.value});
    wait_on(state, words, 0);
}

void Stepper::wait_on(const State& state, const std::vector<Word>& words, std::size_t which) {
    if (which == words.size()) {
        Successor asleep{state, {}, {}};
        asleep.state.threads[thread_].activity = Activity::asleep;
        describe(asleep, model_.programs()[thread_].name() + " sleeps");
        for (const Word& word : words)
            describe(asleep, ", " + place(location(state, word.location)) + " is " +
                                 number(word.expected(state.threads[thread_].registers)));
        forget(asleep.state);
        found_.push_back(std::move(asleep));
        return;
    }
    const std::size_t word = location(state, words[which].location);
    const int expected = words[which].expected(state.threads[thread_].registers);
    const Location& of = state.locations[word];
    auto i = std::max(oldest_readable(state, thread_, word), of.kernel);
    for (; i < of.size; ++i) {
        State next = state;
        Thread& thread = next.threads[thread_];
        thread.current[word] = i;
        thread.acquired[word] = std::max(thread.acquired[word], i);
        next.locations[word].kernel = i;
        if (of.messages[i].value != expected) {
            get_up(thread);
            advance(next, "does not sleep, " + place(word) + " is " + number(of.messages[i].value) +
                              " and not " + number(expected));
            continue;
        }
        thread.beds = static_cast<std::uint16_t>(thread.beds | 1U << word);
        wait_on(next, words, which + 1);
    }
}

/// Nothing happens while another has it.
void Stepper::lock(const State& state) {
    const std::size_t mutex = location(state, instruction(state).location);
    if (state.newest(mutex) != 0) return;
    State next = state;
    const auto last = static_cast<std::uint8_t>(state.locations[mutex].size - 1);
    model::update(next, thread_, mutex, last, 1, instruction(state).order);
    advance(next, "locks " + place(mutex));
}

void Stepper::time_out(const State& state) {
    const Test& may = instruction(state).test;
    if (!may || !may(state, state.threads[thread_].registers)) return;
    State next = state;
    get_up(next.threads[thread_]);
    advance(next, "wakes up, its time is out");
}

void Stepper::wake_these(const State& state, std::size_t word, unsigned sleepers, int count) {
    const std::size_t waker = thread_;
    State next = state;
    next.threads[waker].registers[instruction(state).into] = static_cast<std::int8_t>(count);
    Location& of = next.locations[word];
    of.kernel = std::max(of.kernel, next.threads[waker].current[word]);
    Successor woken{next, {}, {}};
    describe(woken,
             model_.programs()[waker].name() + " wakes " + number(count) + " on " + place(word));
    for (std::size_t i = 0; i < state.thread_count; ++i) {
        if ((sleepers >> i & 1U) == 0) continue;
        get_up(woken.state.threads[i]);
        ++woken.state.threads[i].counter;
        describe(woken, ", " + model_.programs()[i].name());
        thread_ = i;
        settle(woken);
    }
    thread_ = waker;
    ++woken.state.threads[waker].counter;
    settle(woken);
    forget(woken.state);
    found_.push_back(std::move(woken));
}

/// Any of those who sleep: the order in the bucket is not relied upon.
void Stepper::wake(const State& state) {
    const std::size_t word = location(state, instruction(state).location);
    unsigned asleep = 0;
    for (std::size_t i = 0; i < state.thread_count; ++i)
        if (state.threads[i].activity == Activity::asleep &&
            (state.threads[i].beds >> word & 1U) != 0)
            asleep |= 1U << i;
    const int count = std::min(__builtin_popcount(asleep), value(state));
    for (unsigned some = 0; some <= asleep; ++some)
        if ((some & ~asleep) == 0 && __builtin_popcount(some) == count)
            wake_these(state, word, some, count);
}

void Stepper::choose(const State& state) {
    const Instruction& now = instruction(state);
    for (int i = 0; i < value(state); ++i) {
        State next = state;
        next.threads[thread_].registers[now.into] = static_cast<std::int8_t>(i);
        advance(next, "chooses " + number(i));
    }
}

void Stepper::kill(const State& state) {
    const std::size_t counter = state.threads[thread_].counter;
    for (const Mortality& range : model_.programs()[thread_].mortality()) {
        if (counter < range.from || counter >= range.to) continue;
        Successor killed{state, {}, {}};
        killed.state.threads[thread_].counter = static_cast<std::uint8_t>(range.then);
        describe(killed, model_.programs()[thread_].name() + " is killed");
        settle(killed);
        forget(killed.state);
        found_.push_back(std::move(killed));
    }
}

void Stepper::step(const State& state) {
    switch (instruction(state).action) {
        case Action::load: return load(state);
        case Action::store: return store(state);
        case Action::add:
        case Action::exchange: return update(state);
        case Action::wait: return wait(state);
        case Action::wake: return wake(state);
        case Action::lock: return lock(state);
        case Action::choose: return choose(state);
        default: throw std::logic_error("model: not an access");
    }
}

const std::vector<Successor>& Stepper::successors(const State& state) {
    found_.clear();
    for (thread_ = 0; thread_ < state.thread_count; ++thread_) {
        const Activity activity = state.threads[thread_].activity;
        if (activity == Activity::ended) continue;
        kill(state);
        if (activity == Activity::asleep)
            time_out(state);
        else
            step(state);
    }
    return found_;
}

bool Stepper::is_good_end(const State& state) const { return stuck(state).empty(); }

std::string Stepper::stuck(const State& state) const {
    for (std::size_t i = 0; i < state.thread_count; ++i) {
        const Program& program = model_.programs()[i];
        const Thread& thread = state.threads[i];
        if (thread.activity == Activity::ended || program.rests(state, thread.registers)) continue;
        return program.name() + (thread.activity == Activity::asleep
                                     ? " sleeps, and nobody will wake it"
                                     : " waits for what never comes");
    }
    return {};
}

/// The search, breadth first: the first violation found has a shortest trace.
class Search {
 public:
    Search(const Model& model, const std::function<void(const State&)>& at_end)
        : model_(model), at_end_(at_end), stepper_(model, false) {}

    Result run();

 private:
    struct Node {
        const std::string* code;
        std::uint32_t parent;
        std::uint32_t choice;  ///< which of the parent's successors
    };

    void add(const State& state, std::uint32_t parent, std::uint32_t choice);
    bool expand(std::uint32_t node);
    void find_hopeless();
    void fail(std::uint32_t node, const std::string& violation);
    std::string describe(std::uint32_t parent, std::uint32_t choice) const;

    const Model& model_;
    const std::function<void(const State&)>& at_end_;
    Stepper stepper_;
    std::unordered_map<std::string, std::uint32_t> known_;
    std::vector<Node> nodes_;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges_;  ///< to, from
    std::vector<std::uint32_t> good_;
    Result result_;
};

constexpr std::uint32_t nowhere = std::numeric_limits<std::uint32_t>::max();

void Search::add(const State& state, std::uint32_t parent, std::uint32_t choice) {
    const auto number = static_cast<std::uint32_t>(nodes_.size());
    const auto [entry, is_new] = known_.emplace(encode(state), number);
    if (is_new) nodes_.push_back({&entry->first, parent, choice});
    if (parent != nowhere) edges_.emplace_back(entry->second, parent);
}

std::string Search::describe(std::uint32_t parent, std::uint32_t choice) const {
    Stepper teller(model_, true);
    return teller.successors(decode(*nodes_[parent].code))[choice].text;
}

void Search::fail(std::uint32_t node, const std::string& violation) {
    result_.violation = violation;
    for (; nodes_[node].parent != nowhere; node = nodes_[node].parent)
        result_.trace.push_back(describe(nodes_[node].parent, nodes_[node].choice));
    std::reverse(result_.trace.begin(), result_.trace.end());
}

/// False when something is wrong.
bool Search::expand(std::uint32_t node) {
    const State state = decode(*nodes_[node].code);
    const auto& successors = stepper_.successors(state);
    for (std::uint32_t i = 0; i < successors.size(); ++i) {
        if (!successors[i].violation.empty()) {
            fail(node, successors[i].violation);
            result_.trace.push_back(describe(node, i));
            return false;
        }
        add(successors[i].state, node, i);
    }
    if (!successors.empty()) return true;
    if (!stepper_.is_good_end(state)) {
        fail(node, stepper_.stuck(state));
        return false;
    }
    good_.push_back(node);
    if (at_end_) at_end_(state);
    return true;
}

/// A loop that nobody can leave is no end: each state has to have a way to a good one.
void Search::find_hopeless() {
    std::sort(edges_.begin(), edges_.end());
    std::vector<char> hopeful(nodes_.size(), 0);
    std::vector<std::uint32_t> open = good_;
    for (const std::uint32_t node : open) hopeful[node] = 1;
    while (!open.empty()) {
        const std::uint32_t node = open.back();
        open.pop_back();
        auto edge = std::lower_bound(edges_.begin(), edges_.end(), std::make_pair(node, 0U));
        for (; edge != edges_.end() && edge->first == node; ++edge)
            if (std::exchange(hopeful[edge->second], 1) == 0) open.push_back(edge->second);
    }
    const auto lost = std::find(hopeful.begin(), hopeful.end(), 0);
    if (lost != hopeful.end())
        fail(static_cast<std::uint32_t>(lost - hopeful.begin()), "no good end can be reached");
}

Result Search::run() {
    add(stepper_.start(), nowhere, 0);
    result_.violation = stepper_.violation_at_start();
    bool good = result_.holds();
    for (std::uint32_t node = 0; good && node < nodes_.size(); ++node) good = expand(node);
    if (good) find_hopeless();
    result_.states = nodes_.size();
    return std::move(result_);
}

}  // namespace

int Model::place(const std::string& name, int initial) {
    places_.push_back(name);
    initial_.push_back(static_cast<std::int8_t>(initial));
    is_object_.push_back(false);
    return static_cast<int>(places_.size()) - 1;
}

int Model::object(const std::string& name, int initial) {
    const int number = place(name, initial);
    is_object_.back() = true;
    return number;
}

void Model::run(Program program) {
    program.finish();
    programs_.push_back(std::move(program));
}

Result explore(const Model& model, const std::function<void(const State&)>& at_end) {
    return Search(model, at_end).run();
}

}  // namespace versavis::model

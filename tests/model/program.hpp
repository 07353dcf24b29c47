// SPDX-License-Identifier: BSD-3-Clause
// The program of one thread of a model: atomic accesses, fences and futex calls on small numbers,
// and the checks that must hold on the way.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "memory.hpp"

namespace versavis::model {

/// To be woken: all who sleep there.
inline constexpr int everybody = most_threads;

/// A number, or what makes one from the thread's registers: also names a location.
class Value {
 public:
    Value(int constant) : make_([constant](const Registers&) { return constant; }) {}
    template <typename Make, typename = std::enable_if_t<!std::is_arithmetic_v<Make>>>
    Value(Make make) : make_(std::move(make)) {}
    int operator()(const Registers& registers) const { return make_(registers); }

 private:
    std::function<int(const Registers&)> make_;
};

/// Of the whole state: for checks and time-outs, which no real thread could evaluate.
using Test = std::function<bool(const State&, const Registers&)>;

/// A futex, and what it has to hold for a thread to sleep on it.
struct Word {
    Value location;
    Value expected;
};

enum class Action : std::uint8_t {
    load,
    store,
    add,       ///< atomic
    exchange,  ///< atomic
    wait,      ///< FUTEX_WAIT, or FUTEX_WAITV on several words
    wake,      ///< FUTEX_WAKE
    lock,      ///< of a mutex: 0 while nobody has it
    choose,    ///< any of some numbers
    fence,
    set,
    branch,
    check,
    end
};

struct Instruction {
    Action action = Action::end;
    Order order = Order::relaxed;
    std::size_t into = 0;  ///< register
    Value location = 0;
    Value value = 0;
    Test test;
    std::string text;  ///< label to go to, or what is wrong if a check fails
    std::size_t target = 0;
    std::vector<Word> more;  ///< that it waits on
};

/// From its first to its last instruction a thread may be killed: it goes on elsewhere.
struct Mortality {
    std::size_t from, to, then;
};

class Program {
 public:
    explicit Program(std::string name) : name_(std::move(name)) {}

    Program& load(std::size_t into, Value from, Order order);
    Program& store(Value to, Value value, Order order);
    Program& add(Value to, Value value, Order order);
    Program& exchange(Value to, Value value, Order order);
    Program& wait(Value word, Value expected, Test may_time_out = {});
    Program& wait_any(std::vector<Word> words);
    Program& wake(Value word, int most, std::size_t woken);
    Program& lock(Value mutex);
    Program& unlock(Value mutex) { return store(std::move(mutex), 0, Order::release); }
    Program& choose(std::size_t into, int options);
    Program& fence(Order order);
    Program& set(std::size_t into, Value value);
    Program& go(const std::string& label);
    Program& go_if(Value condition, const std::string& label);
    Program& go_when(Test condition, const std::string& label);
    Program& check(Test test, const std::string& otherwise);
    Program& end();
    Program& label(const std::string& name);
    /// Between these labels; goes on at the third.
    Program& mortal(const std::string& from, const std::string& to, const std::string& then);
    /// When it may wait for ever: by default never.
    Program& may_rest(Test when);

    /// Finds the labels: the last call.
    void finish();

    const std::string& name() const { return name_; }
    const Instruction& at(std::size_t counter) const { return instructions_[counter]; }
    const std::vector<Mortality>& mortality() const { return mortality_; }
    bool rests(const State& state, const Registers& registers) const {
        return rest_ && rest_(state, registers);
    }
    std::size_t length() const { return instructions_.size(); }

 private:
    Program& append(Instruction instruction);
    std::size_t place_of(const std::string& label) const;

    std::string name_;
    std::vector<Instruction> instructions_;
    std::map<std::string, std::size_t> labels_;
    std::vector<std::array<std::string, 3>> mortal_;
    std::vector<Mortality> mortality_;
    Test rest_;
};

}  // namespace versavis::model

// SPDX-License-Identifier: BSD-3-Clause
#include "program.hpp"

#include <stdexcept>
#include <utility>

namespace versavis::model {

Program& Program::append(Instruction instruction) {
    if (instructions_.size() == 255) throw std::length_error("model: a program is too long");
    instructions_.push_back(std::move(instruction));
    return *this;
}

Program& Program::load(std::size_t into, Value from, Order order) {
    return append({Action::load, order, into, std::move(from), 0, {}, {}, 0, {}});
}

Program& Program::store(Value to, Value value, Order order) {
    return append({Action::store, order, 0, std::move(to), std::move(value), {}, {}, 0, {}});
}

Program& Program::add(Value to, Value value, Order order) {
    return append({Action::add, order, 0, std::move(to), std::move(value), {}, {}, 0, {}});
}

Program& Program::exchange(Value to, Value value, Order order) {
    return append({Action::exchange, order, 0, std::move(to), std::move(value), {}, {}, 0, {}});
}

Program& Program::wait(Value word, Value expected, Test may_time_out) {
    return append({Action::wait,
                   Order::relaxed,
                   0,
                   std::move(word),
                   std::move(expected),
                   std::move(may_time_out),
                   {},
                   0,
                   {}});
}

Program& Program::wait_any(std::vector<Word> words) {
    wait(words.front().location, words.front().expected);
    words.erase(words.begin());
    instructions_.back().more = std::move(words);
    return *this;
}

Program& Program::wake(Value word, int most, std::size_t woken) {
    return append({Action::wake, Order::relaxed, woken, std::move(word), most, {}, {}, 0, {}});
}

Program& Program::lock(Value mutex) {
    return append({Action::lock, Order::acquire, 0, std::move(mutex), 1, {}, {}, 0, {}});
}

Program& Program::choose(std::size_t into, int options) {
    return append({Action::choose, Order::relaxed, into, 0, options, {}, {}, 0, {}});
}

Program& Program::fence(Order order) {
    return append({Action::fence, order, 0, 0, 0, {}, {}, 0, {}});
}

Program& Program::set(std::size_t into, Value value) {
    return append({Action::set, Order::relaxed, into, 0, std::move(value), {}, {}, 0, {}});
}

Program& Program::go(const std::string& label) { return go_if(1, label); }

Program& Program::go_if(Value condition, const std::string& label) {
    return go_when([condition = std::move(condition)](
                       const State&, const Registers& r) { return condition(r) != 0; },
                   label);
}

Program& Program::go_when(Test condition, const std::string& label) {
    return append({Action::branch, Order::relaxed, 0, 0, 0, std::move(condition), label, 0, {}});
}

Program& Program::check(Test test, const std::string& otherwise) {
    return append({Action::check, Order::relaxed, 0, 0, 0, std::move(test), otherwise, 0, {}});
}

Program& Program::end() { return append({}); }

Program& Program::label(const std::string& name) {
    if (!labels_.emplace(name, instructions_.size()).second)
        throw std::logic_error("model: label '" + name + "' twice in " + name_);
    return *this;
}

Program& Program::mortal(const std::string& from, const std::string& to, const std::string& then) {
    mortal_.push_back({from, to, then});
    return *this;
}

Program& Program::may_rest(Test when) {
    rest_ = std::move(when);
    return *this;
}

std::size_t Program::place_of(const std::string& label) const {
    const auto found = labels_.find(label);
    if (found == labels_.end())
        throw std::logic_error("model: no label '" + label + "' in " + name_);
    return found->second;
}

void Program::finish() {
    end();
    for (Instruction& instruction : instructions_)
        if (instruction.action == Action::branch) instruction.target = place_of(instruction.text);
    for (const auto& [from, to, then] : mortal_)
        mortality_.push_back({place_of(from), place_of(to), place_of(then)});
}

}  // namespace versavis::model

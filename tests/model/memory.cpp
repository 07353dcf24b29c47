// SPDX-License-Identifier: BSD-3-Clause
#include "memory.hpp"

#include <algorithm>
#include <stdexcept>

namespace versavis::model {

namespace {

void join(State& state, View& view, const View& other) {
    for (std::size_t i = 0; i < state.location_count; ++i) view[i] = std::max(view[i], other[i]);
}

/// Calls `change` with each place in the history of `location` that anything names.
template <typename Change>
void for_each_place(State& state, std::size_t location, Change change) {
    for (std::size_t i = 0; i < state.thread_count; ++i) {
        Thread& thread = state.threads[i];
        change(thread.current[location]);
        change(thread.acquired[location]);
        change(thread.released[location]);
    }
    for (std::size_t i = 0; i < state.location_count; ++i)
        for (std::size_t j = 0; j < state.locations[i].size; ++j)
            change(state.locations[i].messages[j].view[location]);
    change(state.locations[location].kernel);
}

Message& insert(State& state, std::size_t location, std::uint8_t at, std::int8_t value) {
    Location& to = state.locations[location];
    if (to.size == most_messages) throw std::length_error("model: a history is too long");
    if (at < to.size)
        for_each_place(state, location, [at](std::uint8_t& place) { place += place >= at; });
    for (std::size_t i = to.size; i > at; --i) to.messages[i] = to.messages[i - 1];
    ++to.size;
    to.messages[at] = {value, false, {}};
    return to.messages[at];
}

void release_view(State& state, std::size_t thread, Message& message, Order order) {
    const Thread& by = state.threads[thread];
    join(state, message.view, releases(order) ? by.current : by.released);
}

void see(Thread& thread, std::size_t location, std::uint8_t at) {
    thread.current[location] = at;
    thread.acquired[location] = std::max(thread.acquired[location], at);
}

/// The oldest write that some thread may still read, or insert another one behind.
std::uint8_t oldest_needed(const State& state, std::size_t location) {
    auto oldest = static_cast<std::uint8_t>(state.locations[location].size - 1);
    if (state.locations[location].is_object) return oldest;
    for (std::size_t i = 0; i < state.thread_count; ++i)
        if (state.threads[i].activity != Activity::ended)
            oldest = std::min(oldest, state.threads[i].current[location]);
    return oldest;
}

void drop(State& state, std::size_t location, std::uint8_t count) {
    Location& from = state.locations[location];
    for_each_place(state, location, [count](std::uint8_t& place) {
        place = static_cast<std::uint8_t>(place > count ? place - count : 0);
    });
    for (std::size_t i = count; i < from.size; ++i) from.messages[i - count] = from.messages[i];
    from.size = static_cast<std::uint8_t>(from.size - count);
    from.messages[0].attached = false;
}

void put(std::string& code, std::uint8_t byte) { code.push_back(static_cast<char>(byte)); }

void put(std::string& code, const View& view, std::size_t count) {
    code.append(reinterpret_cast<const char*>(view.data()), count);
}

class Input {
 public:
    explicit Input(const std::string& code) : code_(code) {}
    std::uint8_t byte() { return static_cast<std::uint8_t>(code_[at_++]); }
    void bytes(std::uint8_t* to, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) to[i] = byte();
    }

 private:
    const std::string& code_;
    std::size_t at_ = 0;
};

void encode_thread(std::string& code, const Thread& thread, std::size_t locations) {
    put(code, static_cast<std::uint8_t>(thread.activity));
    put(code, thread.counter);
    put(code, static_cast<std::uint8_t>(thread.beds & 0xFFU));
    put(code, static_cast<std::uint8_t>(thread.beds >> 8U));
    code.append(reinterpret_cast<const char*>(thread.registers.data()), register_count);
    put(code, thread.current, locations);
    put(code, thread.acquired, locations);
    put(code, thread.released, locations);
}

void decode_thread(Input& input, Thread& thread, std::size_t locations) {
    thread.activity = static_cast<Activity>(input.byte());
    thread.counter = input.byte();
    thread.beds = input.byte();
    thread.beds = static_cast<std::uint16_t>(thread.beds | input.byte() << 8U);
    for (std::int8_t& value : thread.registers) value = static_cast<std::int8_t>(input.byte());
    input.bytes(thread.current.data(), locations);
    input.bytes(thread.acquired.data(), locations);
    input.bytes(thread.released.data(), locations);
}

}  // namespace

bool acquires(Order order) { return order == Order::acquire || order == Order::both; }
bool releases(Order order) { return order == Order::release || order == Order::both; }

const char* name_of(Order order) {
    switch (order) {
        case Order::relaxed: return "relaxed";
        case Order::acquire: return "acquire";
        case Order::release: return "release";
        case Order::both: return "acq_rel";
    }
    return "";
}

std::int8_t State::newest(std::size_t location) const {
    const Location& of = locations[location];
    return of.messages[of.size - 1].value;
}

State make_state(const std::vector<std::int8_t>& initial, std::size_t threads,
                 const std::vector<bool>& is_object) {
    if (initial.size() > most_locations || threads > most_threads)
        throw std::length_error("model: too many locations or threads");
    State state{};
    state.thread_count = static_cast<std::uint8_t>(threads);
    state.location_count = static_cast<std::uint8_t>(initial.size());
    for (std::size_t i = 0; i < initial.size(); ++i) {
        state.locations[i].is_object = i < is_object.size() && is_object[i];
        state.locations[i].size = 1;
        state.locations[i].messages[0].value = initial[i];
    }
    return state;
}

std::uint8_t oldest_readable(const State& state, std::size_t thread, std::size_t location) {
    return state.threads[thread].current[location];
}

std::int8_t load(State& state, std::size_t thread, std::size_t location, std::uint8_t from,
                 Order order) {
    Thread& by = state.threads[thread];
    const Message& message = state.locations[location].messages[from];
    see(by, location, from);
    join(state, by.acquired, message.view);
    if (acquires(order)) join(state, by.current, message.view);
    return message.value;
}

bool can_insert(const State& state, std::size_t location, std::uint8_t at) {
    const Location& to = state.locations[location];
    return at == to.size || !to.messages[at].attached;
}

void store(State& state, std::size_t thread, std::size_t location, std::uint8_t at,
           std::int8_t value, Order order) {
    Message& message = insert(state, location, at, value);
    see(state.threads[thread], location, at);
    release_view(state, thread, message, order);
    message.view[location] = at;
}

void update(State& state, std::size_t thread, std::size_t location, std::uint8_t from,
            std::int8_t value, Order order) {
    load(state, thread, location, from, order);
    const auto at = static_cast<std::uint8_t>(from + 1);
    Message& message = insert(state, location, at, value);
    message.attached = true;
    // The release sequence goes on: who acquires this also acquires what it replaced.
    message.view = state.locations[location].messages[from].view;
    see(state.threads[thread], location, at);
    release_view(state, thread, message, order);
    message.view[location] = at;
}

void fence(State& state, std::size_t thread, Order order) {
    Thread& by = state.threads[thread];
    if (acquires(order)) by.current = by.acquired;
    if (releases(order)) by.released = by.current;
}

void forget(State& state) {
    for (std::size_t i = 0; i < state.thread_count; ++i) {
        Thread& thread = state.threads[i];
        if (thread.activity != Activity::ended) continue;
        thread.current = thread.acquired = thread.released = View{};
    }
    for (std::size_t i = 0; i < state.location_count; ++i)
        if (const std::uint8_t oldest = oldest_needed(state, i); oldest > 0) drop(state, i, oldest);
}

std::string encode(const State& state) {
    std::string code;
    code.reserve(512);
    put(code, state.thread_count);
    put(code, state.location_count);
    for (std::size_t i = 0; i < state.thread_count; ++i)
        encode_thread(code, state.threads[i], state.location_count);
    for (std::size_t i = 0; i < state.location_count; ++i) {
        const Location& location = state.locations[i];
        put(code, location.is_object ? 1 : 0);
        put(code, location.size);
        put(code, location.kernel);
        for (std::size_t j = 0; j < location.size; ++j) {
            put(code, static_cast<std::uint8_t>(location.messages[j].value));
            put(code, location.messages[j].attached ? 1 : 0);
            put(code, location.messages[j].view, state.location_count);
        }
    }
    return code;
}

State decode(const std::string& code) {
    Input input(code);
    State state{};
    state.thread_count = input.byte();
    state.location_count = input.byte();
    for (std::size_t i = 0; i < state.thread_count; ++i)
        decode_thread(input, state.threads[i], state.location_count);
    for (std::size_t i = 0; i < state.location_count; ++i) {
        Location& location = state.locations[i];
        location.is_object = input.byte() != 0;
        location.size = input.byte();
        location.kernel = input.byte();
        for (std::size_t j = 0; j < location.size; ++j) {
            location.messages[j].value = static_cast<std::int8_t>(input.byte());
            location.messages[j].attached = input.byte() != 0;
            input.bytes(location.messages[j].view.data(), state.location_count);
        }
    }
    return state;
}

}  // namespace versavis::model

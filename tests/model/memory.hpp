// SPDX-License-Identifier: BSD-3-Clause
// A weak memory: the release/acquire part of C11 as views on histories, without promises (RC11).
//
// Each location has a history, its writes in modification order. A view names for each location a
// place in its history; a thread reads no write older than its view. Each write carries a view,
// which whoever acquires it joins to their own. The newest write that was made is not always the
// last in the history: a thread may insert its write anywhere after what it has seen.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace versavis::model {

inline constexpr std::size_t most_locations = 16;  // as many as `beds` has bits
inline constexpr std::size_t most_messages = 14;
inline constexpr std::size_t most_threads = 5;
inline constexpr std::size_t register_count = 8;

enum class Order : std::uint8_t { relaxed, acquire, release, both };
inline constexpr auto relaxed = Order::relaxed;
inline constexpr auto acquire = Order::acquire;
inline constexpr auto release = Order::release;
inline constexpr auto both = Order::both;
bool acquires(Order order);
bool releases(Order order);
const char* name_of(Order order);

using View = std::array<std::uint8_t, most_locations>;
using Registers = std::array<std::int8_t, register_count>;

/// A write in a history.
struct Message {
    std::int8_t value;
    bool attached;  ///< by an atomic addition to the write before it: nothing fits in between
    View view;      ///< what is known to those who acquire it
};

struct Location {
    bool is_object;  ///< a mutex, or the kernel's: everybody sees its newest state, and no other
    std::uint8_t size;
    std::uint8_t kernel;  ///< how much of the history the futex's bucket lock has handed on
    std::array<Message, most_messages> messages;
};

enum class Activity : std::uint8_t { running, asleep, ended };

struct Thread {
    std::uint8_t counter;  ///< of its program
    Activity activity;
    std::uint16_t beds;  ///< the locations on which it sleeps, a bit each
    Registers registers;
    View current;   ///< what it has to see
    View acquired;  ///< what it will have to see after an acquire fence
    View released;  ///< what it had to see at its last release fence
};

/// All there is: compared and stored whole.
struct State {
    std::uint8_t thread_count;
    std::uint8_t location_count;
    std::array<Thread, most_threads> threads;
    std::array<Location, most_locations> locations;

    std::int8_t newest(std::size_t location) const;
};

State make_state(const std::vector<std::int8_t>& initial, std::size_t threads,
                 const std::vector<bool>& is_object = {});

/// The writes that a load of this thread may read: from here to the end of the history.
std::uint8_t oldest_readable(const State& state, std::size_t thread, std::size_t location);
std::int8_t load(State& state, std::size_t thread, std::size_t location, std::uint8_t from,
                 Order order);

/// May a write be inserted there, before what is there now?
bool can_insert(const State& state, std::size_t location, std::uint8_t at);
void store(State& state, std::size_t thread, std::size_t location, std::uint8_t at,
           std::int8_t value, Order order);

/// Reads the write `from` and writes right behind it. can_insert(from + 1) has to hold.
void update(State& state, std::size_t thread, std::size_t location, std::uint8_t from,
            std::int8_t value, Order order);

void fence(State& state, std::size_t thread, Order order);

/// Forgets what nobody can read any more, so that states that behave alike are alike.
void forget(State& state);

std::string encode(const State& state);
State decode(const std::string& code);

}  // namespace versavis::model

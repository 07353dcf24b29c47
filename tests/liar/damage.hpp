// SPDX-License-Identifier: BSD-3-Clause
// Damage that a liar between board and service can do to messages: each kind, and the liar.
#pragma once

#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "foreign_packet.hpp"
#include "steady_lie.hpp"
#include "versavis/time.hpp"

namespace versavis::liar {

enum class Way {
    shift,          ///< all fields by the same time, 1 us to 1000 s, either way
    shift_periods,  ///< all fields by the same whole number of periods
    jump,           ///< one of the fields shows another number
    flip_flag,      ///< one bit of the field
    flip_bits,      ///< one to eight bits anywhere in the payload
    swap_messages,  ///< with the next of its type
    swap_fields,    ///< one of the fields, with the next of its type
    repeat,
    drop,
    freeze,   ///< one of the fields keeps its value for several messages
    late,     ///< all fields are off by the same time for several messages
    step,     ///< every instant from here on is off by the same whole number of periods
    regular,  ///< all fields of every n-th message of camera 0 are late, as long as it is ordered
};

struct Victim {
    Type type;
    std::vector<Field> fields;
};

struct Kind {
    std::string_view name;
    Way way;
    std::vector<Victim> victims;
    unsigned every = 1;  ///< for Way::regular: n
    Duration least{};    ///< for Way::regular: how late, drawn anew for each
    Duration most{};     ///< the same
};

const std::vector<Kind>& kinds();
const Kind* find_kind(std::string_view name);

/// One damaged message, for the log. Fields that do not apply are 0 or empty.
struct Damage {
    HostTime at;
    const Kind* kind = nullptr;
    Type type{};
    std::uint64_t camera = 0;
    std::uint64_t number = 0;  ///< true trigger or sample number; else: messages of that type
    std::string what;
};

std::string to_text(const Damage& damage);

/// What the liar may do from now on.
struct Orders {
    std::vector<const Kind*> kinds;   ///< empty: the truth
    double rate = 1;                  ///< fraction of the messages of a kind that it damages
    std::uint64_t most = UINT64_MAX;  ///< so many lies, then the truth; one that lasts counts once
};

/// Takes the board's packets and says what the service gets instead. The choice follows from the
/// seed, the orders and the packets alone. Thread-safe.
class Liar {
 public:
    Liar(std::uint64_t seed, Duration period);

    void obey(Orders orders);

    /// From now on this lie, which must outlive it, and no other; until the next orders.
    void begin(const SteadyLie& lie);

    /// What goes on in place of `packet`; numbered so that nothing seems to be lost.
    std::vector<Packet> pass(Packet packet, HostTime now);

    /// The next packets are those of a board of which the service knows nothing.
    void forget();

    std::uint64_t damaged() const;  ///< messages
    HostTime last_lie() const;      ///< when the last damaged message left
    std::vector<Damage> damages_since(std::size_t begin) const;
    std::optional<std::uint64_t> true_tick(unsigned camera, std::uint64_t trigger) const;

 private:
    /// A lie that lasts for some messages.
    struct Lasting {
        const Kind* kind;
        Type type;
        std::int64_t camera;
        std::vector<Field> fields;
        std::int64_t amount_ns;  ///< for Way::freeze: the value
        unsigned left;
        unsigned rest;  ///< messages after it without another such lie: one for ever is the truth
    };

    void observe(const Packet& packet);
    bool continue_lies(Packet& packet, HostTime now);
    std::vector<Packet> lie(const Kind& kind, const Victim& victim, Packet packet, HostTime now);
    bool alter(const Kind& kind, const Victim& victim, Packet& packet, HostTime now);
    bool shift_regularly(const Kind& kind, const Victim& victim, Packet& packet, HostTime now);
    void note(const Kind& kind, const Packet& packet, HostTime now, std::string what);
    void damage_counted(HostTime now);
    const Kind* choose(const Packet& packet);

    std::int64_t any_shift_ns();
    std::int64_t any_periods_ns();
    std::int64_t small_shift_ns();
    std::int64_t other_number(std::int64_t number);
    std::uint64_t below(std::uint64_t limit) { return random_() % limit; }
    double uniform() { return static_cast<double>(random_() >> 11U) * 0x1p-53; }

    const Duration period_;
    mutable std::mutex mutex_;
    std::mt19937_64 random_;
    Orders orders_;
    std::optional<SteadyLiar> steady_;
    std::uint64_t lies_ = 0;  ///< under the present orders
    std::vector<Lasting> lasting_;
    std::map<std::uint32_t, std::int64_t> follow_ups_;  ///< by request: lie of its answer
    struct Held {
        const Kind* kind;
        Packet packet;
    };
    std::optional<Held> held_;  ///< waits for the message with which it is swapped
    std::int64_t step_ns_ = 0;
    std::uint32_t nonce_ = 0;
    std::optional<std::uint32_t> sequence_;  ///< of the next packet
    std::map<Type, std::uint64_t> seen_;
    std::uint64_t regular_ = 0;  ///< messages that a regular lie could have damaged
    struct Truth {
        std::uint64_t camera = 0;
        std::uint64_t number = 0;
    };
    Truth present_;  ///< of the packet in hand, before any lie
    std::map<std::pair<unsigned, std::uint64_t>, std::uint64_t> ticks_;
    std::uint64_t damaged_ = 0;
    HostTime last_lie_;
    std::vector<Damage> damages_;
};

/// The serial number of a sample, which the rig shows in its magnetic field: no lie changes it.
std::uint64_t serial_in(const Packet& sample);

}  // namespace versavis::liar

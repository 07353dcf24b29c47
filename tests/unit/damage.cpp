// SPDX-License-Identifier: BSD-3-Clause
#include "damage.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <set>

using namespace versavis;
using namespace versavis::liar;

namespace {

constexpr Duration damage_period = milliseconds(10);

/// Payload sizes of the document.
const std::map<Type, std::size_t> sizes{
    {Type::exposure, 48}, {Type::imu_sample, 56},      {Type::event, 24}, {Type::clock_answer, 24},
    {Type::health, 96},   {Type::clock_follow_up, 16}, {Type::log, 96}};

/// The packets of a board: of each type in turn, each with instants and numbers of its own.
class DamagedBoard {
 public:
    Packet next() {
        const auto& [type, size] = *std::next(sizes.begin(), sequence_ % sizes.size());
        Packet packet{type, 7, sequence_++, Bytes(size)};
        const std::int64_t n = sequence_;
        for (const Field& field : instants(type)) set(packet, field, n * 1'000'000);
        if (type == Type::exposure) {
            set(packet, exposure::camera, n % 2);
            set(packet, exposure::trigger, n);
            set(packet, exposure::tick, n + 100);
            set(packet, exposure::flags, 1);
        } else if (type == Type::imu_sample) {
            set(packet, imu_sample::number, n);
            set(packet, imu_sample::magnetic_x, n);
            set(packet, imu_sample::magnetic_y, n >> 3);
            set(packet, imu_sample::age, n + 1);
            set(packet, imu_sample::accel_age, n + 2);
        } else if (type == Type::event) {
            set(packet, event::sequence, n);
            set(packet, event::detail, n + 2);
            set(packet, event::value, n + 1);
        } else if (type == Type::clock_answer) {
            set(packet, clock_answer::id, n);
        } else if (type == Type::clock_follow_up) {
            set(packet, clock_follow_up::id, n);
        }
        return packet;
    }

 private:
    std::uint32_t sequence_ = 0;
};

std::vector<Bytes> pass_all(Liar& liar, int count) {
    DamagedBoard board;
    std::vector<Bytes> out;
    for (int i = 0; i < count; ++i)
        for (const Packet& damaged : liar.pass(board.next(), HostTime{i}))
            out.push_back(encode(damaged));
    return out;
}

bool keeps_its_messages(Way way) {
    return way != Way::drop && way != Way::repeat && way != Way::swap_messages &&
           way != Way::swap_fields;
}

}  // namespace

TEST_CASE("damage: without orders everything passes as it is") {
    Liar liar(1, damage_period);
    DamagedBoard board;
    for (int i = 0; i < 100; ++i) {
        const Packet packet = board.next();
        const auto out = liar.pass(packet, HostTime{i});
        REQUIRE(out.size() == 1);
        CHECK(out[0].payload == packet.payload);
        CHECK(out[0].sequence == packet.sequence);
    }
    CHECK(liar.damaged() == 0);
}

TEST_CASE("damage: each kind reaches each of its fields and nothing else, unseen by the CRC") {
    for (const Kind& kind : kinds()) {
        INFO(kind.name);
        Liar liar(3, damage_period);
        liar.obey({{&kind}, 1});
        DamagedBoard board;
        std::map<Type, std::set<unsigned>> changed;
        std::uint32_t expected = 0;
        for (int i = 0; i < 3000; ++i) {
            const Packet packet = board.next();
            const auto passed = liar.pass(packet, HostTime{i});
            for (const Packet& out : passed) {
                CHECK(out.sequence == expected++);
                Bytes encoded = encode(out);
                encoded.pop_back();
                REQUIRE(decode(encoded));
            }
            if (!keeps_its_messages(kind.way)) continue;
            REQUIRE(passed.size() == 1);
            const Bytes after = passed[0].payload;
            for (unsigned at = 0; at < after.size(); ++at)
                if (after[at] != packet.payload[at]) changed[packet.type].insert(at);
        }
        CHECK(liar.damaged() > 0);
        CHECK(liar.damages_since(0).front().kind == &kind);
        if (!keeps_its_messages(kind.way) || kind.way == Way::flip_bits || kind.way == Way::step)
            continue;
        for (const Victim& victim : kind.victims) {
            std::set<unsigned>& bytes = changed[victim.type];
            for (const Field& field : victim.fields) {
                INFO(field.name);
                const auto begin = bytes.lower_bound(field.offset);
                const auto end = bytes.lower_bound(field.offset + field.size);
                CHECK(begin != end);
                bytes.erase(begin, end);
            }
        }
        // A late answer's follow-up agrees with it.
        if (kind.way == Way::late) changed.erase(Type::clock_follow_up);
        for (const auto& [type, bytes] : changed) CHECK(bytes.empty());
    }
}

TEST_CASE("damage: the seed chooses") {
    std::vector<const Kind*> every;
    for (const Kind& kind : kinds()) every.push_back(&kind);
    const auto run = [&](std::uint64_t seed) {
        Liar liar(seed, damage_period);
        liar.obey({every, 0.5});
        return pass_all(liar, 2000);
    };
    CHECK(run(1) == run(1));
    CHECK(run(1) != run(2));
}

TEST_CASE("damage: as many as ordered") {
    Liar liar(1, damage_period);
    const Kind* kind = find_kind("start");
    liar.obey({{kind}, 1, 1});
    pass_all(liar, 700);
    CHECK(liar.damaged() == 1);
    liar.obey({{kind}, 0.5});
    pass_all(liar, 7000);
    CHECK(liar.damaged() == Approx(500).margin(80));
    liar.obey({{find_kind("late-record")}, 1, 1});
    pass_all(liar, 70);
    liar.obey({});  // also ends what would last
    const std::uint64_t before = liar.damaged();
    pass_all(liar, 700);
    CHECK(liar.damaged() == before);
}

TEST_CASE("damage: messages that change places are all reported") {
    for (const char* name : {"swap-messages", "swap-fields"}) {
        Liar liar(1, damage_period);
        liar.obey({{find_kind(name)}, 1});
        DamagedBoard board;
        std::multiset<std::int64_t> numbers;
        for (int i = 0; i < 3500; ++i) {
            if (i == 3493) liar.obey({});
            for (const Packet& damaged : liar.pass(board.next(), HostTime{i}))
                if (damaged.type == Type::exposure) numbers.insert(get(damaged, exposure::trigger));
        }
        CHECK(numbers.size() == 500);
        CHECK(std::set<std::int64_t>(numbers.begin(), numbers.end()).size() == 500);
    }
}

TEST_CASE("damage: a clock that steps does so in every message, and by whole periods") {
    Liar liar(1, damage_period);
    liar.obey({{find_kind("clock-step")}, 1, 1});
    DamagedBoard board;
    const Packet first = board.next();
    const std::int64_t step =
        get(liar.pass(first, {}).at(0), exposure::start) - get(first, exposure::start);
    CHECK(step != 0);
    CHECK(step % damage_period.ns == 0);
    for (int i = 0; i < 700; ++i) {
        const Packet packet = board.next();
        const Packet damaged = liar.pass(packet, {}).at(0);
        for (const Field& field : instants(packet.type))
            CHECK(get(damaged, field) - get(packet, field) == step);
    }
    liar.forget();
    const Packet packet = board.next();
    CHECK(liar.pass(packet, {}).at(0).payload == packet.payload);
}

TEST_CASE("damage: what was not observed stays so") {
    Liar liar(1, damage_period);
    liar.obey({{find_kind("record")}, 1});
    Packet packet = DamagedBoard().next();
    REQUIRE(packet.type == Type::exposure);
    set(packet, exposure::end, unobserved);
    const Packet damaged = liar.pass(packet, {}).at(0);
    CHECK(get(damaged, exposure::start) != get(packet, exposure::start));
    CHECK(get(damaged, exposure::end) == unobserved);
}

TEST_CASE("damage: a sample's serial number outlives every lie, and so does a frame's tick") {
    std::vector<const Kind*> every;
    for (const Kind& kind : kinds()) every.push_back(&kind);
    Liar liar(5, damage_period);
    liar.obey({every, 1});
    DamagedBoard board;
    std::set<std::uint64_t> given;
    for (int i = 0; i < 7000; ++i) {
        const Packet packet = board.next();
        if (packet.type == Type::imu_sample) given.insert(serial_in(packet));
        for (const Packet& damaged : liar.pass(packet, HostTime{i}))
            if (damaged.type == Type::imu_sample) CHECK(given.count(serial_in(damaged)) == 1);
        if (packet.type == Type::exposure)
            CHECK(liar.true_tick(static_cast<unsigned>(get(packet, exposure::camera)),
                                 static_cast<std::uint64_t>(get(packet, exposure::trigger))) ==
                  static_cast<std::uint64_t>(get(packet, exposure::tick)));
    }
}

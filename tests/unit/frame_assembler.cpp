// SPDX-License-Identifier: BSD-3-Clause
#include "camera/frame_assembler.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <utility>

using namespace versavis;
using namespace versavis::daemon;
using Datagram = std::vector<std::uint8_t>;

namespace {

/// Four packets of ten bytes and one of five.
constexpr std::size_t payload = 45;
constexpr std::size_t per_packet = 10;
constexpr std::uint32_t trailer_id = 6;
constexpr std::uint8_t untouched = 0xEE;

void put(Datagram& out, std::uint64_t value, unsigned bytes) {
    while (bytes-- > 0) out.push_back(static_cast<std::uint8_t>(value >> (8 * bytes)));
}

Datagram header(std::uint64_t block, std::uint32_t id, gvsp::Format format, bool extended) {
    Datagram out;
    put(out, 0, 2);
    put(out, extended ? 0 : block, 2);
    put(out, static_cast<std::uint64_t>(format) | (extended ? 0x80U : 0U), 1);
    put(out, extended ? 0 : id, 3);
    if (extended) put(out, block, 8);
    if (extended) put(out, id, 4);
    return out;
}

std::uint8_t pixel(std::uint64_t block, std::size_t at) {
    return static_cast<std::uint8_t>(block * 50 + at);
}

Datagram leader(std::uint64_t block, bool extended = false, std::uint16_t type = 1) {
    Datagram out = header(block, 0, gvsp::Format::leader, extended);
    put(out, type, 4);
    put(out, block * 1000, 8);
    put(out, 0x01080001, 4);
    put(out, 9, 4);
    put(out, 5, 4);
    out.resize(out.size() + 12);  // offsets and paddings
    return out;
}

Datagram data_packet(std::uint64_t block, std::uint32_t id, bool extended = false,
                     std::optional<std::size_t> size = {}) {
    Datagram out = header(block, id, gvsp::Format::payload, extended);
    const std::size_t begin = (id - 1) * per_packet;
    const std::size_t usual = begin < payload ? std::min(per_packet, payload - begin) : per_packet;
    for (std::size_t i = 0; i < size.value_or(usual); ++i) out.push_back(pixel(block, begin + i));
    return out;
}

Datagram trailer(std::uint64_t block, std::uint32_t id = trailer_id, bool extended = false) {
    Datagram out = header(block, id, gvsp::Format::trailer, extended);
    put(out, 1, 8);
    return out;
}

Datagram gvsp_packet(std::uint64_t block, std::uint32_t id, bool extended = false) {
    if (id == 0) return leader(block, extended);
    return id == trailer_id ? trailer(block, id, extended) : data_packet(block, id, extended);
}

using Range = std::pair<std::uint32_t, std::uint32_t>;

class AssemblerBench : private FrameAssembler::Owner {
 public:
    explicit AssemblerBench(bool extended = false, bool sends_again = true)
        : extended_(extended),
          assembler(
              {payload, 28 + (extended ? 20U : 8U) + per_packet, sends_again, milliseconds(100)},
              *this) {}

    void take(const Datagram& datagram) { assembler.take(datagram, now); }
    void send(std::uint64_t block, const std::vector<std::uint32_t>& ids) {
        for (const std::uint32_t id : ids) take(gvsp_packet(block, id, extended_));
    }
    void pass(Duration time) {
        now = now + time;
        assembler.advance(now);
    }
    std::vector<Range> asked() { return std::exchange(asked_, {}); }
    bool right(std::uint64_t block) const {
        const auto found = std::find_if(frames.begin(), frames.end(),
                                        [&](const auto& frame) { return frame.block_id == block; });
        return found != frames.end() && found->complete && found->size == payload &&
               found->leader->ticks == block * 1000 && found->leader->width == 9 &&
               bytes_right(*found);
    }
    bool nothing_beside() const {
        return std::all_of(slots_.begin(), slots_.end(), [](const Datagram& slot) {
            return std::count(slot.begin() + payload, slot.end(), untouched) ==
                   static_cast<std::ptrdiff_t>(slot.size() - payload);
        });
    }

 private:
    bool bytes_right(const FrameAssembler::Frame& frame) const {
        for (std::size_t at = 0; at < payload; ++at)
            if (slots_[frame.memory.slot][at] != pixel(frame.block_id, at)) return false;
        return true;
    }
    std::optional<FrameAssembler::Memory> begin_frame() override {
        if (slots_.size() == room) return std::nullopt;
        slots_.emplace_back(payload + 100, untouched);
        return FrameAssembler::Memory{static_cast<std::uint32_t>(slots_.size() - 1),
                                      slots_.back().data()};
    }
    void end_frame(const FrameAssembler::Frame& frame) override { frames.push_back(frame); }
    void ask(const gvsp::PacketRange& range) override {
        asked_.emplace_back(range.first, range.last);
    }

    bool extended_;
    std::vector<Datagram> slots_;
    std::vector<Range> asked_;

 public:
    std::size_t room = 1'000'000;
    HostTime now{1'000'000'000};
    std::vector<FrameAssembler::Frame> frames;
    FrameAssembler assembler;
};

const std::vector<std::uint32_t> all_packets{0, 1, 2, 3, 4, 5, 6};

}  // namespace

TEST_CASE("frame_assembler: a frame is whole with its last packet, in any order") {
    const bool extended = GENERATE(false, true);
    const std::uint64_t block = extended ? 0x100000000 : 0xFFFF;
    const auto order =
        GENERATE(std::vector(all_packets), std::vector<std::uint32_t>{6, 5, 4, 3, 2, 1, 0},
                 std::vector<std::uint32_t>{3, 0, 6, 1, 5, 2, 4});
    AssemblerBench bench(extended);
    for (const std::uint32_t id : order) {
        bench.pass({});
        CHECK(bench.frames.empty());
        bench.send(block, {id});
    }
    bench.pass({});
    CHECK(bench.frames.size() == 1);
    CHECK(bench.right(block));
    CHECK_FALSE(bench.assembler.deadline(bench.now));
}

TEST_CASE("frame_assembler: any lost packet is asked for, and makes the frame whole") {
    const std::uint32_t lost = GENERATE(0U, 1U, 3U, 5U);
    AssemblerBench bench;
    for (const std::uint32_t id : all_packets)
        if (id != lost) bench.send(1, {id});
    bench.pass({});
    CHECK(bench.asked() == std::vector<Range>{{lost, lost}});
    bench.pass(microseconds(2900));
    CHECK(bench.asked().empty());
    bench.pass(microseconds(100));
    CHECK(bench.asked() ==
          (lost == 0 ? std::vector<Range>{{0, 0}} : std::vector<Range>{{lost, lost}}));
    bench.send(1, {lost});
    bench.pass({});
    CHECK(bench.right(1));
}

TEST_CASE("frame_assembler: gaps are asked for while the frame still comes, each at once") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 3});
    bench.pass({});
    CHECK(bench.asked() == std::vector<Range>{{2, 2}});
    bench.send(1, {5});
    bench.pass({});
    CHECK(bench.asked() == std::vector<Range>{{4, 4}});
}

TEST_CASE("frame_assembler: a lost trailer is asked for in silence") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 2, 3, 4, 5});
    bench.pass({});
    CHECK(bench.asked().empty());
    CHECK(bench.assembler.deadline(bench.now) == bench.now + milliseconds(1));
    bench.pass(milliseconds(1));
    CHECK(bench.asked() == std::vector<Range>{{6, 6}});
    bench.send(1, {6});
    bench.pass({});
    CHECK(bench.right(1));
}

TEST_CASE("frame_assembler: data of the next frame shows the loss of a frame's end, a leader not") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 2, 3, 4, 5});
    bench.send(2, {0});
    bench.pass({});
    CHECK(bench.asked().empty());
    bench.send(2, {1});
    bench.pass({});
    CHECK(bench.asked() == std::vector<Range>{{6, 6}});
}

TEST_CASE("frame_assembler: a pause within a frame costs it nothing") {
    AssemblerBench bench;
    bench.send(1, {0});
    bench.pass(milliseconds(30));
    bench.send(1, {1, 2});
    for (int i = 0; i < 30; ++i) bench.pass(milliseconds(1));
    CHECK(bench.asked().empty());  // too many to be lost
    bench.send(1, {3, 5, 6});
    bench.pass({});
    CHECK(bench.asked() == std::vector<Range>{{4, 4}});
    bench.send(1, {4});
    bench.pass({});
    CHECK(bench.right(1));
}

TEST_CASE(
    "frame_assembler: what is not sent again is asked for thrice, then the frame is given up") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 3, 4, 5, 6});
    bench.send(2, all_packets);
    std::size_t asks = 0;
    for (int i = 0; i < 9; ++i) {
        bench.pass({});
        asks += bench.asked().size();
        CHECK(bench.frames.empty());  // in the order in which they were sent
        bench.pass(milliseconds(1));
    }
    CHECK(asks <= 3);
    CHECK(asks >= 2);  // within what may be asked for of so small a frame
    REQUIRE(bench.frames.size() == 2);
    CHECK(bench.frames[0].block_id == 1);
    CHECK_FALSE(bench.frames[0].complete);
    CHECK(bench.right(2));
}

TEST_CASE("frame_assembler: a camera that sends nothing again is not asked") {
    AssemblerBench bench(false, false);
    bench.send(1, {0, 1, 3, 4, 5, 6});
    for (int i = 0; i < 10; ++i) bench.pass(milliseconds(1));
    CHECK(bench.asked().empty());
    REQUIRE(bench.frames.size() == 1);
    CHECK_FALSE(bench.frames[0].complete);
}

TEST_CASE("frame_assembler: a frame that ends in silence is given up after its retention") {
    AssemblerBench bench;
    bench.send(1, {0, 1});
    bench.pass(microseconds(99'999));
    CHECK(bench.frames.empty());
    bench.pass(microseconds(1));
    REQUIRE(bench.frames.size() == 1);
    CHECK_FALSE(bench.frames[0].complete);
    bench.send(1, all_packets);  // too late
    bench.pass({});
    CHECK(bench.frames.size() == 1);
}

TEST_CASE("frame_assembler: two frames at the same time, across the wrap of their numbers") {
    AssemblerBench bench;
    for (const std::uint32_t id : all_packets) {
        bench.send(0xFFFF, {id});
        bench.send(1, {id});
    }
    bench.pass({});
    CHECK(bench.right(0xFFFF));
    CHECK(bench.right(1));
    bench.send(0xFFFF, {1});  // late
    bench.pass({});
    CHECK_FALSE(bench.assembler.deadline(bench.now));
}

TEST_CASE("frame_assembler: packets that come twice count once, also after their frame") {
    AssemblerBench bench;
    for (const std::uint32_t id : all_packets) {
        bench.send(1, {id});
        bench.send(1, {id});
    }
    bench.pass({});
    bench.send(1, all_packets);
    bench.pass({});
    CHECK(bench.frames.size() == 1);
    CHECK(bench.right(1));
}

TEST_CASE("frame_assembler: a packet that is too long or empty is as good as lost") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 3, 4, 5, 6});
    bench.take(data_packet(1, 2, false, per_packet + 1));
    bench.take(data_packet(1, 2, false, 0));
    bench.pass({});
    CHECK(bench.frames.empty());
    bench.send(1, {2});
    bench.pass({});
    CHECK(bench.right(1));
}

TEST_CASE("frame_assembler: a short packet within a frame is a hole") {
    AssemblerBench bench;
    bench.take(leader(1));
    bench.take(data_packet(1, 2, false, 4));
    bench.send(1, {1, 3, 4, 5, 6});
    bench.pass({});
    REQUIRE(bench.frames.size() == 1);
    CHECK_FALSE(bench.frames[0].complete);
}

TEST_CASE("frame_assembler: the last packet may be filled up, but not beyond the frame") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 2, 3, 4});
    bench.take(data_packet(1, 5, false, per_packet));
    bench.send(1, {6});
    bench.pass({});
    CHECK(bench.right(1));
    CHECK(bench.nothing_beside());
}

TEST_CASE("frame_assembler: smaller and larger frames come with their own size") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 2});
    bench.take(data_packet(1, 3, false, 3));
    bench.take(trailer(1, 4));
    bench.send(2, {0, 1, 2, 3, 4});
    bench.take(data_packet(2, 5, false, per_packet));
    bench.take(data_packet(2, 6));
    bench.take(data_packet(2, 7, false, 1));
    bench.take(trailer(2, 8));
    bench.pass({});
    REQUIRE(bench.frames.size() == 2);
    CHECK(bench.frames[0].complete);
    CHECK(bench.frames[0].size == 23);
    CHECK(bench.frames[1].complete);
    CHECK(bench.frames[1].size == 61);
    CHECK(bench.nothing_beside());
}

TEST_CASE("frame_assembler: a trailer amid the data is no end") {
    AssemblerBench bench;
    bench.send(1, {0, 1, 2, 3});
    bench.take(trailer(1, 2));
    bench.send(1, {4, 5, 6});
    bench.pass({});
    CHECK(bench.right(1));
}

TEST_CASE("frame_assembler: a leader of another payload is reported, its packets are dropped") {
    AssemblerBench bench;
    bench.take(leader(1, false, 0x4001));
    bench.send(1, {1, 2, 3, 4, 5, 6});
    bench.pass({});
    REQUIRE(bench.frames.size() == 1);
    CHECK_FALSE(bench.frames[0].complete);
    CHECK_FALSE(bench.frames[0].leader->image);
}

TEST_CASE("frame_assembler: a cut leader is asked for") {
    AssemblerBench bench;
    Datagram cut = leader(1);
    cut.resize(30);
    bench.take(cut);
    bench.send(1, {1, 2, 3, 4, 5, 6});
    bench.pass({});
    CHECK(bench.asked() == std::vector<Range>{{0, 0}});
    bench.send(1, {0});
    bench.pass({});
    CHECK(bench.right(1));
}

TEST_CASE("frame_assembler: frames that find no room are lost, the next is not") {
    AssemblerBench bench;
    bench.room = 0;
    bench.send(1, {0, 1, 2});
    bench.room = 1;
    bench.send(1, {3, 4, 5, 6});
    bench.send(2, all_packets);
    bench.pass({});
    REQUIRE(bench.frames.size() == 1);
    CHECK(bench.right(2));
}

TEST_CASE("frame_assembler: stray numbers take no more than a few slots") {
    AssemblerBench bench;
    for (std::uint64_t block = 1; block <= 100; ++block) bench.send(block, {1});
    CHECK(bench.frames.size() == 96);
    CHECK(bench.assembler.close().size() == 4);
}

TEST_CASE(
    "frame_assembler: the time that a frame still takes, for a thread that sleeps meanwhile") {
    AssemblerBench bench;
    CHECK_FALSE(bench.assembler.time_left(bench.now));
    bench.send(1, {0});
    bench.pass(milliseconds(20));  // an early leader says nothing of the rate
    CHECK(bench.assembler.time_left(bench.now) == Duration{});
    bench.send(1, {1});
    bench.pass(microseconds(300));
    CHECK(bench.assembler.time_left(bench.now) == microseconds(600));  // slow, so far
    bench.send(1, {2, 3});
    CHECK(bench.assembler.time_left(bench.now) == microseconds(300));
    bench.send(1, {5, 6});
    CHECK_FALSE(bench.assembler.time_left(bench.now));  // but for what is sent again
}

TEST_CASE("frame_assembler: a frame is expected to take as long as the shortest of late") {
    AssemblerBench bench;
    std::uint64_t block = 0;
    const auto send = [&](Duration length) {
        bench.send(++block, {0, 1, 2, 3, 4});
        bench.pass(length);
        bench.send(block, {5, 6});
        bench.pass(microseconds(100));
    };
    const auto expected = [&] {
        bench.send(++block, {0, 1});
        const auto left = bench.assembler.time_left(bench.now);
        bench.send(block, {2, 3, 4, 5, 6});
        bench.pass(microseconds(100));
        return left.value();
    };
    for (int i = 0; i < 60; ++i) send(microseconds(800));
    send(milliseconds(5));
    CHECK(expected() > microseconds(395));
    CHECK(expected() < microseconds(10));
}

TEST_CASE(
    "frame_assembler: damage of any kind neither writes beside a frame nor ends the service") {
    std::mt19937 random(1);
    AssemblerBench bench;
    for (int i = 0; i < 200'000; ++i) {
        const auto pick = [&](std::uint32_t end) { return random() % end; };
        Datagram made = gvsp_packet(1 + pick(20) + static_cast<std::uint64_t>(i) / 100, pick(9));
        const std::uint32_t damage = pick(4);
        if (damage == 0) made.resize(pick(static_cast<std::uint32_t>(made.size()) + 40));
        for (std::uint32_t k = 0; k < damage && !made.empty(); ++k)
            made[pick(static_cast<std::uint32_t>(std::min<std::size_t>(made.size(), 40)))] =
                static_cast<std::uint8_t>(random());
        bench.take(made);
        if (pick(10) == 0) bench.pass(microseconds(pick(2000)));
    }
    CHECK(bench.nothing_beside());
    bench.pass(milliseconds(100));
    bench.assembler.close();
    bench.send(0x8000, all_packets);
    bench.pass({});
    const auto last = bench.frames.back();
    CHECK((last.complete && last.block_id == 0x8000));
}

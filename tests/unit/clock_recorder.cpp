// SPDX-License-Identifier: BSD-3-Clause
#include "publish/clock_recorder.hpp"
#include "../support/look.hpp"

#include <catch2/catch.hpp>

#include "../support/temporary_directory.hpp"
#include "simulated_clocks.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::clock;

namespace {

struct Recorded {
    ClockItem item;
    OutputTime time;
};

/// A recorder on a simulated machine, and what is in its ring.
struct RecordedClock {
    HostTime now() const { return {clocks->value_ns(SystemClock::monotonic_raw)}; }
    OutputTime output_now() const { return {clocks->value_ns(SystemClock::realtime)}; }
    void tick() { recorder.tick(now()); }

    std::optional<Recorded> next() {
        const auto item = test::look(reader.next());
        if (item.found != test::Found::item) return std::nullopt;
        const auto read = from_metadata(unpack<ClockMetadata>(item.metadata));
        REQUIRE(read);
        return Recorded{*read, item.time.output()};
    }

    template <class Item>
    Item expect() {
        const auto recorded = next();
        REQUIRE(recorded);
        REQUIRE(std::holds_alternative<Item>(recorded->item));
        time = recorded->time;
        return std::get<Item>(recorded->item);
    }

    static ring::Writer make_ring(const std::filesystem::path& directory) {
        auto made = ring::Writer::create(directory, {"clock", ring::StreamKind::clock, 64});
        if (!made) throw std::runtime_error(made.error().message());
        return std::move(*made);
    }
    static ring::Reader open(const std::filesystem::path& directory) {
        auto opened = ring::Reader::open(directory / "clock", {Position::middle});
        if (!opened) throw std::runtime_error(opened.error().message());
        return std::move(*opened);
    }

    test::TemporaryDirectory directory{"/dev/shm"};
    std::shared_ptr<test::SimulatedClocks> clocks = std::make_shared<test::SimulatedClocks>();
    Translator translator{*OutputClock::create(OutputClockKind::realtime, false, clocks)};
    daemon::ClockRecorder recorder{make_ring(directory.path()), translator};
    ring::Reader reader = open(directory.path());
    OutputTime time;  ///< of the item that came last
};

}  // namespace

TEST_CASE(
    "clock_recorder: what it is given is in the ring, with the board's nonce and the output time") {
    RecordedClock recording;
    recording.recorder.board_restarted(77);
    CHECK(recording.expect<RecordedOutput>().epoch == 0);
    CHECK(recording.expect<RecordedRestart>().nonce == 77);
    const HostTime arrived = recording.now() - milliseconds(3);
    recording.recorder.exchange(5, {arrived - microseconds(80), {1'000}, {2'000}, arrived});
    const auto exchange = recording.expect<RecordedExchange>();
    CHECK(exchange.nonce == 77);
    CHECK(exchange.request == 5);
    CHECK(exchange.flags == 0);
    CHECK(exchange.sent == arrived - microseconds(80));
    CHECK(exchange.received == BoardTime{1'000});
    CHECK(exchange.answered == BoardTime{2'000});
    CHECK(exchange.arrived == arrived);
    CHECK(absolute(recording.time - (recording.output_now() - milliseconds(3))) < microseconds(1));
    recording.recorder.one_way({{3'000}, arrived});
    const auto one_way = recording.expect<RecordedMessage>();
    CHECK(one_way.nonce == 77);
    CHECK(one_way.departed == BoardTime{3'000});
    CHECK(one_way.arrived == arrived);
    CHECK_FALSE(recording.next());
    CHECK(recording.recorder.items() == 4);
}

TEST_CASE("clock_recorder: the output clock is reported once a second, and at each step") {
    RecordedClock recording;
    for (int i = 0; i < 30; ++i) {
        recording.tick();
        recording.clocks->pass(milliseconds(50));
    }
    const auto first = recording.expect<RecordedOutput>();
    const auto second = recording.expect<RecordedOutput>();
    CHECK_FALSE(recording.next());
    CHECK(absolute(second.host - first.host - seconds(1)) <= milliseconds(51));
    CHECK(second.epoch == first.epoch);
    CHECK(second.uncertainty > Duration{});
    CHECK(recording.time.ns == second.host.ns + second.minus_host.ns);
    recording.clocks->step(seconds(1));
    recording.tick();
    const auto stepped = recording.expect<RecordedOutput>();
    CHECK(stepped.epoch == first.epoch + 1);
    CHECK(absolute(stepped.minus_host - first.minus_host - seconds(1)) < microseconds(1));
    recording.tick();
    CHECK_FALSE(recording.next());
}

TEST_CASE("clock_recorder: a step is reported before the first item that is stamped after it") {
    RecordedClock recording;
    recording.tick();
    recording.expect<RecordedOutput>();
    recording.clocks->step(-seconds(1));
    recording.recorder.one_way({{1}, recording.now()});
    const auto stepped = recording.expect<RecordedOutput>();
    recording.expect<RecordedMessage>();
    CHECK(stepped.epoch == 1);
    CHECK(absolute(recording.time - recording.output_now()) < microseconds(1));
}

// SPDX-License-Identifier: BSD-3-Clause
#include "board/stamping_reader.hpp"

#include <sched.h>

#include <catch2/catch.hpp>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <numeric>
#include <vector>

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// Hands out what the test gives it, with the stamps that the test gives it.
class PlayedStream final : public ByteStream {
 public:
    struct Given {
        HostTime received;
        std::vector<std::uint8_t> bytes;
    };

    Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) override {
        policy_ = ::sched_getscheduler(0);
        if (restless_) return Chunk{};
        std::unique_lock lock(mutex_);
        idle_ = given_.empty();
        changed_.notify_all();
        const auto any = [this] { return !given_.empty() || ended_; };
        if (!changed_.wait_for(lock, std::chrono::nanoseconds(timeout.ns), any)) return Chunk{};
        if (given_.empty()) return failure("played", "ended");
        const Given given = std::move(given_.front());
        given_.pop_front();
        std::copy(given.bytes.begin(), given.bytes.end(), into.begin());
        return Chunk{given.received, given.bytes.size()};
    }
    Expected<> write(std::span<const std::uint8_t> /*bytes*/) override { return {}; }
    std::string port() const override { return "played"; }

    void give(const Given& given) {
        const std::lock_guard lock(mutex_);
        given_.push_back(given);
        idle_ = false;
        changed_.notify_all();
    }
    void never_sleep() { restless_ = true; }
    int policy() const { return policy_; }
    void end() {
        const std::lock_guard lock(mutex_);
        ended_ = true;
        changed_.notify_all();
    }
    /// Until the reader has kept all that was given, and waits for more.
    void wait_until_read() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return idle_; });
    }

 private:
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Given> given_;
    bool ended_ = false;
    bool idle_ = false;
    std::atomic<bool> restless_{false};
    std::atomic<int> policy_{-1};  ///< of the thread that reads
};

struct StampingBench {
    /// Bytes and stamps that the reader has for its consumer.
    Expected<> drain() {
        return reader.drain([&](std::span<const std::uint8_t> piece, HostTime received) {
            bytes.insert(bytes.end(), piece.begin(), piece.end());
            stamps.push_back(received);
        });
    }

    PlayedStream stream;
    WakeUp wake;
    StampingReader reader{stream, wake};
    std::vector<std::uint8_t> bytes;
    std::vector<HostTime> stamps;
};

}  // namespace

TEST_CASE("stamping_reader: bytes come in order, each with the stamp of its arrival") {
    StampingBench bench;
    bench.stream.give({HostTime{100}, {1, 2, 3}});
    bench.stream.give({HostTime{200}, {4}});
    bench.stream.wait_until_read();
    REQUIRE(bench.drain());
    CHECK(bench.bytes == std::vector<std::uint8_t>{1, 2, 3, 4});
    CHECK(bench.stamps == std::vector{HostTime{100}, HostTime{200}});
    REQUIRE(bench.drain());
    CHECK(bench.stamps.size() == 2);
}

TEST_CASE("stamping_reader: a large chunk keeps one stamp") {
    StampingBench bench;
    std::vector<std::uint8_t> large(largest_chunk);
    std::iota(large.begin(), large.end(), std::uint8_t{0});
    bench.stream.give({HostTime{100}, large});
    bench.stream.wait_until_read();
    REQUIRE(bench.drain());
    CHECK(bench.bytes == large);
    for (const HostTime stamp : bench.stamps) CHECK(stamp == HostTime{100});
}

TEST_CASE("stamping_reader: the consumer is woken by bytes and by the end") {
    StampingBench bench;
    bench.stream.give({HostTime{100}, {1}});
    while (bench.bytes.empty()) {
        bench.wake.wait(seconds(60));
        REQUIRE(bench.drain());
    }
    bench.stream.end();
    for (;;) {
        bench.wake.wait(seconds(60));
        const auto drained = bench.drain();
        if (drained) continue;
        CHECK_THAT(drained.error().message(), Catch::Contains("ended"));
        break;
    }
}

TEST_CASE("stamping_reader: what came before the end is taken before the error") {
    StampingBench bench;
    for (std::uint8_t i = 0; i < 50; ++i) bench.stream.give({HostTime{i}, {i}});
    bench.stream.end();
    while (bench.drain()) bench.wake.wait(seconds(60));
    CHECK(bench.bytes.size() == 50);
}

TEST_CASE("stamping_reader: what finds no room is counted, and what follows is taken again") {
    StampingBench bench;
    constexpr std::size_t excess = 10;
    for (std::size_t i = 0; i < StampingReader::capacity + excess; ++i)
        bench.stream.give({HostTime{1}, {7, 7}});
    bench.stream.wait_until_read();
    CHECK(bench.reader.dropped() == 2 * excess);
    REQUIRE(bench.drain());
    CHECK(bench.bytes.size() == 2 * StampingReader::capacity);
    bench.stream.give({HostTime{2}, {8}});
    bench.stream.wait_until_read();
    REQUIRE(bench.drain());
    CHECK(bench.bytes.back() == 8);
}

TEST_CASE("stamping_reader: a stream that never sleeps does not keep real-time priority") {
    StampingBench bench;
    bench.stream.never_sleep();
    bench.stream.give({HostTime{1}, {1}});
    const HostTime deadline = host_now() + seconds(10);
    while (bench.stream.policy() != SCHED_OTHER && host_now() < deadline) std::this_thread::yield();
    CHECK(bench.stream.policy() == SCHED_OTHER);
}

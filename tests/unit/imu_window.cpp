// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/imu_window.hpp"

#include <catch2/catch.hpp>
#include <memory>
#include <thread>
#include <vector>

#include "../support/sleep.hpp"
#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"

using namespace versavis;

namespace {

struct Samples {
    test::TemporaryDirectory directory{"/dev/shm"};
    std::unique_ptr<ring::Writer> writer = make();
    std::uint64_t number = 0;

    std::unique_ptr<ring::Writer> make() const {
        return std::make_unique<ring::Writer>(
            *ring::Writer::create(directory.path(), {"imu", ring::StreamKind::imu, 64}));
    }
    ImuWindow open() const {
        StreamOptions options;
        options.instance = test::instance_in(directory.path());
        auto window = ImuWindow::open("imu", options);
        REQUIRE(window);
        return std::move(*window);
    }
    /// An instant of the window's life.
    EpochTime at(std::int64_t time_ns, std::uint32_t epoch) const {
        const auto ring =
            ring::Mapping::open(directory.path() / "imu", ring::Mapping::Access::read_only);
        return {ring->constants().life, time_ns, epoch};
    }
    void add(std::int64_t time_ns, std::uint32_t epoch = 1, std::uint64_t skipped = 0) {
        ImuMetadata metadata{};
        number += 1 + skipped;
        metadata.number = number;
        metadata.epoch = epoch;
        writer->publish(OutputTime{time_ns}, pack(metadata));
    }
};

std::vector<std::int64_t> times(const ImuSpan& span) {
    std::vector<std::int64_t> found;
    for (const ImuSample& sample : span.samples) found.push_back(sample.time.ns);
    return found;
}

using Times = std::vector<std::int64_t>;

}  // namespace

TEST_CASE_METHOD(Samples, "imu_window: after the first instant, up to and with the second") {
    for (int i = 0; i <= 10; ++i) add(100 * i);
    ImuWindow window = open();
    const auto span = window.between(at(200, 1), at(500, 1), {});
    REQUIRE(span);
    CHECK(times(*span) == Times{300, 400, 500});
    REQUIRE(span->beyond);
    CHECK(span->beyond->time.ns == 600);
    CHECK(span->complete());
    CHECK(times(*window.between(at(500, 1), at(650, 1), {})) == Times{600});
    CHECK(times(*window.between(at(650, 1), at(650, 1), {})).empty());
}

TEST_CASE_METHOD(Samples, "imu_window: a span that is not covered says so") {
    for (int i = 5; i <= 10; ++i) add(100 * i);
    ImuWindow window = open();
    CHECK_FALSE(window.between(at(200, 1), at(700, 1), {})
                    ->covered());  // nothing is known of its beginning
    CHECK(window.between(at(600, 1), at(1000, 1), {})->covered());
    const auto ahead = window.between(at(800, 1), at(1100, 1), milliseconds(1));
    REQUIRE(ahead);
    CHECK(times(*ahead) == Times{900, 1000});
    CHECK_FALSE(ahead->covered());
    CHECK_FALSE(ahead->beyond);
}

TEST_CASE_METHOD(Samples, "imu_window: samples that are missing are counted") {
    add(100);
    add(200);
    add(300, 1, 4);
    add(400);
    add(500, 1, 2);
    ImuWindow window = open();
    CHECK(window.between(at(100, 1), at(400, 1), {})->lost == 4 + 2);  // up to the one beyond
    CHECK(window.between(at(200, 1), at(300, 1), {})->lost ==
          4);  // between the instant and the first
    CHECK(window.between(at(300, 1), at(350, 1), {})->lost == 0);
    for (const std::uint64_t back : {0, 2}) {  // numbers that stand still or go back
        number -= 1 + back;
        add(static_cast<std::int64_t>(600 + 100 * back));
    }
    CHECK(window.between(at(500, 1), at(800, 1), {})->lost == 0);
    CHECK_FALSE(window.between(at(500, 1), at(800, 1), {})->complete());
}

TEST_CASE_METHOD(Samples, "imu_window: it waits until the second instant is reached [threads]",
                 "[threads]") {
    add(100);
    ImuWindow window = open();
    std::thread writing([&] {
        for (int i = 2; i <= 50; ++i) add(100 * i);
    });
    const auto span = window.between(at(100, 1), at(5000, 1), seconds(20));
    writing.join();
    REQUIRE(span);
    CHECK(span->samples.size() == 49);
    CHECK(span->complete());
}

TEST_CASE_METHOD(Samples, "imu_window: one that waits sleeps on its stream's word [threads]",
                 "[threads]") {
    add(100);
    ImuWindow window = open();
    const auto ring =
        *ring::Mapping::open(directory.path() / "imu", ring::Mapping::Access::read_only);
    std::thread waiting(
        [&] { static_cast<void>(window.between(at(100, 1), at(200, 1), seconds(60))); });
    CHECK(test::wake_sleeper(ring.header().wake));
    add(200);
    waiting.join();
}

TEST_CASE_METHOD(Samples, "imu_window: who is overtaken gets what there is at the next look") {
    ImuWindow window = open();
    REQUIRE(window.collect());
    for (int i = 1; i <= 200; ++i) add(i);
    REQUIRE(window.collect());
    CHECK(window.reaches(at(200, 1)));
    CHECK_FALSE(window.reaches(at(201, 1)));
}

TEST_CASE_METHOD(Samples, "imu_window: it holds more than the ring, and not all for ever") {
    constexpr int published = 140'000;
    ImuWindow window = open();
    for (int i = 1; i <= published; ++i) {
        add(i);
        if (i % 32 == 0) REQUIRE(window.collect());
        if (i == 200)  // the ring has forgotten it
            for (const std::int64_t upto : {30, 20})
                CHECK(window.between(at(10, 1), at(upto, 1), {})->complete());
    }
    const auto kept = window.take(at(0, 1), at(published, 1));
    CHECK(kept.samples.size() > 100'000);
    CHECK(kept.samples.size() < published - 1000);
    CHECK(kept.samples.back().time.ns == published);
}

TEST_CASE_METHOD(Samples, "imu_window: what lies before its beginning is found, too") {
    for (int i = 1; i <= 100; ++i) add(i);
    ImuWindow window = open();
    REQUIRE(window.collect());
    const auto span = window.between(at(40, 1), at(50, 1), {});
    CHECK(span->complete());
    CHECK(span->samples.size() == 10);
}

TEST_CASE_METHOD(Samples, "imu_window: what was forgotten is found again while the ring holds it") {
    for (int i = 1; i <= 10; ++i) add(100 * i);
    ImuWindow window = open();
    CHECK(times(*window.between(at(700, 1), at(900, 1), {})) == Times{800, 900});
    const auto earlier = window.between(at(250, 1), at(400, 1), {});
    CHECK(times(*earlier) == Times{300, 400});
    CHECK(earlier->complete());
    CHECK_FALSE(window.between(at(50, 1), at(400, 1), {})->covered());  // there is none before
}

TEST_CASE_METHOD(Samples, "imu_window: why a span is not covered") {
    for (int i = 1; i <= 5; ++i) add(1000 + 100 * i);
    for (int i = 1; i <= 3; ++i) add(1200 + 100 * i, 2);  // the clock went back by 300
    ImuWindow window = open();
    const auto gap = [&](std::int64_t after, std::int64_t upto, std::uint32_t epoch) {
        return window.between(at(after, epoch), at(upto, epoch), {})->gap;
    };
    CHECK(gap(1100, 1500, 1) == SpanGap::none);
    CHECK(gap(1000, 1500, 1) == SpanGap::begin);
    CHECK(gap(1100, 1501, 1) == SpanGap::epoch);  // it ended
    CHECK(gap(1299, 1400, 2) == SpanGap::epoch);  // it began
    CHECK(gap(1300, 1400, 2) == SpanGap::none);
    CHECK(gap(1300, 1501, 2) == SpanGap::end);
    CHECK(gap(1300, 1301, 3) == SpanGap::epoch);
    --number;
    add(1600, 2);
    CHECK(gap(1500, 1600, 2) == SpanGap::numbers);
    CHECK(gap(1400, 1500, 2) == SpanGap::numbers);  // up to the one beyond
    CHECK(gap(1400, 1450, 2) == SpanGap::none);
    for (const auto& [why, name] :
         {std::pair{SpanGap::none, "none"}, std::pair{SpanGap::begin, "begin"},
          std::pair{SpanGap::end, "end"}, std::pair{SpanGap::epoch, "epoch"},
          std::pair{SpanGap::numbers, "numbers"}})
        CHECK(to_string(why) == std::string(name));
}

TEST_CASE_METHOD(Samples, "imu_window: times of two epochs do not meet, whichever is asked for") {
    for (int i = 1; i <= 9; ++i) add(100 * i);
    for (int i = 1; i <= 9; ++i) add(100 * i + 50, 2);  // the clock went back by 750
    ImuWindow window = open();
    for (int round = 0; round < 2; ++round) {
        const auto first = window.between(at(200, 1), at(500, 1), {});
        CHECK(times(*first) == Times{300, 400, 500});
        CHECK(first->beyond->time.ns == 600);
        CHECK(first->complete());
        const auto second = window.between(at(150, 2), at(350, 2), {});
        CHECK(times(*second) == Times{250, 350});
        CHECK(second->beyond->time.ns == 450);
        CHECK(second->complete());
    }
    // All of an epoch, and nothing of the next.
    const auto rest =
        window.between(at(500, 1), at(100'000, 1), seconds(60));  // nothing to wait for
    CHECK(times(*rest) == Times{600, 700, 800, 900});
    CHECK_FALSE(rest->beyond);
    CHECK_FALSE(rest->complete());
}

TEST_CASE_METHOD(Samples, "imu_window: after a restart, nothing of before is left") {
    for (int i = 1; i <= 5; ++i) add(100 * i);
    ImuWindow window = open();
    CHECK(window.between(at(200, 1), at(300, 1), {})->complete());
    writer.reset();
    writer = make();
    add(10);
    const auto restarted = window.between(at(50, 1), at(60, 1), {});
    REQUIRE_FALSE(restarted);
    CHECK(restarted.error().why == Pause::restarted);
    CHECK_FALSE(window.reaches(at(0, 1)));
    CHECK(times(*window.between(at(5, 1), at(10, 1), {})) == Times{10});
    CHECK(window.between(at(5, 1), at(10, 1), {})->gap == SpanGap::begin);
}

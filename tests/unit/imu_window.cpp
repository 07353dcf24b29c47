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
        options.instance = std::filesystem::relative(directory.path(), "/dev/shm/versavis");
        auto window = ImuWindow::open("imu", options);
        REQUIRE(window);
        return std::move(*window);
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
    const auto span = window.between({200}, {500}, {});
    REQUIRE(span);
    CHECK(times(*span) == Times{300, 400, 500});
    REQUIRE(span->beyond);
    CHECK(span->beyond->time.ns == 600);
    CHECK(span->complete());
    CHECK(times(*window.between({500}, {650}, {})) == Times{600});
    CHECK(times(*window.between({650}, {650}, {})).empty());
}

TEST_CASE_METHOD(Samples, "imu_window: a span that is not covered says so") {
    for (int i = 5; i <= 10; ++i) add(100 * i);
    ImuWindow window = open();
    CHECK_FALSE(window.between({200}, {700}, {})->covered);  // nothing is known of its beginning
    CHECK(window.between({600}, {1000}, {})->covered);
    const auto ahead = window.between({800}, {1100}, milliseconds(1));
    REQUIRE(ahead);
    CHECK(times(*ahead) == Times{900, 1000});
    CHECK_FALSE(ahead->covered);
    CHECK_FALSE(ahead->beyond);
}

TEST_CASE_METHOD(Samples, "imu_window: samples that are missing are counted") {
    add(100);
    add(200);
    add(300, 1, 4);
    add(400);
    add(500, 1, 2);
    ImuWindow window = open();
    CHECK(window.between({100}, {400}, {})->lost == 4 + 2);  // up to the one beyond
    CHECK(window.between({200}, {300}, {})->lost == 4);      // between the instant and the first
    CHECK(window.between({300}, {350}, {})->lost == 0);
    for (const std::uint64_t back : {0, 2}) {  // numbers that stand still or go back
        number -= 1 + back;
        add(static_cast<std::int64_t>(600 + 100 * back));
    }
    CHECK(window.between({500}, {800}, {})->lost == 0);
}

TEST_CASE_METHOD(Samples, "imu_window: it waits until the second instant is reached [threads]",
                 "[threads]") {
    add(100);
    ImuWindow window = open();
    std::thread writing([&] {
        for (int i = 2; i <= 50; ++i) add(100 * i);
    });
    const auto span = window.between({100}, {5000}, seconds(20));
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
    std::thread waiting([&] { static_cast<void>(window.between({100}, {200}, seconds(60))); });
    CHECK(test::wake_sleeper(ring.header().wake));
    add(200);
    waiting.join();
}

TEST_CASE_METHOD(Samples, "imu_window: who is overtaken gets what there is at the next look") {
    ImuWindow window = open();
    REQUIRE(window.collect());
    for (int i = 1; i <= 200; ++i) add(i);
    REQUIRE(window.collect());
    CHECK(window.reaches({200}));
    CHECK_FALSE(window.reaches({201}));
}

TEST_CASE_METHOD(Samples, "imu_window: it holds more than the ring, and not all for ever") {
    constexpr int published = 140'000;
    ImuWindow window = open();
    for (int i = 1; i <= published; ++i) {
        add(i);
        if (i % 32 == 0) REQUIRE(window.collect());
        if (i == 200)  // the ring has forgotten it
            for (const std::int64_t upto : {30, 20})
                CHECK(window.between({10}, {upto}, {})->complete());
    }
    const auto kept = window.take({0}, {published});
    CHECK(kept.samples.size() > 100'000);
    CHECK(kept.samples.size() < published - 1000);
    CHECK(kept.samples.back().time.ns == published);
}

TEST_CASE_METHOD(Samples, "imu_window: what lies before its beginning is found, too") {
    for (int i = 1; i <= 100; ++i) add(i);
    ImuWindow window = open();
    REQUIRE(window.collect());
    const auto span = window.between({40}, {50}, {});
    CHECK(span->complete());
    CHECK(span->samples.size() == 10);
}

TEST_CASE_METHOD(Samples, "imu_window: what was forgotten is found again while the ring holds it") {
    for (int i = 1; i <= 10; ++i) add(100 * i);
    ImuWindow window = open();
    CHECK(times(*window.between({700}, {900}, {})) == Times{800, 900});
    const auto earlier = window.between({250}, {400}, {});
    CHECK(times(*earlier) == Times{300, 400});
    CHECK(earlier->complete());
    CHECK_FALSE(window.between({50}, {400}, {})->covered);  // there is none before
}

TEST_CASE_METHOD(Samples, "imu_window: times of two epochs, or of two services, do not meet") {
    for (int i = 1; i <= 5; ++i) add(1000 + 100 * i);
    ImuWindow window = open();
    REQUIRE(window.collect());
    add(50, 2);
    add(60, 2);
    CHECK(times(*window.between({50}, {60}, {})) == Times{60});
    writer.reset();
    writer = make();
    add(10, 3);
    const auto restarted = window.between({50}, {60}, {});
    REQUIRE_FALSE(restarted);
    CHECK(restarted.error().why == Pause::restarted);
    CHECK(times(*window.between({5}, {10}, {})) == Times{10});
}

TEST_CASE_METHOD(Samples, "imu_window: nothing of an epoch or service before is left in a span") {
    const bool new_service = GENERATE(false, true);
    for (int i = 1; i <= 5; ++i) add(100 * i);
    ImuWindow window = open();
    CHECK(window.between({200}, {300}, {})->complete());
    if (new_service) {
        writer = make();
        CHECK(window.collect().error().why == Pause::restarted);
        CHECK_FALSE(window.reaches({0}));
    }
    for (int i = 6; i <= 9; ++i) add(100 * i, new_service ? 1 : 2);
    REQUIRE(window.collect());
    const auto span = window.take({350}, {800});
    CHECK(times(span) == Times{600, 700, 800});
    CHECK_FALSE(span.covered);
}

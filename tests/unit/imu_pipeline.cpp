// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/imu_pipeline.hpp"
#include "../support/look.hpp"

#include <catch2/catch.hpp>
#include <random>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// Samples without which none is published.
constexpr std::uint32_t neighbours = 31;

wire::ImuSample sample(std::uint32_t number, BoardTime at, std::uint16_t flags = 0) {
    wire::ImuSample sample{};
    sample.kind = wire::ImuKind::adis16448b;
    sample.number = number;
    sample.time_ns = at.ns;
    sample.flags = flags;
    return sample;
}

/// An IMU of 200 Hz whose samples the test makes; each is here a millisecond later.
struct ImuBench : test::Pipelines {
    explicit ImuBench(bool clock_known = true) {
        if (clock_known) synchronise(begin);
    }

    static ImuConfiguration configuration() {
        ImuConfiguration made;
        made.model = imu::find_model("adis16448b");
        made.filter_delay_us = 0;
        made.data_ready = true;
        return made;
    }
    HostTime instant(std::int64_t i) const { return begin + milliseconds(5) * i; }

    /// The i-th sample, of a board whose clock is `off`.
    bool add(std::uint32_t number, std::int64_t i, Duration off = {}, std::uint16_t flags = 0) {
        return pipeline.add(sample(number, to_board(instant(i)) + off, flags),
                            instant(i) + phase + milliseconds(1));
    }
    void run(std::uint32_t from, std::uint32_t to, Duration off = {}) {
        for (std::uint32_t i = from; i < to; ++i) add(i, i, off);
    }
    std::vector<ring::Item> published() {
        std::vector<ring::Item> items;
        for (auto item = test::look(reader_.next()); item.found == test::Found::item;
             item = test::look(reader_.next()))
            items.push_back(item);
        return items;
    }

    const HostTime begin{50'000'000'000};
    Duration phase;  ///< by which samples come later than they did
    ImuPipeline pipeline{configuration(), writer({"imu0", ring::StreamKind::imu, 64}), translator,
                         events};

 private:
    ring::Reader reader_ = reader("imu0");
};

}  // namespace

TEST_CASE(
    "imu_pipeline: nothing before the clock is known, numbers go on over 32 bits, losses are "
    "counted") {
    ImuBench bench(false);
    for (std::uint32_t i = 0; i < neighbours; ++i) bench.add(0xFFFFFFFE - neighbours + i, i);
    CHECK(bench.pipeline.report().no_clock == neighbours);
    bench.synchronise(bench.begin);
    for (std::uint32_t i = 0; i < 2; ++i) CHECK(bench.add(0xFFFFFFFE + i, neighbours + i));
    CHECK(bench.pipeline.report().no_clock == neighbours);
    bench.add(2, neighbours + 4);
    bench.add(3, neighbours + 5, {}, wire::imu_check_failed);
    const auto items = bench.published();
    REQUIRE(items.size() == 4);
    CHECK(unpack<ImuMetadata>(items[1].metadata).number == 0xFFFFFFFFU);
    CHECK(unpack<ImuMetadata>(items[2].metadata).number == 0x100000002U);
    CHECK((unpack<ImuMetadata>(items[3].metadata).flags & flag_sensor_error) != 0);
    CHECK(bench.pipeline.report().lost == 2);
    CHECK(bench.pipeline.report().faulty == 1);
    bench.pipeline.board_restarted();
    for (std::uint32_t i = 0; i <= neighbours; ++i) bench.add(i, 50 + i);
    CHECK(unpack<ImuMetadata>(bench.published().at(0).metadata).number == neighbours);
    CHECK(bench.pipeline.report().lost == 2);
}

TEST_CASE("imu_pipeline: a sample from the future is withheld, and those after it are not") {
    ImuBench bench;
    const Duration lie = GENERATE(seconds(1000), milliseconds(20));
    bench.run(0, 40);
    CHECK_FALSE(bench.add(40, 40, lie));
    bench.run(41, 50);
    const auto items = bench.published();
    REQUIRE(items.size() == 49 - neighbours);
    for (std::size_t i = 0; i < items.size(); ++i) {
        const auto metadata = unpack<ImuMetadata>(items[i].metadata);
        CHECK(metadata.flags == 0);
        CHECK(absolute(metadata.host_time - bench.instant(static_cast<int>(metadata.number))) <=
              microseconds(1));
    }
    CHECK(bench.pipeline.report().doubted == 1);
    CHECK(bench.pipeline.report().lost == 1);
    const auto event = unpack<EventMetadata>(test::look(bench.reader("events").next()).metadata);
    CHECK(event.kind == EventKind::message_doubted);
    CHECK(event.value == (test::Pipelines::to_board(bench.instant(40)) + lie).ns);
}

TEST_CASE("imu_pipeline: a lie that comes first is not published, and misleads nobody") {
    ImuBench bench;
    bench.add(GENERATE(2U, 1U << 30U), 0);
    bench.run(1, 50);
    const auto items = bench.published();
    REQUIRE(items.size() == 49 - neighbours);
    CHECK(unpack<ImuMetadata>(items[0].metadata).number == neighbours + 1);
    CHECK(bench.pipeline.report().lost == 0);
}

TEST_CASE("imu_pipeline: samples that lie alike from the first on for a while are not published") {
    ImuBench bench;
    bench.run(0, 20, -milliseconds(4));
    bench.run(20, 100);
    for (const ring::Item& item : bench.published()) {
        const auto metadata = unpack<ImuMetadata>(item.metadata);
        CHECK(absolute(metadata.host_time - bench.instant(static_cast<int>(metadata.number))) <=
              microseconds(1));
    }
    CHECK(bench.pipeline.report().published >= 25);
}

TEST_CASE("imu_pipeline: lies among those of a new phase do not keep it out") {
    ImuBench bench;
    bench.run(0, 40);
    bench.phase = -milliseconds(2);
    for (std::uint32_t i = 40; i < 100; ++i) {
        bench.add(i, i, i % 4 == 0 ? -milliseconds(i) : bench.phase);
        if (i % 10 == 0) bench.exchange(bench.instant(i));
    }
    bench.published();
    bench.run(100, 110, bench.phase);
    CHECK(bench.published().size() == 10);
}

TEST_CASE("imu_pipeline: a sample that lies by less than a period, or by number, is withheld") {
    ImuBench bench;
    bench.run(0, 40);
    CHECK_FALSE(bench.add(40, 40, GENERATE(microseconds(100), -microseconds(100))));
    CHECK_FALSE(bench.add(40 + (1U << 31U), 41));
    CHECK_FALSE(bench.add(45, 42));
    CHECK(bench.add(43, 43));
    CHECK(bench.pipeline.report().lost == 3);
}

TEST_CASE("imu_pipeline: held stamps and those of a clock without contact say so") {
    ImuBench bench;
    bench.run(0, neighbours + 2);
    const std::int64_t later = 4000 / 5;  // four seconds without contact
    bench.add(later, later);
    const auto items = bench.published();
    REQUIRE(items.size() == 3);
    CHECK((unpack<ImuMetadata>(items[1].metadata).flags & flag_holdover) == 0);
    CHECK((unpack<ImuMetadata>(items[2].metadata).flags & flag_holdover) != 0);
}

TEST_CASE("imu_pipeline: samples that agree in a new phase are taken if they also come in it") {
    ImuBench bench;
    // Exchanges until the estimate is good enough to compare delays of 0.1 ms by.
    std::vector<ring::Item> before;
    for (std::uint32_t i = 0; i < 400; ++i) {
        if (i % 20 == 0) bench.exchange(bench.instant(i));
        bench.add(i, i);
        before = bench.published();
    }
    const Duration said = GENERATE(-milliseconds(2), milliseconds(2));
    const bool comes = GENERATE(true, false);
    if (comes) bench.phase = said;
    for (std::uint32_t i = 400; i < 410; ++i) CHECK_FALSE(bench.add(i, i, said));
    for (std::uint32_t i = 400; i < 480; i += 20) bench.exchange(bench.instant(i));
    bench.run(410, 420, said);
    const auto after = bench.published();
    REQUIRE(after.size() == (comes ? 10 : 0));
    if (!comes) return;
    // The others have nothing to do with it, and numbers go on.
    CHECK(unpack<ImuMetadata>(after[0].metadata).epoch ==
          unpack<ImuMetadata>(before[0].metadata).epoch);
    CHECK(unpack<ImuMetadata>(after[9].metadata).number == 419);
    CHECK(absolute(unpack<ImuMetadata>(after[9].metadata).host_time - (bench.instant(419) + said)) <
          microseconds(5));
}

TEST_CASE("imu_pipeline: a clock that is known to 50 us tells a period from a new phase") {
    ImuBench bench{false};
    std::mt19937 random{1};
    std::exponential_distribution<double> wait{1e-6};  // 1 ms in the mean
    const auto delay = [&] {
        return microseconds(300) + Duration{static_cast<std::int64_t>(wait(random))};
    };
    constexpr std::uint32_t slip = 200;
    std::uint32_t withheld = 0;
    for (std::uint32_t i = 0; i < slip + 200; ++i) {
        const HostTime host = bench.instant(i);
        const BoardTime board = test::Pipelines::to_board(host);
        if (i % 20 == 0) bench.translator.add({host - delay(), board, board, host + delay()});
        const std::uint32_t number = i < slip ? i : i - 3;
        bench.pipeline.add(sample(number, board), host + delay());
        if (bench.published().empty() && i >= slip) ++withheld;
    }
    const auto estimate = bench.translator.to_host(test::Pipelines::to_board(bench.instant(400)));
    REQUIRE(estimate);
    CHECK(estimate->spread > usual_delay_tolerance / 3);
    CHECK(withheld < 100);  // five exchanges
}

TEST_CASE("imu_pipeline: samples from the future are not believed, however long they agree") {
    ImuBench bench;
    constexpr std::uint32_t honest = 400;
    for (std::uint32_t i = 0; i < honest + 12'000; ++i) {
        if (i % 20 == 0) bench.exchange(bench.instant(i));
        const HostTime host = bench.instant(i);
        const Duration off = i < honest ? Duration{} : milliseconds(2);
        const Duration late = i % 10 == 0 ? microseconds(2500) : Duration{};  // it is possible then
        bench.pipeline.add(sample(i, test::Pipelines::to_board(host) + off),
                           host + milliseconds(1) + late);
        const bool published = !bench.published().empty();
        if (i > honest) REQUIRE_FALSE(published);
    }
}

TEST_CASE("imu_pipeline: on a busy host, a clock that steps does not pass for a new phase") {
    ImuBench bench;
    std::mt19937 random{1};
    const double mean_ns = GENERATE(1e5, 15e5);
    std::exponential_distribution<double> wait{1 / mean_ns};
    // The link is so slow that no message of a clock that is ahead by 0.9 ms is impossible.
    const auto delay = [&] {
        return microseconds(1200) + Duration{static_cast<std::int64_t>(wait(random))};
    };
    const Duration step = microseconds(900);
    constexpr std::uint32_t stepped = 8000;
    std::uint64_t before = 0;
    for (std::uint32_t i = 0; i < stepped + 4000; ++i) {
        const Duration off = i < stepped ? Duration{} : step;
        const HostTime host = bench.instant(i);
        const BoardTime board = test::Pipelines::to_board(host) + off;
        if (i % 20 == 0) bench.translator.add({host - delay(), board, board, host + delay()});
        const HostTime arrived = host + delay() + (i % 4 == 3 ? step : Duration{});  // held up
        if (bench.pipeline.add(sample(i, board), arrived)) bench.translator.add({board, arrived});
        for (const ring::Item& item : bench.published()) {
            if (i < stepped) ++before;
            const auto metadata = unpack<ImuMetadata>(item.metadata);
            const Duration error =
                metadata.host_time - bench.instant(static_cast<std::int64_t>(metadata.number));
            INFO(metadata.number << " is off by " << error.ns << ", sigma " << metadata.sigma_ns);
            CHECK((absolute(error).ns < 4 * std::int64_t{metadata.sigma_ns} + 100'000 ||
                   (metadata.flags & flag_holdover) != 0));
        }
    }
    CHECK(before > stepped - 100);
}

TEST_CASE("imu_pipeline: a part that is set up anew samples in a phase of its own at once") {
    ImuBench bench;
    bench.run(0, 40);
    bench.published();
    wire::Event ready{};
    ready.kind = wire::BoardEventKind::imu_ready;
    bench.pipeline.note_state(ready, bench.instant(40));
    bench.run(40, 40 + neighbours + 5, -milliseconds(1));
    CHECK(bench.published().size() == 5);
}

TEST_CASE("imu_pipeline: a board that counts from an earlier number goes on in what is published") {
    ImuBench bench;
    for (std::uint32_t i = 0; i < 400; ++i) {
        if (i % 20 == 0) bench.exchange(bench.instant(i));
        bench.add(i, i);
        bench.published();
    }
    for (std::uint32_t i = 400; i < 500; ++i) {
        if (i % 20 == 0) bench.exchange(bench.instant(i));
        bench.add(i - 390, i);
    }
    const auto after = bench.published();
    REQUIRE(after.size() > 10);
    CHECK(unpack<ImuMetadata>(after[0].metadata).number == 400);
    CHECK(absolute(unpack<ImuMetadata>(after[0].metadata).host_time -
                   bench.instant(500 - static_cast<std::int64_t>(after.size()))) < microseconds(5));
}

TEST_CASE("imu_pipeline: when the clock begins anew, so do numbers and times") {
    ImuBench bench;
    bench.run(0, 40);
    bench.published();
    const Duration step = -milliseconds(50);
    for (std::uint32_t i = 40; i < 77; ++i) {
        CHECK_FALSE(bench.add(i, i, step));
        if (i % 12 != 4) continue;  // the third begins it anew, the fourth confirms that
        const BoardTime board = test::Pipelines::to_board(bench.instant(i)) + step;
        bench.translator.add({bench.instant(i) - microseconds(10), board, board,
                              bench.instant(i) + microseconds(10)});
    }
    CHECK(bench.published().empty());
    bench.run(77, 83, step);
    const auto items = bench.published();
    REQUIRE(items.size() == 6);
    CHECK(absolute(unpack<ImuMetadata>(items[0].metadata).host_time - bench.instant(77)) <=
          microseconds(20));
}

TEST_CASE(
    "imu_pipeline: samples are stamped with the time of the motion, not of the filter's end") {
    test::Pipelines bench;
    ImuConfiguration configuration;
    configuration.model = imu::find_model("adis16448b");
    configuration.filter = 4;
    const auto override_us = GENERATE(as<std::optional<double>>(), std::nullopt, 5000.0, 0.0);
    configuration.filter_delay_us = override_us;
    // Read without data-ready, a sample is half a period of the part old in the mean; and there is
    // the part's element.
    const Duration delay = override_us ? from_us(*override_us) : microseconds(18311 + 610 + 606);
    const std::uint32_t age_sigma_ns = 352'000;
    ImuPipeline pipeline(configuration, bench.writer({"imu0", ring::StreamKind::imu, 64}),
                         bench.translator, bench.events);
    auto reader = bench.reader("imu0");
    const HostTime begin{50'000'000'000};
    bench.synchronise(begin);
    for (std::uint32_t i = 0; i <= neighbours; ++i) {
        const HostTime at = begin + milliseconds(30) + milliseconds(5) * i;
        pipeline.add(sample(i, test::Pipelines::to_board(at)), at + milliseconds(1));
    }
    const HostTime newest = begin + milliseconds(30) + milliseconds(5) * neighbours;
    const auto item = test::look(reader.next());
    const auto metadata = unpack<ImuMetadata>(item.metadata);
    CHECK(absolute(metadata.host_time - (newest - delay)) < microseconds(1));
    CHECK(item.time.ns == metadata.host_time.ns);
    // The board's own stamp stays as it is, beside what was taken off.
    CHECK(metadata.board_time == test::Pipelines::to_board(newest));
    CHECK(absolute(metadata.filter_delay - delay) < microseconds(1));
    CHECK(metadata.sigma_ns >= age_sigma_ns);
    CHECK((metadata.sigma_ns >= age_sigma_ns + 10'000) == !override_us);
    CHECK(pipeline.report().filter.source ==
          (override_us ? imu::FilterDelaySource::configuration : imu::FilterDelaySource::model));
}

TEST_CASE("imu_pipeline: a failure is reported once, then rarely, and anew when it has changed") {
    test::Pipelines bench;
    ImuConfiguration configuration;
    configuration.model = imu::find_model("adis16448b");
    ImuPipeline pipeline(configuration, bench.writer({"imu0", ring::StreamKind::imu, 16}),
                         bench.translator, bench.events);
    wire::Event event{};
    HostTime now{100'000'000'000};
    int logged = 0;
    const auto note = [&](wire::BoardEventKind kind, std::int64_t value) {
        event.kind = kind;
        event.value = value;
        now = now + seconds(1);
        if (pipeline.note_state(event, now)) ++logged;
    };
    for (int i = 0; i < 3600; ++i) note(wire::BoardEventKind::imu_failed, 120);
    CHECK(logged == 6);
    CHECK_FALSE(pipeline.report().working);
    CHECK(pipeline.report().failure.times == 3600);
    note(wire::BoardEventKind::imu_failed, 0);
    CHECK(logged == 7);
    note(wire::BoardEventKind::imu_ready, 0);
    CHECK(logged == 8);
    CHECK(pipeline.report().working);
    now = now + seconds(120);
    note(wire::BoardEventKind::imu_failed, 0);
    CHECK(logged == 9);
    for (int i = 0; i < 100; ++i) {  // it comes and goes
        note(wire::BoardEventKind::imu_ready, 0);
        note(wire::BoardEventKind::imu_failed, 0);
    }
    CHECK(logged <= 11);
}

TEST_CASE("imu_pipeline: samples that repeat are counted, and only a wired line shows an age") {
    test::Pipelines bench;
    ImuConfiguration configuration;
    configuration.model = imu::find_model("bmi088");
    configuration.data_ready = true;
    configuration.accel_ready = GENERATE(true, false);
    ImuPipeline pipeline(configuration, bench.writer({"imu0", ring::StreamKind::imu, 64}),
                         bench.translator, bench.events);
    auto reader = bench.reader("imu0");
    const HostTime begin{50'000'000'000};
    bench.synchronise(begin);
    const auto add = [&](std::uint32_t i, std::uint16_t flags, std::int16_t accel_age) {
        const HostTime at = begin + milliseconds(30) + milliseconds(5) * i;
        wire::ImuSample made = sample(i, test::Pipelines::to_board(at), flags);
        made.accel_age = accel_age;
        return pipeline.add(made, at + milliseconds(1));
    };
    for (std::uint32_t i = 0; i < neighbours; ++i) add(i, 0, 0);
    CHECK(add(neighbours, wire::imu_repeated, 0));
    CHECK(add(neighbours + 1, wire::imu_accel_stamped, 10) == configuration.accel_ready);
    CHECK(add(neighbours + 2, 0, 0));
    CHECK(pipeline.report().repeated == 1);
    CHECK(pipeline.report().doubted == (configuration.accel_ready ? 0 : 1));
    const auto first = unpack<ImuMetadata>(test::look(reader.next()).metadata);
    CHECK(first.flags == flag_repeated);
    CHECK(first.accel_age_ns == 0);
    const auto second = unpack<ImuMetadata>(test::look(reader.next()).metadata);
    CHECK(second.flags == (configuration.accel_ready ? flag_accel_age : 0U));
    CHECK(second.accel_age_ns == (configuration.accel_ready ? 320 : 0));
    if (configuration.accel_ready) return;
    const auto event = unpack<EventMetadata>(test::look(bench.reader("events").next()).metadata);
    CHECK(event.kind == EventKind::message_doubted);
    CHECK(event.reason == EventReason::implausible_flags);
}

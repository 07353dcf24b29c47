// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/set_reader.hpp"

#include <poll.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "../support/sleep.hpp"
#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"

using namespace versavis;

namespace {

constexpr std::int64_t period_ns = 50'000'000;

/// Two cameras and an IMU, as an instance of the service has them.
struct Rig {
    test::TemporaryDirectory directory{"/dev/shm"};
    std::unique_ptr<ring::Writer> a = camera("a");
    std::unique_ptr<ring::Writer> b = camera("b");
    std::unique_ptr<ring::Writer> imu = make({"imu", ring::StreamKind::imu, 64});
    std::uint64_t sample_number = 0;

    std::unique_ptr<ring::Writer> make(const ring::Shape& shape) const {
        return std::make_unique<ring::Writer>(*ring::Writer::create(directory.path(), shape));
    }
    std::unique_ptr<ring::Writer> camera(const std::string& name, std::uint64_t size = 4096,
                                         std::uint64_t life = 0) const {
        return make({name, ring::StreamKind::frames, 16, 8, size, 0, life});
    }
    ring::Mapping map(const std::string& name) const {
        return *ring::Mapping::open(directory.path() / name, ring::Mapping::Access::read_write);
    }

    SetOptions options() const {
        SetOptions made;
        made.instance = test::instance_in(directory.path());
        made.patience = seconds(60);
        return made;
    }
    SetReader open(const SetOptions& options) const {
        auto reader = SetReader::open({"a", "b"}, options);
        REQUIRE(reader);
        return std::move(*reader);
    }
    SetReader open() const { return open(options()); }

    static void frame(ring::Writer& writer, std::uint64_t tick, std::int64_t late_ns = 0,
                      std::uint32_t flags = 0, std::uint32_t epoch = 1) {
        FrameMetadata metadata{};
        metadata.set_tick(tick);
        metadata.host_time = {time_of(tick) + late_ns};
        metadata.trigger = tick + 1;
        metadata.flags = flags;
        metadata.epoch = epoch;
        const auto slot = writer.acquire();
        REQUIRE(slot);
        writer.publish(*slot, 8, OutputTime{time_of(tick) + late_ns}, pack(metadata));
    }
    void sample(std::int64_t time_ns, std::uint64_t skipped = 0, std::uint32_t epoch = 1) {
        ImuMetadata metadata{};
        sample_number += 1 + skipped;
        metadata.number = sample_number;
        metadata.epoch = epoch;
        imu->publish(OutputTime{time_ns}, pack(metadata));
    }
    static std::int64_t time_of(std::uint64_t tick) {
        return static_cast<std::int64_t>(tick % 1000) * period_ns;
    }
};

}  // namespace

TEST_CASE_METHOD(Rig, "set_reader: frames of one tick come together, in the order of cameras") {
    SetReader sets = open();
    CHECK(sets.next({}).error().why == Pause::nothing);
    CHECK(sets.next({}).error().lost == 0);
    frame(*b, 7, 300);
    CHECK(sets.next({}).error().why == Pause::nothing);
    frame(*a, 7);
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->complete());
    CHECK(set->valid());
    CHECK(set->tick == 7);
    CHECK(set->time.epoch == 1);
    CHECK(set->time.life == set->frames[0]->time.life);
    CHECK(set->spread == nanoseconds(300));
    CHECK(set->time.ns == time_of(7));
    CHECK(set->frames[1]->time.ns == time_of(7) + 300);
    CHECK(sets.next({}).error().why == Pause::nothing);
    CHECK(sets.report().sets == 1);
}

TEST_CASE_METHOD(Rig, "set_reader: ticks of more than 32 bits do not meet by their lower half") {
    SetReader sets = open();
    frame(*a, 5);
    frame(*b, (std::uint64_t{1} << 32U) + 5);
    CHECK(sets.next({}).error().why == Pause::nothing);
    frame(*a, (std::uint64_t{1} << 32U) + 5);
    CHECK(sets.next({})->tick == (std::uint64_t{1} << 32U) + 5);
    CHECK(sets.report().incomplete == 1);
}

TEST_CASE_METHOD(Rig, "set_reader: a camera that counts far beyond the others holds no set back") {
    SetOptions partial = options();
    partial.partial = true;
    partial.patience = {};
    auto other_rate = camera("c");
    auto opened = SetReader::open({"a", "b", "c"}, partial);
    REQUIRE(opened);
    SetReader& sets = *opened;
    constexpr std::uint64_t far = 1'000'000'000'000;
    for (const std::uint64_t tick : {3, 5, 7}) {
        frame(*other_rate, far + tick);
        auto set = sets.next({});
        REQUIRE(set);
        CHECK(set->tick == far + tick);
        for (auto& writer : {&a, &b}) frame(**writer, tick + 1);
        set = sets.next({});
        REQUIRE(set);
        CHECK(set->tick == tick + 1);
        CHECK((set->frames[0] && set->frames[1] && !set->frames[2]));
        frame(*a, tick - 1);  // too late for its set
        CHECK(sets.next({}).error().why == Pause::nothing);
    }
    CHECK(sets.report().left_out == 3);
}

TEST_CASE_METHOD(Rig, "set_reader: a set is given up as soon as a camera went past it") {
    SetOptions partial = options();
    partial.partial = GENERATE(true, false);
    SetReader sets = open(partial);
    frame(*a, 1);
    frame(*a, 2);
    frame(*b, 2);
    auto set = sets.next({});
    REQUIRE(set);
    if (partial.partial) {
        CHECK(set->tick == 1);
        CHECK_FALSE(set->complete());
        CHECK(set->frames[0]);
        CHECK_FALSE(set->frames[1]);
        CHECK(set->spread == nanoseconds(0));
        set = sets.next({});
        REQUIRE(set);
    }
    CHECK(set->tick == 2);
    CHECK(sets.report().incomplete == 1);
}

TEST_CASE_METHOD(Rig, "set_reader: a missing frame is waited for no longer than patience") {
    SetOptions hasty = options();
    hasty.partial = true;
    hasty.patience = milliseconds(20);
    SetReader sets = open(hasty);
    frame(*a, 1);
    const HostTime begin = host_now();
    const auto set = sets.next(seconds(20));
    REQUIRE(set);
    CHECK_FALSE(set->complete());
    CHECK(host_now() - begin >= milliseconds(20));
    CHECK(host_now() - begin < seconds(10));
}

TEST_CASE_METHOD(Rig, "set_reader: frames that prove nothing are in no set, unless asked for") {
    SetOptions any = options();
    any.suspect = GENERATE(true, false);
    SetReader sets = open(any);
    frame(*a, 1, 0, flag_suspect);
    frame(*b, 1);
    FrameMetadata untriggered{};
    const auto slot = a->acquire();
    a->publish(*slot, 8, {}, pack(untriggered));
    CHECK(sets.next({}).has_value() == any.suspect);
    CHECK(sets.report().left_out == (any.suspect ? 1 : 2));
}

TEST_CASE_METHOD(Rig, "set_reader: a new epoch's ticks do not meet those before") {
    SetReader sets = open();
    frame(*a, 100);
    frame(*a, 3, 0, 0, 2);
    frame(*b, 3, 0, 0, 2);
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->tick == 3);
    CHECK(set->time.epoch == 2);
    CHECK(sets.report().incomplete == 1);
}

TEST_CASE_METHOD(Rig, "set_reader: samples since the set before come with it, once covered") {
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    SetReader sets = open(with_imu);
    const std::int64_t step = period_ns / 4;
    sample(time_of(1) - step);
    frame(*a, 1);
    frame(*b, 1, 100);
    CHECK(sets.next({}).error().why == Pause::nothing);  // the samples do not reach it yet
    sample(time_of(1) + step);
    auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->imu.samples.empty());  // there was none before
    CHECK(set->imu.gap == SpanGap::begin);
    REQUIRE(set->imu.beyond);
    CHECK(set->imu.beyond->time.ns == time_of(1) + step);
    sample(time_of(1) + 2 * step);
    sample(time_of(2), 3);
    sample(time_of(2) + step);
    frame(*a, 2);
    frame(*b, 2);
    set = sets.next({});
    REQUIRE(set);
    REQUIRE(set->imu.samples.size() == 3);
    CHECK(set->imu.samples[0].time.ns == time_of(1) + step);
    CHECK(set->imu.samples[2].time.ns == time_of(2));  // up to and with its stamp
    CHECK(set->imu.lost == 3);
    CHECK(set->imu.covered());
    CHECK_FALSE(set->imu.complete());
}

TEST_CASE_METHOD(Rig, "set_reader: where the clock steps, no set has samples of another epoch") {
    const std::int64_t step_ns = GENERATE(-300, -100, -50, 3'600'000) * std::int64_t{1'000'000};
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    SetReader sets = open(with_imu);
    constexpr std::int64_t between_samples_ns = period_ns / 10;
    constexpr std::uint64_t last_before = 20;
    std::uint64_t delivered = 0;
    for (std::uint64_t tick = 10; tick < 35; ++tick) {
        const bool stepped = tick > last_before;
        const std::uint32_t epoch = stepped ? 2 : 1;
        const std::int64_t by_ns = stepped ? step_ns : 0;
        frame(*a, tick, by_ns, 0, epoch);
        frame(*b, tick, by_ns, 0, epoch);
        for (int i = -4; i <= 5; ++i)
            sample(time_of(tick) + i * between_samples_ns + by_ns, 0, epoch);
        const auto set = sets.next({});
        REQUIRE(set);
        CHECK(set->tick == tick);
        for (const ImuSample& sample : set->imu.samples) CHECK(sample.data.epoch == epoch);
        if (tick == 10) continue;
        ++delivered;
        if (tick == last_before + 1) {  // those since the epoch began
            CHECK(set->imu.gap == SpanGap::epoch);
            CHECK(set->imu.samples.size() == 5);
            continue;
        }
        CHECK(set->imu.complete());
        REQUIRE(set->imu.samples.size() == 10);
        const auto before_frame = set->time.since(set->imu.samples.back().time);
        REQUIRE(before_frame);
        CHECK(*before_frame == Duration{});
    }
    CHECK(delivered == 24);
}

TEST_CASE_METHOD(Rig, "set_reader: a silent IMU does not hold sets back for ever") {
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    with_imu.patience = milliseconds(20);
    SetReader sets = open(with_imu);
    frame(*a, 1);
    frame(*b, 1);
    const auto set = sets.next(seconds(20));
    REQUIRE(set);
    CHECK(set->complete());
    CHECK_FALSE(set->imu.covered());
}

TEST_CASE_METHOD(Rig, "set_reader: overtaken frames are counted, and what is in a set knows it") {
    SetReader sets = open();
    frame(*a, 1);
    frame(*b, 1);
    const auto held = sets.next({});
    REQUIRE(held);
    for (std::uint64_t tick = 2; tick < 30; ++tick) frame(*a, tick);
    CHECK_FALSE(held->valid());
    CHECK(sets.next({}).error().why == Pause::nothing);
    CHECK(sets.report().lost >= 28 - 8);
    CHECK(sets.report().lost < 28);
}

TEST_CASE_METHOD(Rig,
                 "set_reader: an end is reported once, and a larger ring of one life is no end") {
    SetReader sets = open();
    frame(*a, 1);
    auto larger = camera("a", 8192);
    frame(*larger, 2);
    frame(*b, 2);
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->tick == 2);
    a.reset();
    larger.reset();
    b.reset();
    CHECK(sets.next(seconds(20)).error().why == Pause::gone);
    CHECK(sets.next(milliseconds(1)).error().why == Pause::gone);  // at its time-out
    a = camera("a");
    b = camera("b");
    frame(*a, 9);
    frame(*b, 9);
    const auto back = sets.next(seconds(20));
    REQUIRE(back);
    CHECK(back->tick == 9);
    CHECK(sets.next(milliseconds(1)).error().why == Pause::nothing);
}

TEST_CASE_METHOD(Rig,
                 "set_reader: a restart is reported once, and begins anew whatever there was") {
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    SetReader sets = open(with_imu);
    constexpr std::uint64_t next_life = 77;
    const std::int64_t step = period_ns / 4;
    frame(*a, 4);
    frame(*b, 4);
    sample(time_of(4) - step);
    sample(time_of(4) + step);
    CHECK(sets.next({})->tick == 4);
    frame(*a, 5);
    CHECK(sets.next({}).error().why == Pause::nothing);
    imu = make({"imu", ring::StreamKind::imu, 64, 0, 0, 0, next_life});
    CHECK(sets.next({}).error().why == Pause::restarted);
    frame(*b, 5);  // of a camera that has not restarted yet
    CHECK(sets.next({}).error().why == Pause::nothing);
    CHECK(sets.report().left_out == 1);
    a = camera("a", 4096, next_life);
    b = camera("b", 4096, next_life);
    CHECK(sets.next({}).error().why == Pause::nothing);
    // Its ticks begin anew, and its times may lie anywhere.
    const std::int64_t late = 10 * period_ns;
    frame(*b, 2, late);
    for (const std::int64_t ago : {2, 1, 0, -100}) sample(time_of(2) + late - ago * step);
    CHECK(sets.next({}).error().why == Pause::nothing);
    CHECK(sets.report().incomplete == 0);
    frame(*a, 2, late);
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->tick == 2);
    CHECK(set->time.life == next_life);
    CHECK(set->imu.samples.empty());
    frame(*b, 5, late);
    for (auto* camera : {a.get(), b.get()}) frame(*camera, 6, late);
    CHECK(sets.next({})->tick == 6);
    CHECK(sets.report().incomplete == 1);
}

TEST_CASE_METHOD(Rig, "set_reader: a restart after an end is an end no more") {
    SetReader sets = open();
    a.reset();
    CHECK(sets.next(seconds(20)).error().why == Pause::gone);
    a = camera("a", 4096, 77);
    CHECK(sets.next(seconds(20)).error().why == Pause::restarted);
    CHECK(sets.next(milliseconds(1)).error().why == Pause::nothing);
}

TEST_CASE_METHOD(Rig, "set_reader: where a camera is silent, sets do not pile up without end") {
    SetOptions partial = options();
    partial.partial = true;
    SetReader sets = open(partial);
    std::uint64_t tick = 0;
    auto set = sets.next({});
    for (; !set && tick < 1000; set = sets.next({})) frame(*a, ++tick);
    REQUIRE(set);
    CHECK(set->tick == 1);
    CHECK(tick > 20);
}

TEST_CASE_METHOD(Rig, "set_reader: what is there is found without waiting, behind many losses") {
    a = make({"a", ring::StreamKind::frames, 128, 128, 4096});
    SetReader sets = open();
    for (std::uint64_t tick = 0; tick < 128; ++tick) frame(*a, tick);
    frame(*b, 127);
    const ring::Mapping of_a = map("a");
    std::uint64_t lost = 0;
    for (std::uint32_t slot = 65; slot < 127; slot += 2, ++lost) of_a.generation(slot) += 2;
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->tick == 127);
    CHECK(sets.report().lost == lost);
}

TEST_CASE_METHOD(Rig,
                 "set_reader: one that waits sleeps until something comes that it needs "
                 "[threads]",
                 "[threads]") {
    if (!test::kernel_waits_for_any()) return;
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    SetReader sets = open(with_imu);
    std::atomic<pid_t> number{0};
    bool found = false;
    std::thread waiting([&] {
        number = ::gettid();
        found = sets.next(seconds(60)).has_value();
    });
    CHECK(test::wake_sleeper(map("a").header().wake));
    CHECK(test::wake_sleeper(map("b").header().wake));
    const ring::Mapping of_imu = map("imu");
    for (int i = 0; i < 5; ++i) {
        test::await_sleep(number);
        CHECK(ring::futex_wake(of_imu.header().wake, 1) == 0);  // no set needs samples yet
    }
    frame(*a, 1);
    frame(*b, 1);
    CHECK(test::wake_sleeper(of_imu.header().wake));
    sample(time_of(1));
    waiting.join();
    CHECK(found);
}

TEST_CASE_METHOD(Rig, "set_reader: where nothing comes, it waits as long as was asked") {
    SetReader sets = open();
    const HostTime begin = host_now();
    CHECK(sets.next(milliseconds(150)).error().why == Pause::nothing);
    CHECK(host_now() - begin >= milliseconds(150));
}

TEST_CASE_METHOD(Rig,
                 "set_reader: its descriptor is readable for sets and when patience ends "
                 "[threads]",
                 "[threads]") {
    SetOptions hasty = options();
    hasty.partial = true;
    hasty.patience = milliseconds(50);
    SetReader sets = open(hasty);
    const auto descriptor = sets.fd();
    REQUIRE(descriptor);
    const auto readable = [&](int timeout_ms) {
        pollfd entry{*descriptor, POLLIN, 0};
        return ::poll(&entry, 1, timeout_ms) == 1;
    };
    CHECK_FALSE(sets.next({}));
    CHECK_FALSE(readable(0));
    frame(*a, 1);
    REQUIRE(readable(20'000));
    CHECK_FALSE(sets.next({}));
    REQUIRE(readable(20'000));
    const auto set = sets.next(seconds(20));
    REQUIRE(set);
    CHECK_FALSE(set->complete());
}

TEST_CASE_METHOD(Rig, "set_reader: a frame that comes after its set was given up makes no other") {
    const bool partial = GENERATE(false, true);
    SetOptions impatient = options();
    impatient.partial = partial;
    impatient.patience = {};
    SetReader sets = open(impatient);
    frame(*a, 1);
    CHECK(sets.next({}).has_value() == partial);
    frame(*b, 1);
    CHECK_FALSE(sets.next({}));
    CHECK(sets.report().sets == (partial ? 1 : 0));
    CHECK(sets.report().incomplete == 1);
    CHECK(sets.report().left_out == 1);
    frame(*a, 2);
    frame(*b, 2);
    CHECK(sets.next({})->tick == 2);
}

TEST_CASE_METHOD(Rig,
                 "set_reader: the end of one camera is reported once, whatever the others do") {
    SetOptions impatient = options();
    impatient.partial = true;
    impatient.patience = {};
    SetReader sets = open(impatient);
    b.reset();
    frame(*a, 1);
    CHECK(sets.next({}).error().why == Pause::gone);
    for (std::uint64_t tick = 1; tick < 10; ++tick) {
        CHECK(sets.next({})->tick == tick);
        frame(*a, tick + 1);
    }
    CHECK(sets.next({}));
    CHECK(sets.next({}).error().why == Pause::gone);  // time is over
}

TEST_CASE_METHOD(Rig, "set_reader: a damaged ring, or stamps that are anything, hold nobody up") {
    {
        SetReader sets = open();
        FrameMetadata metadata{};
        metadata.trigger = 1;
        for (const auto& [writer, time] : {std::pair{a.get(), INT64_MIN}, {b.get(), INT64_MAX}})
            writer->publish(*writer->acquire(), 8, OutputTime{time}, pack(metadata));
        CHECK(sets.next({})->spread.ns == INT64_MAX);
    }
    // The ring seems to end where the first item was read, or there is one loss after another.
    for (const std::uint64_t head : {std::uint64_t{1} << 62U, std::uint64_t{1} << 61U}) {
        a = camera("a");
        imu = make({"imu", ring::StreamKind::imu, 64});
        SetReader sets = open();
        const auto damage = [&](const std::string& name, unsigned count) {
            const ring::Mapping mapping = map(name);
            mapping.header().head = head;
            const std::uint64_t sequence = head | std::uint64_t{1} << 62U;
            for (unsigned i = 0; i < count; ++i) mapping.descriptor(i).sequence = sequence;
        };
        damage("a", 16);
        CHECK_FALSE(sets.next({}));
        CHECK_FALSE(sets.next(milliseconds(1)));
        damage("imu", 64);
        StreamOptions where;
        where.instance = options().instance;
        auto window = ImuWindow::open("imu", where);
        CHECK_FALSE(window->between({1, 0, 1}, {1, 1, 1}, milliseconds(1))->covered());
    }
}

TEST_CASE_METHOD(Rig, "set_reader: what cannot be a set is refused") {
    const auto refusal = [&](const std::vector<std::string>& cameras) {
        return SetReader::open(cameras, options()).error().message();
    };
    CHECK_THAT(refusal({}), Catch::Contains("needs the names"));
    CHECK_THAT(refusal({"a", "a"}), Catch::Contains("twice"));
    CHECK_THAT(refusal({"a", "imu"}), Catch::Contains("another kind"));
    CHECK_THAT(refusal({"a", "c"}), Catch::Contains("no such stream"));
    SetOptions with_imu = options();
    with_imu.imu = "none";
    CHECK_THAT(SetReader::open({"a", "b"}, with_imu).error().message(),
               Catch::Contains("no such stream"));
}

TEST_CASE_METHOD(Rig, "set_reader: too many streams are refused") {
    std::vector<std::string> names;
    std::vector<std::unique_ptr<ring::Writer>> writers;
    for (int i = 0; i < 127; ++i) {
        names.push_back("camera" + std::to_string(i));
        writers.push_back(make({names.back(), ring::StreamKind::frames, 1, 1, 1}));
    }
    CHECK(SetReader::open(names, options()));
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    CHECK_THAT(SetReader::open(names, with_imu).error().message(),
               Catch::Contains("imu: is one stream more than a WaitSet can hold"));
    names.emplace_back("a");
    CHECK_THAT(SetReader::open(names, options()).error().message(),
               Catch::Contains("a: is one stream more than a WaitSet can hold"));
}

TEST_CASE_METHOD(Rig, "set_reader: a camera that has ended is not waited for") {
    SetOptions some = options();
    some.partial = true;
    SetReader sets = open(some);
    b.reset();
    CHECK(sets.next(seconds(20)).error().why == Pause::gone);
    frame(*a, 3);
    const auto set = sets.next({});  // without patience, which is a minute
    REQUIRE(set);
    CHECK(set->tick == 3);
    CHECK_FALSE(set->complete());
    b = camera("b");
    frame(*a, 4);
    frame(*b, 4);
    CHECK(sets.next(seconds(20))->complete());
    frame(*a, 5);
    CHECK(sets.next({}).error().why == Pause::nothing);  // it is waited for again
    frame(*b, 5);
    CHECK(sets.next({})->complete());
}

TEST_CASE_METHOD(Rig, "set_reader: cameras that are not there yet are taken in") {
    SetOptions some = options();
    b.reset();
    std::filesystem::remove(directory.path() / "b");
    const auto refused = SetReader::open({"a", "b"}, some);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code == ErrorCode::absent);
    some.partial = true;
    SetReader sets = open(some);
    frame(*a, 1);
    const auto alone = sets.next({});
    REQUIRE(alone);
    CHECK(alone->tick == 1);
    CHECK_FALSE(alone->frames[1]);
    b = camera("b");
    frame(*b, 2);  // before it is found
    CHECK(sets.next(milliseconds(300)).error().why == Pause::nothing);
    frame(*b, 3);
    CHECK(sets.next({}).error().why == Pause::nothing);
    frame(*a, 3);
    const auto both = sets.next({});
    REQUIRE(both);
    CHECK(both->tick == 3);
    CHECK(both->complete());
}

TEST_CASE_METHOD(Rig, "set_reader: it may be open before any camera is there") {
    SetOptions some = options();
    some.partial = true;
    for (auto* writer : {&a, &b}) writer->reset();
    for (const char* name : {"a", "b"}) std::filesystem::remove(directory.path() / name);
    SetReader sets = open(some);
    CHECK(sets.next(milliseconds(1)).error().why == Pause::gone);
    CHECK(sets.fd().value_or(-1) >= 0);
    a = camera("a", 4096, 77);
    b = camera("b", 4096, 77);
    CHECK(sets.next(milliseconds(300)).error().why == Pause::nothing);
    frame(*a, 1);
    frame(*b, 1);
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->complete());
    CHECK(set->time.life == 77);
}

TEST_CASE_METHOD(Rig, "set_reader: a camera that appears in another life is a restart") {
    SetOptions some = options();
    some.partial = true;
    b.reset();
    std::filesystem::remove(directory.path() / "b");
    SetReader sets = open(some);
    frame(*a, 1);
    REQUIRE(sets.next({}));
    b = camera("b", 4096, 78);
    CHECK(sets.next(seconds(20)).error().why == Pause::restarted);
    frame(*b, 4);
    frame(*a, 4);  // of a camera that has not restarted yet
    CHECK(sets.next({}).error().why == Pause::nothing);
    CHECK(sets.report().left_out == 1);
}

TEST_CASE_METHOD(Rig, "set_reader: opening waits for its cameras [threads]", "[threads][kernel]") {
    b.reset();
    std::filesystem::remove(directory.path() / "b");
    SetOptions patient = options();
    patient.wait = seconds(60);
    std::thread service([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(30));
        b = camera("b");
    });
    SetReader sets = open(patient);
    service.join();
    frame(*a, 1);
    frame(*b, 1);
    CHECK(sets.next({})->complete());
}

TEST_CASE_METHOD(Rig, "set_reader: the newest set comes with all samples since the one before") {
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    SetReader sets = open(with_imu);
    const std::int64_t step = period_ns / 2;
    const auto publish = [&](std::uint64_t tick) {
        sample(time_of(tick));
        frame(*a, tick);
        frame(*b, tick);
        sample(time_of(tick) + step);
    };
    publish(1);
    REQUIRE(sets.next({}));
    for (std::uint64_t tick = 2; tick <= 5; ++tick) publish(tick);
    frame(*a, 6);  // it is not whole
    const auto set = sets.latest({});
    REQUIRE(set);
    CHECK(set->tick == 5);
    CHECK(set->imu.complete());
    CHECK(set->imu.samples.size() == 8);
    CHECK(sets.report().skipped == 3);
    CHECK(sets.report().sets == 2);
    CHECK(sets.latest({}).error().why == Pause::nothing);
    frame(*b, 6);
    sample(time_of(6));
    CHECK(sets.latest({})->tick == 6);
    CHECK(sets.report().skipped == 3);
}

TEST_CASE_METHOD(Rig, "set_reader: a newest set whose samples lag does not take the one before") {
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    SetReader sets = open(with_imu);
    for (std::uint64_t tick = 1; tick <= 5; ++tick) {  // a program that looks once a frame
        frame(*a, tick);
        frame(*b, tick);
        const auto set = sets.latest({});
        CHECK(set.has_value() == (tick > 1));
        if (set) CHECK(set->tick == tick - 1);
        sample(time_of(tick));
    }
    CHECK(sets.report().skipped == 0);
}

namespace {

/// Beside it, another service with one camera, on the same grid. Its ticks and its output time have
/// another origin.
struct TwoInstances : Rig {
    test::TemporaryDirectory rear_directory{"/dev/shm"};
    std::string rear = test::instance_in(rear_directory.path());
    std::unique_ptr<ring::Writer> c = rear_camera(17);
    std::vector<std::string> names{"a", rear + "/c"};

    std::unique_ptr<ring::Writer> rear_camera(std::uint64_t life) const {
        return std::make_unique<ring::Writer>(*ring::Writer::create(
            rear_directory.path(), {"c", ring::StreamKind::frames, 16, 8, 4096, 0, life}));
    }
    /// Exposed with the others' of this tick, but for `late`.
    static void rear_frame(ring::Writer& writer, std::uint64_t tick, Duration late = {}) {
        FrameMetadata metadata{};
        metadata.set_tick(tick + 1'000'000);
        metadata.trigger = tick + 1;
        metadata.epoch = 5;
        metadata.host_time = {time_of(tick) + late.ns};
        const auto slot = writer.acquire();
        REQUIRE(slot);
        writer.publish(*slot, 8, OutputTime{time_of(tick) - 3'600'000'000'000}, pack(metadata));
    }
    SetReader open_both(const SetOptions& options) const {
        auto reader = SetReader::open(names, options);
        REQUIRE(reader);
        return std::move(*reader);
    }
};

}  // namespace

TEST_CASE_METHOD(TwoInstances, "set_reader: cameras of two instances meet by host time") {
    SetReader sets = open_both(options());
    for (const std::uint64_t tick : {7, 8}) {
        rear_frame(*c, tick, microseconds(30));
        CHECK(sets.next({}).error().why == Pause::nothing);
        frame(*a, tick);
        const auto set = sets.next({});
        REQUIRE(set);
        CHECK(set->complete());
        CHECK(set->tick == tick);
        CHECK(set->spread == microseconds(30));
        CHECK(set->frames[1]->data.tick() == tick + 1'000'000);
        CHECK_FALSE(set->frames[0]->time.since(set->frames[1]->time));
    }
}

TEST_CASE_METHOD(TwoInstances, "set_reader: what two boards took apart is in no set of both") {
    SetReader sets = open_both(options());
    const auto late = GENERATE(milliseconds(25), -milliseconds(25), microseconds(501));
    frame(*a, 7);
    rear_frame(*c, 7, late);
    frame(*a, 8);
    rear_frame(*c, 8, late);
    CHECK(sets.next({}).error().why == Pause::nothing);
    CHECK(sets.report().sets == 0);
    CHECK(sets.report().incomplete >= 2);
    frame(*a, 9);
    rear_frame(*c, 9, -microseconds(500));
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->frames[0]->data.tick() == 9);
    CHECK(set->frames[1]->data.tick() == 1'000'009);
}

TEST_CASE_METHOD(TwoInstances,
                 "set_reader: a service that restarts does not take the other along") {
    SetReader sets = open_both(options());
    frame(*a, 7);
    rear_frame(*c, 7);
    REQUIRE(sets.next({}));
    c = rear_camera(18);
    rear_frame(*c, 8);
    CHECK(sets.next({}).error().why == Pause::restarted);
    frame(*a, 8);
    const auto set = sets.next({});
    REQUIRE(set);
    CHECK(set->frames[0]->data.tick() == 8);
    CHECK(set->frames[1]->time.life == 18);
}

TEST_CASE_METHOD(TwoInstances,
                 "set_reader: samples of one instance reach from set to set of both") {
    SetOptions with_imu = options();
    with_imu.imu = "imu";
    with_imu.partial = true;
    SetReader sets = open_both(with_imu);
    const auto take = [&] {
        sample(time_of(7 + sample_number));
        return sets.next({});
    };
    frame(*a, 7);
    rear_frame(*c, 7, microseconds(400));
    REQUIRE(take());  // its sample is of the time of a's frame, by the output clock of a
    rear_frame(*c, 8);
    rear_frame(*c, 9);
    frame(*a, 9);
    auto set = take();  // of the rear alone
    REQUIRE(set);
    CHECK(set->imu.samples.empty());
    CHECK(set->imu.gap == SpanGap::begin);
    set = take();
    REQUIRE(set);
    CHECK(set->imu.complete());
    CHECK(set->imu.samples.size() == 2);
    CHECK(set->imu.samples.back().time.ns == set->frames[0]->time.ns);
}

TEST_CASE_METHOD(TwoInstances, "set_reader: cameras and an IMU must be of instances that fit") {
    auto twice = SetReader::open({"a", test::instance_in(directory.path()) + "/a"}, options());
    REQUIRE_FALSE(twice);
    CHECK(twice.error().code == ErrorCode::invalid);
    SetOptions with_imu = options();
    with_imu.imu = rear + "/imu";
    const auto elsewhere = SetReader::open({"a", "b"}, with_imu);
    REQUIRE_FALSE(elsewhere);
    CHECK(elsewhere.error().code == ErrorCode::invalid);
    CHECK(elsewhere.error().message().find("without a camera") != std::string::npos);
}

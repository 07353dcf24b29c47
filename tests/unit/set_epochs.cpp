// SPDX-License-Identifier: BSD-3-Clause
// Sets and spans where the output clock is set while they come: each size of a step, at each phase
// of a set. The witness is the board's time, which goes on, and of which readers know nothing.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/set_reader.hpp"

using namespace versavis;

namespace {

constexpr std::int64_t frame_period_ns = 50'000'000;
constexpr std::int64_t sample_period_ns = 5'000'000;
constexpr int frames_published = 16;
constexpr int step_after_frame = 7;
constexpr std::uint32_t first_epoch = 5;

/// What comes next, by board time: a sample or a frame, published a while after its instant, as the
/// service does.
struct Publication {
    std::int64_t board_ns;
    std::int64_t published_ns;
    int camera;  ///< -1: the IMU
    std::uint64_t number;
};

std::vector<Publication> publications(std::int64_t frame_delay_ns, std::int64_t sample_delay_ns) {
    std::vector<Publication> all;
    for (int i = 0; i < frames_published; ++i)
        for (const int camera : {0, 1}) {
            const std::int64_t instant = i * frame_period_ns + camera * 200'000;
            all.push_back({instant, instant + frame_delay_ns + camera * 3'000'000, camera,
                           static_cast<std::uint64_t>(i)});
        }
    const std::int64_t samples = frames_published * frame_period_ns / sample_period_ns;
    for (std::int64_t i = -4; i < samples + 8; ++i)
        all.push_back({i * sample_period_ns + 1'300'000,
                       i * sample_period_ns + 1'300'000 + sample_delay_ns, -1,
                       static_cast<std::uint64_t>(i + 5)});
    std::sort(all.begin(), all.end(),
              [](const auto& a, const auto& b) { return a.published_ns < b.published_ns; });
    return all;
}

struct Streams {
    test::TemporaryDirectory directory{"/dev/shm"};
    std::vector<ring::Writer> cameras;
    std::optional<ring::Writer> imu;

    Streams() {
        for (const char* name : {"a", "b"})
            cameras.push_back(*ring::Writer::create(
                directory.path(), {name, ring::StreamKind::frames, 32, 24, 4096}));
        imu = *ring::Writer::create(directory.path(), {"imu", ring::StreamKind::imu, 512});
    }

    SetOptions options() const {
        SetOptions made;
        made.instance = test::instance_in(directory.path());
        made.imu = "imu";
        made.patience = seconds(600);
        return made;
    }

    /// Its output time is the board's, and `by_ns` from epoch to epoch.
    void publish(const Publication& what, std::uint32_t epoch, std::int64_t by_ns) {
        const OutputTime time{what.board_ns + (epoch > first_epoch ? by_ns : 0)};
        if (what.camera < 0) {
            ImuMetadata sample{};
            sample.board_time = {what.board_ns};
            sample.number = what.number;
            sample.epoch = epoch;
            imu->publish(time, pack(sample));
            return;
        }
        FrameMetadata frame{};
        frame.board_time = {what.board_ns};
        frame.set_tick(what.number);
        frame.trigger = what.number + 1;
        frame.epoch = epoch;
        ring::Writer& camera = cameras[static_cast<std::size_t>(what.camera)];
        const auto slot = camera.acquire();
        REQUIRE(slot);
        camera.publish(*slot, 8, time, pack(frame));
    }
};

std::int64_t latest_board_ns(const versavis::FrameSet& set) {
    std::int64_t latest = std::numeric_limits<std::int64_t>::min();
    for (const auto& frame : set.frames)
        if (frame) latest = std::max(latest, frame->data.board_time.ns);
    return latest;
}

/// Against the board's times: a set that says it is complete has each sample since the set before,
/// and none of another time.
struct Witness {
    std::optional<versavis::FrameSet> before;
    std::uint64_t sets = 0;
    std::uint64_t complete = 0;
    std::uint64_t wrong = 0;

    void see(const versavis::FrameSet& set, ImuWindow& window) {
        ++sets;
        for (const auto& frame : set.frames)
            if (frame && !frame->time.compares_with(set.time)) ++wrong;
        const std::int64_t end = latest_board_ns(set);
        // The first set of an epoch has those of the epoch, whatever their instants.
        const bool follows = before && before->time.compares_with(set.time);
        const std::int64_t begin =
            follows ? latest_board_ns(*before) : std::numeric_limits<std::int64_t>::min();
        for (const ImuSample& sample : set.imu.samples)
            if (!sample.time.compares_with(set.time) || sample.data.board_time.ns <= begin ||
                sample.data.board_time.ns > end)
                ++wrong;
        if (set.imu.complete() && before) {
            ++complete;
            const auto expected = static_cast<std::size_t>((end - begin) / sample_period_ns);
            if (set.imu.samples.size() != expected) ++wrong;
            if (!follows) ++wrong;
        }
        if (before) check_span(*before, set, window);
        before = set;
    }

    /// The same by the window, asked for the times of two sets.
    void check_span(const versavis::FrameSet& from, const versavis::FrameSet& to,
                    ImuWindow& window) {
        const auto span = window.between(from.time, to.time, {});
        if (!span) return;
        if (!from.time.compares_with(to.time)) {
            if (span->gap != SpanGap::epoch || !span->samples.empty()) ++wrong;
            return;
        }
        for (const ImuSample& sample : span->samples) {
            const auto at = sample.data.board_time.ns;
            if (at <= from.frames[0]->data.board_time.ns || at > to.frames[0]->data.board_time.ns)
                ++wrong;
        }
    }
};

template <class A, class B, class = void>
struct Compares : std::false_type {};
template <class A, class B>
struct Compares<A, B, std::void_t<decltype(std::declval<A>() < std::declval<B>())>>
    : std::true_type {};
template <class A, class B, class = void>
struct Subtracts : std::false_type {};
template <class A, class B>
struct Subtracts<A, B, std::void_t<decltype(std::declval<A>() - std::declval<B>())>>
    : std::true_type {};
template <class A, class B, class = void>
struct Equals : std::false_type {};
template <class A, class B>
struct Equals<A, B, std::void_t<decltype(std::declval<A>() == std::declval<B>())>>
    : std::true_type {};

static_assert(Compares<OutputTime, OutputTime>() && Subtracts<OutputTime, OutputTime>() &&
              Equals<OutputTime, OutputTime>());
static_assert(!Compares<EpochTime, EpochTime>() && !Subtracts<EpochTime, EpochTime>() &&
              !Equals<EpochTime, EpochTime>());
static_assert(!Compares<EpochTime, OutputTime>() && !Subtracts<EpochTime, OutputTime>() &&
              !Equals<EpochTime, OutputTime>());
static_assert(!std::is_convertible_v<EpochTime, OutputTime>);
using Since = decltype(EpochTime{}.since(EpochTime{}));
static_assert(!Compares<Since, Duration>() && !Compares<Duration, Since>() &&
              !Equals<Since, Duration>() && !Compares<Since, Since>());

}  // namespace

TEST_CASE("set_epochs: instants compare within their epoch, and have an order of publication") {
    const EpochTime time{7, 1000, 3};
    const auto span_ns = [](const EpochTime& later, const EpochTime& earlier) {
        const auto span = later.since(earlier);
        return span ? std::optional(span->ns) : std::nullopt;
    };
    CHECK(span_ns({7, 1050, 3}, time) == 50);
    CHECK(span_ns(time, {7, 1050, 3}) == -50);
    CHECK_FALSE(span_ns(time, {7, 1000, 4}));
    CHECK_FALSE(span_ns(time, {8, 1000, 3}));
    CHECK_FALSE(span_ns(EpochTime{}, EpochTime{}));  // of no epoch
    CHECK(span_ns({7, INT64_MAX, 3}, {7, -2, 3}) == INT64_MAX);
    CHECK(span_ns({7, INT64_MIN, 3}, {7, 2, 3}) == INT64_MIN);
    CHECK(time.precedes(EpochTime{7, 1001, 3}));
    CHECK(time.precedes(EpochTime{7, 0, 4}));
    CHECK_FALSE(time.precedes(time));
    CHECK_FALSE(time.precedes(EpochTime{7, 2000, 2}));
}

TEST_CASE("set_epochs: whatever the step and its phase, no set has samples of another time") {
    const std::int64_t step_ns = GENERATE(1'000'000, 10'000'000, 49'000'000, 300'000'000,
                                          60'000'000'000, 3'600'000'000'000) *
                                 GENERATE(-1, 1);
    const bool newest = GENERATE(false, true);
    const std::int64_t frame_delay_ns = GENERATE(4'000'000, 31'000'000);
    const std::int64_t sample_delay_ns = GENERATE(700'000, 17'000'000);
    const auto all = publications(frame_delay_ns, sample_delay_ns);
    std::uint64_t sets = 0;
    std::uint64_t complete = 0;
    std::uint64_t wrong = 0;
    for (std::int64_t phase = 0; phase < frame_period_ns; phase += 2'500'000) {
        Streams streams;
        auto reader = SetReader::open({"a", "b"}, streams.options());
        auto window = ImuWindow::open("imu", streams.options());
        REQUIRE((reader && window));
        Witness witness;
        const std::int64_t stepped = step_after_frame * frame_period_ns + phase;
        for (std::size_t i = 0; i < all.size(); ++i) {
            // The service begins an epoch between two publications; instants before are in it, too.
            const bool after = all[i].published_ns > stepped;
            streams.publish(all[i], first_epoch + (after ? 1 : 0), step_ns);
            if (newest && i % 40 != 39) continue;  // a slow reader
            while (auto set = newest ? reader->latest({}) : reader->next({}))
                witness.see(*set, *window);
        }
        sets += witness.sets;
        complete += witness.complete;
        wrong += witness.wrong;
    }
    CHECK(wrong == 0);
    CHECK(sets > (newest ? 40 : 200));
    CHECK(complete > (newest ? 10 : 150));
}

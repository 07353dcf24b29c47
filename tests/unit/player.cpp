// SPDX-License-Identifier: BSD-3-Clause
#include "play/player.hpp"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <map>
#include <optional>
#include <string>

#include "engine/ring/directory.hpp"
#include "play/playback_clock.hpp"
#include "recording_file.hpp"
#include "temporary_directory.hpp"
#include "versavis/ring_path.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::client;

namespace {

// Tests run side by side, each in a process of its own.
const std::string player_instance = "player-test-" + std::to_string(::getpid());

struct PlayerSample {
    test::TemporaryDirectory directory;
    std::string path = (directory.path() / "a.mcap").string();

    PlayerSample() {
        std::ofstream(path, std::ios::binary) << test::sample_recording(1, true, false, 0x01080001);
    }
    ~PlayerSample() { std::filesystem::remove_all(instance_directory(player_instance)); }
};

}  // namespace

TEST_CASE("player: items come out of the rings as they were, once each round, of another life") {
    const PlayerSample sample;
    const auto recording = Recording::open(sample.path);
    REQUIRE(recording);
    std::map<std::uint64_t, std::vector<std::byte>> expected;
    REQUIRE(recording->for_each({"cam1"}, [&](const RecordedItem& item) {
        expected[item.number] = {item.payload.begin(), item.payload.end()};
        return true;
    }));
    std::optional<ring::Reader> reader;
    std::map<std::uint64_t, std::uint64_t> lives;
    std::uint64_t good = 0;
    std::uint64_t restarts = 0;
    PlaySettings settings;
    settings.instance = player_instance;
    settings.streams = {"cam1"};
    settings.rate = 1000;
    settings.loop = true;
    // The reader looks between any two items: it misses none.
    settings.stop = [&] {
        if (!reader) {
            auto opened = ring::Reader::open(stream_path(player_instance, "cam1"),
                                             {ring::Position::oldest, ring::Position::oldest});
            if (!opened) return false;
            reader.emplace(std::move(*opened));
        }
        for (;;) {
            const auto item = reader->next();
            if (!item && item.error().why == ring::Pause::restarted) ++restarts;
            if (!item && item.error().why != ring::Pause::restarted) break;
            if (!item) continue;
            ++lives[item->time.life];
            const auto frame = unpack<FrameMetadata>(item->metadata);
            const auto& pixels = expected.at(frame.block_id - 1);
            const SensorState sensor = unpack_sensor_state(item->payload.attributes());
            good += std::equal(pixels.begin(), pixels.end(), item->payload.data(),
                               item->payload.data() + item->payload.size()) &&
                            sensor.gain == static_cast<float>(frame.block_id - 1) &&
                            sensor.temperature_c == 41.5F
                        ? 1
                        : 0;
        }
        return lives.size() == 3;
    };
    const auto report = play(*recording, settings);
    REQUIRE(report);
    CHECK(lives.size() == 3);
    CHECK(restarts == 2);
    CHECK(lives.begin()->second + std::next(lives.begin())->second > expected.size());
    CHECK(good >= 2 * expected.size());
}

TEST_CASE("player: an instance that somebody serves is refused") {
    const PlayerSample sample;
    const auto recording = Recording::open(sample.path);
    const auto owned = ring::OwnedDirectory::claim(instance_directory(player_instance));
    REQUIRE(owned);
    PlaySettings settings;
    settings.instance = player_instance;
    const auto report = play(*recording, settings);
    REQUIRE_FALSE(report);
    CHECK(report.error().what.find("serves this instance") != std::string::npos);
    settings.streams = {"nothing"};
    CHECK_FALSE(play(*recording, settings));
}

TEST_CASE("pace: by the stamps, faster or slower, and jumps are not waited for") {
    PlaybackClock clock(2);
    constexpr HostTime begin{1'000'000'000};
    CHECK(clock.due({seconds(100).ns}, begin) == begin);
    CHECK(clock.due({seconds(101).ns}, begin) == begin + milliseconds(500));
    CHECK(clock.due({seconds(100).ns}, begin + seconds(1)) == begin);
    const HostTime later = begin + seconds(3);
    CHECK(clock.due({seconds(900).ns}, later) == later);
    CHECK(clock.due({seconds(902).ns}, later) == later + seconds(1));
    CHECK(clock.due({seconds(5).ns}, later) == later);
}

TEST_CASE("pace: who does not set it waits as the others do, but not for what is before or far") {
    PlaybackClock clock(2);
    constexpr HostTime begin{1'000'000'000};
    CHECK(clock.due_beside({seconds(100).ns}, begin) == begin);
    CHECK(clock.due({seconds(200).ns}, begin) == begin);
    CHECK(clock.due_beside({seconds(199).ns}, begin + seconds(1)) == begin + seconds(1));
    CHECK(clock.due_beside({seconds(204).ns}, begin) == begin + seconds(2));
    CHECK(clock.due_beside({seconds(500).ns}, begin) == begin);
    CHECK(clock.due({seconds(202).ns}, begin) == begin + seconds(1));
}

TEST_CASE("player: what the clock was fed in the minutes before is there at once") {
    const test::TemporaryDirectory directory;
    constexpr std::int64_t begin = 1'700'000'000'000'000'000;
    test::RecordingFile file;
    for (int i = 0; i < 60; ++i)
        file.add({"clock",
                  ring::StreamKind::clock,
                  static_cast<std::uint64_t>(i),
                  1,
                  OutputTime{begin} - seconds(60 - i),
                  {},
                  {}});
    for (int i = 0; i < 20; ++i)
        file.add({"imu0",
                  ring::StreamKind::imu,
                  static_cast<std::uint64_t>(i),
                  1,
                  OutputTime{begin} + milliseconds(10) * i,
                  {},
                  {}});
    const auto recording = Recording::open(directory.write("a.mcap", file.finish()));
    REQUIRE(recording);
    PlaySettings settings;
    settings.instance = player_instance;
    const HostTime until = host_now() + seconds(5);
    settings.stop = [&] { return host_now() > until; };
    double all = 0;
    settings.progress = [&](double /*seconds*/, double length) { all = length; };
    const HostTime started = host_now();
    const auto report = play(*recording, settings);
    REQUIRE(report);
    CHECK(report->items == 80);
    CHECK(host_now() - started >= milliseconds(190));
    CHECK(all == Approx(0.19));
    settings.streams = {"clock"};
    settings.rate = 1000;
    REQUIRE(play(*recording, settings));
    CHECK(all == Approx(59));
    std::filesystem::remove_all(instance_directory(player_instance));
}

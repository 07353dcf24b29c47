// SPDX-License-Identifier: BSD-3-Clause
#include "process/recording_process.hpp"

#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>

#include "../pairing/pairing_bench.hpp"
#include "../support/recording_file.hpp"
#include "../support/temporary_directory.hpp"
#include "engine/clock/recording.hpp"
#include "engine/pairing/recording.hpp"
#include "mcap_messages.hpp"
#include "recording/item_messages.hpp"
#include "recording/recording.hpp"
#include "recording/ros_messages.hpp"
#include "recording_sketch.hpp"
#include "ros_decoder.hpp"

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;
using ring::StreamKind;
using test::Bench;
using test::RecordingSketch;

namespace {

constexpr Duration host_behind = seconds(1'700'000'000);  ///< of the host
constexpr int before_lock = 15;                           ///< frames that were suspect live

OutputTime shown(HostTime host) { return {host.ns + host_behind.ns}; }
HostTime on_host(BoardTime board) { return {board.ns + test::host_ahead.ns}; }

/// A minute: the board, its clock, a camera and an IMU. Live, stamps were off by some 30 us.
class Minute {
 public:
    Minute() {
        clock();
        frames();
        samples();
    }

    RecordingSketch file;
    std::vector<OutputTime> truth;  ///< of the frames

    template <class T>
    void item(const std::string& stream, StreamKind kind, OutputTime time, const T& metadata) {
        file.add_item(stream, kind, number_++, time, pack(metadata));
    }

 private:
    void clock() {
        std::exponential_distribution<double> delay(1 / 100e3);
        for (int i = 0; i < 600; ++i) {
            const HostTime sent = on_host({}) + seconds(5) + milliseconds(100) * i;
            const HostTime there =
                sent + Duration{60'000 + static_cast<std::int64_t>(delay(random_))};
            const HostTime arrived =
                there + Duration{60'000 + static_cast<std::int64_t>(delay(random_))};
            const BoardTime at{there.ns - test::host_ahead.ns};
            const clock::RecordedExchange exchange{3, 1, 0, sent, at, at, arrived};
            item("clock", StreamKind::clock, shown(arrived),
                 clock::to_metadata(clock::ClockItem{exchange}));
            if (i % 10 == 0)
                item("clock", StreamKind::clock, shown(sent),
                     clock::to_metadata(
                         clock::ClockItem{clock::RecordedOutput{1, sent, host_behind, {}}}));
        }
    }

    void evidence(const pairing::Evidence& decision, HostTime at) {
        item("cam0-evidence", StreamKind::evidence, shown(at), pairing::to_metadata(decision));
    }

    void frames() {
        std::uniform_real_distribution<double> noise(-52e3, 52e3);  // 30 us rms
        const Bench bench;
        pairing::Limits limits = Bench::made();
        evidence(limits, on_host({}));
        std::uint64_t tick = 0;
        for (std::uint64_t n = 1; n <= 600; ++n) {
            const std::uint64_t in_pattern = n - before_lock - 1;
            tick += n > before_lock && in_pattern < 12
                        ? test::pattern[in_pattern] -
                              (in_pattern == 0 ? 0 : test::pattern[in_pattern - 1])
                        : 1;
            const pairing::Exposure exposure = Bench::exposure(n, tick);
            const pairing::Arrival arrival = bench.frame(n, exposure);
            evidence(exposure, exposure.recorded);
            evidence(arrival, arrival.arrived);
            const HostTime middle_then = on_host(middle(exposure.start, exposure.end));
            truth.push_back(shown(middle_then));
            FrameMetadata frame{};
            frame.block_id = n;
            frame.arrival = arrival.arrived;
            frame.epoch = 1;
            OutputTime time = shown(arrival.arrived);
            frame.host_time = arrival.arrived;
            frame.sigma_ns = sigma_unknown;
            frame.flags = flag_suspect | 3U;
            if (n > before_lock + 12) {
                const Duration off{static_cast<std::int64_t>(noise(random_))};
                frame.host_time = middle_then + off;
                time = shown(frame.host_time);
                frame.trigger = n;
                frame.board_time = middle(exposure.start, exposure.end);
                frame.sigma_ns = 30'000;
                frame.flags = 0;
            }
            file.add("/cam0/image_raw", "cdr", number_, time, std::string(40, '\1'));
            item("cam0", StreamKind::frames, time, frame);
            file.add("/versavis/cam0/stamp", "json", number_, time,
                     R"({"time_ns":)" + std::to_string(time.ns) + R"(,"suspect":true,"flags":)" +
                         std::to_string(frame.flags) + "}");
        }
    }

    void samples() {
        for (int i = 0; i < 3000; ++i) {
            ImuMetadata sample{};
            sample.board_time = BoardTime{} + seconds(6) + milliseconds(10) * i;
            sample.filter_delay = milliseconds(3);
            sample.host_time = on_host(sample.board_time - sample.filter_delay);
            sample.host_time = sample.host_time + microseconds(i % 2 == 0 ? 40 : -40);
            sample.sigma_ns = 50'000;
            sample.epoch = 1;
            item("imu0", StreamKind::imu, shown(sample.host_time), sample);
        }
    }

    std::mt19937_64 random_{7};
    std::uint64_t number_ = 0;
};

bool on(double /*share*/) { return true; }

}  // namespace

TEST_CASE("recording_process: suspect frames get their stamps, and all stamps the smoothed clock") {
    const test::TemporaryDirectory directory;
    const std::string old_file = directory.path() / "old.mcap";
    const std::string new_file = directory.path() / "new.mcap";
    const Minute minute;
    minute.file.write(old_file);
    const auto report = process_recording(old_file, new_file, on);
    REQUIRE(report);
    INFO(to_text(*report));
    const ProcessedStream& camera = report->streams.at("cam0");
    CHECK(camera.items == 600);
    CHECK(camera.restamped == 600);
    CHECK(camera.suspect == before_lock + 12);
    CHECK(camera.proved == before_lock + 12);
    CHECK(camera.contradicted == 0);
    CHECK(camera.change_rms_ns == Approx(30e3).epsilon(0.3));
    CHECK(report->streams.at("imu0").restamped == 3000);
    const auto recording = Recording::open(new_file);
    REQUIRE(recording);
    CHECK(recording->facts().defect.empty());
    std::size_t index = 0;
    OutputTime last;
    REQUIRE(recording->for_each({"cam0"}, [&](const RecordedItem& item) {
        const auto frame = unpack<FrameMetadata>(item.metadata);
        CHECK(std::abs((item.time - minute.truth[index]).ns) < 15'000);
        CHECK((frame.flags & flag_suspect) == 0);
        CHECK(frame.trigger == ++index);
        CHECK(frame.sigma_ns < 30'000);
        CHECK(frame.exposure.ns == (index <= before_lock + 12 ? 5'000'000 : 0));
        CHECK(shown(frame.host_time) == item.time);
        CHECK(item.time > last);
        last = item.time;
        return true;
    }));
    CHECK(index == 600);
    double rough = 0;
    int sample_number = 0;
    REQUIRE(recording->for_each({"imu0"}, [&](const RecordedItem& item) {
        const OutputTime true_time =
            shown(on_host({})) + seconds(6) + milliseconds(10) * sample_number++ - milliseconds(3);
        rough = std::max(rough, std::abs(static_cast<double>((item.time - true_time).ns)));
        return true;
    }));
    CHECK(rough < 15e3);
    REQUIRE(recording->attachment("process.json") != nullptr);
    CHECK(nlohmann::json::parse(
              recording->attachment("process.json")->content)["streams"]["cam0"]["proved"] ==
          before_lock + 12);
}

TEST_CASE("recording_process: images and texts have the stamp of their item") {
    const test::TemporaryDirectory directory;
    const std::string old_file = directory.path() / "old.mcap";
    const std::string new_file = directory.path() / "new.mcap";
    const Minute minute;
    minute.file.write(old_file);
    REQUIRE(process_recording(old_file, new_file, on));
    const auto recording = Recording::open(new_file);
    REQUIRE(recording);
    std::vector<std::uint32_t> flags;
    REQUIRE(recording->for_each({"cam0"}, [&](const RecordedItem& item) {
        flags.push_back(unpack<FrameMetadata>(item.metadata).flags);
        return true;
    }));
    REQUIRE(flags.size() == 600);
    std::map<std::string, int> seen;
    test::RosDecoder stamps(ros_definition(stamp_type));
    test::for_each_message(new_file, [&](const std::string& topic, const auto& message) {
        const int index = seen[topic]++;
        const std::string data(reinterpret_cast<const char*>(message.data.data()),
                               message.data.size());
        if (topic == "/cam0/image_raw") {
            std::int32_t s = 0;
            std::uint32_t ns = 0;
            std::memcpy(&s, data.data() + 4, 4);
            std::memcpy(&ns, data.data() + 8, 4);
            CHECK(std::uint64_t(s) * 1'000'000'000 + ns == message.log_time);
            CHECK(data.substr(12) == std::string(28, '\1'));
        } else if (topic == "/versavis/cam0/stamp") {
            const auto stamp = stamps.decode(data);  // it was JSON, as before version 2
            CHECK(stamp["time_ns"] == message.log_time);
            CHECK(stamp["suspect"] == false);
            CHECK(stamp["flags"] == flags[index]);
            if (index == 3) CHECK(stamp["trigger"][0] == 4);
        }
    });
    CHECK(seen["/cam0/image_raw"] == 600);
    CHECK(seen["/versavis/clock/item"] == 660);
}

TEST_CASE("recording_process: stamps that would be equal are held one after the other") {
    const test::TemporaryDirectory directory;
    const std::string old_file = directory.path() / "old.mcap";
    const std::string new_file = directory.path() / "new.mcap";
    Minute minute;
    for (int i = 0; i < 20; ++i) {
        ImuMetadata sample{};  // two of each board time
        sample.board_time = BoardTime{} + seconds(6) + milliseconds(10) * (i / 2);
        sample.host_time = on_host(sample.board_time) + microseconds(i % 2);
        sample.sigma_ns = i == 1 ? sigma_unknown : 50'000;
        sample.epoch = 1;
        minute.item("imu1", StreamKind::imu, shown(sample.host_time), sample);
    }
    minute.file.write(old_file);
    REQUIRE(process_recording(old_file, new_file, on));
    const auto recording = Recording::open(new_file);
    REQUIRE(recording);
    std::optional<OutputTime> last;
    int index = 0;
    REQUIRE(recording->for_each({"imu1"}, [&](const RecordedItem& item) {
        const auto sample = unpack<ImuMetadata>(item.metadata);
        if (index % 2 == 1) CHECK((item.time - *last).ns == 1);
        CHECK(((sample.flags & flag_clamped) != 0) == (index % 2 == 1));
        CHECK((sample.sigma_ns == sigma_unknown) == (index == 1));
        last = item.time;
        ++index;
        return true;
    }));
    CHECK(index == 20);
}

TEST_CASE("recording_process: of a recording in several files, the one that is named") {
    const test::TemporaryDirectory directory;
    std::vector<std::string> files;
    for (const int part : {0, 1}) {
        test::RecordingFile file(std::to_string(part));
        for (int i = 0; i < 300; ++i) {
            const HostTime sent = HostTime{} + seconds(100 + 30 * part) + milliseconds(100) * i;
            const BoardTime at{sent.ns + 70'000};
            const auto number = static_cast<std::uint64_t>(300 * part + i);
            const auto add = [&](const clock::ClockItem& item) {
                file.add({"clock",
                          StreamKind::clock,
                          number,
                          1,
                          shown(sent),
                          pack(clock::to_metadata(item)),
                          {}});
            };
            add(clock::RecordedExchange{3, 1, 0, sent, at, at, sent + microseconds(140)});
            if (i % 10 == 0) add(clock::RecordedOutput{1, sent, host_behind, {}});
            ImuMetadata sample{};
            sample.board_time = BoardTime{sent.ns};
            sample.host_time = sent;
            file.add({"imu0", StreamKind::imu, number, 1, shown(sent), pack(sample), {}});
        }
        files.push_back(directory.write(part == 0 ? "a.mcap" : "a-0001.mcap", file.finish()));
    }
    const auto report = process_recording(files[0], directory.path() / "new.mcap", on);
    REQUIRE(report);
    CHECK(report->streams.at("imu0").items == 300);
}

TEST_CASE("recording_process: what cannot be done is reported, and leaves no file") {
    const test::TemporaryDirectory directory;
    const std::string old_file = directory.path() / "old.mcap";
    const std::string new_file = directory.path() / "new.mcap";
    Minute().file.write(old_file);
    const auto onto_itself = process_recording(old_file, old_file, on);
    REQUIRE_FALSE(onto_itself);
    CHECK_THAT(onto_itself.error().message(), Contains("none is overwritten"));
    int asked = 0;
    const auto stopped = process_recording(old_file, new_file,
                                           [&](double share) { return share == 0 || ++asked < 1; });
    CHECK_FALSE(stopped);
    CHECK(std::distance(std::filesystem::directory_iterator(directory.path()), {}) == 1);
    CHECK_FALSE(process_recording(directory.path() / "none.mcap", new_file, on));
    CHECK_FALSE(process_recording(old_file, "/nonexistent/new.mcap", on));
}

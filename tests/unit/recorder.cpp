// SPDX-License-Identifier: BSD-3-Clause
// The recorder against writers that run in step with it: its question whether to stop is their
// turn.
#include "record/recorder.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <thread>

#include "../support/in_process.hpp"
#include "../support/temporary_directory.hpp"
#include "base/byte_cursor.hpp"
#include "commands/record_command.hpp"
#include "engine/ring/writer.hpp"
#include "mcap_messages.hpp"
#include "pixel_formats.hpp"
#include "record/item_writer.hpp"
#include "recording/item_messages.hpp"
#include "recording/recording.hpp"
#include "recording/repair.hpp"
#include "recording/ros_messages.hpp"
#include "ros_decoder.hpp"
#include "versavis/fields.hpp"
#include "versavis/ring_path.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;
using Catch::Matchers::Contains;

namespace {

constexpr std::uint32_t image_width = 64;
constexpr std::uint32_t image_height = 48;
constexpr std::uint32_t ring_slots = 8;

std::vector<std::byte> pixels_of(std::uint64_t number) {
    return std::vector<std::byte>(image_width * image_height, static_cast<std::byte>(number + 1));
}

/// An instance that no service owns, with a camera, an IMU and events.
struct RecordedInstance {
    std::string name = fmt::format("recorder-{}", ::getpid());
    std::filesystem::path directory = instance_directory(name);
    test::TemporaryDirectory files;
    std::optional<ring::Writer> camera;
    std::optional<ring::Writer> imu;
    std::optional<ring::Writer> events;
    std::uint32_t epoch = 1;

    RecordedInstance() {
        std::filesystem::create_directories(directory);
        open();
    }
    ~RecordedInstance() {
        close();
        std::filesystem::remove_all(directory);
    }
    ring::Writer make(const ring::Shape& shape) const {
        return *ring::Writer::create(directory, shape);
    }
    void open() {
        using Kind = ring::StreamKind;
        camera =
            make({"cam0", Kind::frames, 64, ring_slots, std::uint64_t{image_width} * image_height});
        imu = make({"imu0", Kind::imu, 256});
        events = make({"events", Kind::events, 64});
    }
    void close() {
        camera.reset();
        imu.reset();
        events.reset();
    }

    /// A frame, and the sample of the same instant.
    void publish() {
        const std::uint64_t number = camera->head();
        const OutputTime time{1'000'000'000 + static_cast<std::int64_t>(number) * 50'000'000};
        FrameMetadata frame{};
        frame.trigger = number + 1;
        frame.width = frame.stride = image_width;
        frame.height = image_height;
        frame.pixel_format = mono8;
        frame.epoch = epoch;
        const auto pixels = pixels_of(number);
        const std::uint32_t slot = camera->acquire().value();
        std::memcpy(camera->slot_data(slot), pixels.data(), pixels.size());
        camera->publish(slot, static_cast<std::uint32_t>(pixels.size()), time, pack(frame),
                        pack(SensorState{static_cast<float>(number), 41.5F}));
        ImuMetadata sample{};
        sample.number = number;
        sample.epoch = epoch;
        imu->publish(time, pack(sample));
    }

    RecordSettings settings(const std::string& file = "a.mcap") const {
        RecordSettings settings;
        settings.instance = name;
        settings.output = (files.path() / file).string();
        return settings;
    }

    /// `turn` is called with 0, 1, ... between the recorder's rounds, until it returns false.
    RecordReport record(RecordSettings settings, const std::function<bool(int)>& turn) const {
        settings.stop = [&turn, number = 0]() mutable { return !turn(number++); };
        auto report = client::record(settings);
        REQUIRE(report);
        return *report;
    }
};

/// Threads want a stack that no machine has.
class NoMoreThreads {
 public:
    NoMoreThreads() {
        ::pthread_getattr_default_np(&usual_);
        pthread_attr_t impossible;
        ::pthread_getattr_default_np(&impossible);
        ::pthread_attr_setstacksize(&impossible, std::size_t{1} << 50U);
        REQUIRE(::pthread_setattr_default_np(&impossible) == 0);
        CHECK_THROWS(std::thread([] {}));
    }
    NoMoreThreads(const NoMoreThreads&) = delete;
    NoMoreThreads& operator=(const NoMoreThreads&) = delete;
    ~NoMoreThreads() { ::pthread_setattr_default_np(&usual_); }

 private:
    pthread_attr_t usual_{};
};

/// What a recording has of the camera: numbers, and whether all pixels are right.
struct Frames {
    std::vector<std::uint64_t> numbers;
    bool right = true;
};

Frames frames_in(const std::string& path) {
    Frames frames;
    const auto recording = Recording::open(path);
    REQUIRE(recording);
    CHECK(recording->facts().defect.empty());
    CHECK(recording->for_each({"cam0"}, [&](const RecordedItem& item) {
        const auto expected = pixels_of(item.number);
        frames.numbers.push_back(item.number);
        frames.right = frames.right && std::equal(item.payload.begin(), item.payload.end(),
                                                  expected.begin(), expected.end());
        const SensorState sensor = unpack_sensor_state(item.attributes);
        CHECK(sensor.gain == static_cast<float>(item.number));
        CHECK(sensor.temperature_c == 41.5F);
        return true;
    }));
    return frames;
}

std::vector<std::uint64_t> from_to(std::uint64_t first, std::uint64_t end) {
    std::vector<std::uint64_t> numbers;
    for (; first < end; ++first) numbers.push_back(first);
    return numbers;
}

std::vector<nlohmann::json> decoded_messages(const std::string& path, const std::string& topic,
                                             std::string_view type) {
    std::vector<nlohmann::json> found;
    test::RosDecoder decoder(ros_definition(type));
    test::for_each_message(path, [&](const std::string& its_topic, const auto& message) {
        if (its_topic == topic) found.push_back(decoder.decode(std::string(as_text(message.data))));
    });
    return found;
}

std::map<std::string, std::uint64_t> gaps_in(const std::string& path, const std::string& stream) {
    std::map<std::string, std::uint64_t> gaps;
    const auto all = Recording::open(path)->gaps();
    REQUIRE(all);
    for (const RecordedGap& gap : *all)
        if (gap.stream == stream) gaps[gap.reason] += gap.items + (gap.reason == "lost" ? 0 : 1);
    return gaps;
}

}  // namespace

TEST_CASE_METHOD(RecordedInstance, "recorder: each item is in the file as it was in the ring") {
    const bool png = GENERATE(false, true);
    auto settings = this->settings();
    settings.png = png;
    const RecordReport report = record(settings, [&](int turn) {
        publish();
        if (turn == 3) events->publish(OutputTime{5}, pack(EventMetadata{}));
        return turn < 20;
    });
    CHECK(report.lost() == 0);
    CHECK(report.streams.at("cam0").items == 20);
    CHECK(report.streams.at("events").items == 1);
    const Frames frames = frames_in(settings.output);
    CHECK(frames.numbers == from_to(0, 20));
    CHECK(frames.right);
    const auto recording = Recording::open(settings.output);
    CHECK(recording->facts().metadata.at("instance") == name);
    std::uint64_t samples = 0;
    CHECK(recording->for_each({"imu0"}, [&](const RecordedItem& item) {
        CHECK(unpack<ImuMetadata>(item.metadata).number == samples++);
        return true;
    }));
    CHECK(samples == 20);
}

TEST_CASE_METHOD(RecordedInstance, "recorder: stamps and events have time, life, and all fields") {
    const auto settings = this->settings();
    record(settings, [&](int turn) {
        publish();
        events->publish(OutputTime{5}, pack(EventMetadata{}));
        return turn < 2;
    });
    struct Note {
        const char* topic;
        std::string_view type;
        ring::StreamKind kind;
    };
    for (const Note& note : {Note{"/versavis/cam0/stamp", stamp_type, ring::StreamKind::frames},
                             Note{"/versavis/events", event_type, ring::StreamKind::events}}) {
        std::set<std::string> expected{"header", "time_ns", "life"};
        for (const Field& field : fields_of(note.kind)) expected.insert(field.name);
        const auto messages = decoded_messages(settings.output, note.topic, note.type);
        INFO(note.topic);
        CHECK_FALSE(messages.empty());
        for (const auto& message : messages) {
            std::set<std::string> names;
            for (const auto& [field, value] : message.items()) names.insert(field);
            CHECK(names == expected);
        }
    }
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: what is overwritten before it is written is reported as lost") {
    const auto settings = this->settings();
    const RecordReport report = record(settings, [&](int turn) {
        for (int i = 0; i < (turn == 2 ? 100 : 1); ++i) publish();
        return turn < 5;
    });
    const StreamReport& stream = report.streams.at("cam0");
    CHECK(stream.lost > 80);
    CHECK(stream.items + stream.lost == 104);
    CHECK(gaps_in(settings.output, "cam0").at("lost") == stream.lost);
    const Frames frames = frames_in(settings.output);
    CHECK(frames.numbers.size() == stream.items);
    CHECK(frames.right);
    CHECK(report.streams.at("imu0").lost == 0);
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: what is overwritten while it is written is taken back") {
    auto file = McapWriter::create((files.path() / "a.mcap").string(), "a test");
    ItemWriter writer(std::move(*file));
    auto reader = ring::Reader::open(directory / "cam0");
    publish();
    publish();
    const auto first = reader->next();
    REQUIRE(writer.write_frame("cam0", *first));
    const auto second = reader->next();
    for (std::uint32_t i = 0; i < ring_slots; ++i) publish();  // as if meanwhile
    const auto outcome = writer.write_frame("cam0", *second);
    REQUIRE(outcome);
    CHECK(*outcome == ItemWriter::Outcome::overtaken);
    REQUIRE(writer.file().close());
    CHECK(frames_in((files.path() / "a.mcap").string()).numbers == from_to(0, 1));
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: a service that ends and comes back is reported, and followed") {
    const auto settings = this->settings();
    const RecordReport report = record(settings, [&](int turn) {
        if (turn == 4) close();
        if (turn == 6) open();
        if (turn == 8) ++epoch;
        if (camera) publish();
        return turn < 12;
    });
    const StreamReport& stream = report.streams.at("cam0");
    CHECK(stream.restarts == 1);
    CHECK(stream.epochs == 1);
    CHECK(stream.lost == 0);
    CHECK(stream.items == 10);
    CHECK(gaps_in(settings.output, "cam0") ==
          std::map<std::string, std::uint64_t>{{"epoch", 1}, {"gone", 1}, {"restarted", 1}});
    auto expected = from_to(0, 4);
    for (const std::uint64_t number : from_to(0, 6)) expected.push_back(number);
    CHECK(frames_in(settings.output).numbers == expected);
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: a stream that comes later is recorded from its first item on") {
    std::optional<ring::Writer> late;
    const auto settings = this->settings();
    const RecordReport report = record(settings, [&](int turn) {
        if (turn == 1) {
            late = make({"late", ring::StreamKind::events, 64});
            for (int i = 0; i < 3; ++i) late->publish(OutputTime{9}, pack(EventMetadata{}));
        }
        return turn < 15;  // rounds without items last a tenth of a second
    });
    CHECK(report.streams.at("late").items == 3);
}

TEST_CASE_METHOD(RecordedInstance, "recorder: the past, as far as the rings go") {
    for (int i = 0; i < 20; ++i) publish();
    auto settings = this->settings();
    settings.before = milliseconds(200);
    const RecordReport report = record(settings, [&](int turn) {
        publish();
        return turn < 2;
    });
    CHECK(report.lost() == 0);
    CHECK(frames_in(settings.output).numbers == from_to(15, 22));
    CHECK_THAT(to_text(report, false), !Catch::Contains("later than --before"));
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: all that the rings hold, while they are written, is no loss") {
    for (int i = 0; i < 200; ++i) publish();
    auto settings = this->settings();
    settings.before = seconds(1000);
    const RecordReport report = record(settings, [&](int turn) {
        publish();
        return turn < 3;
    });
    CHECK(report.lost() == 0);
    const auto numbers = frames_in(settings.output).numbers;
    REQUIRE(numbers.size() >= ring_slots / 2);
    CHECK(numbers == from_to(numbers.front(), 203));
    CHECK_THAT(to_text(report, false),
               Catch::Contains("cam0 begins") && Catch::Contains("later than --before asked for"));
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: the past of a stream with nothing new is older than wanted") {
    EventMetadata event{};
    event.epoch = epoch;
    events->publish(OutputTime{1}, pack(event));
    for (int i = 0; i < 200; ++i) publish();
    auto settings = this->settings();
    settings.before = milliseconds(300);
    const RecordReport report = record(settings, [&](int turn) {
        publish();
        return turn < 3;
    });
    CHECK(report.streams.at("events").items == 0);
    CHECK(report.streams.at("imu0").items == 10);
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: of the past, what no time of another epoch says is recorded") {
    const std::int64_t step_s = GENERATE(-3600, 3600);
    for (int i = 0; i < 5; ++i) publish();
    EventMetadata event{};
    event.epoch = epoch + 1;
    for (int i = 0; i < 3; ++i)
        events->publish(OutputTime{(step_s + i) * 1'000'000'000}, pack(event));
    auto settings = this->settings();
    settings.before = milliseconds(200);
    const RecordReport report = record(settings, [](int turn) { return turn < 2; });
    CHECK(frames_in(settings.output).numbers == from_to(0, 5));
    CHECK(report.streams.at("events").items == 1);  // of its own epoch, as far back as wanted
}

TEST_CASE_METHOD(RecordedInstance, "recorder: a gap before the first item stands where that does") {
    const auto settings = this->settings();
    const RecordReport report = record(settings, [&](int turn) {
        for (int i = 0; i < (turn == 0 ? 100 : 1); ++i) publish();
        return turn < 3;
    });
    CHECK(report.streams.at("cam0").lost > 0);
    CHECK(gaps_in(settings.output, "cam0").at("lost") == report.streams.at("cam0").lost);
    test::for_each_message(settings.output, [](const std::string&, const auto& message) {
        CHECK(message.log_time >= 1'000'000'000);
    });
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: where the next file cannot be made, the one before is whole") {
    auto settings = this->settings();
    settings.split_bytes = 20'000;
    settings.output = (files.path() / "split.mcap").string();
    const RecordReport report = record(settings, [&](int turn) {
        if (turn == 1) files.write("split-0001.mcap", "somebody's");
        publish();
        if (turn % 8 == 7) ::usleep(600'000);  // chunks end by their age
        return turn < 24;
    });
    REQUIRE(report.stopped_early);
    CHECK_THAT(report.stopped_early->message(), Contains("split-0001.mcap"));
    CHECK(report.bytes == std::filesystem::file_size(settings.output));
    std::filesystem::remove(files.path() / "split-0001.mcap");
    CHECK(frames_in(settings.output).numbers.size() == report.streams.at("cam0").items);
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: a name that a later file needs is looked at in the beginning") {
    auto settings = this->settings("split.mcap");
    settings.stop = [] { return true; };
    files.write("split-0017.mcap", "somebody's");
    files.write("split-x.mcap", "no part");
    files.write("split-0001.txt", "no part");
    CHECK(client::record(settings));  // one file needs no other name
    std::filesystem::remove(settings.output);
    settings.split_bytes = 1 << 30U;
    const auto refused = client::record(settings);
    REQUIRE_FALSE(refused);
    CHECK_THAT(refused.error().message(), Contains("split-0017.mcap"));
    CHECK_FALSE(std::filesystem::exists(settings.output));
    std::filesystem::remove(files.path() / "split-0017.mcap");
    CHECK(client::record(settings));
}

TEST_CASE_METHOD(RecordedInstance, "recorder: camera infos have the intrinsics that it is given") {
    auto settings = this->settings();
    const auto calibrated = [](const char* key, const char* lens, const char* topic) {
        return fmt::format(
            "{}: {{camera_model: pinhole, intrinsics: [321.5, 1.0, 1.0, 1.0], {}, resolution: "
            "[{}, {}], rostopic: {}}}\n",
            key, lens, image_width, image_height, topic);
    };
    constexpr auto radtan = "distortion_model: radtan, distortion_coeffs: [1.0, 2.0, 3.0, 4.0]";
    const bool known = GENERATE(true, false);
    settings.calibration = {
        files.write("chain.yaml",
                    calibrated("cam0", "distortion_model: fov, distortion_coeffs: [1.0]", "/x/y") +
                        calibrated("cam1", radtan, known ? "/cam0/image_raw" : "/cam1/image_raw"))};
    record(settings, [&](int turn) {
        publish();
        return turn < 1;
    });
    std::ifstream file(settings.output, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    const double fx = 321.5;
    const std::string number(reinterpret_cast<const char*>(&fx), sizeof fx);
    CHECK((bytes.find(number) != std::string::npos) == known);
    CHECK(Recording::open(settings.output)->attachment("calibration/camchain.yaml") != nullptr);
}

TEST_CASE_METHOD(RecordedInstance, "recorder: a status that is none, as of a file that is played") {
    const std::string text = GENERATE(std::string("[1]"), std::string(R"({"schema":"1"})"),
                                      std::string(200'000, '[') + std::string(200'000, ']'));
    auto status = make({"status", ring::StreamKind::status, 8, 4, 500'000});
    status.heartbeat(host_now());
    const std::uint32_t slot = status.acquire().value();
    std::memcpy(status.slot_data(slot), text.data(), text.size());
    status.publish(slot, static_cast<std::uint32_t>(text.size()), OutputTime{5}, {});
    const auto settings = this->settings();
    const RecordReport report = record(settings, [&](int turn) {
        publish();
        return turn < 3;
    });
    CHECK(report.lost() == 0);
    CHECK(Recording::open(settings.output)->attachment("status.json") == nullptr);
}

TEST_CASE_METHOD(RecordedInstance, "recorder: files of a size, each whole in itself") {
    auto settings = this->settings();
    settings.split_bytes = 20'000;
    settings.output = (files.path() / "split.mcap").string();
    const RecordReport report = record(settings, [&](int turn) {
        publish();
        if (turn % 8 == 7) ::usleep(600'000);  // chunks end by their age
        return turn < 24;
    });
    REQUIRE(report.files.size() == 4);
    CHECK_THAT(report.files[1], Contains("split-0001.mcap"));
    CHECK(frames_in(report.files.front()).numbers == from_to(0, 24));  // it has the others follow
    const auto id = [](const std::string& path) {
        return Recording::open_file(path)->facts().metadata.at("recording");
    };
    CHECK(id(report.files[0]).size() == 16);
    CHECK(id(report.files[0]) == id(report.files[3]));
}

TEST_CASE_METHOD(RecordedInstance, "recorder: a full disk ends it, and what came before is whole") {
    const auto settings = this->settings();
    CHECK(test::in_process([&] {
        ::signal(SIGXFSZ, SIG_IGN);
        const rlimit limit{6'000'000, 6'000'000};
        ::setrlimit(RLIMIT_FSIZE, &limit);
        auto full = settings;
        full.stop = [&] {
            publish();
            return camera->head() > 5000;
        };
        const auto report = client::record(full);
        if (!report) return false;
        const StreamReport& camera_report = report->streams.at("cam0");
        std::ofstream(files.path() / "reported") << camera_report.items;
        return camera_report.lost > 0 && report->stopped_early && camera->head() < 5000 &&
               report->stopped_early->message().find("free some") != std::string::npos;
    }));
    const Frames frames = frames_in(settings.output);
    // All but the chunk that does not fit any more, of 4 MiB, or less where it ends by its age.
    CHECK(frames.numbers.size() > 350);
    CHECK(frames.right);
    std::uint64_t reported = 0;
    std::ifstream(files.path() / "reported") >> reported;
    CHECK(reported == frames.numbers.size());
}

TEST_CASE_METHOD(RecordedInstance, "recorder: a disk without room for the summary costs no item") {
    const auto run = [&](const std::string& file) {
        auto settings = this->settings(file);
        return record(settings, [&](int turn) {
            publish();
            return turn < 10;
        });
    };
    const std::uint64_t whole = run("a.mcap").bytes;
    CHECK(test::in_process([&] {
        close();
        open();  // numbers begin anew: the file will be as long
        ::signal(SIGXFSZ, SIG_IGN);
        const rlimit limit{whole - 4, whole - 4};
        ::setrlimit(RLIMIT_FSIZE, &limit);
        const RecordReport report = run("b.mcap");
        return report.stopped_early && report.lost() == 0 && report.streams.at("cam0").items == 10;
    }));
    const std::string cut = (files.path() / "b.mcap").string();
    REQUIRE(repair(cut, ""));
    CHECK(frames_in(cut).numbers == from_to(0, 10));
}

TEST_CASE_METHOD(RecordedInstance, "recorder: where no thread is to be had, it packs by itself") {
    auto settings = this->settings();
    settings.png = true;
    std::optional<NoMoreThreads> none;
    const RecordReport report = record(settings, [&](int turn) {
        if (turn == 0) none.emplace();  // readers have theirs by now
        publish();
        return turn < 20;
    });
    none.reset();
    CHECK(report.lost() == 0);
    const Frames frames = frames_in(settings.output);
    CHECK(frames.numbers == from_to(0, 20));
    CHECK(frames.right);
}

TEST_CASE_METHOD(RecordedInstance,
                 "recorder: one that is killed leaves all up to the last whole chunk") {
    const auto settings = this->settings();
    const pid_t child = ::fork();
    if (child == 0) {
        auto endless = settings;
        endless.stop = [&] {
            publish();
            if (camera->head() > 4000) ::raise(SIGKILL);
            return false;
        };
        [[maybe_unused]] const auto never = client::record(endless);
        ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    REQUIRE(WIFSIGNALED(status));
    const auto cut = Recording::open(settings.output);
    REQUIRE(cut);
    CHECK_FALSE(cut->facts().defect.empty());
    REQUIRE(repair(settings.output, ""));
    const Frames frames = frames_in(settings.output);
    CHECK(frames.numbers == from_to(0, frames.numbers.size()));
    CHECK(frames.numbers.size() > 2000);
    CHECK(frames.right);
}

TEST_CASE_METHOD(RecordedInstance, "recorder: what cannot be recorded says why") {
    const auto refusal = [](const RecordSettings& settings) {
        const auto report = client::record(settings);
        return report ? "" : report.error().message();
    };
    auto wrong = settings();
    wrong.streams = {"cam7"};
    CHECK_THAT(refusal(wrong), Contains("cam7"));
    wrong.streams = {"../cam0"};
    CHECK_THAT(refusal(wrong), Contains("is not a name of a stream"));
    wrong = settings();
    wrong.instance = "nobody";
    CHECK_THAT(refusal(wrong), Contains("has no streams to record"));
    wrong = settings();
    wrong.output = "/nowhere/a.mcap";
    CHECK_THAT(refusal(wrong), Contains("make its directory"));
    wrong = settings();
    wrong.calibration = {"/nowhere/chain.yaml"};
    CHECK_THAT(refusal(wrong), Contains("/nowhere/chain.yaml: cannot be read"));
    CHECK(std::filesystem::is_empty(files.path()));
    wrong.calibration = {files.write("chain.yaml", "cam0: 3\n")};
    CHECK_THAT(refusal(wrong), Contains("chain.yaml:1"));
}

TEST_CASE("recorder: sizes and times of --split") {
    RecordSettings settings;
    REQUIRE(read_split("2GiB", settings));
    CHECK(settings.split_bytes == std::uint64_t{2} << 30U);
    REQUIRE(read_split("1.5MB", settings));
    CHECK(settings.split_bytes == 1'500'000);
    REQUIRE(read_split("10min", settings));
    CHECK(*settings.split_length == seconds(600));
    for (const char* wrong : {"", "2", "GiB", "-1h", "nans", "1d", "1 h", "0s"})
        CHECK_FALSE(read_split(wrong, settings));
}

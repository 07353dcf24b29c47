// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <thread>

#include "../support/process.hpp"
#include "../support/temporary_directory.hpp"
#include "cpu_time.hpp"
#include "engine/ring/writer.hpp"
#include "metric.hpp"
#include "recording/recording.hpp"
#include "recording/repair.hpp"
#include "ring/child.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring/path.hpp"

namespace versavis::bench {

namespace {

constexpr std::uint32_t width = 1920;
constexpr std::uint32_t height = 1200;
constexpr std::uint32_t mono8 = 0x01080001;
constexpr std::size_t frame_size = std::size_t{width} * height;
constexpr unsigned cameras = 3;
constexpr double frame_hz = 20;
constexpr unsigned samples_for_a_frame = 40;
constexpr std::uint32_t slots = 17;

template <class T>
T checked(Expected<T> made) {
    if (!made) throw std::runtime_error(made.error().message());
    return std::move(*made);
}

/// A scene whose detail falls with its frequency, and the shot noise of a sensor: blocks of all
/// sizes, and a spread that grows with the root of the brightness.
std::vector<std::vector<std::byte>> noisy_scenes() {
    constexpr unsigned count = 4;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    std::vector<double> scene(frame_size, 110.0);
    for (unsigned block = 512; block >= 2; block /= 2) {
        const double amplitude = 24.0 * std::sqrt(block / 512.0);
        std::vector<double> values((width / block + 2) * (height / block + 2));
        for (double& value : values) value = amplitude * normal(random);
        for (unsigned y = 0; y < height; ++y)
            for (unsigned x = 0; x < width; ++x)
                scene[std::size_t{y} * width + x] +=
                    values[std::size_t{y / block} * (width / block + 2) + x / block];
    }
    std::vector<std::vector<std::byte>> frames(count, std::vector<std::byte>(frame_size));
    for (auto& frame : frames)
        for (std::size_t i = 0; i < frame_size; ++i) {
            const double level = std::clamp(scene[i], 4.0, 250.0);
            const double seen = level + 0.18 * std::sqrt(level) * normal(random);
            frame[i] = static_cast<std::byte>(std::clamp(seen, 0.0, 255.0));
        }
    return frames;
}

/// Counts in memory that the processes share.
struct Course {
    std::atomic<bool> ready{false};
    std::atomic<bool> stop{false};
    std::atomic<std::uint64_t> frames{0};  ///< published by all cameras
};

/// The service's part, in a process of its own: three cameras and an IMU.
class Streams {
 public:
    /// `pace`: from one set of frames to the next; none: as fast as `limit_mb_s` allows.
    Streams(std::string instance, Duration pace, bool noisy)
        : instance_(std::move(instance)),
          directory_(instance_directory(instance_)),
          course_(make_shared_between_processes<Course>()) {
        std::filesystem::create_directories(directory_);
        child_ = std::make_unique<Child>([this, pace, noisy] { publish_all(pace, noisy); });
        while (!course_->ready) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    Streams(const Streams&) = delete;
    Streams& operator=(const Streams&) = delete;
    ~Streams() {
        course_->stop = true;
        child_->finish(seconds(20));
        std::filesystem::remove_all(directory_);
    }
    std::uint64_t frames() const { return course_->frames; }

 private:
    void publish_all(Duration pace, bool noisy) {
        using Kind = ring::StreamKind;
        const auto scenes =
            noisy ? noisy_scenes()
                  : std::vector<std::vector<std::byte>>(1, std::vector<std::byte>(frame_size));
        std::vector<ring::Writer> rings;
        for (unsigned camera = 0; camera < cameras; ++camera)
            rings.push_back(checked(ring::Writer::create(
                directory_, {fmt::format("cam{}", camera), Kind::frames, 64, slots, frame_size})));
        auto imu = checked(ring::Writer::create(directory_, {"imu0", Kind::imu, 16384}));
        course_->ready = true;
        auto due = std::chrono::steady_clock::now();
        for (std::uint64_t tick = 0; !course_->stop; ++tick) {
            due += std::chrono::nanoseconds(pace.ns / samples_for_a_frame);
            std::this_thread::sleep_until(due);
            const OutputTime time{host_now().ns};
            ImuMetadata sample{};
            sample.number = tick;
            imu.publish(time, pack(sample));
            if (tick % samples_for_a_frame == 0)
                for (ring::Writer& ring : rings) publish(ring, time, scenes);
            if (tick % 16 != 0) continue;
            for (ring::Writer& ring : rings) ring.heartbeat(host_now());
            imu.heartbeat(host_now());
        }
    }

    void publish(ring::Writer& ring, OutputTime time,
                 const std::vector<std::vector<std::byte>>& scenes) {
        FrameMetadata frame{};
        frame.trigger = ring.head() + 1;
        frame.width = frame.stride = width;
        frame.height = height;
        frame.pixel_format = mono8;
        const std::uint32_t slot = ring.acquire().value();
        const auto& scene = scenes[ring.head() % scenes.size()];
        std::memcpy(ring.slot_data(slot), scene.data(), scene.size());
        ring.publish(slot, frame_size, time, pack(frame));
        ++course_->frames;
    }

    std::string instance_;
    std::filesystem::path directory_;
    std::shared_ptr<Course> course_;
    std::unique_ptr<Child> child_;
};

constexpr Duration set_period = {static_cast<std::int64_t>(1e9 / frame_hz)};

struct Recorded {
    nlohmann::json report;
    double cpu_s = 0;
    std::uint64_t bytes = 0;
};

class Bench {
 public:
    explicit Bench(double seconds) : seconds_(seconds) {}

    std::vector<Metric> run() {
        measure_cost();
        measure_png();
        measure_stop();
        measure_kills();
        return std::move(metrics_);
    }

 private:
    std::vector<std::string> command(const std::string& file,
                                     std::vector<std::string> more = {}) const {
        std::vector<std::string> all{
            test::program("versavis"), "--instance", instance_, "record", "-o", file, "--json"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    std::string file(const std::string& name) const { return (directory_.path() / name).string(); }

    /// Runs the recorder; `meanwhile` gets its process.
    Recorded record(const std::string& name, std::vector<std::string> options,
                    const std::function<void(test::Process&)>& meanwhile = {}) {
        options.insert(options.end(), {"--seconds", fmt::format("{}", seconds_)});
        test::Process process(command(file(name), options), file(name + ".log"));
        if (meanwhile) meanwhile(process);
        Recorded recorded;
        while (process.wait(milliseconds(50)) < 0) {
            const double cpu = cpu_seconds(process.pid());
            recorded.cpu_s = std::max(recorded.cpu_s, cpu);
        }
        recorded.report = nlohmann::json::parse(process.output());
        recorded.bytes = recorded.report["bytes"];
        return recorded;
    }

    /// What it costs to write the same bytes at the same pace from memory, and nothing else.
    double bare_cpu_s(std::uint64_t bytes) const {
        const auto cost = make_shared_between_processes<std::atomic<double>>();
        const std::string path = file("bare");
        Child child([&] {
            const std::vector<std::byte> frame(frame_size, std::byte{1});
            const int out = ::open(path.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
            const Usage before = Usage::now();
            const auto pause =
                std::chrono::duration<double>(seconds_ * frame_size / static_cast<double>(bytes));
            auto due = std::chrono::steady_clock::now();
            for (std::uint64_t done = 0; done < bytes; done += frame_size) {
                if (::write(out, frame.data(), frame.size()) < 0) break;
                due += std::chrono::duration_cast<std::chrono::nanoseconds>(pause);
                std::this_thread::sleep_until(due);
            }
            *cost = (Usage::now() - before).cpu_ns * 1e-9;
            ::close(out);
        });
        child.finish(seconds(300));
        std::filesystem::remove(path);
        return *cost;
    }

    void measure_cost() {
        const Streams streams(instance_, set_period, false);
        const Recorded recorded = record("raw.mcap", {});
        metrics_.push_back({"record, lost", recorded.report["lost"], "items", 0});
        metrics_.push_back(
            {"record, rate", static_cast<double>(recorded.bytes) / seconds_ * 1e-6, "MB/s", {}});
        metrics_.push_back({"record, CPU", recorded.cpu_s / seconds_, "processors", {}});
        metrics_.push_back({"record, CPU to bare writing",
                            recorded.cpu_s / bare_cpu_s(recorded.bytes), "ratio", 1.2});
        std::filesystem::remove(file("raw.mcap"));
    }

    void measure_png() {
        const Streams streams(instance_, set_period, true);
        const Recorded recorded = record("png.mcap", {"--compress", "png"});
        const double frames = recorded.report["streams"]["cam0"]["items"].get<double>() +
                              recorded.report["streams"]["cam1"]["items"].get<double>() +
                              recorded.report["streams"]["cam2"]["items"].get<double>();
        const double raw = frames * frame_size;
        metrics_.push_back({"record png, lost", recorded.report["lost"], "items", 0});
        metrics_.push_back({"record png, file to pixels", static_cast<double>(recorded.bytes) / raw,
                            "ratio", 1 / 1.6});
        metrics_.push_back({"record png, CPU", recorded.cpu_s / seconds_, "processors", 1});
        std::filesystem::remove(file("png.mcap"));
    }

    /// Missing numbers are those that the file tells.
    void measure_stop() {
        const Streams streams(instance_, set_period, false);
        const Recorded recorded = record("stopped.mcap", {}, [](test::Process& process) {
            std::this_thread::sleep_for(std::chrono::seconds(1));
            process.signal(SIGSTOP);
            std::this_thread::sleep_for(std::chrono::seconds(2));
            process.signal(SIGCONT);
        });
        const auto recording = checked(client::Recording::open(file("stopped.mcap")));
        std::uint64_t told = 0;
        for (const auto& gap : checked(recording.gaps()))
            if (gap.reason == "lost") told += gap.items;
        std::map<std::string, std::uint64_t> next;
        std::uint64_t missing = 0;
        const auto glanced = recording.glance({}, [&](const client::RecordedItem& item) {
            const auto known = next.find(item.stream);
            if (known != next.end()) missing += item.number - known->second;
            next[item.stream] = item.number + 1;
            return true;
        });
        if (!glanced) throw std::runtime_error(glanced.error().message());
        const double untold = std::abs(static_cast<double>(missing) - static_cast<double>(told));
        metrics_.push_back(
            {"record, stopped for 2 s: lost", static_cast<double>(told), "items", {}});
        metrics_.push_back({"record, stopped for 2 s: lost and not told", untold, "items", 0});
        const double expected = (seconds_ - 1) * frame_hz * cameras;
        metrics_.push_back({"record, stopped for 2 s: frames the service published, of what is due",
                            expected / static_cast<double>(streams.frames()), "ratio", 1});
        std::filesystem::remove(file("stopped.mcap"));
    }

    /// Each file is read up to its last whole chunk, and repaired with the same items.
    void measure_kills() {
        constexpr int kills = 100;
        const Streams streams(instance_, set_period, false);
        std::mt19937 random(3);
        double unreadable = 0;
        for (int i = 0; i < kills; ++i) {
            const std::string path = file("killed.mcap");
            {
                test::Process process(command(path, {"imu0", "cam0"}), file("killed.log"));
                std::this_thread::sleep_for(std::chrono::milliseconds(20 + random() % 900));
                process.signal(SIGKILL);
                process.wait(seconds(10));
            }
            if (std::filesystem::exists(path) && !good(path)) ++unreadable;
            for (const char* end : {"", ".cut"}) std::filesystem::remove(path + end);
        }
        metrics_.push_back(
            {"record, 100 kills: files not read or repaired", unreadable, "files", 0});
    }

    static std::uint64_t items_in(const std::string& path) {
        const auto recording = client::Recording::open(path);
        std::uint64_t items = 0;
        if (recording)
            for (const auto& stream : recording->streams()) items += stream.items;
        return items;
    }

    /// One that was killed before its first chunk has nothing to repair.
    static bool good(const std::string& path) {
        const std::uint64_t before = items_in(path);
        const auto repaired = client::repair(path, "");
        return before == 0 || (repaired && items_in(path) == before);
    }

    double seconds_;
    test::TemporaryDirectory directory_{"/dev/shm"};
    std::string instance_ = fmt::format("bench-record-{}", ::getpid());
    std::vector<Metric> metrics_;
};

}  // namespace

std::vector<Metric> bench_record(double seconds) { return Bench(seconds).run(); }

}  // namespace versavis::bench

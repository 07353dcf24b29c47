// SPDX-License-Identifier: BSD-3-Clause
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <tuple>

#include "../support/process.hpp"
#include "../support/temporary_directory.hpp"
#include "cpu_time.hpp"
#include "engine/ring/writer.hpp"
#include "metric.hpp"
#include "recording/recording.hpp"
#include "recording/repair.hpp"
#include "ring/child.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::bench {

namespace {

constexpr std::uint32_t width = 1920;
constexpr std::uint32_t height = 1200;
constexpr std::uint32_t mono8 = 0x01080001;
constexpr std::size_t frame_size = std::size_t{width} * height;
constexpr unsigned cameras = 3;
constexpr double frame_hz = 20;
constexpr double sample_hz = 800;
constexpr double set_size = cameras * frame_size;

/// A disk that takes so much more than the cameras make is taken for one that can. Half: it cannot.
/// Twice: good disks are not used.
constexpr double disk_margin = 1.5;

/// To learn a disk's rate. Half: its own memory may hold what was written. Twice: it takes longer.
constexpr Duration probe_time = milliseconds(1500);

/// Written at a time, and how its memory must lie. Half: more calls. Twice: nothing is faster.
constexpr std::size_t block_size = 4 << 20U;

/// At each rate that is tried. Half: fsync is a large part of it. Twice: it takes longer.
constexpr double rung_size = 1e9;

/// The first rate that is tried, as a share of the disk's, and from one to the next. Half: it takes
/// longer. Twice: the first may be too much, and the highest is known less well.
constexpr double first_rung = 0.3;
constexpr double rung_step = 1.2;

/// What gets so much less onto the disk than the cameras should make is behind: the recorder, or
/// the cameras. Half: the last fsync alone is that much. Twice: the disk is asked for more and
/// more.
constexpr double behind = 1.3;

/// After its first chunk a recorder is killed at a random instant of so long. Half: most files have
/// one or two chunks. Twice: it takes longer.
constexpr int kill_range_ms = 300;

template <class T>
T checked(Expected<T> made) {
    if (!made) throw std::runtime_error(made.error().message());
    return std::move(*made);
}

using Scenes = std::vector<std::vector<std::byte>>;

Scenes flat_scene() { return Scenes(1, std::vector<std::byte>(frame_size)); }

/// A scene whose detail falls with its frequency, and the shot noise of a sensor: blocks of all
/// sizes, and a spread that grows with the root of the brightness.
Scenes noisy_scenes() {
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
    Scenes frames(count, std::vector<std::byte>(frame_size));
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
    /// `rate_hz`: of sets of frames.
    Streams(std::string instance, double rate_hz, const Scenes& scenes)
        : instance_(std::move(instance)),
          directory_(instance_directory(instance_)),
          course_(make_shared_between_processes<Course>()) {
        std::filesystem::create_directories(directory_);
        child_ =
            std::make_unique<Child>([this, rate_hz, &scenes] { publish_all(rate_hz, scenes); });
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
    void publish_all(double rate_hz, const Scenes& scenes) {
        using Kind = ring::StreamKind;
        // As many as the service makes by default.
        const auto slots = static_cast<std::uint32_t>(std::ceil(14 + 0.12 * rate_hz));
        const auto descriptors = std::bit_ceil(std::max(64U, 2 * slots));
        std::vector<ring::Writer> rings;
        for (unsigned camera = 0; camera < cameras; ++camera)
            rings.push_back(checked(ring::Writer::create(
                directory_, {fmt::format("cam{}", camera), Kind::frames, descriptors, slots,
                             static_cast<std::uint32_t>(frame_size)})));
        auto imu = checked(ring::Writer::create(directory_, {"imu0", Kind::imu, 16384}));
        course_->ready = true;
        auto due = std::chrono::steady_clock::now();
        const auto samples =
            std::max<std::uint64_t>(1, static_cast<std::uint64_t>(sample_hz / rate_hz));
        const std::chrono::nanoseconds pause(
            static_cast<std::int64_t>(1e9 / rate_hz / static_cast<double>(samples)));
        for (std::uint64_t tick = 0; !course_->stop; ++tick) {
            due += pause;
            std::this_thread::sleep_until(due);
            const OutputTime time{host_now().ns};
            ImuMetadata sample{};
            sample.number = tick;
            imu.publish(time, pack(sample));
            if (tick % samples == 0)
                for (ring::Writer& ring : rings) publish(ring, time, scenes);
            if (tick % 16 != 0) continue;
            for (ring::Writer& ring : rings) ring.heartbeat(host_now());
            imu.heartbeat(host_now());
        }
    }

    void publish(ring::Writer& ring, OutputTime time, const Scenes& scenes) {
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

/// Bytes per second that the disk of `directory` takes: past the page cache, where the file system
/// can, since that may cost more than the disk.
double raw_rate(const std::string& directory, const Scenes& scenes) {
    const std::string path = fmt::format("{}/versavis-bench-raw-{}", directory, ::getpid());
    constexpr int flags = O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC;
    int file = ::open(path.c_str(), flags | O_DIRECT, 0600);
    if (file < 0) file = ::open(path.c_str(), flags, 0600);
    if (file < 0) throw std::runtime_error(path + " cannot be written: name another --directory");
    const std::unique_ptr<void, decltype(&std::free)> block(
        std::aligned_alloc(block_size, block_size), &std::free);
    for (std::size_t at = 0; at < block_size; at += frame_size)
        std::memcpy(static_cast<std::byte*>(block.get()) + at, scenes.back().data(),
                    std::min(frame_size, block_size - at));
    const HostTime begin = host_now();
    double written = 0;
    bool good = true;
    while (good && host_now() - begin < probe_time) {
        good = ::write(file, block.get(), block_size) == static_cast<ssize_t>(block_size);
        written += block_size;
    }
    good = good && ::fdatasync(file) == 0;
    const double seconds = static_cast<double>((host_now() - begin).ns) * 1e-9;
    ::close(file);
    std::filesystem::remove(path);
    if (!good) throw std::runtime_error(directory + " is full: name another --directory");
    return written / seconds;
}

/// What was recorded of an item: stream, number, stamp, pixels.
using Seen = std::tuple<std::string, std::uint64_t, std::int64_t, std::size_t>;

/// None: the file cannot be read.
std::optional<std::vector<Seen>> items_in(const std::string& path) {
    const auto recording = client::Recording::open(path);
    if (!recording) return std::nullopt;
    std::vector<Seen> items;
    const auto read = recording->for_each({}, [&](const client::RecordedItem& item) {
        const std::string_view pixels(reinterpret_cast<const char*>(item.payload.data()),
                                      item.payload.size());
        items.emplace_back(item.stream, item.number, item.time.ns,
                           std::hash<std::string_view>()(pixels));
        return true;
    });
    if (!read) return std::nullopt;
    return items;
}

/// npm's @mcap/core, if this build has fetched it.
class OthersReader {
 public:
    explicit OthersReader(const std::string& directory) : log_(directory + "/reader.log") {
        std::string ignored;
        there_ = std::filesystem::exists(script_) &&
                 test::run({"sh", "-c", "command -v node"}, log_, &ignored) == 0;
    }

    bool there() const { return there_; }

    /// Items of all streams that it reads; none: it cannot, or is not there. `how`: --stream, of a
    /// file without its end; or nothing: by its indexes, too, which must say the same.
    std::optional<std::uint64_t> items(const std::string& path,
                                       const std::vector<std::string>& how) const {
        if (!there_) return std::nullopt;
        std::vector<std::string> command{"node", "--single-threaded", script_, path};
        command.insert(command.end(), how.begin(), how.end());
        std::string output;
        if (test::run(command, log_, &output) != 0) return std::nullopt;
        const auto seen = nlohmann::json::parse(output, nullptr, false);
        if (seen.is_discarded()) return std::nullopt;
        if (how.empty() && seen["streamed"] != seen["indexed"]) return std::nullopt;
        std::uint64_t items = 0;
        for (const auto& [topic, messages] : seen["streamed"].items())
            if (topic.ends_with("/item")) items += messages.get<std::uint64_t>();
        return items;
    }

 private:
    std::string script_ = test::program("../readers/read_mcap.mjs");
    std::string log_;
    bool there_ = false;
};

struct Recorded {
    nlohmann::json report;
    double cpu_s = 0;
    std::uint64_t bytes = 0;
};

class Bench {
 public:
    Bench(double seconds, const std::string& disk)
        : seconds_(seconds),
          disk_(disk.empty() ? std::filesystem::current_path().string() : disk),
          directory_(disk.empty() ? fast_directory() : disk),
          others_(directory_.path().string()) {
        const auto room = static_cast<double>(std::filesystem::space(directory_.path()).available);
        if (room < 1.2 * seconds_ * frame_hz * set_size)
            throw std::runtime_error("too little room there for so long: --directory or --seconds");
        if (!others_.there())
            fmt::print(stderr,
                       "bench record: @mcap/core is not asked: it needs node, and "
                       "'ninja -C build readers'\n");
    }

    std::vector<Metric> run() {
        measure_cost();
        measure_png();
        measure_highest_rate();
        measure_stop();
        measure_kills();
        return std::move(metrics_);
    }

 private:
    /// The disk, if it takes what the cameras make; else memory.
    std::string fast_directory() const {
        const double rate = raw_rate(disk_, noisy_);
        const bool fast = rate >= disk_margin * frame_hz * set_size;
        fmt::print(stderr, "bench record: {} takes {:.0f} MB/s: {}\n", disk_, rate * 1e-6,
                   fast ? "recordings go there" : "recordings go to /dev/shm");
        return fast ? disk_ : "/dev/shm";
    }

    std::vector<std::string> command(const std::string& file,
                                     std::vector<std::string> more = {}) const {
        std::vector<std::string> all{
            test::program("versavis"), "--instance", instance_, "record", "-o", file, "--json"};
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
    std::string file(const std::string& name) const { return (directory_.path() / name).string(); }

    /// Runs the recorder; `meanwhile` gets its process.
    Recorded record(const std::string& name, double seconds, std::vector<std::string> options = {},
                    const std::function<void(test::Process&)>& meanwhile = {}) {
        return record_into(file(name), seconds, std::move(options), meanwhile);
    }

    Recorded record_into(const std::string& path, double seconds, std::vector<std::string> options,
                         const std::function<void(test::Process&)>& meanwhile = {}) {
        options.insert(options.end(), {"--seconds", fmt::format("{}", seconds)});
        test::Process process(command(path, options), file("record.log"));
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
        child.finish(seconds(60 + static_cast<int>(2 * seconds_)));
        std::filesystem::remove(path);
        return *cost;
    }

    void measure_cost() {
        const Streams streams(instance_, frame_hz, flat_);
        const Recorded recorded = record("raw.mcap", seconds_);
        std::filesystem::remove(file("raw.mcap"));
        metrics_.push_back({"record, lost", recorded.report["lost"], "items", 0});
        metrics_.push_back(
            {"record, rate", static_cast<double>(recorded.bytes) / seconds_ * 1e-6, "MB/s", {}});
        metrics_.push_back({"record, CPU", recorded.cpu_s / seconds_, "processors", {}});
        metrics_.push_back({"record, CPU to bare writing",
                            recorded.cpu_s / bare_cpu_s(recorded.bytes), "ratio", 1.2});
    }

    void measure_png() {
        const Streams streams(instance_, frame_hz, noisy_);
        const Recorded recorded = record("png.mcap", seconds_, {"--compress", "png"});
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

    /// The rate of frames rises until items are lost, or the disk is surely behind. What counts is
    /// when all is on the disk, as with raw writing: the page cache takes any rate for a while.
    void measure_highest_rate() {
        const test::TemporaryDirectory directory(disk_);
        const std::string path = (directory.path() / "fast.mcap").string();
        const double before = raw_rate(disk_, noisy_);
        double highest = 0;
        double cpu = 0;
        for (double rate = first_rung * before;; rate *= rung_step) {
            const Streams streams(instance_, rate / set_size, noisy_);
            const double length = std::max(1.0, rung_size / rate);
            const Recorded recorded = record_into(path, length, {});
            std::filesystem::remove(path);
            const std::uint64_t lost = recorded.report["lost"];
            const double taken =
                static_cast<double>(recorded.bytes) / recorded.report["seconds"].get<double>();
            fmt::print(stderr, "bench record: at {:.0f} MB/s {:.0f} come to the disk, {} lost\n",
                       rate * 1e-6, taken * 1e-6, lost);
            if (lost != 0) break;
            if (taken > highest) {
                highest = taken;
                cpu = recorded.cpu_s / recorded.report["seconds"].get<double>();
            }
            if (taken * behind < rate) break;
        }
        // Disks are not always equally fast: the recorder is held against the better one.
        const double raw = std::max(before, raw_rate(disk_, noisy_));
        metrics_.push_back({"record, disk's raw write rate", raw * 1e-6, "MB/s", {}});
        metrics_.push_back({"record, highest rate without loss", highest * 1e-6, "MB/s", {}});
        metrics_.push_back({"record, CPU at that rate", cpu, "processors", {}});
        metrics_.push_back({"record, raw rate to highest", raw / highest, "ratio", 1 / 0.9});
    }

    /// Missing numbers are those that the file reports.
    void measure_stop() {
        const Streams streams(instance_, frame_hz, flat_);
        const double length = std::max(seconds_, 6.0);
        const Recorded recorded = record("stopped.mcap", length, {}, [](test::Process& process) {
            std::this_thread::sleep_for(std::chrono::seconds(1));
            process.signal(SIGSTOP);
            std::this_thread::sleep_for(std::chrono::seconds(2));
            process.signal(SIGCONT);
        });
        const auto recording = checked(client::Recording::open(file("stopped.mcap")));
        std::uint64_t reported = 0;
        for (const auto& gap : checked(recording.gaps()))
            if (gap.reason == "lost") reported += gap.items;
        std::map<std::string, std::uint64_t> next;
        std::uint64_t missing = 0;
        const auto glanced = recording.glance({}, [&](const client::RecordedItem& item) {
            const auto known = next.find(item.stream);
            if (known != next.end()) missing += item.number - known->second;
            next[item.stream] = item.number + 1;
            return true;
        });
        if (!glanced) throw std::runtime_error(glanced.error().message());
        const double unreported =
            std::abs(static_cast<double>(missing) - static_cast<double>(reported));
        metrics_.push_back(
            {"record, stopped for 2 s: lost", static_cast<double>(reported), "items", {}});
        metrics_.push_back(
            {"record, stopped for 2 s: lost and not reported", unreported, "items", 0});
        const double expected = (length - 1) * frame_hz * cameras;
        metrics_.push_back({"record, stopped for 2 s: frames the service published, of what is due",
                            expected / static_cast<double>(streams.frames()), "ratio", 1});
        std::filesystem::remove(file("stopped.mcap"));
    }

    /// Each file is read up to its last whole chunk, and repaired with the same items.
    void measure_kills() {
        constexpr int kills = 100;
        const Streams streams(instance_, frame_hz, noisy_);
        std::mt19937 random(3);
        double bad = 0;
        double unread = 0;
        for (int i = 0; i < kills; ++i) {
            const std::string path = file("killed.mcap");
            kill_recorder(path, milliseconds(static_cast<int>(random() % kill_range_ms)));
            const auto before = items_in(path);
            const auto cut_off = others_.items(path, {"--stream"});
            const auto repaired = client::repair(path, "");
            const auto after = items_in(path);
            if (!before || before->empty() || !repaired || repaired->was_whole || after != before)
                ++bad;
            if (!before || cut_off != before->size() || others_.items(path, {}) != before->size())
                ++unread;
            for (const char* end : {"", ".cut"}) std::filesystem::remove(path + end);
        }
        metrics_.push_back({"record, 100 kills: files not read or repaired", bad, "files", 0});
        if (others_.there())
            metrics_.push_back({"record, 100 kills: not read by @mcap/core", unread, "files", 0});
    }

    /// So long after the first chunk stood in the file.
    void kill_recorder(const std::string& path, Duration later) {
        test::Process process(command(path, {"imu0", "cam0"}), file("killed.log"));
        const HostTime deadline = host_now() + seconds(20);
        const auto begun = [&] {
            const auto recording = client::Recording::open(path);
            return recording && recording->facts().chunks > 0;
        };
        while (!begun()) {
            if (host_now() > deadline) throw std::runtime_error("the recorder writes nothing");
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        std::this_thread::sleep_for(std::chrono::nanoseconds(later.ns));
        process.signal(SIGKILL);
        process.wait(seconds(10));
    }

    Scenes flat_ = flat_scene();
    Scenes noisy_ = noisy_scenes();
    double seconds_;
    std::string disk_;
    test::TemporaryDirectory directory_;
    OthersReader others_;
    std::string instance_ = fmt::format("bench-record-{}", ::getpid());
    std::vector<Metric> metrics_;
};

}  // namespace

std::vector<Metric> bench_record(double seconds, const std::string& directory) {
    return Bench(seconds, directory).run();
}

}  // namespace versavis::bench

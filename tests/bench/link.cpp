// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "../support/look.hpp"
#include "../support/stack.hpp"
#include "board/board_link.hpp"
#include "engine/clock/recording.hpp"
#include "metric.hpp"
#include "pipeline/camera_pipeline.hpp"
#include "pipeline/imu_pipeline.hpp"
#include "versavis/ring_reader.hpp"

namespace versavis::bench {

namespace {

using namespace daemon;

constexpr int turns = 3;  // of each way, in turn
constexpr Duration turn_time = seconds(5);
constexpr int busy_threads = 8;
constexpr int rig_priority = 30;  // above the reader's: hardware would not wait for the host

/// What the service does with each packet: it pairs and publishes.
class Work final : public BoardListener {
 public:
    Work(const Configuration& configuration, const std::filesystem::path& directory,
         clock::Translator& translator, EventJournal& events)
        : imu_(configuration.imus[0],
               *ring::Writer::create(directory, {"imu0", ring::StreamKind::imu, 16384}), translator,
               events) {
        for (const CameraConfiguration& camera : configuration.cameras) {
            cameras_.push_back(
                std::make_unique<CameraPipeline>(camera, camera.output, translator, events));
            if (!cameras_.back()->prepare(directory, 4096, true))
                throw std::runtime_error("no ring for " + camera.name);
        }
    }

    void board_restarted() override {}
    void board_synchronised() override {}
    void board_connected() override { connected_ = true; }
    void cameras_changed(std::uint8_t /*outputs*/, std::uint8_t /*other_rate*/) override {}
    void board_lost() override {}
    void exposure(const wire::Exposure& record, HostTime received) override {
        if (record.camera < cameras_.size()) cameras_[record.camera]->add(record, received);
    }
    bool imu_sample(const wire::ImuSample& sample, HostTime received) override {
        return imu_.add(sample, received);
    }
    void exchange_doubted(const Implausibility& /*doubt*/) override {}
    void board_event(const wire::Event& /*event*/, HostTime /*received*/) override {}

    bool connected() const { return connected_; }

 private:
    ImuPipeline imu_;
    std::vector<std::unique_ptr<CameraPipeline>> cameras_;
    std::atomic<bool> connected_{false};
};

/// The way before: the thread that reads and stamps also works, at ordinary priority.
class WorkingStream final : public ByteStream {
 public:
    WorkingStream(std::unique_ptr<ByteStream> stream, BoardListener& work)
        : stream_(std::move(stream)), work_(work) {}

    Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) override {
        const sched_param ordinary{};
        ::pthread_setschedparam(::pthread_self(), SCHED_OTHER, &ordinary);
        auto chunk = stream_->read(into, timeout);
        if (chunk)
            decoder_.feed(into.data(), chunk->size, [&](const wire::Packet& packet) {
                wire::Exposure record{};
                wire::ImuSample sample{};
                if (packet.read(record)) work_.exposure(record, chunk->received);
                if (packet.read(sample)) work_.imu_sample(sample, chunk->received);
            });
        return chunk;
    }
    Expected<> write(std::span<const std::uint8_t> bytes) override { return stream_->write(bytes); }
    std::string port() const override { return stream_->port(); }

 private:
    std::unique_ptr<ByteStream> stream_;
    BoardListener& work_;
    wire::Decoder decoder_;
};

/// Threads that take all the time that they can get.
class BusyLoad {
 public:
    BusyLoad() {
        for (int i = 0; i < busy_threads; ++i)
            threads_.emplace_back([this] {
                while (!stop_) {
                }
            });
    }
    ~BusyLoad() {
        stop_ = true;
        for (std::thread& thread : threads_) thread.join();
    }
    BusyLoad(const BusyLoad&) = delete;
    BusyLoad& operator=(const BusyLoad&) = delete;

 private:
    std::atomic<bool> stop_{false};
    std::vector<std::thread> threads_;
};

void pause(Duration duration) {
    const timespec time{duration.ns / 1'000'000'000, duration.ns % 1'000'000'000};
    nanosleep(&time, nullptr);
}

struct Idle final : BoardListener {
    explicit Idle(Work& of) : work(of) {}
    void board_restarted() override {}
    void board_synchronised() override {}
    void board_connected() override { work.board_connected(); }
    void cameras_changed(std::uint8_t outputs, std::uint8_t other_rate) override {
        work.cameras_changed(outputs, other_rate);
    }
    void board_lost() override {}
    void exposure(const wire::Exposure& /*record*/, HostTime /*received*/) override {}
    bool imu_sample(const wire::ImuSample& /*sample*/, HostTime /*received*/) override {
        return true;
    }
    void exchange_doubted(const Implausibility& /*doubt*/) override {}
    void board_event(const wire::Event& /*event*/, HostTime /*received*/) override {}
    Work& work;
};

/// Arrival minus departure of all samples of one turn, from the smallest on, in us. The rig's clock
/// runs as fast as the host's.
std::vector<double> delays_us(const test::Stack& stack, bool own_thread) {
    const test::TemporaryDirectory directory("/dev/shm");
    const auto configuration = load_configuration(stack.configuration_path());
    if (!configuration) throw std::runtime_error("the rig's configuration is refused");
    clock::Translator translator(*clock::OutputClock::create(clock::OutputClockKind::realtime));
    EventJournal events(
        *ring::Writer::create(directory.path(), {"events", ring::StreamKind::events, 4096}),
        translator);
    ClockRecorder recorder(
        *ring::Writer::create(directory.path(), {"clock", ring::StreamKind::clock, 65536}),
        translator);
    Work work(*configuration, directory.path(), translator, events);
    Idle idle(work);
    BoardListener& listener = own_thread ? static_cast<BoardListener&>(work) : idle;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            auto stream = open_byte_stream(configuration->board);
            if (!stream || own_thread) return stream;
            return std::make_unique<WorkingStream>(std::move(*stream), work);
        },
        *configuration, configuration->clock.exchange_rate_hz, translator, recorder, listener);
    link.start();
    while (!work.connected()) pause(milliseconds(10));
    link.start_cameras(0xF, pairing::Start::steady);
    const BusyLoad load;
    auto reader = ring::Reader::open(directory.path() / "clock");
    pause(turn_time);
    std::vector<double> delays;
    for (auto item = test::look(reader->next()); item.found == test::Found::item;
         item = test::look(reader->next())) {
        const auto recorded = clock::from_metadata(unpack<clock::ClockMetadata>(item.metadata));
        if (!recorded || !std::holds_alternative<clock::RecordedMessage>(*recorded)) continue;
        const auto& message = std::get<clock::RecordedMessage>(*recorded);
        delays.push_back(static_cast<double>(message.arrived.ns - message.departed.ns) * 1e-3);
    }
    if (delays.size() < 1000) throw std::runtime_error("too few samples came");
    const double smallest = *std::min_element(delays.begin(), delays.end());
    for (double& delay : delays) delay -= smallest;
    return delays;
}

double quantile(std::vector<double>& values, double part) {
    const auto at =
        values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// All threads of the rig's process.
void set_realtime(pid_t process) {
    const sched_param wanted{rig_priority};
    for (const auto& task :
         std::filesystem::directory_iterator(fmt::format("/proc/{}/task", process)))
        if (::sched_setscheduler(std::stoi(task.path().filename()), SCHED_FIFO, &wanted) != 0)
            throw std::runtime_error("bench link needs the right to real-time priority");
}

}  // namespace

/// Four outputs at 100 Hz and an IMU at 800 Hz, while busy threads take all that they get.
std::vector<Metric> bench_link() {
    test::StackSettings settings{
        "benchlink", 43, 4, 100, "", "[board]\nclock_skew_ppm = 0\nclock_drift_ppm_per_s = 0\n",
        ""};
    settings.imu_extra = "rate_hz = 800\n";
    test::Stack stack(settings);
    stack.start_rig();
    set_realtime(stack.rig().pid());
    std::vector<double> before;
    std::vector<double> now;
    for (int turn = 0; turn < turns; ++turn) {
        for (const double delay : delays_us(stack, false)) before.push_back(delay);
        for (const double delay : delays_us(stack, true)) now.push_back(delay);
    }
    std::vector<Metric> metrics;
    for (const auto& [name, part, goal_us, goal_ratio] : {std::tuple{"p50", 0.5, 200.0, 1.0},
                                                          {"p99", 0.99, 1000.0, 0.5},
                                                          {"max", 1.0, 10000.0, 0.5}}) {
        const double spread = quantile(now, part);
        const double spread_before = quantile(before, part);
        fmt::print("one thread for all: {} {:.1f} us\n", name, spread_before);
        metrics.push_back({fmt::format("link_stamp_delay_{}", name), spread, "us", goal_us});
        metrics.push_back({fmt::format("link_stamp_delay_{}_to_one_thread", name),
                           spread / spread_before, "ratio", goal_ratio});
    }
    return metrics;
}

}  // namespace versavis::bench

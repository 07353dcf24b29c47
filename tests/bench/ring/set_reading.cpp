// SPDX-License-Identifier: BSD-3-Clause
#include "set_reading.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <stdexcept>
#include <thread>

#include "child.hpp"
#include "engine/ring/writer.hpp"
#include "transport.hpp"
#include "versavis/set_reader.hpp"
#include "versavis/wait_set.hpp"

namespace versavis::bench {

namespace {

constexpr unsigned samples = 1600;            // at 800 Hz
constexpr unsigned samples_for_a_frame = 40;  // 20 frames per second
constexpr Duration sample_period = microseconds(1250);

struct Course {
    std::atomic<bool> ready{false};
    std::atomic<bool> done{false};
    double cpu_ns = 0;
    unsigned frames = 0;
    unsigned imu_samples = 0;
};

/// Removed with its owner.
struct Instance {
    std::string name = fmt::format("bench-{}", ::getpid());
    std::filesystem::path directory = instance_directory(name);

    Instance() { std::filesystem::create_directories(directory); }
    Instance(const Instance&) = delete;
    Instance& operator=(const Instance&) = delete;
    ~Instance() {
        std::error_code ignored;
        std::filesystem::remove_all(directory, ignored);
    }
};

template <class T>
T checked(Expected<T> made) {
    if (!made) throw std::runtime_error(made.error().message());
    return std::move(*made);
}

void publish_all(const Instance& instance, Course& course,
                 const std::function<void(const Instance&, Course&)>& consumer) {
    const auto make = [&](const ring::Shape& shape) {
        return checked(ring::Writer::create(instance.directory, shape));
    };
    using Kind = ring::StreamKind;
    ring::Writer cameras[]{make({"left", Kind::frames, 64, frame_slots, frame_size}),
                           make({"right", Kind::frames, 64, frame_slots, frame_size})};
    ring::Writer imu = make({"imu", Kind::imu, 4096});
    Child child([&] { consumer(instance, course); });
    while (!course.ready) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    auto due = std::chrono::steady_clock::now();
    for (unsigned i = 0; i < samples; ++i) {
        due += std::chrono::nanoseconds(sample_period.ns);
        std::this_thread::sleep_until(due);
        const OutputTime time{host_now().ns};
        if (i % samples_for_a_frame == samples_for_a_frame / 2) {
            FrameMetadata frame{};
            frame.trigger = 1 + i / samples_for_a_frame;
            frame.set_tick(frame.trigger);
            for (ring::Writer& camera : cameras)
                camera.publish(camera.acquire().value(), frame_size, time, pack(frame));
        }
        ImuMetadata sample{};
        sample.number = i;
        imu.publish(time, pack(sample));
        for (ring::Writer* writer : {&imu, &cameras[0], &cameras[1]}) writer->heartbeat(host_now());
    }
    course.done = true;
    child.finish(seconds(10));
    constexpr unsigned frames = 2 * samples / samples_for_a_frame;
    if (course.frames < frames - 4 || course.imu_samples < samples - 2 * samples_for_a_frame)
        throw std::runtime_error(fmt::format("a consumer of sets has {} frames and {} samples",
                                             course.frames, course.imu_samples));
}

void consume_bare(const Instance& instance, Course& course) {
    std::vector<ring::Reader> readers;
    for (const char* name : {"left", "right", "imu"})
        readers.push_back(checked(ring::Reader::open(instance.directory / name)));
    WaitSet waiting;
    for (ring::Reader& reader : readers)
        if (const auto added = waiting.add(reader); !added)
            throw std::runtime_error(added.error().message());
    course.ready = true;
    const Usage before = Usage::now();
    while (!course.done) {
        const auto found = waiting.wait(milliseconds(20));
        if (!found) continue;
        while (readers[*found].next()) ++(*found == 2 ? course.imu_samples : course.frames);
    }
    course.cpu_ns = (Usage::now() - before).cpu_ns;
}

void consume_sets(const Instance& instance, Course& course) {
    SetOptions options;
    options.instance = instance.name;
    options.imu = "imu";
    auto reader = checked(SetReader::open({"left", "right"}, options));
    course.ready = true;
    const Usage before = Usage::now();
    while (!course.done) {
        const auto set = reader.next(milliseconds(20));
        if (!set) continue;
        course.frames += static_cast<unsigned>(set->frames.size());
        course.imu_samples += static_cast<unsigned>(set->imu.samples.size());
    }
    course.cpu_ns = (Usage::now() - before).cpu_ns;
}

}  // namespace

void read_sets(SetReading& cost) {
    const Instance instance;
    const auto bare = make_shared_between_processes<Course>();
    publish_all(instance, *bare, consume_bare);
    cost.bare_cpu_ns += bare->cpu_ns;
    const auto sets = make_shared_between_processes<Course>();
    publish_all(instance, *sets, consume_sets);
    cost.set_cpu_ns += sets->cpu_ns;
}

}  // namespace versavis::bench

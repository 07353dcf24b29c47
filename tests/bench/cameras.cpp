// SPDX-License-Identifier: BSD-3-Clause
#include <arv.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "../support/look.hpp"
#include "../support/stack.hpp"
#include "cpu_time.hpp"
#include "judge.hpp"
#include "metric.hpp"
#include "scene.hpp"
#include "true_times.hpp"
#include "versavis/stream.hpp"

namespace versavis::bench {

namespace {

constexpr Duration latency_time = seconds(10);

using Arrivals = TimesBySerial;

/// Frames in the callback of Aravis's stream thread, and in a thread that waits for it.
struct Bare {
    ArvStream* stream = nullptr;
    Arrivals in_callback;
    Arrivals by_waiter;
    std::mutex mutex;
    std::condition_variable wake;
    std::deque<std::uint64_t> ready;
    bool done = false;

    void wait() {
        std::unique_lock lock(mutex);
        for (;;) {
            wake.wait(lock, [this] { return done || !ready.empty(); });
            if (ready.empty()) return;
            by_waiter[ready.front()] = host_now();
            ready.pop_front();
        }
    }
};

void on_frame(void* user, ArvStreamCallbackType type, ArvBuffer* /*buffer*/) {
    if (type != ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) return;
    const HostTime now = host_now();
    auto& bare = *static_cast<Bare*>(user);
    ArvBuffer* buffer = arv_stream_try_pop_buffer(bare.stream);
    if (buffer == nullptr) return;
    if (arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS) {
        std::size_t size = 0;
        const void* pixels = arv_buffer_get_data(buffer, &size);
        const std::uint64_t serial = rig::FrameMark::serial_in(pixels, size);
        bare.in_callback[serial] = now;
        const std::lock_guard lock(bare.mutex);
        bare.ready.push_back(serial);
        bare.wake.notify_one();
    }
    arv_stream_push_buffer(bare.stream, buffer);
}

/// Frames of a camera that runs freely.
void receive_bare(const std::string& address, Bare& bare) {
    ArvCamera* camera = arv_camera_new(address.c_str(), nullptr);
    if (camera == nullptr) throw std::runtime_error("no camera at " + address);
    arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    arv_camera_gv_set_packet_size(camera, 9000, nullptr);
    bare.stream = arv_camera_create_stream(camera, on_frame, &bare, nullptr);
    g_object_set(bare.stream, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
                 "socket-buffer-size", 32 << 20, nullptr);
    for (int i = 0; i < 6; ++i)
        arv_stream_push_buffer(bare.stream,
                               arv_buffer_new_allocate(arv_camera_get_payload(camera, nullptr)));
    std::thread waiter([&bare] { bare.wait(); });
    arv_camera_start_acquisition(camera, nullptr);
    const timespec time{latency_time.ns / 1'000'000'000, 0};
    nanosleep(&time, nullptr);
    arv_camera_stop_acquisition(camera, nullptr);
    g_object_unref(bare.stream);
    g_object_unref(camera);
    {
        const std::lock_guard lock(bare.mutex);
        bare.done = true;
    }
    bare.wake.notify_one();
    waiter.join();
}

/// Frames of the service, when a reader that waits for them has them.
Arrivals by_reader(test::Stack& stack) {
    Arrivals arrivals;
    auto stream = test::wait_for_stream<FrameStream>("cam0", stack.instance());
    const HostTime end = host_now() + latency_time;
    while (host_now() < end) {
        const auto item = test::look(stream.next(seconds(1)));
        if (item.found == test::Found::item)
            arrivals[rig::FrameMark::serial_in(item.payload.data(), item.payload.size())] =
                host_now();
    }
    return arrivals;
}

double median_us(const Arrivals& arrivals, const Arrivals& departures) {
    std::vector<double> latencies;
    for (const auto& [serial, at] : arrivals)
        if (const auto left = departures.find(serial); left != departures.end())
            latencies.push_back(static_cast<double>((at - left->second).ns) * 1e-3);
    if (latencies.size() < 50) throw std::runtime_error("too few frames for a latency");
    std::nth_element(latencies.begin(),
                     latencies.begin() + static_cast<std::ptrdiff_t>(latencies.size() / 2),
                     latencies.end());
    return latencies[latencies.size() / 2];
}

std::vector<Metric> latency() {
    test::Stack stack({"benchlat", 41, 1, 20, "", "", "", 1920, 1200});
    stack.start_rig();
    Bare bare;
    receive_bare(stack.scenario().cameras[0].address, bare);
    stack.start_service();
    stack.wait_for_status(test::healthy);
    const Arrivals read = by_reader(stack);
    const Arrivals left = true_times(stack.truth_path(), "cam0", "departure", "at_ns");
    const double callback_us = median_us(bare.in_callback, left);
    const double waiter_us = median_us(bare.by_waiter, left);
    const double read_us = median_us(read, left);
    // A callback has not woken anybody yet: the goal is against a thread that waits, as a reader
    // does.
    return {{"frame_latency_p50", read_us, "us", 1000},
            {"frame_latency_to_bare_callback", read_us / callback_us, "ratio", 10},
            {"frame_latency_to_thread_woken_by_it", read_us / waiter_us, "ratio", 1.5}};
}

std::vector<Metric> three_cameras(double seconds) {
    test::StackSettings settings{"benchcam", 42, 3, 20, "", "", "", 1920, 1200};
    settings.imu_extra = "rate_hz = 800\n";
    test::Stack stack(settings);
    stack.start_rig();
    const double aravis = aravis_cpu_per_gb(stack, std::min(seconds, 20.0));
    stack.start_service();
    stack.wait_for_status(test::healthy);
    const double before = cpu_seconds(stack.service().pid());
    const HostTime begin = host_now();
    const auto verdict = rig::judge(stack.scenario(), stack.judging(seconds));
    if (!verdict) throw std::runtime_error(verdict.error().message());
    const double elapsed = static_cast<double>((host_now() - begin).ns) * 1e-9;
    const double cpu = cpu_seconds(stack.service().pid()) - before;
    double wrong = 0;
    double lost = 0;
    double rate = 0;
    for (const auto& [name, stream] : verdict->streams) {
        wrong += static_cast<double>(stream.wrong_pairs);
        lost += static_cast<double>(stream.lost);
        if (name != stack.scenario().imu) rate += stream.rate_hz;
    }
    return {{"three_cameras_wrong", wrong, "items", 0},
            {"three_cameras_lost", lost, "items", 0},
            {"three_cameras_cpu_to_arv_camera_test", cpu / (rate * elapsed * frame_gb) / aravis,
             "ratio", 1.1}};
}

}  // namespace

std::vector<Metric> bench_cameras(double seconds) {
    std::vector<Metric> metrics = latency();
    for (Metric& metric : three_cameras(seconds)) metrics.push_back(std::move(metric));
    return metrics;
}

}  // namespace versavis::bench

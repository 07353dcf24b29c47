// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <thread>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "metric.hpp"
#include "versavis/metadata.hpp"
#include "versavis/ring/reader.hpp"

namespace versavis::bench {

namespace {

double median(std::vector<double> values) {
    std::nth_element(values.begin(),
                     values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

ring::Writer make_ring(const std::filesystem::path& directory, const ring::Shape& shape) {
    auto writer = ring::Writer::create(directory, shape);
    if (!writer) throw std::runtime_error(writer.error().message());
    return std::move(*writer);
}

/// From the writer's call to the moment when a polling reader on the other core has the item.
double publish_to_poll_ns() {
    const test::TemporaryDirectory directory("/dev/shm");
    ring::Writer writer = make_ring(directory.path(), {"imu", ring::StreamKind::imu, 4096});
    auto reader = ring::Reader::open(directory.path() / "imu");
    constexpr std::size_t samples = 20000;
    std::atomic<bool> ready{false};
    std::vector<double> delays;
    std::thread reading([&] {
        ready = true;
        while (delays.size() < samples) {
            const ring::Item item = reader->next();
            if (item.found == ring::Found::item)
                delays.push_back(static_cast<double>(host_now().ns -
                                                     static_cast<std::int64_t>(item.metadata[0])));
        }
    });
    while (!ready) std::this_thread::yield();
    for (std::size_t i = 0; i < samples; ++i) {
        const HostTime due = host_now() + microseconds(20);
        while (host_now() < due) {
        }
        writer.publish({}, {static_cast<std::uint64_t>(host_now().ns)});
    }
    reading.join();
    return median(delays);
}

/// What it takes to acquire and publish one frame that somebody else has filled.
double frame_publication_ns(std::uint64_t size) {
    const test::TemporaryDirectory directory("/dev/shm");
    ring::Writer writer =
        make_ring(directory.path(), {"frames", ring::StreamKind::frames, 64, 8, size});
    std::vector<double> costs;
    for (int i = 0; i < 20000; ++i) {
        const HostTime begin = host_now();
        const auto slot = writer.acquire();
        writer.publish(*slot, static_cast<std::uint32_t>(size), {}, {});
        costs.push_back(static_cast<double>((host_now() - begin).ns));
    }
    return median(costs);
}

}  // namespace

std::vector<Metric> bench_ring() {
    const double small = frame_publication_ns(4096);
    const double large = frame_publication_ns(16 << 20);
    return {{"imu_publish_to_polling_reader_p50", publish_to_poll_ns(), "ns", 1000},
            {"frame_publication_16MiB_to_4KiB", large / small, "ratio", 1.2}};
}

}  // namespace versavis::bench

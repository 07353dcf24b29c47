// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <atomic>
#include <cstring>
#include <map>
#include <stdexcept>

#include "../../support/temporary_directory.hpp"
#include "../metric.hpp"
#include "client/futex.hpp"
#include "engine/ring/writer.hpp"
#include "race.hpp"
#include "set_reading.hpp"
#include "versavis/ring_reader.hpp"

namespace versavis::bench {

namespace {

constexpr int rounds = 3;
constexpr unsigned reader_counts[]{1, 4, 16};

using Metrics = std::vector<Metric>;
using Outcomes = std::map<std::string, Outcome>;  ///< by the transport's name

/// All of them in turn, `rounds` times: whatever else the machine does meets all.
Outcomes race_all(const std::vector<Transport>& transports, const Load& load) {
    Outcomes outcomes;
    for (int round = 0; round < rounds; ++round)
        for (const Transport& transport : transports)
            if (load.readers <= transport.most_readers)
                race(transport, load, outcomes[transport.name]);
    return outcomes;
}

double p50(const Outcome& outcome) { return quantile(outcome.delays_ns, 0.5); }
double cpu(const Outcome& outcome) { return outcome.cpu_ns_per_item(); }
double time_per_byte(const Outcome& outcome) { return 1 / outcome.bytes_per_second(); }

/// The figures of all transports, for information.
void report(Metrics& metrics, const std::string& load, const Outcomes& outcomes) {
    for (const auto& [name, outcome] : outcomes) {
        const double p99 = quantile(outcome.delays_ns, 0.99);
        metrics.push_back({fmt::format("{}, {}: p50", load, name), p50(outcome) / 1000, "us", {}});
        metrics.push_back({fmt::format("{}, {}: p99", load, name), p99 / 1000, "us", {}});
    }
}

/// `value` of a ring's outcome against the same of another transport, if that took part.
void compare(Metrics& metrics, const std::string& load, const Outcomes& outcomes,
             const std::string& other, double (*value)(const Outcome&), std::optional<double> goal,
             const std::string& ring = "ring") {
    const auto found = outcomes.find(other);
    if (found == outcomes.end()) return;
    const double ratio = value(outcomes.at(ring)) / value(found->second);
    metrics.push_back({fmt::format("{}, {} to {}", load, ring, other), ratio, "ratio", goal});
}

std::vector<Transport> with(std::vector<Transport> transports,
                            const std::optional<Transport>& more) {
    if (more) transports.push_back(*more);
    return transports;
}

void measure_polling(Metrics& metrics, const std::optional<Transport>& peer) {
    Load load;
    load.polling = true;
    load.items = 8000;
    load.interval = microseconds(20);
    const Outcomes outcomes = race_all(with({versavis_ring(), shared_word()}, peer), load);
    const std::string name = "imu, polling";
    report(metrics, name, outcomes);
    metrics.push_back({"imu_publish_to_polling_reader_p50", p50(outcomes.at("ring")), "ns", 1000});
    compare(metrics, name, outcomes, "shared word", p50, 1.4);
    compare(metrics, name, outcomes, "iceoryx", p50, 0.19);
}

void measure_blocking(Metrics& metrics, const std::optional<Transport>& peer) {
    std::map<unsigned, double> publish_ns;
    for (const unsigned readers : reader_counts) {
        Load load;
        load.readers = readers;
        auto transports = with({versavis_ring(), bare_futex()}, peer);
        if (readers == 1) transports = with(with(transports, boost_queue()), zeromq());
        const Outcomes outcomes = race_all(transports, load);
        publish_ns[readers] = quantile(outcomes.at("ring").publish_ns, 0.5);
        const auto name = fmt::format("imu, {} waiting", readers);
        for (const auto& [transport, outcome] : outcomes)
            metrics.push_back({fmt::format("{}, {}: publication p50", name, transport),
                               quantile(outcome.publish_ns, 0.5) / 1000,
                               "us",
                               {}});
        report(metrics, name, outcomes);
        compare(metrics, name, outcomes, "bare futex", p50, 1.05);
        compare(metrics, name, outcomes, "iceoryx", p50, {});
    }
    metrics.push_back({"publish_16_waiting_to_1", publish_ns[16] / publish_ns[1], "ratio", 4});
}

void measure_crowd(Metrics& metrics) {
    Load load;
    load.readers = 2;
    load.items = 1000;
    const Outcomes outcomes = race_all({crowded_ring()}, load);
    const double p99 = quantile(outcomes.begin()->second.publish_ns, 0.99);
    metrics.push_back({"publish_1000_hostile_waiting_p99", p99 / 1000, "us", 50});
}

void measure_frames(Metrics& metrics, const std::optional<Transport>& peer) {
    for (const unsigned readers : reader_counts) {
        Load load;
        load.size = frame_size;
        load.readers = readers;
        load.items = 60;
        load.interval = milliseconds(10);
        auto transports = with({versavis_ring(), ring_without_history()}, peer);
        if (readers == 1) transports = with(with(transports, boost_queue()), zeromq());
        const Outcomes outcomes = race_all(transports, load);
        const auto name = fmt::format("frame, {} waiting", readers);
        report(metrics, name, outcomes);
        compare(metrics, name, outcomes, "iceoryx", p50, {});
        compare(metrics, name, outcomes, "iceoryx", p50, 0.7, without_history);
    }
}

void measure_cost(Metrics& metrics, const std::optional<Transport>& peer, unsigned readers,
                  double goal) {
    Load load;
    load.size = frame_size;
    load.readers = readers;
    load.items = 1000;
    load.interval = milliseconds(2);
    const Outcomes outcomes =
        race_all(with({versavis_ring(), ring_without_history(), bare_futex()}, peer), load);
    const auto name = fmt::format("frame, CPU, {} waiting", readers);
    for (const auto& [transport, outcome] : outcomes)
        metrics.push_back({fmt::format("{}, {}", name, transport), cpu(outcome) / 1000, "us", {}});
    compare(metrics, name, outcomes, "bare futex", cpu, 1.1);
    compare(metrics, name, outcomes, "iceoryx", cpu, {});
    compare(metrics, name, outcomes, "iceoryx", cpu, goal, without_history);
    if (readers == 1)
        metrics.push_back(
            {"page_faults_in_1000_frames", outcomes.at("ring").page_faults / rounds, "faults", 0});
}

/// Every byte written and read.
void measure_throughput(Metrics& metrics, const std::optional<Transport>& peer) {
    Load load;
    load.size = frame_size;
    load.items = 4000;
    load.interval = {};
    load.reading = Reading::all_bytes;
    const Outcomes outcomes = race_all(with({versavis_ring(), ring_without_history()}, peer), load);
    for (const auto& [transport, outcome] : outcomes)
        metrics.push_back({fmt::format("frames unthrottled, {}", transport),
                           outcome.bytes_per_second() * 1e-9,
                           "GB/s",
                           {}});
    compare(metrics, "frames unthrottled, time per byte", outcomes, "iceoryx", time_per_byte,
            1 / 1.1);
}

/// What it costs that nobody can cut a ring short under its readers.
void measure_sealed(Metrics& metrics) {
    const std::vector<Transport> both{versavis_ring(), sealed_ring()};
    Load load;
    load.readers = 4;
    compare(metrics, "imu, 4 waiting", race_all(both, load), "ring", p50, 1.05, sealed);
    load.size = frame_size;
    load.items = 1000;
    load.interval = milliseconds(2);
    const Outcomes frames = race_all(both, load);
    compare(metrics, "frame, 4 waiting", frames, "ring", p50, 1.05, sealed);
    compare(metrics, "frame, CPU, 4 waiting", frames, "ring", cpu, 1.05, sealed);
    load.readers = 1;
    load.interval = {};
    load.reading = Reading::all_bytes;
    compare(metrics, "frames unthrottled, time per byte", race_all(both, load), "ring",
            time_per_byte, 1.05, sealed);
}

void measure_sets(Metrics& metrics) {
    SetReading cost;
    for (int round = 0; round < rounds; ++round) read_sets(cost);
    metrics.push_back(
        {"set_reader_cpu_to_bare_readers", cost.set_cpu_ns / cost.bare_cpu_ns, "ratio", 1.2});
}

/// Nanoseconds that something takes, in the middle of many times.
template <class Work>
double middle_ns(int times, Work work) {
    std::vector<double> costs;
    for (int i = 0; i < times; ++i) {
        const HostTime begin = host_now();
        work(i);
        costs.push_back(static_cast<double>((host_now() - begin).ns));
    }
    return quantile(std::move(costs), 0.5);
}

/// What a copy of a frame costs that is checked afterwards: the alternative to holding it.
void measure_copy(Metrics& metrics) {
    constexpr unsigned slots = 8;
    const test::TemporaryDirectory directory("/dev/shm");
    auto writer = *ring::Writer::create(
        directory.path(), {"frames", ring::StreamKind::frames, 64, slots, frame_size});
    auto reader = *ring::Reader::open(directory.path() / "frames");
    std::vector<ring::Item> items;
    for (unsigned i = 0; i < slots; ++i) {
        writer.publish(*writer.acquire(), frame_size, {}, {});
        items.push_back(*reader.next());
    }
    std::vector<std::byte> copy(frame_size);
    const auto payload = [&](int i) -> const ring::Payload& {
        return items[static_cast<unsigned>(i) % slots].payload;
    };
    std::vector<double> checked;
    std::vector<double> plain;
    for (int round = 0; round < 16; ++round) {  // in turn: a machine has faster and slower moments
        checked.push_back(
            middle_ns(100, [&](int i) { static_cast<void>(payload(i).copy_to(copy.data())); }));
        plain.push_back(middle_ns(
            100, [&](int i) { std::memcpy(copy.data(), payload(i).data(), frame_size); }));
    }
    const double checked_ns = quantile(std::move(checked), 0.5);
    metrics.push_back({"frame_copy", checked_ns / 1000, "us", {}});
    metrics.push_back(
        {"frame_copy_to_memcpy", checked_ns / quantile(std::move(plain), 0.5), "ratio", 1.02});
}

/// Readers map rings read-only, so a writer cannot know that nobody waits: it asks the kernel.
void measure_nobody(Metrics& metrics) {
    const test::TemporaryDirectory directory("/dev/shm");
    auto writer = *ring::Writer::create(directory.path(), {"imu", ring::StreamKind::imu, 4096});
    const std::atomic<std::uint32_t> nobody{0};
    const double published = middle_ns(20000, [&](int) { writer.publish({}, {}); });
    const double woken = middle_ns(20000, [&](int) { ring::futex_wake(nobody, 1); });
    metrics.push_back({"publish_nobody_waiting_to_futex_wake", published / woken, "ratio", {}});
}

/// What it takes to acquire and publish one frame that somebody else has filled.
double frame_publication_ns(std::uint64_t size) {
    const test::TemporaryDirectory directory("/dev/shm");
    auto writer =
        ring::Writer::create(directory.path(), {"frames", ring::StreamKind::frames, 64, 8, size});
    if (!writer) throw std::runtime_error(writer.error().message());
    return middle_ns(20000, [&](int) {
        const auto slot = writer->acquire();
        writer->publish(*slot, static_cast<std::uint32_t>(size), {}, {});
    });
}

}  // namespace

std::vector<Metric> bench_ring() {
    auto peer = iceoryx();
    const auto roudi = peer ? start_roudi() : nullptr;
    if (!roudi) {
        fmt::print("iceoryx is missing (libiceoryx-posh-dev, iceoryx), or does not start\n");
        peer.reset();
    }
    if (!zeromq()) fmt::print("ZeroMQ is missing (libzmq3-dev, cppzmq-dev)\n");
    Metrics metrics;
    const double small = frame_publication_ns(4096);
    const double large = frame_publication_ns(16 << 20);
    metrics.push_back({"frame_publication_16MiB_to_4KiB", large / small, "ratio", 1.2});
    measure_nobody(metrics);
    measure_copy(metrics);
    measure_polling(metrics, peer);
    measure_blocking(metrics, peer);
    measure_crowd(metrics);
    measure_frames(metrics, peer);
    measure_cost(metrics, peer, 1, 0.6);
    measure_cost(metrics, peer, 4, 0.4);
    measure_throughput(metrics, peer);
    measure_sealed(metrics);
    measure_sets(metrics);
    return metrics;
}

}  // namespace versavis::bench

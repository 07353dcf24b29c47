// SPDX-License-Identifier: BSD-3-Clause
#include "race.hpp"

#include <sched.h>

#include <algorithm>
#include <cstring>
#include <ctime>
#include <numeric>
#include <stdexcept>
#include <thread>

#include "../../support/temporary_directory.hpp"
#include "child.hpp"

namespace versavis::bench {

namespace {

constexpr unsigned warm_up = 50;

/// First bytes of an item.
struct Stamp {
    std::int64_t ns;
    std::uint64_t number;
};

struct Course {
    std::atomic<bool> writer_ready{false};
    std::atomic<unsigned> readers_ready{0};
    std::atomic<bool> done{false};
};

template <class Condition>
void wait_until(Condition condition) {
    while (!condition()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

void sleep_until(HostTime due, bool spin) {
    for (HostTime now = host_now(); now < due; now = host_now())
        if (!spin) std::this_thread::sleep_for(std::chrono::nanoseconds((due - now).ns));
}

/// Pollers need a processor each.
void pin(unsigned number) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(number % std::max(1U, std::thread::hardware_concurrency()), &set);
    ::sched_setaffinity(0, sizeof set, &set);
}

void write(Sender& sender, const Load& load, Course& course, Sheet& sheet) {
    const std::vector<std::byte> image(load.size, std::byte{1});
    sheet.touch();
    Usage before;
    HostTime due = host_now();
    for (unsigned i = 0; i < warm_up + load.items; ++i) {
        if (i == warm_up) before = Usage::now();
        due = due + load.interval;
        if (load.interval > Duration{}) sleep_until(due, load.polling);
        // As from a camera: pixels come right before their publication, not after the one before.
        std::byte* item = sender.loan();
        std::memcpy(item, image.data(), image.size());
        const HostTime begin = host_now();
        const Stamp stamp{begin.ns, i};
        std::memcpy(item, &stamp, sizeof stamp);
        sender.publish();
        if (i >= warm_up) sheet.add(static_cast<double>((host_now() - begin).ns));
    }
    sheet.usage = Usage::now() - before;
    course.done = true;
}

std::uint64_t sum_of(const std::byte* item, std::size_t size, Reading reading) {
    if (reading == Reading::ends) return std::to_integer<std::uint64_t>(item[size - 1]);
    const auto* words = reinterpret_cast<const std::uint64_t*>(item);
    return std::accumulate(words, words + size / sizeof *words, std::uint64_t{0});
}

void read(Receiver& receiver, const Load& load, const Course& course, Sheet& sheet) {
    bool warm = false;
    Usage before;
    for (;;) {
        const bool last = course.done;
        const std::byte* item = receiver.receive();
        if (item == nullptr) {
            if (last) break;
            continue;
        }
        Stamp stamp{};
        std::memcpy(&stamp, item, sizeof stamp);
        sheet.sum += sum_of(item, load.size, load.reading);
        if (!receiver.valid()) continue;
        const HostTime now = host_now();
        sheet.end_ns = static_cast<std::uint64_t>(now.ns);
        if (warm) {
            sheet.add(static_cast<double>(now.ns - stamp.ns));
            ++sheet.items;
        } else if (load.polling ? ++sheet.items > warm_up : stamp.number >= warm_up) {
            warm = true;
            sheet.items = 0;
            sheet.begin_ns = sheet.end_ns;
            before = Usage::now();
        }
    }
    if (warm) sheet.usage = Usage::now() - before;
}

}  // namespace

void race(const Transport& transport, const Load& load, Outcome& outcome) {
    const test::TemporaryDirectory directory("/dev/shm");
    const Channel channel{directory.path(), load.size, load.polling};
    const auto course = make_shared_between_processes<Course>();
    std::vector<std::shared_ptr<Sheet>> sheets;
    for (unsigned i = 0; i <= load.readers; ++i)
        sheets.push_back(make_shared_between_processes<Sheet>());
    std::vector<Child> children;
    children.emplace_back([&] {
        if (load.polling) pin(0);
        const auto sender = transport.sender(channel);
        course->writer_ready = true;
        wait_until([&] { return course->readers_ready == load.readers; });
        write(*sender, load, *course, *sheets[0]);
        wait_until([&] { return course->readers_ready == 0; });
    });
    for (unsigned i = 0; i < load.readers; ++i) {
        children.emplace_back([&, i] {
            if (load.polling) pin(1 + i);
            wait_until([&] { return course->writer_ready.load(); });
            const auto receiver = transport.receiver(channel, i);
            sheets[1 + i]->touch();
            ++course->readers_ready;
            read(*receiver, load, *course, *sheets[1 + i]);
            --course->readers_ready;
        });
    }
    for (Child& child : children) child.finish(seconds(60));

    outcome.sent += load.items;
    for (const auto& sheet : sheets) {
        auto& values = sheet == sheets[0] ? outcome.publish_ns : outcome.delays_ns;
        values.insert(values.end(), sheet->values, sheet->values + sheet->value_count);
        outcome.cpu_ns += sheet->usage.cpu_ns;
        outcome.page_faults += sheet->usage.page_faults;
        outcome.bytes += static_cast<double>(sheet->items * load.size);
    }
    outcome.seconds += static_cast<double>(sheets[1]->end_ns - sheets[1]->begin_ns) * 1e-9;
}

double quantile(std::vector<double> values, double part) {
    if (values.empty()) throw std::runtime_error("a reader received nothing");
    const auto at =
        values.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(values.size() - 1) * part);
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

}  // namespace versavis::bench

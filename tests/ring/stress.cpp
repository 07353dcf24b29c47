// SPDX-License-Identifier: BSD-3-Clause
// Writers at full speed, readers in processes of their own that check each byte, and kills at
// random. VERSAVIS_KILLS says how many; 50 without it.
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <random>
#include <vector>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis/ring_reader.hpp"

using namespace versavis;
using namespace versavis::ring;

namespace {

constexpr std::uint32_t words = 16 * page_size / sizeof(std::uint64_t);
constexpr unsigned readers = 3;
constexpr std::uint32_t frame_slots = 4;

/// What a reader found.
struct Finding {
    std::atomic<std::uint64_t> items;    ///< those that said they were valid after they were read
    std::atomic<std::uint64_t> wrong;    ///< valid, and not what was published
    std::atomic<std::uint64_t> torn;     ///< not what was published, and not valid: well refused
    std::atomic<std::uint64_t> refused;  ///< not valid
    std::atomic<std::uint64_t> lost;
    std::atomic<std::uint64_t> disorder;  ///< numbers that do not follow from those before
    std::atomic<std::uint64_t> restarts;
    std::atomic<std::uint64_t> newest;  ///< what the newest item said that it is
    std::atomic<bool> ready;
};

/// In memory that all processes share.
struct Course {
    std::atomic<std::uint64_t> published;
    std::atomic<bool> done;
    Finding findings[readers];
};

class Shared {
 public:
    Shared()
        : course_(static_cast<Course*>(::mmap(nullptr, sizeof(Course), PROT_READ | PROT_WRITE,
                                              MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {
        REQUIRE(course_ != MAP_FAILED);
    }
    Shared(const Shared&) = delete;
    Shared& operator=(const Shared&) = delete;
    ~Shared() { ::munmap(course_, sizeof(Course)); }
    Course* operator->() const { return course_; }

 private:
    Course* course_;
};

pid_t start(const std::function<void()>& body) {
    const pid_t process = ::fork();
    if (process != 0) return process;
    body();
    ::_exit(0);
}

void end(pid_t process, int signal = 0) {
    if (signal != 0) ::kill(process, signal);
    ::waitpid(process, nullptr, 0);
}

/// `what` stands in each word, so that a payload of two items shows.
void publish(Writer& writer, std::uint64_t what) {
    const std::uint32_t slot = writer.acquire().value();
    auto* word = reinterpret_cast<std::uint64_t*>(writer.slot_data(slot));
    for (std::uint32_t i = 0; i < words; ++i) word[i] = what + i;
    writer.publish(slot, words * sizeof *word, OutputTime{static_cast<std::int64_t>(what)},
                   {what, what});
}

/// `halfway` is called when half of the payload is read.
bool as_published(const Item& item, const std::function<void()>& halfway) {
    const std::uint64_t what = item.metadata[0];
    const auto* word = reinterpret_cast<const std::uint64_t*>(item.payload.data());
    bool same = item.metadata[1] == what && item.time.ns == static_cast<std::int64_t>(what);
    for (std::uint32_t i = 0; i < words; ++i) {
        if (i == words / 2) halfway();
        same = same && *const_cast<const volatile std::uint64_t*>(word + i) == what + i;
    }
    return same;
}

void check(const Item& item, Finding& finding, const std::function<void()>& halfway) {
    const bool same = as_published(item, halfway);
    if (!item.valid()) {
        ++finding.refused;
        if (!same) ++finding.torn;
        return;
    }
    ++finding.items;
    if (!same) ++finding.wrong;
    finding.newest = item.metadata[0];
}

void read_all(Reader& reader, const Shared& course, Finding& finding) {
    std::uint64_t next = reader.head();
    finding.ready = true;
    // Now and then one dawdles, until its slot is in use again: it must find a torn payload.
    unsigned turn = 0;
    const auto dawdle = [&] {
        const std::uint64_t from = reader.head();
        if (turn++ % 64 != 0) return;
        while (reader.head() - from < 2 * frame_slots && !course->done) ::sched_yield();
    };
    for (;;) {
        const bool last = course->done;
        const auto item = reader.next(milliseconds(5));
        if (item) {
            if (item->number != next) ++finding.disorder;
            next = item->number + 1;
            check(*item, finding, dawdle);
        } else if (item.error().why == Pause::lost) {
            finding.lost += item.error().lost;
            next += item.error().lost;
        } else if (item.error().why == Pause::restarted) {
            ++finding.restarts;
            next = 0;
        } else if (last) {
            return;
        }
    }
}

struct Stress {
    test::TemporaryDirectory directory{"/dev/shm"};
    Shared course;
    std::vector<pid_t> processes;

    Writer writer(std::uint64_t first = 0) {
        return *Writer::create(directory.path(), {"frames", StreamKind::frames, 8, frame_slots,
                                                  words * sizeof(std::uint64_t), first});
    }
    void start_readers() {
        for (Finding& finding : course->findings)
            processes.push_back(start([this, &finding] {
                auto reader = Reader::open(directory.path() / "frames");
                if (reader) read_all(*reader, course, finding);
            }));
        for (const Finding& finding : course->findings)
            while (!finding.ready) ::sched_yield();
    }
    void end_readers() {
        course->done = true;
        for (const pid_t process : processes) end(process);
    }
    /// A reader found an item in the middle of being overwritten: so the check has teeth.
    bool tore() const {
        return std::any_of(std::begin(course->findings), std::end(course->findings),
                           [](const Finding& finding) { return finding.torn > 0; });
    }
    /// What no reader may ever find.
    void judge() const {
        for (const Finding& finding : course->findings) {
            CHECK(finding.items > 0);
            CHECK(finding.wrong == 0);
            CHECK(finding.disorder == 0);
        }
    }
};

unsigned kills_asked_for() {
    const char* asked = std::getenv("VERSAVIS_KILLS");
    return asked == nullptr ? 50U : static_cast<unsigned>(std::strtoul(asked, nullptr, 10));
}

}  // namespace

TEST_CASE("stress: each item is read whole or refused, where numbers wrap, too") {
    constexpr std::uint64_t items = 10000;
    const std::uint64_t first = GENERATE(std::uint64_t{0}, (std::uint64_t{1} << 32U) - items / 2,
                                         (std::uint64_t{1} << 63U) - items / 2);
    INFO("first item " << first);
    Stress stress;
    Writer writer = stress.writer(first);
    stress.start_readers();
    for (std::uint64_t i = 0; i < items; ++i) publish(writer, i << 32U);
    stress.end_readers();
    CHECK(stress.tore());
    stress.judge();
    for (const Finding& finding : stress.course->findings)
        CHECK(finding.items + finding.refused + finding.lost == items);
}

TEST_CASE("stress: writers are killed at random, readers follow to the last") {
    const unsigned kills = kills_asked_for();
    constexpr unsigned seed = 7;
    std::mt19937 random(seed);
    Stress stress;
    static_cast<void>(stress.writer());  // for readers to open; it ends at once
    Writer first = stress.writer();
    stress.start_readers();
    std::uint64_t life = 1;
    for (; life <= kills; ++life) {
        stress.course->published = 0;
        const pid_t process = start([&] {
            Writer writer = stress.writer();
            for (std::uint64_t i = 0;; ++i) {
                publish(writer, life << 40U | i << 20U);
                ++stress.course->published;
            }
        });
        // Some die while they make their ring, some after hundreds of items.
        const unsigned when = random() % 500;
        if (life % 4 == 0)
            for (unsigned i = 0; i < when; ++i) ::sched_yield();
        else
            while (stress.course->published < when) ::sched_yield();
        end(process, SIGKILL);
    }
    {
        Writer last = stress.writer();
        publish(last, life << 40U);
        stress.end_readers();
    }
    stress.judge();
    for (const Finding& finding : stress.course->findings) {
        CHECK(finding.newest == life << 40U);
        CHECK(finding.restarts > 0);
    }
}

// SPDX-License-Identifier: BSD-3-Clause
#include "base/thread_watch.hpp"

#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <string>
#include <thread>

#include "../support/threads.hpp"

using namespace versavis;
using daemon::ThreadWatch;

namespace {

/// A thread that is watched, and runs only when it is asked to.
class Sleeper {
 public:
    Sleeper(ThreadWatch& watch, const std::string& name)
        : thread_([this, &watch, name] {
              const auto watched = watch.watch(name, seconds(3));
              id_ = ::gettid();
              id_.notify_one();
              for (int asked = 0; asked != ends; asked = asked_) {
                  turns_ = asked;
                  turns_.notify_one();
                  asked_.wait(asked);
              }
          }) {
        id_.wait(0);
        rest();
    }
    ~Sleeper() {
        ask(ends);
        thread_.join();
    }
    void run() {
        const int before = turns_;
        ask(before + 1);
        turns_.wait(before);
        rest();
    }

 private:
    static constexpr int ends = -1;

    void ask(int what) {
        asked_ = what;
        asked_.notify_one();
    }
    void rest() { test::Rest(std::to_string(id_)).wait(); }

    std::atomic<int> id_{0};
    std::atomic<int> asked_{0};
    std::atomic<int> turns_{0};
    std::thread thread_;
};

/// What is found when it is looked for so long, several times a second.
std::optional<std::string> look(ThreadWatch& watch, HostTime& now, Duration length) {
    std::optional<std::string> found;
    for (const HostTime end = now + length; now < end; now = now + milliseconds(250))
        found = watch.stuck(now);
    return found;
}

}  // namespace

TEST_CASE("thread_watch: a thread that does not run is stuck, until it runs or ends") {
    ThreadWatch watch;
    HostTime now = HostTime{} + seconds(1000);
    {
        Sleeper first(watch, "first");
        CHECK_FALSE(look(watch, now, seconds(3)));
        CHECK(look(watch, now, seconds(2)) == "first");
        first.run();
        CHECK_FALSE(look(watch, now, seconds(2)));
        Sleeper second(watch, "second");
        CHECK_FALSE(look(watch, now, seconds(1)));
        first.run();
        CHECK(look(watch, now, seconds(3)) == "second");
    }
    CHECK_FALSE(look(watch, now, seconds(10)));
}

TEST_CASE("thread_watch: where this process was stopped, no thread is taken for stuck") {
    ThreadWatch watch;
    HostTime now = HostTime{} + seconds(1000);
    const Sleeper sleeper(watch, "sleeper");
    CHECK_FALSE(look(watch, now, seconds(2)));
    now = now + seconds(60);
    CHECK_FALSE(look(watch, now, seconds(3)));
    CHECK(look(watch, now, seconds(2)) == "sleeper");
}

// SPDX-License-Identifier: BSD-3-Clause
#include "client/watch.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <system_error>

#include "client/futex.hpp"
#include "client/quiet_thread.hpp"

namespace versavis::ring {

namespace {

bool stirred(const WatchTarget& target, Pulse& pulse) {
    // SYNC 5: acquire, as in Reader::next().
    if (target.mapping->header().wake.load(std::memory_order_acquire) != target.seen) return true;
    return target.gone ? has_successor(target.path, target.mapping->name(), target.refused)
                       : !writer_lives(*target.mapping, pulse);
}

}  // namespace

bool has_successor(const std::filesystem::path& path, FileId known, FileId refused) {
    const FileId now = file_id(path);
    return now != FileId{} && now != known && now != refused;
}

Expected<std::unique_ptr<Watch>> Watch::start() {
    File event(::eventfd(1, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!event)
        return failure("a descriptor to wait on",
                       std::error_code(errno, std::generic_category()).message());
    auto watch = std::unique_ptr<Watch>(new Watch(std::move(event)));
    try {
        watch->thread_ = quiet_thread([self = watch.get()] { self->run(); });
    } catch (const std::system_error& error) {
        return failure("a thread to wait in", error.what());
    }
    return watch;
}

Watch::~Watch() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
        version_.fetch_add(1);
    }
    armed_.notify_one();
    futex_wake(version_, INT_MAX);
    if (thread_.joinable()) thread_.join();
}

void Watch::calm() {
    eventfd_t count = 0;
    ::eventfd_read(event_.descriptor(), &count);
}

void Watch::signal() { ::eventfd_write(event_.descriptor(), 1); }

void Watch::arm(std::vector<WatchTarget> targets, std::optional<HostTime> deadline) {
    {
        const std::lock_guard lock(mutex_);
        targets_ = std::move(targets);
        deadline_ = deadline;
        idle_ = false;
        version_.fetch_add(1);
    }
    armed_.notify_one();
    futex_wake(version_, INT_MAX);
}

bool Watch::outdated(std::uint32_t version) const { return version_.load() != version; }

void Watch::run() {
    std::unique_lock lock(mutex_);
    for (;;) {
        armed_.wait(lock, [this] { return stop_ || !idle_; });
        if (stop_) return;
        const auto targets = targets_;
        const auto deadline = deadline_;
        const std::uint32_t version = version_.load();
        lock.unlock();
        keep(version, targets, deadline);
        lock.lock();
        if (outdated(version)) continue;
        idle_ = true;
        signal();
    }
}

/// Returns when something happened, or the watch was armed anew.
void Watch::keep(std::uint32_t version, const std::vector<WatchTarget>& targets,
                 std::optional<HostTime> deadline) {
    std::vector<Pulse> pulses;
    std::vector<FutexWord> words{{&version_, version}};
    for (const WatchTarget& target : targets) {
        pulses.push_back(target.pulse);
        words.push_back({&target.mapping->header().wake, target.seen});
    }
    while (!outdated(version)) {
        for (std::size_t i = 0; i < targets.size(); ++i)
            if (stirred(targets[i], pulses[i])) return;
        std::int64_t sleep_ns = longest_sleep_ns;
        if (deadline) sleep_ns = std::min(sleep_ns, (*deadline - host_now()).ns);
        if (sleep_ns <= 0) return;
        futex_wait_any(words.data(), words.size(), sleep_ns);
    }
}

}  // namespace versavis::ring

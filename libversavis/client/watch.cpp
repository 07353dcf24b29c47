// SPDX-License-Identifier: BSD-3-Clause
#include "client/watch.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdint>
#include <system_error>
#include <utility>

#include "client/deadline.hpp"
#include "client/futex.hpp"
#include "posix/thread.hpp"

namespace versavis::ring {

namespace {

bool stirred(WatchTarget& target) {
    // SYNC 5: acquire, as in Reader::next().
    if (target.mapping->header().wake.load(std::memory_order_acquire) != target.seen) return true;
    return target.gone ? has_successor(target.path, target.mapping->name(), target.refused)
                       : !writer_lives(*target.mapping, target.pulse);
}

}  // namespace

bool has_successor(const std::filesystem::path& path, FileId known, FileId refused) {
    const FileId now = file_id(path);
    return now != FileId{} && now != known && now != refused;
}

Expected<std::unique_ptr<Watch>> Watch::start() {
    FileDescriptor event(::eventfd(1, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!event)
        return failure(ErrorCode::exhausted, "a descriptor to wait on",
                       std::error_code(errno, std::generic_category()).message());
    auto watch = std::unique_ptr<Watch>(new Watch(std::move(event)));
    try {
        watch->thread_ = start_thread("watch", [self = watch.get()] { self->run(); });
    } catch (const std::system_error& error) {
        return failure(ErrorCode::exhausted, "a thread to wait in", error.what());
    }
    return watch;
}

Watch::~Watch() {
    become(std::nullopt, true);
    if (thread_.joinable()) thread_.join();
}

void Watch::calm() {
    eventfd_t count{};
    ::eventfd_read(event_.get(), &count);
}

void Watch::signal() { ::eventfd_write(event_.get(), 1); }

void Watch::arm(std::vector<WatchTarget> targets, std::optional<HostTime> deadline) {
    become(Watched{std::move(targets), deadline}, false);
}

void Watch::become(std::optional<Watched> watched, bool stop) {
    {
        const std::lock_guard lock(mutex_);
        watched_ = std::move(watched);
        stop_ = stop;
        version_.fetch_add(1);
    }
    futex_wake(version_, INT_MAX);
}

bool Watch::outdated(std::uint32_t version) const { return version_.load() != version; }

void Watch::run() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
        const std::uint32_t version = version_.load();
        auto watched = watched_;
        lock.unlock();
        if (watched)
            keep(version, std::move(*watched));
        else
            futex_wait(version_, version, INT64_MAX);
        lock.lock();
        if (!watched || outdated(version)) continue;
        watched_.reset();
        signal();
    }
}

/// Returns when something happened, or the watch was armed again.
void Watch::keep(std::uint32_t version, Watched watched) const {
    std::vector<FutexWord> words{{&version_, version}};
    for (const WatchTarget& target : watched.targets)
        words.push_back({&target.mapping->header().wake, target.seen});
    const HostTime deadline = watched.deadline.value_or(HostTime{INT64_MAX});
    while (!outdated(version)) {
        for (WatchTarget& target : watched.targets)
            if (stirred(target)) return;
        const Duration left = left_until(deadline);
        if (left == Duration{}) return;
        futex_wait_any(words, std::min(left.ns, longest_sleep_ns));
    }
}

}  // namespace versavis::ring

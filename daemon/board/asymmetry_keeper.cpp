// SPDX-License-Identifier: BSD-3-Clause
#include "board/asymmetry_keeper.hpp"

#include "base/log.hpp"

#include "posix/thread.hpp"

namespace versavis::daemon {

AsymmetryKeeper::AsymmetryKeeper(const std::string& directory, clock::Translator& translator)
    : store_(directory),
      translator_(translator),
      writer_(start_thread("writer", [this] { write(); })) {}

AsymmetryKeeper::~AsymmetryKeeper() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    changed_.notify_one();
    writer_.join();
}

void AsymmetryKeeper::use(const std::string& port) {
    {
        const std::lock_guard lock(mutex_);
        if (port == port_) return;
    }
    const auto stored = store_.load(port);
    if (!stored) log(LogLevel::warning, "clock", "{}", stored.error().message());
    const std::lock_guard lock(mutex_);
    translator_.use_asymmetry(stored.value_or(std::nullopt));
    kept_ = translator_.report().asymmetry.offset;
    port_ = port;
}

void AsymmetryKeeper::keep(const clock::ClockReport& clock) {
    const std::lock_guard lock(mutex_);
    if (clock.asymmetry_source != clock::AsymmetrySource::pps || port_.empty() ||
        absolute(clock.asymmetry.offset - kept_) < clock.asymmetry.sigma)
        return;
    kept_ = clock.asymmetry.offset;
    unwritten_.emplace(port_, clock.asymmetry);
    changed_.notify_one();
}

void AsymmetryKeeper::write() {
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return stop_ || unwritten_; });
        if (!unwritten_) return;
        const auto [port, asymmetry] = *std::exchange(unwritten_, std::nullopt);
        lock.unlock();
        const auto saved = store_.save(port, asymmetry);
        if (!saved) log(LogLevel::warning, "clock", "{}", saved.error().message());
        lock.lock();
    }
}

}  // namespace versavis::daemon

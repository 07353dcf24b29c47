// SPDX-License-Identifier: BSD-3-Clause
#include "board/asymmetry_keeper.hpp"

#include "log.hpp"

namespace versavis::daemon {

void AsymmetryKeeper::use(const std::string& port) {
    const std::lock_guard lock(mutex_);
    if (port == port_) return;
    const auto stored = store_.load(port);
    if (!stored) log(LogLevel::warning, "clock", "{}", stored.error().message());
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
    const auto saved = store_.save(port_, clock.asymmetry);
    if (!saved) log(LogLevel::warning, "clock", "{}", saved.error().message());
}

}  // namespace versavis::daemon

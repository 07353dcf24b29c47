// SPDX-License-Identifier: BSD-3-Clause
#include "ptp_follower.hpp"

#include <time.h>

#include <cmath>

namespace versavis::rig {

namespace {

constexpr double swing_period_s = 11;

/// CLOCK_REALTIME when the host's clock shows `at`, which is about now.
std::int64_t utc_ns(HostTime at) {
    timespec utc{};
    const HostTime before = host_now();
    clock_gettime(CLOCK_REALTIME, &utc);
    const HostTime now = middle(before, host_now());
    return utc.tv_sec * 1'000'000'000 + utc.tv_nsec - (now - at).ns;
}

}  // namespace

PtpFollower::PtpFollower(HostTime zero, const PtpScenario& network, const Settings& settings)
    : zero_(zero),
      own_(zero, settings.clock),
      master_(zero,
              {utc_ns(zero) + std::llround(network.ahead_of_utc_s * 1e9), network.skew_ppm, 0}),
      settings_(settings) {}

bool PtpFollower::follows(HostTime at) const { return enabled_ && at >= follows_from_; }

std::int64_t PtpFollower::offset_ns(HostTime at) const {
    const double phase =
        2 * 3.14159265358979 * static_cast<double>((at - zero_).ns) * 1e-9 / swing_period_s;
    return settings_.error_ns +
           std::llround(static_cast<double>(settings_.swing_ns) * std::sin(phase));
}

std::int64_t PtpFollower::shown(HostTime at) const {
    const std::int64_t off = at < other_until_ ? other_off_ns_ : 0;
    const std::int64_t ns = follows(at) ? master_.device_ns(at) + offset_ns(at) + off
                                        : own_.device_ns(at) + alone_ahead_ns_;
    return ns + jumped_ns_;
}

void PtpFollower::enable(bool enabled, HostTime now) {
    const std::lock_guard lock(mutex_);
    if (enabled == enabled_) return;
    enabled_ = enabled;
    alone_ahead_ns_ = 0;
    follows_from_ = now + settings_.lock_time;
    claims_to_be_master_ = false;
}

void PtpFollower::leave(HostTime now, Duration duration) {
    alone_ahead_ns_ = shown(now) - jumped_ns_ - own_.device_ns(now);
    follows_from_ = now + duration;
}

void PtpFollower::lose_master(HostTime now, Duration duration) {
    const std::lock_guard lock(mutex_);
    if (!follows(now)) return;
    leave(now, duration);
    claims_to_be_master_ = false;
}

void PtpFollower::become_master(HostTime now, Duration duration) {
    const std::lock_guard lock(mutex_);
    if (!follows(now)) return;
    leave(now, duration);
    claims_to_be_master_ = true;
}

void PtpFollower::follow_another(HostTime now, Duration off, Duration duration) {
    const std::lock_guard lock(mutex_);
    other_until_ = now + duration;
    other_off_ns_ = off.ns;
}

void PtpFollower::jump(Duration by) {
    const std::lock_guard lock(mutex_);
    jumped_ns_ += by.ns;
}

PtpPort PtpFollower::port(HostTime now) const {
    const std::lock_guard lock(mutex_);
    if (!enabled_) return PtpPort::disabled;
    if (follows(now)) return PtpPort::slave;
    if (claims_to_be_master_) return PtpPort::master;
    return follows_from_ - now < settings_.lock_time / 2 ? PtpPort::uncalibrated
                                                         : PtpPort::listening;
}

std::int64_t PtpFollower::device_ns(HostTime at) const {
    const std::lock_guard lock(mutex_);
    return shown(at);
}

HostTime PtpFollower::host(std::int64_t device) const {
    const std::lock_guard lock(mutex_);
    HostTime guess = host_now();
    for (int i = 0; i < 8; ++i) guess = guess + Duration{device - shown(guess)};
    return guess;
}

}  // namespace versavis::rig

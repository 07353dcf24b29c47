// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/ptp_timescale.hpp"

namespace versavis::clock {

namespace {

/// A clock that agreed so short a time ago is a witness against one that does not. Half: clocks
/// that are read once a second are none. Twice: a step of PTP's time is followed later.
constexpr Duration witness_memory = seconds(2);

/// Steps of the iteration that inverts the estimate; each leaves a thousandth of the error.
constexpr int inversions = 4;

/// 73 years after PTP's zero: later times are no times, and cannot be computed with.
constexpr std::int64_t latest_ns = std::int64_t{1} << 61;

bool possible(CameraTime ptp) { return ptp.ns > 0 && ptp.ns < latest_ns; }

/// The filter calls the far clock the board's.
BoardTime far(CameraTime ptp) { return {ptp.ns}; }

Exchange exchange_of(const ClockReading& reading) {
    return {reading.before, far(reading.shown), far(reading.shown), reading.after};
}

}  // namespace

std::size_t PtpTimescale::add_clock() {
    agreed_.emplace_back();
    return agreed_.size() - 1;
}

bool PtpTimescale::confirmed_by_another(std::size_t clock, HostTime now) const {
    for (std::size_t other = 0; other < agreed_.size(); ++other)
        if (other != clock && agreed_[other] && now - *agreed_[other] < witness_memory) return true;
    return false;
}

Agreement PtpTimescale::add(std::size_t clock, const ClockReading& reading) {
    if (reading.width().ns <= 0 || !possible(reading.shown)) return Agreement::unknown;
    if (filter_.confirmed()) {
        const HostEstimate estimate = filter_.translate(far(reading.shown));
        const Duration tolerance = rounded(bound_sigmas * static_cast<double>(estimate.sigma.ns));
        const bool differs =
            estimate.time + tolerance < reading.before || estimate.time - tolerance > reading.after;
        if (differs) agreed_[clock].reset();
        if (differs && confirmed_by_another(clock, reading.after)) return Agreement::differs;
        const std::uint64_t restarts = filter_.restarts();
        filter_.add(exchange_of(reading));
        if (filter_.restarts() != restarts) {
            ++steps_;
            leader_.reset();
            for (auto& agreed : agreed_) agreed.reset();
        }
        if (differs || filter_.contradicted()) return Agreement::differs;
        if (reading.width() > widest_reading) return Agreement::unknown;
        agreed_[clock] = reading.after;
        return Agreement::agrees;
    }
    if (leads(clock, reading.after)) filter_.add(exchange_of(reading));
    return Agreement::unknown;
}

/// One clock alone confirms what it began: two that differ would begin anew in turns.
bool PtpTimescale::leads(std::size_t clock, HostTime now) {
    if (!leader_ || now - leader_read_ > witness_memory) leader_ = clock;
    if (leader_ != clock) return false;
    leader_read_ = now;
    return true;
}

void PtpTimescale::forget(std::size_t clock) {
    agreed_[clock].reset();
    if (leader_ == clock) leader_.reset();
}

std::optional<HostEstimate> PtpTimescale::to_host(CameraTime ptp) const {
    if (!filter_.confirmed() || !possible(ptp)) return std::nullopt;
    return filter_.translate(far(ptp));
}

std::optional<CameraTime> PtpTimescale::at(HostTime host) const {
    if (!filter_.confirmed()) return std::nullopt;
    BoardTime shown = filter_.last_contact();
    for (int i = 0; i < inversions; ++i) shown = shown + (host - filter_.translate(shown).time);
    return CameraTime{shown.ns};
}

}  // namespace versavis::clock

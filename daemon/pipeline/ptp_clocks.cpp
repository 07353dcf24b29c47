// SPDX-License-Identifier: BSD-3-Clause
#include "ptp_clocks.hpp"

#include <time.h>

#include <algorithm>

namespace versavis::daemon {

using clock::Agreement;

std::size_t PtpClocks::add(const std::string& name) {
    const std::lock_guard lock(mutex_);
    PtpClockReport report;
    report.name = name;
    clocks_.push_back(std::move(report));
    return timescale_.add_clock();
}

void PtpClocks::note(std::size_t clock, const PtpStatus& status) {
    const std::lock_guard lock(mutex_);
    clocks_[clock].status = status;
    if (status.state.empty()) clocks_[clock].contradicted = false;
    if (status.follows()) return;
    clocks_[clock].agreement = Agreement::unknown;
    timescale_.forget(clock);
}

Agreement PtpClocks::read(std::size_t clock, const clock::ClockReading& reading) {
    bool stepped = false;
    Agreement agreement = Agreement::differs;
    {
        const std::lock_guard lock(mutex_);
        PtpClockReport& report = clocks_[clock];
        ++report.readings;
        report.width = reading.width();
        if (!report.status.follows()) return Agreement::differs;
        const std::uint64_t steps = timescale_.steps();
        agreement = timescale_.add(clock, reading);
        if (agreement != Agreement::unknown) report.agreement = agreement;
        if (agreement == Agreement::differs) ++report.differing;
        stepped = timescale_.steps() != steps;
    }
    if (stepped) translator_.begin_epoch();
    return agreement;
}

std::string PtpClocks::master() const {
    const auto found = std::find_if(clocks_.begin(), clocks_.end(),
                                    [](const auto& clock) { return clock.status.is_master(); });
    return found == clocks_.end() ? "" : found->name;
}

void PtpClocks::contradict(std::size_t clock, bool contradicted) {
    const std::lock_guard lock(mutex_);
    clocks_[clock].contradicted = contradicted;
}

/// Of one that lost PTP, or shows another time, the board's word is about that.
std::string PtpClocks::contradicted() const {
    const auto found = std::find_if(clocks_.begin(), clocks_.end(), [](const auto& clock) {
        return clock.contradicted && clock.status.follows() && clock.agreement == Agreement::agrees;
    });
    return found == clocks_.end() ? "" : found->name;
}

bool PtpClocks::distrusted() const {
    const std::lock_guard lock(mutex_);
    return !contradicted().empty() || !master().empty();
}

std::uint64_t PtpClocks::steps() const {
    const std::lock_guard lock(mutex_);
    return timescale_.steps();
}

bool PtpClocks::ready(std::size_t clock) const {
    const std::lock_guard lock(mutex_);
    return clocks_[clock].status.follows() && clocks_[clock].agreement == Agreement::agrees &&
           master().empty();
}

std::optional<clock::HostEstimate> PtpClocks::to_host(CameraTime ptp) const {
    const std::lock_guard lock(mutex_);
    return timescale_.to_host(ptp);
}

std::optional<CameraTime> PtpClocks::at(HostTime host) const {
    const std::lock_guard lock(mutex_);
    return timescale_.at(host);
}

std::optional<clock::Stamp> PtpClocks::translate(CameraTime ptp) {
    const auto estimate = to_host(ptp);
    if (!estimate) return std::nullopt;
    clock::Stamp stamp = translator_.translate(estimate->time, estimate->sigma);
    stamp.state = estimate->state;
    stamp.second_doubted = false;  // that is of a receiver at the board
    return stamp;
}

PtpReport PtpClocks::report() {
    PtpReport report;
    const HostTime now = host_now();
    timespec utc{};
    clock_gettime(CLOCK_REALTIME, &utc);
    const std::lock_guard lock(mutex_);
    report.clocks = clocks_;
    report.master = master();
    report.contradicted = contradicted();
    report.steps = timescale_.steps();
    const auto ptp = timescale_.at(now);
    if (!ptp) return report;
    const auto estimate = timescale_.to_host(*ptp);
    report.state = estimate->state;
    report.sigma = estimate->sigma;
    report.bound = estimate->bound;
    report.minus_utc = Duration{ptp->ns - (utc.tv_sec * 1'000'000'000 + utc.tv_nsec)};
    return report;
}

}  // namespace versavis::daemon

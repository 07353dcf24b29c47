// SPDX-License-Identifier: BSD-3-Clause
#include "answer_watch.hpp"

#include <algorithm>
#include <cmath>

namespace versavis::daemon {

namespace {

/// Exposures that show which triggers the camera takes.
constexpr std::size_t takes_kept = 9;

/// Frames of which the first half must show the same rate of the clock as the second.
constexpr std::size_t times_kept = 33;

/// A clock that seems faster than this does not count nanoseconds.
constexpr double fastest_rate = 1.5;

/// The same for one that seems slower. Frames that queue make an honest clock seem slow, down to
/// the inverse of the load of their link.
constexpr double slowest_rate = 0.2;

/// How far the two halves may differ.
constexpr double same_rate = 0.05;

/// A line that rises so shortly before the next trigger, and within this part of the period, leads.
constexpr Duration longest_lead = milliseconds(5);
constexpr std::int64_t lead_part = 8;

/// Records in a row that show it.
constexpr int leads_to_believe = 5;

/// Ids this far behind the one before began anew; less far, the frames changed places.
constexpr std::uint64_t ids_back = 16;

}  // namespace

void AnswerWatch::recorded(const wire::Exposure& record) {
    constexpr auto of_no_own_line = wire::exposure_predicted | wire::exposure_from_master;
    if ((record.flags & of_no_own_line) != 0) return;
    if (record.start_ns == wire::no_time) {
        ++report_.ignored;
        return;
    }
    measure_lead(record);
    takes_.push_back({record.trigger, BoardTime{record.trigger_ns}});
    if (takes_.size() > takes_kept) takes_.pop_front();
    measure_takes();
}

/// The board gives the edge to the trigger before, for no other has left yet. Where the next one is
/// far, as in a slow start, it gives it to none.
void AnswerWatch::measure_lead(const wire::Exposure& record) {
    const Duration delay{record.start_ns - record.trigger_ns};
    const Duration lead = period_ - delay;
    const bool leads = lead.ns > 0 && lead < longest_lead && lead * lead_part < period_;
    leads_ = leads ? leads_ + 1 : 0;
    report_.lead = leads_ >= leads_to_believe ? lead : Duration{};
}

void AnswerWatch::measure_takes() {
    report_.every = 1;
    report_.shortest = {};
    if (takes_.size() < takes_kept) return;
    const std::uint64_t every = takes_[1].trigger - takes_[0].trigger;
    bool steady = true;
    report_.shortest = takes_[1].at - takes_[0].at;
    for (std::size_t i = 1; i < takes_.size(); ++i) {
        steady = steady && takes_[i].trigger - takes_[i - 1].trigger == every;
        report_.shortest = std::min(report_.shortest, takes_[i].at - takes_[i - 1].at);
    }
    if (steady) report_.every = every;
}

void AnswerWatch::arrived(const pairing::Arrival& arrival) {
    if (!times_.empty()) {
        if (arrival.block_id == report_.block_id) ++report_.ids_repeated;
        if (arrival.block_id + ids_back < report_.block_id) ++report_.ids_restarted;
        if (arrival.block_id > report_.block_id)
            report_.ids_skipped += arrival.block_id - report_.block_id - 1;
    }
    report_.block_id = arrival.block_id;
    times_.push_back({arrival.camera_time, arrival.arrived});
    if (times_.size() > times_kept) times_.pop_front();
    measure_clock();
}

/// Arrivals say how much time has passed, but for their lateness.
void AnswerWatch::measure_clock() {
    if (times_.size() < times_kept || report_.clock_rate != 1) return;
    const auto rate = [&](std::size_t from, std::size_t to) {
        return static_cast<double>((times_[to].camera - times_[from].camera).ns) /
               static_cast<double>(
                   std::max<std::int64_t>((times_[to].arrived - times_[from].arrived).ns, 1));
    };
    const std::size_t half = times_kept / 2;
    const double first = rate(0, half);
    const double second = rate(half, times_kept - 1);
    if (first <= 0 || second <= 0 || std::abs(first / second - 1) > same_rate) return;
    const double whole = rate(0, times_kept - 1);
    if (whole > fastest_rate || whole < slowest_rate) report_.clock_rate = whole;
}

void AnswerWatch::restart() {
    takes_.clear();
    times_.clear();
    leads_ = 0;
    report_.lead = {};
    report_.every = 1;
    report_.shortest = {};
    report_.clock_rate = 1;
}

}  // namespace versavis::daemon

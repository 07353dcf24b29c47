// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/exposure_log.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace versavis::pairing {

namespace {

// Records that come closer than this, in periods, were held up together: the last late one is late
// by a quarter at least. At half, most ends of a stall are not seen as such; at twice, a step of
// the board's time passes for one.
constexpr double held_up_together = 0.75;

}  // namespace

std::int64_t Record::instant_ns(Instant instant) const {
    switch (instant) {
        case Instant::middle: return middle(exposure.start, end).ns;
        case Instant::end: return end.ns;
        case Instant::arrival: return end_on_host.ns;
        default: return exposure.start.ns;
    }
}

void ExposureLog::add(const Exposure& exposure, bool prompt) {
    ++recorded_;
    if (!exposure.exposed) ++silent_;
    const Duration reported = exposure.end - exposure.start;
    Duration length = reported;
    if (exposure.kind == StampKind::measured_middle) last_length_ = reported;
    // An end that nobody saw is as late as it may be.
    if (exposure.kind == StampKind::predicted_middle && last_length_.ns != 0)
        length = std::min(reported, last_length_);
    records_.push_back({exposure, exposure.start + length,
                        exposure.end_on_host - (reported - length), false, recorded_, silent_,
                        prompt});
    if (prompt && exposure.exposed) explain_late_ones();
    measure();
}

/// Records that the link held up come together with the first that it did not. Those of a board
/// whose time was set back, and forward again, come as far apart as their exposures. Those of a
/// silent line come when the board has waited long enough for a start.
void ExposureLog::explain_late_ones() {
    const Duration together{part_of(period_.ns, held_up_together)};
    HostTime after = records_.back().exposure.recorded;
    for (std::size_t i = records_.size() - 1; i > 0; --i) {
        Record& before = records_[i - 1];
        if (!before.exposure.exposed) continue;
        if (before.prompt || after - before.exposure.recorded >= together) return;
        before.prompt = true;
        after = before.exposure.recorded;
    }
}

Record ExposureLog::pop_front() {
    const Record record = records_.front();
    records_.pop_front();
    measure();
    return record;
}

void ExposureLog::measure() {
    smallest_gap_ = period_;
    longest_ = {};
    for (std::size_t i = 0; i < records_.size(); ++i) {
        const Record& record = records_[i];
        longest_ = std::max(longest_, record.end - record.exposure.start);
        if (i != 0)
            smallest_gap_ =
                std::min(smallest_gap_, record.exposure.start - records_[i - 1].exposure.start);
    }
}

const Record* ExposureLog::find(std::uint64_t trigger) const {
    const auto found = std::find_if(records_.begin(), records_.end(), [&](const Record& record) {
        return record.exposure.trigger == trigger;
    });
    return found == records_.end() ? nullptr : &*found;
}

Record* ExposureLog::find(std::uint64_t trigger) {
    return const_cast<Record*>(std::as_const(*this).find(trigger));
}

/// Exposures are in order of their starts, and of no other instant: a long one may end after the
/// next.
const Record* ExposureLog::near(Instant instant, std::int64_t instant_ns,
                                std::int64_t tolerance_ns) const {
    const auto start_ns = [instant](const Record& record) {
        const Duration length = record.end - record.exposure.start;
        return instant == Instant::arrival ? (record.end_on_host - length).ns
                                           : record.exposure.start.ns;
    };
    const std::int64_t last_start_ns = instant_ns + tolerance_ns;
    auto record =
        std::partition_point(records_.begin(), records_.end(), [&](const Record& candidate) {
            return start_ns(candidate) < instant_ns - tolerance_ns - longest_.ns;
        });
    const Record* nearest = nullptr;
    for (; record != records_.end() && start_ns(*record) <= last_start_ns; ++record) {
        const std::int64_t distance = std::abs(record->instant_ns(instant) - instant_ns);
        if (distance > tolerance_ns) continue;
        tolerance_ns = distance;
        nearest = &*record;
    }
    return nearest;
}

bool ExposureLog::lost_near(Instant instant, std::int64_t instant_ns,
                            std::uint64_t before_first) const {
    std::uint64_t before = before_first;
    for (const Record& record : records_) {
        if (record.instant_ns(instant) > instant_ns)
            return before != 0 && record.exposure.trigger > before + 1;
        before = record.exposure.trigger;
    }
    return false;
}

bool ExposureLog::takes_seen() const {
    return std::none_of(records_.begin(), records_.end(), [](const Record& record) {
        return record.exposure.exposed && record.exposure.kind == StampKind::trigger_edge;
    });
}

}  // namespace versavis::pairing

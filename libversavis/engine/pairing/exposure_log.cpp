// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/exposure_log.hpp"

#include <algorithm>
#include <cstdlib>

namespace versavis::pairing {

bool ExposureLog::add(const Exposure& exposure) {
    if (!records_.empty()) {
        const Exposure& before = records_.back().exposure;
        if (exposure.trigger <= before.trigger || exposure.start <= before.start) return false;
    }
    ++recorded_;
    if (!exposure.exposed) ++silent_;
    records_.push_back({exposure, false, recorded_, silent_});
    return true;
}

Record ExposureLog::pop_front() {
    const Record record = records_.front();
    records_.pop_front();
    return record;
}

Record* ExposureLog::find(std::uint64_t trigger) {
    const auto found = std::find_if(records_.begin(), records_.end(), [&](const Record& record) {
        return record.exposure.trigger == trigger;
    });
    return found == records_.end() ? nullptr : &*found;
}

std::size_t ExposureLog::first_after(Timeline timeline, std::int64_t instant_ns) const {
    const auto later = [&](std::int64_t instant, const Record& record) {
        return instant < record.instant_ns(timeline);
    };
    return static_cast<std::size_t>(
        std::upper_bound(records_.begin(), records_.end(), instant_ns, later) - records_.begin());
}

const Record* ExposureLog::near(Timeline timeline, std::int64_t instant_ns,
                                std::int64_t tolerance_ns) const {
    const std::size_t after = first_after(timeline, instant_ns);
    const Record* nearest = nullptr;
    for (std::size_t i = after == 0 ? 0 : after - 1; i <= after && i < records_.size(); ++i) {
        const std::int64_t distance = std::abs(records_[i].instant_ns(timeline) - instant_ns);
        if (distance > tolerance_ns) continue;
        tolerance_ns = distance;
        nearest = &records_[i];
    }
    return nearest;
}

bool ExposureLog::lost_near(Timeline timeline, std::int64_t instant_ns,
                            std::uint64_t before_first) const {
    const std::size_t after = first_after(timeline, instant_ns);
    if (after == records_.size()) return false;
    const std::uint64_t before = after > 0 ? records_[after - 1].exposure.trigger : before_first;
    return before != 0 && records_[after].exposure.trigger > before + 1;
}

std::int64_t ExposureLog::smallest_gap_ns() const {
    std::int64_t smallest = period_.ns;
    for (std::size_t i = 1; i < records_.size(); ++i)
        smallest =
            std::min(smallest, (records_[i].exposure.start - records_[i - 1].exposure.start).ns);
    return smallest;
}

}  // namespace versavis::pairing

// SPDX-License-Identifier: BSD-3-Clause
#include "verify/imu_judge.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "base/median.hpp"
#include "verify/even_line.hpp"

namespace versavis::client {

namespace {

/// What an IMU's own clock, or the board that asks it, may jitter: so many times what is usual, and
/// so much in any case. A quarter of a period is another sample.
constexpr std::int64_t usual_amounts = 12;
constexpr Duration least_jitter = microseconds(50);

struct Found {
    std::size_t sample;
    Finding finding;
    Duration by;
};

class ImuJudge {
 public:
    ImuJudge(const ImuEvidence& imu, const std::vector<BoardTime>& set_up,
             const ClockWitness& clock)
        : imu_(imu), set_up_(set_up), clock_(clock) {
        std::size_t begin = 0;
        for (std::size_t i = 1; i <= imu.samples.size(); ++i) {
            if (i < imu.samples.size() && goes_on(imu.samples[i - 1], imu.samples[i])) continue;
            judge_stretch(begin, i);
            begin = i;
        }
        std::sort(found_.begin(), found_.end(),
                  [](const Found& a, const Found& b) { return a.sample < b.sample; });
    }

    StreamVerdict finish(StreamOrder order) const;

 private:
    bool goes_on(const StampedSample& last, const StampedSample& next) const {
        const bool anew = std::any_of(set_up_.begin(), set_up_.end(), [&](BoardTime at) {
            return last.board < at && at <= next.board;
        });
        return !anew && last.life == next.life && last.epoch == next.epoch &&
               last.sample < next.sample;
    }
    void judge_stretch(std::size_t begin, std::size_t end);
    void judge_numbers(const std::vector<std::size_t>& which);
    void judge_translation(const std::vector<std::size_t>& which);

    const ImuEvidence& imu_;
    const std::vector<BoardTime>& set_up_;
    const ClockWitness& clock_;
    std::vector<Found> found_;
};

bool judged(const StampedSample& sample) { return (sample.flags & flag_suspect) == 0; }

/// Of samples whose numbers and clocks are continuous.
void ImuJudge::judge_stretch(std::size_t begin, std::size_t end) {
    std::vector<std::size_t> which;
    for (std::size_t i = begin; i < end; ++i)
        if (judged(imu_.samples[i]) && imu_.samples[i].sigma_ns != sigma_unknown)
            which.push_back(i);
    judge_numbers(which);
    // What is out of bounds is wrong by that, and no measure for those beside it.
    std::erase_if(which, [&](std::size_t i) {
        const StampedSample& sample = imu_.samples[i];
        return absolute(clock_.outside_bounds(sample.board - sample.filter_delay, sample.host)) >
               allowed_error(sample.sigma_ns);
    });
    judge_translation(which);
}

void ImuJudge::judge_numbers(const std::vector<std::size_t>& which) {
    std::vector<LinePoint> points;
    std::vector<Duration> periods;
    for (const std::size_t i : which) {
        const StampedSample& sample = imu_.samples[i];
        const LinePoint point{static_cast<std::int64_t>(sample.sample), sample.board.ns};
        if (!points.empty())
            periods.push_back({(point.y - points.back().y) / (point.x - points.back().x)});
        points.push_back(point);
    }
    if (periods.empty()) return;
    const Duration period = median(std::move(periods));
    const auto off = off_line(points);
    const std::int64_t jitter =
        std::min(period.ns / 4, std::max(least_jitter.ns, usual_amounts * usual_amount(off)));
    for (std::size_t i = 0; i < which.size(); ++i)
        if (std::llabs(off[i]) > jitter)
            found_.push_back({which[i], Finding::sample_clock, {off[i]}});
}

void ImuJudge::judge_translation(const std::vector<std::size_t>& which) {
    std::vector<LinePoint> points;
    for (const std::size_t i : which) {
        const StampedSample& sample = imu_.samples[i];
        points.push_back({sample.board.ns, sample.host.ns - sample.board.ns});
    }
    const auto off = off_line(points);
    for (std::size_t i = 0; i < which.size(); ++i) {
        if (std::llabs(off[i]) > allowed_error(imu_.samples[which[i]].sigma_ns).ns)
            found_.push_back({which[i], Finding::uneven, {off[i]}});
    }
}

StreamVerdict ImuJudge::finish(StreamOrder order) const {
    VerdictBuilder verdict(imu_.name, "imu");
    auto found = found_.begin();
    for (std::size_t i = 0; i < imu_.samples.size(); ++i) {
        const StampedSample& sample = imu_.samples[i];
        verdict.begin_item(order.second(sample.host), sample.sigma_ns);
        order.judge(sample, sample.epoch, verdict);
        for (; found != found_.end() && found->sample == i; ++found)
            verdict.add(found->finding, found->by);
        if (!judged(sample)) {
            verdict.withhold();
            continue;
        }
        clock_.judge({sample.board - sample.filter_delay, sample.host, sample.time, sample.sigma_ns,
                      sample.epoch, sample.flags},
                     verdict);
    }
    for (const RecordedGap& gap : imu_.gaps) verdict.add_lost(gap.items);
    verdict.add_damaged(imu_.impossible);
    return verdict.finish();
}

}  // namespace

StreamVerdict judge_imu(const ImuEvidence& imu, const std::vector<BoardTime>& set_up,
                        const ClockWitness& clock, StreamOrder order) {
    return ImuJudge(imu, set_up, clock).finish(order);
}

}  // namespace versavis::client

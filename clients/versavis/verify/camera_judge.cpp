// SPDX-License-Identifier: BSD-3-Clause
#include "verify/camera_judge.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>

#include "base/median.hpp"
#include "base/stamp_source.hpp"
#include "verify/even_line.hpp"
#include "verify/picture_judge.hpp"

namespace versavis::client {

namespace {

/// What the same instant may differ by in two places: same_instant, when delays are subtracted.
constexpr Duration same_instant = microseconds(1);

/// Frame and evidence of an exposure are recorded within this.
constexpr Duration latest_evidence = seconds(1);

/// A camera may state another length than its line shows, always by the same amount. What differs
/// from that by more is another exposure.
constexpr Duration length_tolerance = microseconds(200);
constexpr std::int64_t length_share = 20;  // a twentieth

/// Frames that must contradict a shift of all frames by some triggers to exclude it.
constexpr std::size_t contradicting_frames = 3;

/// Arrivals from the beginning of a run on in which shifts are looked for: the start pattern.
constexpr std::size_t first_arrivals = 300;

/// A shift further than a frame may be late is impossible; this is the usual limit.
constexpr std::int64_t furthest_shift = 20;

struct RunIndex {
    explicit RunIndex(const CameraRun& run);

    const ExposureEvidence* exposure(std::uint64_t trigger) const {
        const auto found = exposures.find(trigger);
        return found == exposures.end() ? nullptr : &of->exposures[found->second];
    }
    const ExposureRecord* record(std::uint64_t trigger) const {
        const auto found = records.find(trigger);
        return found == records.end() ? nullptr : &of->records[found->second];
    }
    /// The distance to the nearest exposure: only neighbours can be confused.
    Duration gap(std::uint64_t trigger) const;

    const CameraRun* of;
    std::unordered_map<std::uint64_t, std::size_t> exposures;
    std::unordered_map<std::uint64_t, std::size_t> records;
};

RunIndex::RunIndex(const CameraRun& run) : of(&run) {
    for (std::size_t i = 0; i < run.exposures.size(); ++i) exposures[run.exposures[i].trigger] = i;
    for (std::size_t i = 0; i < run.records.size(); ++i) records[run.records[i].trigger] = i;
}

Duration RunIndex::gap(std::uint64_t trigger) const {
    Duration least = of->period.ns > 0 ? of->period : seconds(1);
    const ExposureEvidence* here = exposure(trigger);
    for (const std::uint64_t beside : {trigger - 1, trigger + 1}) {
        const ExposureEvidence* other = exposure(beside);
        if (here == nullptr || other == nullptr) continue;
        const Duration apart = absolute(other->start - here->start);
        if (apart.ns > 0) least = std::min(least, apart);
    }
    return least;
}

/// One frame with what was recorded of it.
struct Claim {
    const StampedFrame* frame;
    std::size_t run = 0;
    const ArrivalEvidence* arrival = nullptr;
    bool other_arrival = false;  ///< found by its block id only
    const ExposureEvidence* exposure = nullptr;
    bool cut_off = false;  ///< its evidence may lie before the recording, or after it
    std::vector<std::pair<Finding, Duration>> findings{};

    bool judged() const { return (frame->frame.flags & flag_suspect) == 0; }
    void add(Finding finding, Duration by = {}) { findings.emplace_back(finding, by); }
    void withdraw(Finding finding) {
        std::erase_if(findings, [&](const auto& one) { return one.first == finding; });
    }
};

class CameraJudge {
 public:
    CameraJudge(const CameraEvidence& camera, const ClockWitness& clock)
        : camera_(camera), clock_(clock) {
        for (const CameraRun& run : camera.runs) runs_.emplace_back(run);
        find_arrivals();
        find_cut_off();
        for (Claim& claim : claims_)
            if (claim.judged()) judge_alone(claim);
        for (std::size_t run = 0; run < runs_.size(); ++run) judge_run(run);
        judge_translation();
    }

    StreamVerdict finish(StreamOrder order) const;

 private:
    void find_arrivals();
    void find_cut_off();
    void judge_alone(Claim& claim) const;
    void judge_exposure(Claim& claim) const;
    void judge_run(std::size_t run);
    void judge_steps(const std::vector<Claim*>& claims) const;
    void judge_lengths(const std::vector<Claim*>& claims) const;
    void judge_camera_clock(const std::vector<Claim*>& claims) const;
    bool only_one_shift(std::size_t run, const std::vector<Claim*>& claims) const;
    void judge_translation();
    std::optional<ClockBounds::Interval> on_host(BoardTime board, HostTime about) const;

    const CameraEvidence& camera_;
    const ClockWitness& clock_;
    std::vector<RunIndex> runs_;
    std::vector<Claim> claims_;
};

void CameraJudge::find_arrivals() {
    std::map<std::pair<std::uint64_t, std::int64_t>, std::pair<std::size_t, std::size_t>> known;
    for (std::size_t run = 0; run < camera_.runs.size(); ++run) {
        const auto& arrivals = camera_.runs[run].arrivals;
        for (std::size_t i = 0; i < arrivals.size(); ++i)
            known[{arrivals[i].block_id, arrivals[i].arrived.ns}] = {run, i};
    }
    for (const StampedFrame& each : camera_.frames) {
        Claim& claim = claims_.emplace_back(Claim{&each});
        constexpr Duration apart = seconds(10);
        const HostTime arrived = each.frame.arrival;
        auto found = known.lower_bound({each.frame.block_id, arrived.ns});
        const auto fits = [&](Duration within) {
            return found != known.end() && found->first.first == each.frame.block_id &&
                   absolute(HostTime{found->first.second} - arrived) <= within;
        };
        if (!fits({})) {
            found = known.lower_bound({each.frame.block_id, (arrived - apart).ns});
            if (!fits(apart)) continue;
            claim.other_arrival = true;
        }
        const auto [run, index] = found->second;
        claim.run = run;
        claim.arrival = &camera_.runs[run].arrivals[index];
        claim.exposure = runs_[run].exposure(each.frame.trigger);
    }
}

/// A recording may begin and end between a frame and its evidence, as the parts of a split one do.
void CameraJudge::find_cut_off() {
    const auto mark = [](auto first, auto end) {
        for (auto claim = first; claim != end; ++claim) {
            const bool whole = claim->arrival != nullptr && claim->exposure != nullptr;
            const Duration away = claim->frame->frame.arrival - first->frame->frame.arrival;
            if (whole || absolute(away) > latest_evidence) return;
            claim->cut_off = true;
        }
    };
    mark(claims_.begin(), claims_.end());
    mark(claims_.rbegin(), claims_.rend());
}

std::optional<ClockBounds::Interval> CameraJudge::on_host(BoardTime board, HostTime about) const {
    const ClockBounds* life = clock_.life(board, about);
    return life == nullptr ? std::nullopt : life->at(board);
}

void CameraJudge::judge_alone(Claim& claim) const {
    const FrameMetadata& frame = claim.frame->frame;
    if (frame.stamp_kind() == StampKind::camera_ptp) {
        claim.add(Finding::by_camera);
        return;
    }
    if (camera_.runs.empty()) {
        claim.add(Finding::no_record);
        return;
    }
    if (claim.arrival == nullptr) {
        claim.add(claim.cut_off ? Finding::no_record : Finding::no_arrival);
        return;
    }
    if (claim.other_arrival)
        claim.add(Finding::other_arrival, frame.arrival - claim.arrival->arrived);
    else if (claim.arrival->camera != frame.camera_time)
        claim.add(Finding::other_arrival, frame.camera_time - claim.arrival->camera);
    if (frame.stamp_kind() == StampKind::arrival) {
        claim.add(Finding::no_hardware);
        return;
    }
    if (frame.stamp_kind() != StampKind::measured_middle) claim.add(Finding::no_edges);
    judge_exposure(claim);
}

void CameraJudge::judge_exposure(Claim& claim) const {
    const FrameMetadata& frame = claim.frame->frame;
    if (claim.exposure == nullptr) {
        claim.add(claim.cut_off ? Finding::no_record : Finding::no_exposure);
        return;
    }
    const ExposureEvidence& exposure = *claim.exposure;
    if (frame.stamp_kind() == StampKind::measured_middle) {
        const Duration off = frame.board_time - middle(exposure.start, exposure.end);
        if (absolute(off) > same_instant) claim.add(Finding::other_middle, off);
        const Duration longer = frame.exposure - (exposure.end - exposure.start);
        const bool of_camera = (frame.flags & flag_camera_length) != 0 || frame.exposure.ns == 0;
        if (!of_camera && absolute(longer) > same_instant) claim.add(Finding::other_length, longer);
        const ExposureRecord* record = runs_[claim.run].record(frame.trigger);
        if (record != nullptr && record->measured) {
            const Duration moved = middle(record->start, record->end) - exposure.delay -
                                   middle(exposure.start, exposure.end);
            if (absolute(moved) > same_instant) claim.add(Finding::record_differs, moved);
        }
    }
    const auto end = on_host(exposure.end, claim.arrival->arrived);
    if (end && claim.arrival->arrived < end->earliest)
        claim.add(Finding::too_early, claim.arrival->arrived - end->earliest);
}

void CameraJudge::judge_run(std::size_t run) {
    std::vector<Claim*> claims;
    for (Claim& claim : claims_)
        if (claim.judged() && claim.run == run && claim.arrival != nullptr &&
            claim.exposure != nullptr && stamped_by_board(claim.frame->frame))
            claims.push_back(&claim);
    if (claims.empty()) return;
    judge_steps(claims);
    judge_lengths(claims);
    judge_camera_clock(claims);
    if (only_one_shift(run, claims)) return;
    for (Claim* claim : claims) claim->add(Finding::no_start);
}

/// A camera numbers every trigger, or those that it took. It may also take frames of its own, or
/// begin to count anew: only its clock distinguishes these from frames of other triggers.
void CameraJudge::judge_steps(const std::vector<Claim*>& claims) const {
    for (std::size_t i = 1; i < claims.size(); ++i) {
        const FrameMetadata& last = claims[i - 1]->frame->frame;
        const FrameMetadata& frame = claims[i]->frame->frame;
        const CameraTime before = claims[i - 1]->arrival->camera;
        const CameraTime now = claims[i]->arrival->camera;
        const bool by_clock = before.ns != 0 && now.ns != 0 && before != now;
        const bool more = frame.block_id <= last.block_id ||
                          frame.block_id - last.block_id > frame.trigger - last.trigger;
        if (more && !by_clock) claims[i]->add(Finding::block_step);
    }
}

void CameraJudge::judge_lengths(const std::vector<Claim*>& claims) const {
    const auto longer = [](const Claim* claim) {
        return claim->exposure->end - claim->exposure->start - claim->arrival->exposure;
    };
    const auto states = [](const Claim* claim) {
        return claim->arrival->exposure.ns > 0 &&
               claim->frame->frame.stamp_kind() == StampKind::measured_middle;
    };
    std::vector<Duration> all;
    for (const Claim* claim : claims)
        if (states(claim)) all.push_back(longer(claim));
    if (all.empty()) return;
    const Duration usual = median(std::move(all));
    for (Claim* claim : claims) {
        if (!states(claim)) continue;
        const Duration off = longer(claim) - usual;
        if (absolute(off) > std::max(length_tolerance, claim->arrival->exposure / length_share))
            claim->add(Finding::stated_length, off);
    }
}

BoardTime instant_of(const ExposureEvidence& exposure, int halves) {
    return exposure.start + (exposure.end - exposure.start) * halves / 2;
}

/// Which instant of the exposure the camera stamps, in halves of it: that which fits best.
int stamped_instant(const std::vector<Claim*>& claims) {
    int best = 0;
    std::int64_t least = 0;
    for (int halves = 0; halves < 3; ++halves) {
        std::vector<LinePoint> points;
        for (const Claim* claim : claims) {
            const BoardTime at = instant_of(*claim->exposure, halves);
            points.push_back({at.ns, claim->arrival->camera.ns - at.ns});
        }
        const std::int64_t usual = usual_amount(off_line(points));
        if (halves == 0 || usual < least) best = halves, least = usual;
    }
    return best;
}

/// Follows the difference of the camera's clock and the board's through the frames of a run. What
/// leaves it by a quarter of the way to another exposure is of that exposure, unless the arrivals
/// stay where they were: then the camera's clock was set.
class ClockFollower {
 public:
    struct Point {
        BoardTime at;
        Duration camera_minus_board;
        Duration latency;  ///< from the end of the exposure to the arrival
        Duration gap;      ///< to the nearest other exposure
    };

    /// How far the point lies off; none: not so far that it is of another exposure.
    std::optional<Duration> off(const Point& point) {
        set_anew_ = false;
        if (good_.empty()) {
            accept(point);
            return std::nullopt;
        }
        const Point& last = good_.back();
        const auto apart = static_cast<double>((point.at - last.at).ns);
        const Duration expected = last.camera_minus_board +
                                  Duration{static_cast<std::int64_t>(std::llround(apart * drift_))};
        const Duration off = point.camera_minus_board - expected;
        const Duration allowed =
            point.gap / 4 + Duration{static_cast<std::int64_t>(std::abs(apart) * drift_error_)};
        if (absolute(off) <= allowed) {
            accept(point);
            return std::nullopt;
        }
        // A frame of another exposure arrives as much too late or too early.
        const Duration later = point.latency - usual_latency();
        set_ = absolute(later - off) > absolute(off) / 2 ? set_ + 1 : 0;
        if (set_ < frames_to_believe) return off;
        set_anew_ = true;
        good_.clear();
        drift_ = 0;
        drift_error_ = unknown_drift;
        accept(point);
        return std::nullopt;
    }

    /// By the newest point and those before it that were off, the camera's clock was set.
    bool set_anew() const { return set_anew_; }

 private:
    static constexpr std::size_t remembered = 64;
    static constexpr int frames_to_believe = 5;
    static constexpr double unknown_drift = 200e-6;  // two crystals
    static constexpr double known_drift = 10e-6;     // what temperature changes within an hour

    void accept(const Point& point) {
        set_ = 0;
        good_.push_back(point);
        if (good_.size() > remembered) good_.pop_front();
        if (++accepted_ % (remembered / 4) != 0 || good_.size() < remembered / 2) return;
        std::vector<double> drifts;
        const std::size_t half = good_.size() / 2;
        for (std::size_t i = 0; i + half < good_.size(); ++i) {
            const auto apart = static_cast<double>((good_[i + half].at - good_[i].at).ns);
            if (apart <= 0) continue;
            const Duration risen = good_[i + half].camera_minus_board - good_[i].camera_minus_board;
            drifts.push_back(static_cast<double>(risen.ns) / apart);
        }
        if (drifts.empty()) return;
        drift_ = median(std::move(drifts));
        drift_error_ = known_drift;
    }

    Duration usual_latency() const {
        std::vector<Duration> all;
        for (const Point& point : good_) all.push_back(point.latency);
        return median(std::move(all));
    }

    std::deque<Point> good_;
    double drift_ = 0;
    double drift_error_ = unknown_drift;
    std::size_t accepted_ = 0;
    int set_ = 0;  ///< points in a row by which the camera's clock was set
    bool set_anew_ = false;
};

void CameraJudge::judge_camera_clock(const std::vector<Claim*>& claims) const {
    const bool has_clock = std::all_of(claims.begin(), claims.end(), [](const Claim* claim) {
        return claim->arrival->camera.ns != 0;
    });
    if (!has_clock) {
        // Arrivals are late as it happens: they confirm nothing.
        for (Claim* claim : claims) claim->add(Finding::no_camera_clock);
        return;
    }
    const int halves = stamped_instant(claims);
    ClockFollower follower;
    std::vector<std::pair<Claim*, Duration>> doubted;  // in a row
    for (Claim* claim : claims) {
        const FrameMetadata& frame = claim->frame->frame;
        const BoardTime at = instant_of(*claim->exposure, halves);
        const HostTime end = frame.host_time + (claim->exposure->end - frame.board_time);
        const ClockFollower::Point point{at, Duration{claim->arrival->camera.ns - at.ns},
                                         claim->arrival->arrived - end,
                                         runs_[claim->run].gap(frame.trigger)};
        if (const auto off = follower.off(point)) {
            claim->add(Finding::camera_clock, *off);
            doubted.emplace_back(claim, point.camera_minus_board);
            continue;
        }
        for (const auto& [before, camera_minus_board] : doubted)
            if (follower.set_anew() &&
                absolute(point.camera_minus_board - camera_minus_board) <= point.gap / 4)
                before->withdraw(Finding::camera_clock);
        doubted.clear();
    }
}

/// Whether the recording excludes that each frame of the run is of an exposure so many triggers
/// earlier or later, all by the same number: by an irregular pattern of exposures, or since a frame
/// would have arrived before it was exposed, or later than the service allows.
bool CameraJudge::only_one_shift(std::size_t run, const std::vector<Claim*>& claims) const {
    const RunIndex& index = runs_[run];
    struct Seen {
        std::uint64_t trigger;
        std::int64_t clock;
        HostTime arrived;
    };
    // Frames that were not published count, too, by their block ids: they are of the start.
    std::vector<Seen> seen;
    const auto& arrivals = index.of->arrivals;
    std::size_t beside = 0;
    for (std::size_t i = 0; i < arrivals.size(); ++i) {
        const ArrivalEvidence& arrival = arrivals[i];
        while (beside + 1 < claims.size() &&
               claims[beside + 1]->arrival->block_id <= arrival.block_id)
            ++beside;
        const FrameMetadata& known = claims[beside]->frame->frame;
        const bool published = known.block_id == arrival.block_id;
        if (!published && i >= first_arrivals) continue;
        const std::uint64_t trigger = known.trigger + arrival.block_id - known.block_id;
        seen.push_back({trigger, arrival.camera.ns != 0 ? arrival.camera.ns : arrival.arrived.ns,
                        arrival.arrived});
    }
    const auto contradictions = [&](std::int64_t shift) {
        std::vector<LinePoint> points;
        std::vector<std::int64_t> quarter;
        std::size_t count = 0;
        for (const Seen& each : seen) {
            const std::uint64_t trigger = each.trigger + static_cast<std::uint64_t>(shift);
            const ExposureEvidence* exposure = index.exposure(trigger);
            if (exposure == nullptr || !exposure->exposed) continue;
            points.push_back({exposure->start.ns, each.clock - exposure->start.ns});
            quarter.push_back(index.gap(trigger).ns / 4);
            const auto end = on_host(exposure->end, each.arrived);
            const bool early = end && each.arrived < end->earliest;
            const bool late = end && index.of->latest_arrival.ns > 0 &&
                              each.arrived > end->latest + index.of->latest_arrival;
            if (early || late) ++count;
        }
        const auto off = off_line(points);
        for (std::size_t i = 0; i < off.size(); ++i)
            if (std::llabs(off[i]) > quarter[i]) ++count;
        return count;
    };
    const std::size_t least = contradicting_frames * (1 + contradictions(0));
    std::int64_t furthest = furthest_shift;
    if (index.of->period.ns > 0 && index.of->latest_arrival.ns > 0)
        furthest = std::min(furthest, index.of->latest_arrival.ns / index.of->period.ns + 1);
    for (std::int64_t shift = 1; shift <= furthest; ++shift)
        if (contradictions(shift) < least || contradictions(-shift) < least) return false;
    return true;
}

/// Board and host time differ evenly.
void CameraJudge::judge_translation() {
    std::vector<Claim*> claims;
    std::vector<LinePoint> points;
    const auto judge = [&] {
        const auto off = off_line(points);
        for (std::size_t i = 0; i < off.size(); ++i) {
            if (std::llabs(off[i]) > allowed_error(claims[i]->frame->frame.sigma_ns).ns)
                claims[i]->add(Finding::uneven, {off[i]});
        }
        points.clear();
        claims.clear();
    };
    for (Claim& claim : claims_) {
        const FrameMetadata& frame = claim.frame->frame;
        // What is out of bounds is wrong by that, and no measure for those beside it.
        if (!claim.judged() || !stamped_by_board(frame) || frame.sigma_ns == sigma_unknown ||
            absolute(clock_.outside_bounds(frame.board_time, frame.host_time)) >
                allowed_error(frame.sigma_ns))
            continue;
        const bool goes_on = !claims.empty() && claims.back()->frame->frame.epoch == frame.epoch &&
                             claims.back()->frame->life == claim.frame->life &&
                             claims.back()->frame->frame.board_time < frame.board_time;
        if (!goes_on) judge();
        claims.push_back(&claim);
        points.push_back({frame.board_time.ns, frame.host_time.ns - frame.board_time.ns});
    }
    judge();
}

StreamVerdict CameraJudge::finish(StreamOrder order) const {
    VerdictBuilder verdict(camera_.name, "camera");
    const PictureJudge pictures(camera_.pictures);
    for (const Claim& claim : claims_) {
        const FrameMetadata& frame = claim.frame->frame;
        verdict.begin_item(order.second(frame.arrival), frame.sigma_ns);
        order.judge(*claim.frame, frame.epoch, verdict);
        if (!claim.judged()) {
            verdict.withhold();
            continue;
        }
        for (const auto& [finding, by] : claim.findings) verdict.add(finding, by);
        if (const auto by = pictures.off(claim.frame->time)) verdict.add(Finding::pictures, *by);
        const StampTimes times{frame.board_time, frame.host_time, claim.frame->time,
                               frame.sigma_ns,   frame.epoch,     frame.flags};
        if (stamped_by_board(frame))
            clock_.judge(times, verdict);
        else
            clock_.judge_by_host_clock(times, verdict);
    }
    for (const RecordedGap& gap : camera_.gaps) verdict.add_lost(gap.items);
    verdict.add_damaged(camera_.impossible);
    return verdict.finish();
}

}  // namespace

StreamVerdict judge_camera(const CameraEvidence& camera, const ClockWitness& clock,
                           StreamOrder order) {
    return CameraJudge(camera, clock).finish(order);
}

}  // namespace versavis::client

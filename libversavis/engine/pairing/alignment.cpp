// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/alignment.hpp"

#include <algorithm>
#include <cstdlib>
#include <optional>

namespace versavis::pairing {

namespace {

// How close a frame's time must come to that of an exposure to be of it, in smallest gaps. At half
// alignment by arrival needs steadier frames; at twice each frame lies near some exposure.
constexpr double coincidence = 0.25;

// Differences of the clocks that are this close, in smallest gaps, are tried once. At half more are
// tried and lead to the same; at twice, as far as `coincidence`, the one that fits may be skipped.
constexpr double same_difference = 0.125;

// How much the gaps between triggers must vary to prove anything, in smallest gaps. They are whole
// periods: at half nothing changes, and at twice only frames around a gap of three periods prove
// anything.
constexpr double irregularity = 0.5;

// Gaps that must be so much longer. At half (1) a grid that waits once, because the board's time
// was set back, looks like a place of the pattern; at twice starts take twice as long.
constexpr std::ptrdiff_t longer_gaps = 2;

// A frame that is later than the quickest one of a start by more, in smallest gaps, is not proved
// with the others. At half starts with some jitter fail; at twice one period late passes.
constexpr double lateness_spread = 0.6;

// How far the board's time may have stepped ahead of its estimate, in smallest gaps. Then frames
// seem to come before they were exposed, and records to be there that are not. At half steps by
// three periods hide the truth from a start; at twice starts take some frames longer.
constexpr double unseen_step = 4;

// How far the camera's own exposure time may be off from the measured one. At half the ramps of
// some exposure outputs look like another exposure; at twice short exposures are distinguished
// less.
constexpr Duration length_tolerance = microseconds(200);

// The same for long exposures, as a share. At half coarse exposure times of cameras contradict; at
// twice auto exposure must change by more before it distinguishes one exposure from the next.
constexpr double length_tolerance_share = 0.05;

// Frames that a start needs by the camera's clock: the four gaps that stand in one place of the
// pattern only. At half (3) wrong pairs are certain; at twice starts take twice as long, and a lost
// frame is likelier.
constexpr std::size_t frames_by_clock = 5;

// The same where nobody sees which triggers the camera ignores. At half a camera that ignores one
// trigger in five gets wrong pairs; at twice such starts take longer than the pattern.
constexpr std::size_t unseen_frames_by_clock = 8;

// Frames that a start needs by arrival, a second apart. At half (2) one stray frame imitates the
// single gap, and pairs are wrong; at twice such a start takes six seconds.
constexpr std::size_t frames_by_arrival = 3;

struct Alignment {
    std::vector<std::uint64_t> triggers;
    unsigned faults = 0;   ///< ignored triggers that nobody saw, which it takes
    bool unknown = false;  ///< a frame falls where a record was lost: neither proved nor refuted
};

std::int64_t time_ns(const Arrival& frame, Instant instant) {
    return instant == Instant::arrival ? frame.arrived.ns : frame.camera_time.ns;
}

class Search {
 public:
    Search(const std::vector<Arrival>& frames, const ExposureLog& exposures, Instant instant,
           const Limits& limits)
        : frames_(frames),
          exposures_(exposures),
          instant_(instant),
          limits_(limits),
          stepped_(limits),
          gap_ns_(exposures.smallest_gap_ns()),
          takes_seen_(exposures.takes_seen()) {
        if (instant_ == Instant::arrival) return;
        stepped_.earliest_arrival.ns -= part_of(gap_ns_, unseen_step);
    }

    /// Faults that rule out an alignment. Nobody sees how many triggers a camera without exposure
    /// line ignores: by leaving out any number of steady ones, its frames imitate the pattern. Then
    /// they seem to be late, and are of newer exposures: those no fault rules out.
    unsigned faults_to_refute(bool newer) const {
        if (takes_seen_) return pairing::faults_to_refute;
        return newer ? impossible_step : unseen_faults_to_refute;
    }

    /// Differences of the clocks that bring some frame and some exposure together, the one to the
    /// newest exposures first.
    std::vector<std::int64_t> candidates() const {
        std::vector<std::int64_t> differences;
        for (const Arrival& frame : frames_)
            for (std::size_t i = 0; i < exposures_.size(); ++i)
                if (arrival_possible(stepped_, frame, exposures_[i].exposure))
                    differences.push_back(time_ns(frame, instant_) -
                                          exposures_[i].instant_ns(instant_));
        std::sort(differences.begin(), differences.end());
        const auto same = [this](std::int64_t a, std::int64_t b) {
            return b - a < part_of(gap_ns_, same_difference);
        };
        differences.erase(std::unique(differences.begin(), differences.end(), same),
                          differences.end());
        return differences;
    }

    /// What must have gone wrong if the frames' clock differs from the board's by so much. None: it
    /// cannot be, or takes `refuted` faults.
    std::optional<Alignment> explain(std::int64_t difference_ns, unsigned refuted) const {
        Alignment alignment;
        const Record* last = nullptr;
        const Arrival* last_frame = nullptr;
        for (const Arrival& frame : frames_) {
            const std::int64_t at_ns = time_ns(frame, instant_) - difference_ns;
            const Record* record = exposures_.near(instant_, at_ns, tolerance_ns());
            if (record == nullptr) {
                if (!exposures_.lost_near(instant_, at_ns, 0) && !on_its_way(at_ns))
                    return std::nullopt;  // no pulse then
                alignment.unknown = true;
                continue;
            }
            if (!possible(frame, *record)) return std::nullopt;
            if (last != nullptr)
                alignment.faults +=
                    step_faults(frame.block_id - last_frame->block_id, *last, *record);
            if (alignment.faults >= refuted) return std::nullopt;
            last = record;
            last_frame = &frame;
            alignment.triggers.push_back(record->exposure.trigger);
        }
        return alignment;
    }

    /// Regular triggers prove nothing: the true exposures may be those whose records are missing at
    /// either end. Only a gap with a frame at both ends counts: where one was lost, two gaps of the
    /// pattern may be as long as two others. A trigger whose exposure line stayed silent has none
    /// to lose.
    bool irregular(const std::vector<std::uint64_t>& triggers) const {
        const auto has_frame = [&](const Exposure& exposure) {
            return std::binary_search(triggers.begin(), triggers.end(), exposure.trigger);
        };
        std::vector<std::int64_t> gaps;
        const Exposure* before = nullptr;  // of the exposures, all known since then
        std::uint64_t next = 0;
        for (std::size_t i = 0; i < exposures_.size(); ++i) {
            const Exposure& exposure = exposures_[i].exposure;
            if (exposure.trigger != next) before = nullptr;
            next = exposure.trigger + 1;
            if (!exposure.exposed) continue;
            if (before != nullptr && has_frame(*before) && has_frame(exposure))
                gaps.push_back((exposure.start - before->start).ns);
            before = &exposure;
        }
        if (gaps.empty()) return false;
        const std::int64_t usual =
            *std::min_element(gaps.begin(), gaps.end()) + part_of(gap_ns_, irregularity);
        return std::count_if(gaps.begin(), gaps.end(),
                             [usual](std::int64_t gap) { return gap > usual; }) >= longer_gaps;
    }

    /// A frame of another exposure than these could not have arrived when it did.
    bool separated(const std::vector<std::uint64_t>& triggers) const {
        const Duration window = limits_.latest_arrival - limits_.earliest_arrival;
        for (std::size_t i = 1; i < exposures_.size(); ++i) {
            const Exposure& exposure = exposures_[i].exposure;
            const bool inside =
                exposure.trigger >= triggers.front() && exposure.trigger <= triggers.back();
            const Exposure& before = exposures_[i - 1].exposure;
            if (!inside && before.trigger != triggers.back()) continue;
            if (exposure.trigger != before.trigger + 1 || exposure.start - before.start <= window)
                return false;
        }
        return true;
    }

    /// The alignment with a zero for each frame that is later than others: such a frame may be slow
    /// to come, or the camera's clock may have stepped among them by a period, and it is of another
    /// exposure. Empty when what is left proves nothing.
    std::vector<std::uint64_t> proved(std::vector<std::uint64_t> triggers) const {
        std::vector<std::int64_t> late;
        for (std::size_t i = 0; late.size() < triggers.size();) {
            const Exposure& exposure = exposures_[i].exposure;
            if (exposure.trigger != triggers[late.size()]) {
                ++i;
                continue;
            }
            const Arrival& frame = frames_[late.size()];
            if (!arrival_possible(limits_, frame, exposure)) return {};
            late.push_back((frame.arrived - exposures_[i].end_on_host).ns);
        }
        const std::int64_t least = *std::min_element(late.begin(), late.end());
        std::vector<std::uint64_t> kept;
        for (std::size_t i = 0; i < triggers.size(); ++i) {
            if (late[i] - least > part_of(gap_ns_, lateness_spread))
                triggers[i] = 0;
            else
                kept.push_back(triggers[i]);
        }
        const bool proof = kept.size() >= frames_needed() &&
                           (instant_ != Instant::arrival ? irregular(kept) : separated(kept));
        return proof ? triggers : std::vector<std::uint64_t>{};
    }

 private:
    std::int64_t tolerance_ns() const { return part_of(gap_ns_, coincidence); }

    /// The record of an exposure there may not have come yet.
    bool on_its_way(std::int64_t at_ns) const {
        if (instant_ == Instant::arrival || exposures_.empty()) return false;
        const std::int64_t after_ns = at_ns - exposures_.back().instant_ns(instant_);
        return after_ns > 0 && after_ns < part_of(gap_ns_, unseen_step);
    }

    std::size_t frames_needed() const {
        const bool by_clock = instant_ != Instant::arrival;
        return by_clock && !takes_seen_ ? unseen_frames_by_clock : frames_for_proof(by_clock);
    }

    bool possible(const Arrival& frame, const Record& record) const {
        return !record.used && record.exposure.exposed &&
               arrival_possible(stepped_, frame, record.exposure) &&
               !length_contradicts(frame, record.exposure);
    }

    const std::vector<Arrival>& frames_;
    const ExposureLog& exposures_;
    Instant instant_;
    const Limits& limits_;
    Limits stepped_;  ///< for an alignment that only speaks against another
    std::int64_t gap_ns_;
    bool takes_seen_;
};

}  // namespace

bool arrival_possible(const Limits& limits, const Arrival& arrival, const Exposure& exposure) {
    const Duration after_end = arrival.arrived - exposure.earliest_on_host;
    return after_end >= limits.earliest_arrival && after_end <= limits.latest_arrival;
}

std::uint64_t perhaps_not_taken(const Record& from, const Record& to) {
    const std::uint64_t sent = to.exposure.trigger - from.exposure.trigger;
    const std::uint64_t unrecorded = sent - std::min(sent, to.recorded - from.recorded);
    const std::uint64_t silent = to.silent - from.silent - (to.exposure.exposed ? 0 : 1);
    return std::min(sent - 1, unrecorded + silent);
}

unsigned step_faults(std::uint64_t id_step, const Record& from, const Record& to) {
    if (to.exposure.trigger <= from.exposure.trigger) return impossible_step;
    const std::uint64_t sent = to.exposure.trigger - from.exposure.trigger;
    if (id_step == 0 || id_step > sent) return impossible_step;
    const std::uint64_t taken = sent - perhaps_not_taken(from, to);
    return taken > id_step
               ? static_cast<unsigned>(std::min<std::uint64_t>(taken - id_step, impossible_step))
               : 0;
}

bool lengths_differ(Duration reported, Duration measured) {
    const Duration share{part_of(measured.ns, length_tolerance_share)};
    return absolute(reported - measured) > std::max(length_tolerance, share);
}

bool length_contradicts(const Arrival& arrival, const Exposure& exposure) {
    if (arrival.exposure.ns == 0 || exposure.kind != StampKind::measured_middle) return false;
    return lengths_differ(arrival.exposure, exposure.end - exposure.start);
}

std::size_t frames_for_proof(bool by_clock) {
    return by_clock ? frames_by_clock : frames_by_arrival;
}

std::vector<std::uint64_t> align(const std::vector<Arrival>& frames, const ExposureLog& exposures,
                                 std::span<const Instant> instants, const Limits& limits) {
    std::optional<Alignment> found;
    for (const Instant instant : instants) {
        const Search search(frames, exposures, instant, limits);
        bool newer = true;  // than the one without fault
        for (const std::int64_t difference : search.candidates()) {
            auto alignment = search.explain(difference, search.faults_to_refute(newer));
            if (!alignment) continue;
            if (alignment->faults > 0 || alignment->unknown) return {};
            // Neighbouring differences may lead to the same, and so may the instants.
            if (found && found->triggers != alignment->triggers) return {};
            found = std::move(alignment);
            newer = false;
        }
    }
    return found ? Search(frames, exposures, instants.front(), limits).proved(found->triggers)
                 : std::vector<std::uint64_t>{};
}

}  // namespace versavis::pairing

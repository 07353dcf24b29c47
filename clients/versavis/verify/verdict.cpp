// SPDX-License-Identifier: BSD-3-Clause
#include "verify/verdict.hpp"

#include <algorithm>

#include "base/median.hpp"
#include "versavis/metadata.hpp"

namespace versavis::client {

namespace {

struct FindingText {
    Finding finding;
    Grade grade;
    const char* name;
    const char* words;
};

constexpr FindingText texts[] = {
    {Finding::impossible_value, Grade::untrusted, "impossible_value",
     "a time is impossible: the item is damaged"},
    {Finding::no_exposure, Grade::untrusted, "no_exposure",
     "the board reported no exposure with its trigger number"},
    {Finding::other_middle, Grade::untrusted, "other_middle",
     "its board time is not the middle of the exposure that the board measured"},
    {Finding::other_length, Grade::untrusted, "other_length",
     "its exposure is not as long as the board measured"},
    {Finding::record_differs, Grade::untrusted, "record_differs",
     "the exposure differs from the edges that the board sent"},
    {Finding::no_arrival, Grade::untrusted, "no_arrival",
     "no frame with its block id arrived from the camera"},
    {Finding::other_arrival, Grade::untrusted, "other_arrival",
     "arrival or camera time differ from those of the frame that arrived"},
    {Finding::too_early, Grade::untrusted, "too_early",
     "the frame arrived before its exposure ended"},
    {Finding::camera_clock, Grade::untrusted, "camera_clock",
     "by the camera's clock it belongs to another exposure"},
    {Finding::block_step, Grade::untrusted, "block_step",
     "block ids grew by more than the triggers"},
    {Finding::stated_length, Grade::untrusted, "stated_length",
     "the camera states another length of exposure than the board measured"},
    {Finding::host_time, Grade::untrusted, "host_time",
     "its host time is outside the bounds that the messages of the board set"},
    {Finding::uneven, Grade::untrusted, "uneven",
     "board and host time differ otherwise than at the items beside it"},
    {Finding::output_time, Grade::untrusted, "output_time",
     "its time is neither that of the output clock nor that of the PPS pulses"},
    {Finding::other_second, Grade::untrusted, "other_second", "its time is off by whole seconds"},
    {Finding::backwards, Grade::untrusted, "backwards", "its time is before that of the last item"},
    {Finding::missing, Grade::untrusted, "missing",
     "items before it are missing, and the recorder noted no loss"},
    {Finding::repeated, Grade::untrusted, "repeated", "an item is there twice, or out of order"},
    {Finding::sample_clock, Grade::untrusted, "sample_clock",
     "its board time does not follow from its number and the samples beside it"},
    {Finding::message_stamp, Grade::untrusted, "message_stamp",
     "the stamp in the ROS message is not that of the item"},
    {Finding::pictures, Grade::untrusted, "pictures",
     "its pictures and its stamps differ, by the rotation that the gyro measured"},
    {Finding::no_edges, Grade::plausible, "no_edges",
     "an edge of the exposure line is missing: the middle is predicted"},
    {Finding::no_hardware, Grade::plausible, "no_hardware",
     "no exposure of the board is known: the stamp is the arrival's"},
    {Finding::by_camera, Grade::plausible, "by_camera",
     "the stamp is by the camera's own clock, which followed PTP: nothing recorded confirms it"},
    {Finding::no_camera_clock, Grade::plausible, "no_camera_clock",
     "the camera has no clock that confirms the pairing"},
    {Finding::no_start, Grade::plausible, "no_start",
     "nothing in the recording excludes that all frames are off by some triggers"},
    {Finding::no_exchange, Grade::plausible, "no_exchange",
     "no exchange with the board around it: nothing bounds its host time"},
    {Finding::contradictory_exchanges, Grade::plausible, "contradictory_exchanges",
     "exchanges with the board contradict each other around it"},
    {Finding::no_output_reading, Grade::plausible, "no_output_reading",
     "the output clock was not recorded around it"},
    {Finding::second_doubted, Grade::plausible, "second_doubted",
     "receiver and host differ by whole seconds, as its flag says"},
    {Finding::no_record, Grade::plausible, "no_record",
     "what the pairing was made from is not in the recording"},
    {Finding::clock_uncertain, Grade::plausible, "clock_uncertain", "no accuracy is known of it"},
};
static_assert(std::size(texts) == finding_count);

bool is_worse(const WorstSecond& a, const WorstSecond& b) {
    return a.items != b.items ? a.items > b.items : absolute(a.worst) > absolute(b.worst);
}

const FindingText& text_of(Finding finding) { return texts[static_cast<std::size_t>(finding)]; }

}  // namespace

const char* to_string(Grade grade) {
    switch (grade) {
        case Grade::untrusted: return "not to be trusted";
        case Grade::plausible: return "plausible";
        case Grade::proved: break;
    }
    return "proved";
}

Grade grade_of(Finding finding) { return text_of(finding).grade; }
const char* name_of(Finding finding) { return text_of(finding).name; }
const char* words_of(Finding finding) { return text_of(finding).words; }

Grade StreamVerdict::grade() const {
    if (graded[static_cast<std::size_t>(Grade::untrusted)] > 0) return Grade::untrusted;
    const bool all = graded[static_cast<std::size_t>(Grade::plausible)] == 0;
    return all && items > withheld ? Grade::proved : Grade::plausible;
}

VerdictBuilder::VerdictBuilder(std::string name, std::string kind) {
    verdict_.name = std::move(name);
    verdict_.kind = std::move(kind);
}

void VerdictBuilder::begin_item(std::int64_t second, std::uint32_t sigma_ns) {
    end_item();
    open_ = true;
    withheld_ = false;
    grade_ = Grade::proved;
    second_ = second;
    ++verdict_.items;
    ++verdict_.seconds[second].items;
    if (sigma_ns != sigma_unknown) sigmas_.push_back(sigma_ns);
}

void VerdictBuilder::add(Finding finding, Duration by) {
    grade_ = std::min(grade_, grade_of(finding));
    Cell& cell = cells_[static_cast<std::size_t>(finding)][second_];
    ++cell.items;
    if (absolute(by) > absolute(cell.worst)) cell.worst = by;
}

void VerdictBuilder::add_position(Duration from_middle, Duration half_width) {
    SecondVerdict& second = verdict_.seconds[second_];
    const bool first = second.half_width.ns == 0;
    second.lowest = first ? from_middle : std::min(second.lowest, from_middle);
    second.highest = first ? from_middle : std::max(second.highest, from_middle);
    second.half_width = std::max(second.half_width, half_width);
}

void VerdictBuilder::add_damaged(std::uint64_t items) {
    for (std::uint64_t i = 0; i < items; ++i) {
        begin_item(0, sigma_unknown);
        add(Finding::impossible_value);
    }
}

void VerdictBuilder::withhold() { withheld_ = true; }

void VerdictBuilder::end_item() {
    if (!open_) return;
    open_ = false;
    SecondVerdict& second = verdict_.seconds[second_];
    if (withheld_) {
        ++verdict_.withheld;
        ++second.withheld;
    }
    if (withheld_ && grade_ != Grade::untrusted) return;
    ++verdict_.graded[static_cast<std::size_t>(grade_)];
    second.grade = std::min(second.grade, grade_);
}

StreamVerdict VerdictBuilder::finish() {
    end_item();
    for (std::size_t i = 0; i < finding_count; ++i) {
        const auto finding = static_cast<Finding>(i);
        for (const auto& [second, cell] : cells_[i]) {
            const bool follows = !verdict_.findings.empty() &&
                                 verdict_.findings.back().finding == finding &&
                                 verdict_.findings.back().to_s + 1 >= second;
            if (!follows) verdict_.findings.push_back({finding, second, second, 0, {}});
            FindingSpan& span = verdict_.findings.back();
            span.to_s = second;
            span.items += cell.items;
            if (absolute(cell.worst) > absolute(span.worst)) span.worst = cell.worst;
            if (grade_of(finding) != Grade::untrusted) continue;
            const WorstSecond here{finding, second, cell.items, cell.worst};
            if (!verdict_.worst_second || is_worse(here, *verdict_.worst_second))
                verdict_.worst_second = here;
        }
    }
    if (!sigmas_.empty()) verdict_.sigma = {std::int64_t{median(std::move(sigmas_))}};
    return std::move(verdict_);
}

}  // namespace versavis::client

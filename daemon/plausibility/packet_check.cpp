// SPDX-License-Identifier: BSD-3-Clause
#include "packet_check.hpp"

#include <algorithm>
#include <bit>
#include <string_view>

namespace versavis::daemon {

namespace {

/// More packets in a row are not lost: a link carries some 20,000 in the longest silence before the
/// board is greeted anew.
constexpr std::uint32_t largest_loss = 32768;

/// No board runs for 36 years.
constexpr std::int64_t latest_ns = std::int64_t{1} << 60U;

/// The year 2200.
constexpr std::int64_t latest_label_s = 7'258'118'400;

constexpr std::uint32_t camera_parts = (1U << wire::camera_count) - 1U;
static_assert(wire::present_camera0 == 1U, "the first bits of what is present are cameras");

bool in_life(std::int64_t ns) { return ns >= 0 && ns <= latest_ns; }

}  // namespace

bool SequenceWatch::add(std::uint32_t sequence) {
    const std::uint32_t gap = sequence - next_;
    const bool follows = gap <= largest_loss || sequence == after_error_;
    if (gap <= largest_loss) lost_ += gap;
    if (!follows) after_error_ = sequence + 1;
    next_ = (follows ? sequence : next_) + 1;
    return follows;
}

/// A trigger board has outputs, and says twice which.
bool possible(const wire::BoardHello& message) {
    const int outputs = std::popcount(message.present & camera_parts);
    return in_life(message.board_time_ns) && outputs > 0 && outputs == message.cameras;
}

bool possible(const wire::Exposure& message) {
    const auto edge = [](std::int64_t ns) { return ns == wire::no_time || in_life(ns); };
    return in_life(message.trigger_ns) && edge(message.start_ns) && edge(message.end_ns);
}

bool possible(const wire::ImuSample& message) {
    const bool aged = (message.flags & wire::imu_accel_stamped) != 0;
    return in_life(message.time_ns) && (aged || message.accel_age == 0);
}

bool possible(const wire::Event& message) {
    if (!in_life(message.time_ns)) return false;
    switch (message.kind) {
        case wire::BoardEventKind::time_pulse:
            return message.source < wire::time_output_count && message.value >= 0 &&
                   message.value <= latest_label_s;
        case wire::BoardEventKind::utc_label:
            return message.value >= 0 && message.value <= latest_label_s;
        case wire::BoardEventKind::triggers_skipped: return message.detail > 0;
        case wire::BoardEventKind::stored: return message.value == 0 || message.value == 1;
        default: return true;
    }
}

bool possible(const wire::Sentence& message) {
    if (!in_life(message.time_ns) || message.size == 0 || message.size > sizeof message.text)
        return false;
    const std::string_view text(message.text, message.size);
    const auto printable = [](char c) { return c >= ' ' && c <= '~'; };
    return (text[0] == '$' || text[0] == '!') && std::all_of(text.begin(), text.end(), printable);
}

bool possible(const wire::Health& message) {
    return in_life(message.board_time_ns) && message.pps_state <= wire::PpsState::good &&
           message.sync_state <= wire::SyncState::followed &&
           message.stamp_test <= wire::StampTest::passed &&
           message.reset_cause <= wire::ResetCause::update;
}

bool possible(const wire::ClockAnswer& message) {
    return in_life(message.received_ns) && in_life(message.sent_ns);
}

bool possible(const wire::ClockFollowUp& message) { return in_life(message.sent_ns); }

}  // namespace versavis::daemon

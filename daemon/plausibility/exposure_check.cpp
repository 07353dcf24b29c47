// SPDX-License-Identifier: BSD-3-Clause
#include "exposure_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace versavis::daemon {

namespace {

/// How long a new exposure takes to hold in slow cameras.
constexpr Duration exposure_settling = milliseconds(500);

/// Frames that may still have the old exposure: those in the camera's queue.
constexpr int settling_frames = 5;

/// Sigma of the middle of an exposure of whose length nothing but its line is known: six sigma are
/// more than half of the slowest edge.
constexpr Duration unwitnessed_end = microseconds(100);

/// By how much a camera's events and its register may differ about one exposure: a part of it, and
/// no less than the time.
constexpr std::int64_t part_of_length = 50;
constexpr Duration least_difference = microseconds(20);

/// A length that may be anything in a range leaves the middle uncertain by half of it either way,
/// which is taken for two sigma.
constexpr std::int64_t range_per_sigma = 4;

Duration root_of_squares(Duration a, Duration b) { return rounded(std::hypot(a.ns, b.ns)); }

}  // namespace

const char* to_string(ExposureSource source) {
    switch (source) {
        case ExposureSource::none: return "none";
        case ExposureSource::setting: return "setting";
        case ExposureSource::reading: return "reading";
        case ExposureSource::event: return "event";
        case ExposureSource::chunk: return "chunk";
        case ExposureSource::chunk_before: return "chunk_before";
    }
    return "none";
}

ExposureCheck::ExposureCheck(const CameraConfiguration& configuration)
    : enabled_(configuration.check_exposure),
      settings_(exposure_settling + period_of(configuration) * settling_frames),
      readings_(exposure_reading_interval + period_of(configuration) * settling_frames) {}

void ExposureCheck::set_line_delays(const LineDelays& lines) {
    edges_.set_line_delays(lines);
    settings_.clear();
    readings_.clear();
    newest_ = {};
    lags_ = false;
    votes_ = 0;
}

void ExposureCheck::set_camera_exposure(Duration exposure, HostTime since) {
    settings_.add(exposure, since);
    varies_ = exposure.ns == 0;
}

/// A reading shows what frames were exposed before it as little as a setting; but where the one
/// before and this one agree, the frame in between had this exposure.
void ExposureCheck::read_exposure(Duration exposure, HostTime at, Duration start_delay) {
    if (exposure.ns == 0) return;
    ReportedExposure& reports = varies_ ? readings_ : settings_;
    reports.add(exposure, at);
    const auto range = reports.at(newest_.end);
    const bool fresh = std::exchange(newest_.unread, false);
    if (fresh && range && range->width().ns == 0)
        edges_.learn(newest_.length - exposure, start_delay);
}

bool ExposureCheck::wants_readings() const {
    const bool by_frame = source_ == ExposureSource::event || source_ == ExposureSource::chunk ||
                          source_ == ExposureSource::chunk_before;
    const bool shown = newest_.length.ns != 0;
    return !(by_frame && shown) && (varies_ || contradicted_);
}

Duration ExposureCheck::reported_at(HostTime at) const {
    const auto range = settings_.at(at);
    return range && range->width().ns == 0 ? range->longest : Duration{};
}

/// Before the line's own difference is known, the true exposure may seem to be another one.
Duration ExposureCheck::for_pairing(Duration chunk) const {
    const bool usable = chunk.ns != 0 && enabled_ && !lags_ && edges_.settled();
    return usable ? chunk + edges_.surplus() : Duration{};
}

/// Some cameras send with each frame the exposure of the one before. That shows when it changes.
void ExposureCheck::follow_lag(const Measured& before, Duration chunk) {
    const bool own = edges_.explains(newest_.length - chunk);
    const bool neighbour = edges_.explains(before.length - chunk);
    if (own == neighbour) return;
    if (neighbour == lags_) {
        votes_ = 0;
    } else if (++votes_ >= votes_to_shift) {
        lags_ = neighbour;
        votes_ = 0;
    }
}

ExposureCheck::Account ExposureCheck::account_of(const Measured& before, const FrameAccount& frame,
                                                 Duration start_delay) {
    if (frame.chunk.ns != 0) {
        const bool follows = before.length.ns != 0 && newest_.block_id == before.block_id + 1;
        if (follows) follow_lag(before, frame.chunk);
        if (!lags_) return {ExposureSource::chunk, {frame.chunk, frame.chunk}};
        if (follows) edges_.learn(before.length - frame.chunk, start_delay);
        readings_.add(frame.chunk, before.end);
        const auto range = readings_.at(newest_.end);
        return range ? Account{ExposureSource::chunk_before, *range} : Account{};
    }
    if (frame.event.ns != 0) return {ExposureSource::event, {frame.event, frame.event}};
    const auto range = (varies_ ? readings_ : settings_).at(newest_.end);
    if (!range) return {};
    return {varies_ ? ExposureSource::reading : ExposureSource::setting, *range};
}

/// The account is of this exposure, and of no older one.
bool ExposureCheck::certain() const {
    return source_ == ExposureSource::event || source_ == ExposureSource::chunk ||
           source_ == ExposureSource::setting;
}

/// By how much the measured length lies outside of that range.
Duration ExposureCheck::excess(LengthRange range) const {
    const Duration length = newest_.length - edges_.surplus();
    return std::max({Duration{}, length - range.longest, range.shortest - length});
}

/// A length that changed may as well be wrong by the change.
ExposureVerdict ExposureCheck::unwitnessed(const Measured& before) const {
    const Duration change =
        before.length.ns != 0 ? absolute(newest_.length - before.length) : Duration{};
    return {false, {{}, {}, root_of_squares(unwitnessed_end, change / 2)}, {}};
}

/// Without an exposure line, two accounts of the camera must agree; one alone is the best guess.
ExposureVerdict ExposureCheck::by_camera(const FrameAccount& frame,
                                         const pairing::Exposure& exposure) {
    if (!enabled_) return {};
    const Duration length = frame.event;
    const auto range = frame.chunk.ns != 0
                           ? LengthRange{frame.chunk, frame.chunk}
                           : (varies_ ? readings_ : settings_).at(exposure.earliest_on_host);
    const Duration difference = std::max(length / part_of_length, least_difference);
    if (length.ns == 0 || !range || length + difference < range->shortest ||
        length - difference > range->longest)
        return {false, {}, range ? (range->shortest + range->longest) / 2 : length};
    source_ = ExposureSource::event;
    reported_ = length;
    return {false, {}, length, true};
}

ExposureVerdict ExposureCheck::judge(const pairing::Arrival& arrival, const FrameAccount& frame,
                                     const pairing::Exposure& exposure, Duration start_delay) {
    contradicted_ = false;
    reported_ = {};
    source_ = ExposureSource::none;
    const Measured before = std::exchange(newest_, {});
    if (exposure.kind == StampKind::trigger_edge) return by_camera(frame, exposure);
    if (exposure.kind != StampKind::measured_middle) return {};
    newest_ = {arrival.block_id, exposure.end - exposure.start, exposure.earliest_on_host, true};
    const Account account = account_of(before, frame, start_delay);
    if (account.source == ExposureSource::none) return unwitnessed(before);
    source_ = account.source;
    reported_ = account.range.longest;
    const Duration excess = this->excess(account.range);
    const bool off = certain() && excess > edges_.tolerance();
    // A setting that is off may be an old one: readings decide.
    const bool old = source_ == ExposureSource::setting && off;
    if (certain() && !old && account.range.width().ns == 0)
        edges_.learn(newest_.length - account.range.longest, start_delay);
    if (!enabled_) return unwitnessed(before);
    contradicted_ = off;
    ExposureVerdict verdict{contradicted_, edges_.correction(), {}};
    Duration& sigma = verdict.correction.sigma;
    sigma = root_of_squares(sigma, account.range.width() / range_per_sigma);
    if (!certain()) sigma = root_of_squares(sigma, excess / 2);
    return verdict;
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/envelope_filter.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/clock/gaussian_state_matrix.hpp"
#include "engine/clock/square.hpp"
#include "engine/rounding.hpp"

namespace versavis::clock {

namespace {

// Length of a slot in the long run. Half: its shortest delay is further from the edge, and sigma
// is a tenth too small. Twice: the clocks wander within it.
constexpr std::int64_t longest_slot_ns = 2'000'000'000;

// A slot lasts one over this of the time since the beginning. Half or twice: p99 after five
// minutes changes by a tenth with IMU packets.
constexpr std::int64_t slots_per_age = 16;

// Messages within this are delayed by the same load of the host: what a shorter slot says is not
// independent of the one before, and counts by its share of this. Half: sigma is too small by a
// quarter in the first minute. Twice: too large by a fifth from 2 to 8 s.
constexpr double shared_load_s = 0.25;

// The least such share. Half: errors of the first second grow by a tenth. Twice is the whole.
constexpr double least_share = 0.5;

// The bound counts the shortest round trip of one to two of these. Half or twice: it follows a
// changed link sooner or later; the estimate does not depend on it.
constexpr std::int64_t window_ns = 300'000'000'000;

// A message older than this did not just arrive out of order: the board's clock went back. Half
// or twice matters only after such a step.
constexpr std::int64_t longest_disorder_ns = 5'000'000'000;

// Deviations below the edge that a delay surprises by. Half: sigma is a sixth too large. Twice:
// p99 of invisible jitter grows by a quarter, and sigma is a quarter too small.
constexpr double surprising = 3.0;

// Deviations of the shortest delay by which a link must have changed for the level to follow.
// Half or twice: no figure changes.
constexpr double shift_deviations = 4.0;

// The most that one surprise inflates the covariance by. Half: a large step takes more messages.
// Twice: a single wild stamp costs more of what was known.
constexpr double most_inflation = 100.0;

// What is left of a surprise when the next message is used. Half: only surprises in a row count.
// As it is below one, twice is no value.
constexpr double surprise_memory = 0.9;

// Fading surprises beyond which the skew is doubted, too. Half: two suffice. Twice: a change of
// skew is followed some slots later.
constexpr double surprises_of_skew = 2.0;

// The time within which the skew is taken to have caused the surprise: a slot. Half or twice: the
// skew is doubted twice or half as much.
constexpr double surprise_span_s = 2.0;

// Deviations of the offset by which a message may seem to arrive before it was sent. Half: bad
// luck passes for a step. Twice: small steps are followed as surprises, slowly.
constexpr double contradicting = 6.0;

// Contradicting exchanges in a row that begin the estimate anew. One: a single wild stamp does.
// Six: a step is followed 0.3 s later.
constexpr int contradictions_to_restart = 3;

// The same while the board's other messages go on, and take as long to the host, as before: then
// its clock cannot have stepped, and the exchanges are wrong, or the estimate was. They must last,
// for 3 s of ten exchanges a second at least. Half: shorter lies are followed after a beginning.
// Twice: an estimate that began wrong is doubted for twice as long.
constexpr std::uint64_t least_contradictions_to_prevail = 30;

// In ns/s; no two clocks differ by 1000 ppm. Half or twice is as far from any crystal.
constexpr double largest_skew = 1e6;

// Deviation of a skew that is kept over a restart, in ns/s: the crystal is the one it was. Half
// or twice: the first seconds change by little.
constexpr double kept_skew_sigma = 10e3;

// Share of the first round trip that delays are taken to spread by. Half or twice matters for the
// first three slots.
constexpr double start_scale_of_round_trip = 0.5;

// Fewer slots count as converging. Half or twice: `locked` comes after half or twice the time.
constexpr std::uint64_t slots_to_lock = 10;

// Exchanges that follow each other sooner are one comparison of the clocks, as no other message may
// have come in between: a link begins with several exchanges at once. Half: an IMU of 20 Hz may not
// have spoken. Twice: a step is followed 0.1 s later.
constexpr std::int64_t same_comparison_ns = 50'000'000;

// With fewer slots than these, the board's other messages are no witness for the estimate. Half:
// one that two equal lies began lasts for 3 s more often. Twice: so do lies soon after a beginning.
constexpr std::uint64_t slots_to_trust = 4;

// A larger sigma of the offset counts as converging. Half: links of several ms take longer to
// lock. Twice: they lock with an error of 0.5 ms.
constexpr double locked_sigma_ns = 250e3;

// Silence after which the state is `holdover`. Half: an exchange a second comes close to it. Twice:
// silence is reported later; sigma grows either way.
constexpr std::int64_t holdover_after_ns = 3'000'000'000;

// When exchanges are in doubt, the estimate is that of so long before, up to twice. Half: what
// drifts by 10 us/s has moved it before that is noticed. Twice: sigma grows for longer.
constexpr std::int64_t past_ns = 16'000'000'000;

// After a beginning it is shorter, so that the estimate is as good as it can be then.
constexpr std::int64_t pasts_per_age = 4;

/// 73 years: what is summed cannot overflow.
const std::int64_t furthest_ns = std::int64_t{1} << 61;

template <class Clock>
bool sane(Time<Clock> t) {
    return t.ns > -furthest_ns && t.ns < furthest_ns;
}

OffsetSample to_host(const BoardTime sent, const HostTime arrived) {
    return {sent, {arrived.ns - sent.ns}};
}
OffsetSample to_board(const HostTime sent, const BoardTime arrived) {
    return {arrived, {sent.ns - arrived.ns}};
}

}  // namespace

const char* to_string(ClockState state) {
    switch (state) {
        case ClockState::init: return "init";
        case ClockState::converging: return "converging";
        case ClockState::locked: return "locked";
        case ClockState::holdover: return "holdover";
        case ClockState::step: return "step";
        case ClockState::reset: return "reset";
    }
    return "unknown";
}

void EnvelopeFilter::add(const Exchange& exchange, bool denied) {
    if (!sane(exchange.sent) || !sane(exchange.received) || !sane(exchange.answered) ||
        !sane(exchange.arrived))
        return;
    const Duration round_trip =
        (exchange.arrived - exchange.sent) - (exchange.answered - exchange.received);
    if (round_trip.ns <= 0) return;
    last_round_trip_ = round_trip;
    ++exchanges_;
    const bool anew = absolute(exchange.arrived - last_comparison_).ns >= same_comparison_ns;
    if (anew) {
        ++comparisons_;
        last_comparison_ = exchange.arrived;
    }
    if (denied && !confirmed_) return;
    if (!begun_) return begin(exchange, round_trip);
    const OffsetSample down = to_board(exchange.sent, exchange.received);
    const OffsetSample up = to_host(exchange.answered, exchange.arrived);
    const BoardTime now = std::max(exchange.received, exchange.answered);
    last_residual_ = rounded((delay_ns(up, up_) - delay_ns(down, down_)) / 2);
    const bool old = goes_back(std::min(exchange.received, exchange.answered));
    if (contradicts(up, up_) || contradicts(down, down_)) {
        if (!confirmed_) return restart(exchange, round_trip);  // one of the two is wrong
        if (contradictions_ > 0 && !anew) return;
        ++contradictions_;
        if (denied) {
            unwitnessed_contradictions_ = 0;
            return;
        }
        const bool prevails = persistence_.contradict(least_contradictions_to_prevail);
        // An estimate that just began may itself be what is wrong.
        const bool witnessed = continued_ && slots_ >= slots_to_trust;
        unwitnessed_contradictions_ = witnessed ? 0 : unwitnessed_contradictions_ + 1;
        continued_ = false;
        if (unwitnessed_contradictions_ >= contradictions_to_restart || prevails)
            restart(exchange, round_trip);
        return;
    }
    if (old) return;  // it was held up on its way
    confirmed_ = true;
    persistence_.agree();
    contradictions_ = unwitnessed_contradictions_ = 0;
    continued_ = false;
    contradiction_ = {};
    remember_round_trip(now, round_trip);
    if (doubt_ > Duration{}) return;
    down_.offer(down, delay_ns(down, down_));
    up_.offer(up, delay_ns(up, up_));
    down_in_slot_ = true;
    last_contact_ = std::max(last_contact_, now);
    close_slot_if_due(now);
}

void EnvelopeFilter::add(const OneWay& message) {
    if (!begun_ || !sane(message.sent) || !sane(message.arrived)) return;
    const OffsetSample up = to_host(message.sent, message.arrived);
    if (goes_back(message.sent) || contradicts(up, up_)) return;
    ++one_way_messages_;
    if (doubt_ > Duration{}) return;  // how long messages take says little without exchanges
    up_.offer(up, delay_ns(up, up_));
    last_contact_ = std::max(last_contact_, message.sent);
    close_slot_if_due(message.sent);
}

void EnvelopeFilter::doubt(Duration by, Duration allowance) {
    if (begun_ && doubt_ == Duration{} && by > Duration{}) take_back(by);
    doubt_ = by;
    allowance_ = allowance;
}

/// The exchanges may have been wrong for a while before they were in doubt, but were never off by
/// more than a round trip: then they contradict the estimate, and are not used. What they made of
/// it since nothing was in doubt is not believed.
void EnvelopeFilter::take_back(Duration doubt) {
    const std::optional<Past>& past = older_ ? older_ : newer_;
    const Duration span = reference_ - (past ? past->at : started_);
    const double span_s = std::max(static_cast<double>(span.ns) * 1e-9, surprise_span_s);
    const double moved_ns = static_cast<double>(std::min(doubt, last_round_trip_).ns);
    if (past) {
        state_ = past->state.after(span);
        up_ = past->up;
        down_ = past->down;
    } else {
        matrix(state_)(0, 0) += square(moved_ns);
    }
    matrix(state_)(1, 1) += square(moved_ns / span_s);
    up_.take();
    down_.take();
    down_in_slot_ = false;
}

void EnvelopeFilter::keep_past() {
    if (doubt_ > Duration{} || allowance_ > Duration{}) return;
    const std::int64_t apart_ns = std::min((reference_ - started_).ns / pasts_per_age, past_ns);
    if (newer_ && (reference_ - newer_->at).ns < apart_ns) return;
    older_ = std::exchange(newer_, Past{state_, up_, down_, reference_});
}

void EnvelopeFilter::board_restarted() {
    reset_ = reset_ || begun_;
    begun_ = confirmed_ = false;
}

void EnvelopeFilter::clock_stepped() {
    ++restarts_;
    board_restarted();
}

void EnvelopeFilter::begin(const Exchange& exchange, Duration round_trip) {
    const double kept_skew = std::abs(state_.mean[1]) < largest_skew ? state_.mean[1] : 0;
    reference_ = middle(exchange.received, exchange.answered);
    base_ = {middle(exchange.sent, exchange.arrived).ns - reference_.ns};
    state_ = GaussianState::after_exchange(static_cast<double>(round_trip.ns));
    if (reset_) {
        state_.mean[1] = kept_skew;
        matrix(state_)(1, 1) = square(kept_skew_sigma);
    }
    begun_ = true;
    confirmed_ = false;
    reset_ = false;
    older_.reset();
    newer_.reset();
    contradictions_ = unwitnessed_contradictions_ = 0;
    persistence_.forget();
    continued_ = false;
    contradiction_ = {};
    const double scale = start_scale_of_round_trip * static_cast<double>(round_trip.ns);
    up_.begin(scale);
    down_.begin(scale);
    down_in_slot_ = false;
    last_contact_ = started_ = slot_begin_ = std::max(exchange.received, exchange.answered);
    slots_ = 0;
    smallest_in_window_ = smallest_before_ = {INT64_MAX};
    remember_round_trip(started_, round_trip);
    if (sites_ == nullptr) return;
    sites_->push_back(
        {to_board(exchange.sent, exchange.received), Direction::to_board, scale, restarts_});
    sites_->push_back(
        {to_host(exchange.answered, exchange.arrived), Direction::to_host, scale, restarts_});
}

void EnvelopeFilter::restart(const Exchange& exchange, Duration round_trip) {
    ++restarts_;
    reset_ = true;
    begin(exchange, round_trip);
}

bool EnvelopeFilter::goes_back(BoardTime board) const {
    return (last_contact_ - board).ns > longest_disorder_ns;
}

/// True when a message would have arrived before it was sent, by more than the estimate's own error
/// explains: the error at the host's stamp, as the board's may be so far off that any error would.
bool EnvelopeFilter::contradicts(const OffsetSample& sample, const DelayEdge& edge) {
    const double delay = delay_ns(sample, edge);
    const Duration since = sample.at - reference_ + rounded(edge.sign() * delay);
    if (delay >= -contradicting * std::sqrt(state_.offset_variance_after(since))) return false;
    contradiction_ = rounded(-delay) + last_round_trip_;  // it took some time, too
    return true;
}

double EnvelopeFilter::relative_ns(const OffsetSample& sample) const {
    return static_cast<double>((sample.host_minus_board - base_).ns);
}

double EnvelopeFilter::delay_ns(const OffsetSample& sample, const DelayEdge& edge) const {
    return edge.sign() * (relative_ns(sample) - state_.offset_after(sample.at - reference_));
}

void EnvelopeFilter::close_slot_if_due(BoardTime now) {
    const std::int64_t length = (now - slot_begin_).ns;
    const bool due = length >= std::min((now - started_).ns / slots_per_age, longest_slot_ns);
    if (due && (down_in_slot_ || length >= longest_slot_ns)) close_slot(now);
}

void EnvelopeFilter::close_slot(BoardTime now) {
    const double length_s = static_cast<double>((now - slot_begin_).ns) * 1e-9;
    slot_share_ = std::clamp(length_s / shared_load_s, least_share, 1.0);
    slot_begin_ = now;
    down_in_slot_ = false;
    ++slots_;
    const auto up = up_.take();
    const auto down = down_.take();
    const BoardTime newest = std::max(up ? up->at : reference_, down ? down->at : reference_);
    const double expected = state_.offset_after(newest - reference_);
    if (up && down && slots_ > slots_to_lock) follow_fall(*up, *down);
    const bool down_first = down && up && down->at < up->at;
    if (down && down_first) use(*down, down_);
    if (up) use(*up, up_);
    if (down && !down_first) use(*down, down_);
    follow_rise();
    last_innovation_ = rounded(state_.offset_after(newest - reference_) - expected);
    keep_past();
}

/// Both directions take longer than they did, by more than they spread, or both are shorter than
/// they can be: so is the link, and no clock has anything to do with it. Left alone, the offset
/// would slide until one of the two edges fits.
void EnvelopeFilter::follow_rise() {
    const auto up = up_.newest_least_ns();
    const auto down = down_.newest_least_ns();
    if (!up || !down) return;
    const double up_more = *up - state_.mean[3];
    const double down_more = *down - state_.mean[3];
    if (up_more > up_.scale_ns() && down_more > down_.scale_ns())
        shift_level(std::min(up_more, down_more));
}

void EnvelopeFilter::follow_fall(const OffsetSample& up, const OffsetSample& down) {
    const double up_less = state_.mean[3] - delay_ns(up, up_);
    const double down_less = state_.mean[3] - delay_ns(down, down_);
    const double blur = edge_blur(std::max(up_.scale_ns(), down_.scale_ns()));
    if (std::min(up_less, down_less) > surprising * blur)
        shift_level(-std::min(up_less, down_less));
}

void EnvelopeFilter::shift_level(double by_ns) {
    if (square(by_ns) < square(shift_deviations) * matrix(state_)(3, 3)) return;
    state_.mean[3] += by_ns;
    matrix(state_)(3, 3) += square(by_ns);
}

void EnvelopeFilter::use(const OffsetSample& sample, DelayEdge& edge) {
    if (sample.at > reference_) {
        state_ = state_.after(sample.at - reference_);
        reference_ = sample.at;
    }
    edge.remember(sample, [&](const OffsetSample& p) { return delay_ns(p, edge); });
    if (sites_ != nullptr)
        sites_->push_back({sample, edge.direction(), edge.scale_ns(), restarts_});
    move(sample, edge);
}

/// Moments of the state given this delay.
void EnvelopeFilter::move(const OffsetSample& sample, const DelayEdge& edge) {
    const Duration since = sample.at - reference_;
    const StateVector direction = level_by_component(edge.sign(), since);
    const double blur = edge_blur(edge.scale_ns());
    const double excess = edge.sign() * relative_ns(sample) - direction.dot(vector(state_));
    const auto deviation = [&] {
        return std::sqrt(direction.dot(matrix(state_) * direction) + square(blur));
    };
    recent_surprises_ *= surprise_memory;
    if (excess < -surprising * deviation()) {
        ++surprises_;
        if (++recent_surprises_ > surprises_of_skew) {
            // One may be anything; several in a row say that a clock runs at another pace than it
            // did.
            matrix(state_)(1, 1) += square(excess / surprise_span_s);
            recent_surprises_ = 0;
        }
        matrix(state_) *= std::min(square(excess / (surprising * deviation())), most_inflation);
        // Without an end to them no component may grow beyond all that a first exchange leaves
        // open.
        if (matrix(state_)(1, 1) > square(largest_skew))
            state_.covariance =
                GaussianState::after_exchange(static_cast<double>(last_round_trip_.ns)).covariance;
    }
    const Influence influence =
        influence_of(excess, std::max(deviation(), -excess / surprising), edge.scale_ns());
    const StateVector gain = matrix(state_) * direction;
    vector(state_) += gain * (slot_share_ * influence.score);
    matrix(state_) -= slot_share_ * influence.curvature * gain * gain.transpose();
    // No delay is negative; left alone, both edges could slide below what they bound.
    if (state_.mean[3] < 0)
        vector(state_) -= matrix(state_).col(3) * (state_.mean[3] / matrix(state_)(3, 3));
    // What rounding makes unequal is never measured away, but surprises would inflate it.
    matrix(state_) = (0.5 * (matrix(state_) + matrix(state_).transpose())).eval();
}

void EnvelopeFilter::remember_round_trip(BoardTime now, Duration round_trip) {
    if ((now - window_begin_).ns > window_ns || now < window_begin_) {
        smallest_before_ = smallest_in_window_;
        smallest_in_window_ = {INT64_MAX};
        window_begin_ = now;
    }
    smallest_in_window_ = std::min(smallest_in_window_, round_trip);
}

Duration EnvelopeFilter::smallest_round_trip() const {
    return std::min(smallest_in_window_, smallest_before_);
}

double EnvelopeFilter::skew_sigma_ppm() const { return std::sqrt(matrix(state_)(1, 1)) * 1e-3; }

Duration EnvelopeFilter::presumed_asymmetry() const {
    if (asymmetry_) return {};
    return rounded((up_.overshoot_ns() - down_.overshoot_ns()) / 2);
}

HostEstimate EnvelopeFilter::translate(BoardTime board) const {
    HostEstimate estimate;
    if (reset_) estimate.state = ClockState::reset;
    if (!begun_ || !sane(board)) return estimate;
    const Duration since = board - reference_;
    const double variance = state_.offset_variance_after(since);
    const double offset = state_.offset_after(since);
    const Duration contradiction = std::max(contradiction_, doubt_);
    const double doubt = static_cast<double>(std::max(contradiction, allowance_).ns);
    const Duration asymmetry = asymmetry_ ? asymmetry_->offset : presumed_asymmetry();
    estimate.time = HostTime{board.ns} + base_ + rounded(offset) - asymmetry;
    estimate.sigma = rounded(
        std::sqrt(variance + asymmetry_variance(asymmetry_, state_.mean[3]) + square(doubt)));
    estimate.spread = rounded(std::sqrt(variance));
    estimate.bound = smallest_round_trip() / 2 + absolute(asymmetry) +
                     rounded(bound_sigmas * std::sqrt(variance) + doubt);
    if (contradiction.ns > 0)
        estimate.state = ClockState::step;
    else if ((board - last_contact_).ns > holdover_after_ns)
        estimate.state = ClockState::holdover;
    else
        estimate.state = slots_ < slots_to_lock || variance > square(locked_sigma_ns)
                             ? ClockState::converging
                             : ClockState::locked;
    return estimate;
}

}  // namespace versavis::clock

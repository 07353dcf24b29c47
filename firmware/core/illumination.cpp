// SPDX-License-Identifier: BSD-3-Clause
#include "illumination.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds lead_overlap =
    50'000;  // the lead lasts into the exposure, so that there is no gap when it begins
constexpr Nanoseconds start_patience =
    2'000'000;  // a camera that starts this late still gets light
constexpr Nanoseconds shortest_light = 10'000;
constexpr std::int64_t million = 1'000'000;

Nanoseconds max(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }
Nanoseconds min(Nanoseconds a, Nanoseconds b) { return a < b ? a : b; }

}  // namespace

Illumination::Illumination(OutputQueue& outputs, ChannelReports& reports)
    : outputs_(outputs), reports_(reports) {}

void Illumination::configure(const wire::IlluminationConfiguration& configuration,
                             Nanoseconds now) {
    stop(now);
    if (configuration.cameras != 0) {
        // A new configuration earns no light; the very first finds a full store.
        saved_ = configuration_.max_on_ns == 0 ? configuration.max_on_ns
                                               : min(budget(now), configuration.max_on_ns);
        saved_at_ = now;
        configuration_ = configuration;
    } else {
        configuration_.cameras = 0;
    }
}

void Illumination::stop(Nanoseconds now) {
    plan_count_ = 0;
    exposing_ = 0;
    outputs_.rest(output_light_lead, false, now);
    close_gate(now);
}

/// On-time that a span of time earns.
Nanoseconds Illumination::earned(Nanoseconds span) const {
    return span / million * configuration_.duty_ppm +
           span % million * configuration_.duty_ppm / million;
}

/// On-time available at `at`: never more than the longest single light.
Nanoseconds Illumination::budget(Nanoseconds at) const {
    return min(configuration_.max_on_ns, saved_ + earned(at - saved_at_));
}

void Illumination::plan(std::uint8_t camera, Nanoseconds start, Nanoseconds duration,
                        bool has_strobe, Nanoseconds now) {
    if (!lights(camera)) return;
    if (plan_count_ == max_plans)
        return reports_.event(wire::BoardEventKind::illumination_limited, camera, start, duration);
    const Nanoseconds on = start - configuration_.lead_ns;
    const Nanoseconds lead_off = start + (has_strobe ? lead_overlap : duration);
    std::size_t i = plan_count_++;
    for (; i > 0 && plans_[i - 1].on > on; --i) plans_[i] = plans_[i - 1];
    plans_[i] = {on, lead_off};
    set_leads(now);
    open_next(now);
}

/// The union of the leads of all plans that are not over; there is no edge where they overlap.
void Illumination::set_leads(Nanoseconds now) {
    bool on_now = outputs_.cancel(output_light_lead);
    for (std::size_t i = 0; i < plan_count_;) {
        const Nanoseconds on = plans_[i].on;
        Nanoseconds off = plans_[i].lead_off;
        for (++i; i < plan_count_ && plans_[i].on <= off; ++i) off = max(off, plans_[i].lead_off);
        if (off <= now) continue;
        if (on_now && on > now) outputs_.set(now, output_light_lead, false);
        on_now = false;
        outputs_.set(max(on, now), output_light_lead, true);
        outputs_.set(off, output_light_lead, false);
    }
}

void Illumination::edge(std::uint8_t camera, bool exposing) {
    if (!lights(camera)) return;
    const std::uint8_t bit = static_cast<std::uint8_t>(1U << camera);
    exposing_ = static_cast<std::uint8_t>(exposing ? exposing_ | bit : exposing_ & ~bit);
    over_ = exposing_ == 0;
}

/// Without an exposure line, its light is the lead.
Nanoseconds Illumination::awaited_until(const Plan& plan) {
    return max(plan.lead_off, plan.on + start_patience);
}

/// Plans whose exposures may still come: an edge that is not known yet may begin one.
void Illumination::forget_past(Nanoseconds settled) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < plan_count_; ++i) {
        if (plans_[i].lead_off > settled)
            plans_[kept++] = plans_[i];
        else
            awaited_until_ = max(awaited_until_, awaited_until(plans_[i]));
    }
    plan_count_ = kept;
}

bool Illumination::exposes_before(Nanoseconds at) const {
    return plan_count_ > 0 && plans_[0].on <= at;
}

void Illumination::open_next(Nanoseconds now) {
    if (!open() && plan_count_ > 0) open_gate(max(max(plans_[0].on, dark_until_), now));
}

void Illumination::open_gate(Nanoseconds on) {
    const Nanoseconds allowed = budget(on);
    if (allowed < shortest_light + configuration_.lead_ns) {
        reports_.event(wire::BoardEventKind::illumination_limited, output_light_gate, on, 0);
        --plan_count_;  // it stays dark
        for (std::size_t i = 0; i < plan_count_; ++i) plans_[i] = plans_[i + 1];
        return;
    }
    gate_on_ = outputs_.set(on, output_light_gate, true);
    gate_off_ = outputs_.set(gate_on_ + allowed, output_light_gate, false);
    last_off_ = gate_off_;
    saved_ = earned(allowed);  // all counts as spent, until it is known how much really was
    saved_at_ = gate_off_;
}

void Illumination::close_gate(Nanoseconds now) {
    if (!open()) return;
    const Nanoseconds closed =
        min(gate_off_, max(outputs_.rest(output_light_gate, false, now), gate_on_));
    const Nanoseconds unused = gate_off_ - closed;
    last_off_ = closed;
    saved_ += unused - earned(unused);  // what a late end cost is already subtracted
    saved_at_ = closed;
    gate_off_ = never;
}

void Illumination::edges_lost(std::uint32_t lines) {
    exposing_ = static_cast<std::uint8_t>(exposing_ & ~lines);
    over_ = false;
}

void Illumination::moved(bool open, Nanoseconds asked, Nanoseconds left) {
    if (!open && asked == last_off_) saved_ -= min(left - asked, configuration_.max_on_ns);
}

void Illumination::poll(Nanoseconds now, Nanoseconds settled) {
    if (open() && gate_off_ <= settled) {
        bool wanted = exposing_ != 0;
        for (std::size_t i = 0; i < plan_count_; ++i)
            wanted = wanted || (plans_[i].on < gate_off_ && plans_[i].lead_off > gate_off_);
        if (wanted) {
            reports_.event(wire::BoardEventKind::illumination_limited, output_light_gate, gate_off_,
                           gate_off_ - gate_on_);
            dark_until_ = gate_off_ + configuration_.max_on_ns / 10;
        }
        gate_off_ = never;
    } else if (open() && exposing_ == 0 &&
               (next_end() <= settled ||
                (over_ && gate_on_ <= settled && !exposes_before(outputs_.soonest(now))))) {
        close_gate(now);
    }
    if (!open() || gate_on_ > settled) over_ = false;  // an exposure without this light ended
    forget_past(settled);
    open_next(now);
}

Nanoseconds Illumination::next_end() const {
    if (!open()) return never;
    if (exposing_ != 0) return gate_off_;
    // No exposure came: the gate need not stay open.
    Nanoseconds last = awaited_until_;
    for (std::size_t i = 0; i < plan_count_; ++i) last = max(last, awaited_until(plans_[i]));
    return min(gate_off_, last);
}

}  // namespace versavis::firmware

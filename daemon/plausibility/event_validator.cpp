// SPDX-License-Identifier: BSD-3-Clause
#include "event_validator.hpp"

#include "arrival_check.hpp"

namespace versavis::daemon {

namespace {

/// How far the second pulse may be off a second from the first: the board's crystal, a receiver
/// that settles.
constexpr Duration first_pps_tolerance = microseconds(200);

/// Over lost pulses the board's crystal drifts by no more than 10 ppm.
constexpr std::int64_t crystal_parts = 100'000;

/// Pulses that agree until one is believed: the first has no neighbour.
constexpr int pulses_to_confirm = 2;

}  // namespace

EventValidator::EventValidator(const clock::Translator& translator)
    : translator_(translator),
      pps_(PulseHistory(seconds(1), first_pps_tolerance, crystal_parts), pulses_to_confirm) {}

std::optional<Implausibility> EventValidator::judge(const wire::Event& event, HostTime received) {
    const Pulse pulse{static_cast<std::uint32_t>(event.value), BoardTime{event.time_ns}};
    if (const auto doubt = contradicts_arrival(pulse.at, received, translator_)) return doubt;
    if (event.kind != wire::BoardEventKind::pps) return std::nullopt;
    const clock::ClockContact contact = translator_.contact();
    if (contact.life != clock_life_) pps_.forget();
    clock_life_ = contact.life;
    const auto doubt = pps_.judge(pulse, contact.exchanges);
    if (!doubt && !pps_.confirmed()) return Implausibility{EventReason::unproved, event.time_ns, 0};
    if (!doubt || !pps_.stepped(contact.exchanges)) return doubt;
    pps_.adopt(pulse);
    return std::nullopt;
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "event_witness.hpp"

#include "arrival_check.hpp"

namespace versavis::daemon {

namespace {

/// How far the second pulse may be off a second from the first: the board's crystal, a receiver
/// that settles. At half, receivers that settle slowly lose pulses; at twice, such a lie may pass.
constexpr Duration first_pps_tolerance = microseconds(200);

/// Over lost pulses the board's crystal drifts by no more than 10 ppm. At half, one that warms up
/// is doubted after a gap; at twice, such a pulse may be off by 20 us per second of the gap.
constexpr std::int64_t crystal_parts = 100'000;

/// Pulses that agree until one is believed: the first has no neighbour. At half (1), it may be off
/// by as much as the link is late; at twice, PPS is used two seconds later.
constexpr int pulses_to_confirm = 2;

}  // namespace

EventWitness::EventWitness(const clock::Translator& translator)
    : translator_(translator),
      pps_(PulseHistory(seconds(1), first_pps_tolerance, crystal_parts), pulses_to_confirm) {}

std::optional<Doubt> EventWitness::judge(const wire::Event& event, HostTime received) {
    const Pulse pulse{static_cast<std::uint32_t>(event.value), BoardTime{event.time_ns}};
    if (const auto doubt = contradicts_arrival(pulse.at, received, translator_)) return doubt;
    if (event.kind != wire::EventKind::pps) return std::nullopt;
    const clock::ClockContact contact = translator_.contact();
    if (contact.life != clock_life_) pps_.forget();
    clock_life_ = contact.life;
    const auto doubt = pps_.judge(pulse, contact.exchanges);
    if (!doubt && !pps_.confirmed()) return Doubt{EventReason::unproved, event.time_ns, 0};
    if (!doubt || !pps_.stepped(contact.exchanges)) return doubt;
    pps_.adopt(pulse);
    return std::nullopt;
}

}  // namespace versavis::daemon

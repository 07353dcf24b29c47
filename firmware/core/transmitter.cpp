// SPDX-License-Identifier: BSD-3-Clause
#include "transmitter.hpp"

namespace versavis::firmware {

namespace {

/// 0, for unknown, when the age is negative or does not fit the field.
std::uint32_t age(Nanoseconds of, Nanoseconds now) {
    const Nanoseconds passed = now - of;
    return passed < 0 || passed > UINT32_MAX ? 0 : static_cast<std::uint32_t>(passed);
}

}  // namespace

void Transmitter::begin() {
    hellos_.clear();
    refusals_.clear();
    answers_.clear();
    follow_ups_.clear();
    clock_answers_.clear();
    exposures_.clear();
    events_.clear();
    healths_.clear();
    samples_.clear();
    logs_.clear();
    frame_.bytes[0] = 0;  // ends the packet that was being written
    frame_.size = 1;
    written_ = 0;
    answering_ = watching_ = false;
}

std::size_t Transmitter::waiting_packets() const {
    return hellos_.size() + refusals_.size() + answers_.size() + follow_ups_.size() +
           clock_answers_.size() + exposures_.size() + events_.size() + healths_.size() +
           samples_.size() + logs_.size();
}

template <class Queue>
bool Transmitter::stage_first_of(Queue& queue) {
    if (queue.empty()) return false;
    wire::encode(queue.front(), nonce_, sequence_++, frame_);
    written_ = 0;
    queue.pop();
    return true;
}

/// The packet that matters most.
void Transmitter::stage() {
    stamp();
    if (stage_first_of(hellos_) || stage_first_of(follow_ups_)) return;
    answering_ = !clock_answers_.empty();
    if (answering_) answer_id_ = clock_answers_.front().id;
    if (stage_first_of(clock_answers_) || stage_first_of(refusals_) || stage_first_of(answers_) ||
        stage_first_of(exposures_) || stage_first_of(events_) || stage_first_of(healths_) ||
        stage_first_of(samples_))
        return;
    stage_first_of(logs_);
}

/// The packet staged next carries the current time.
void Transmitter::stamp() {
    const Nanoseconds now = clock_.now();
    if (!clock_answers_.empty()) clock_answers_.front().sent_ns = now;
    if (!samples_.empty()) samples_.front().departure_ns = age(samples_.front().time_ns, now);
}

void Transmitter::follow_up() {
    Nanoseconds left = 0;
    if (!watching_ || !link_.take_departure(left)) return;
    watching_ = false;
    follow_ups_.push(wire::ClockFollowUp{watched_id_, 0, left});
}

bool Transmitter::pump() {
    follow_up();
    const std::size_t waiting = waiting_packets();
    if (waiting > high_water_) high_water_ = waiting;
    std::size_t budget = bytes_a_pump;
    while (written_ < frame_.size || waiting_packets() != 0) {
        const std::size_t free = link_.free_space();
        const std::size_t space = free < budget ? free : budget;
        if (space == 0) return budget == 0;
        if (written_ == frame_.size) stage();
        const std::size_t left = frame_.size - written_;
        const std::size_t size = left < space ? left : space;
        link_.write(frame_.bytes + written_, size);
        written_ += size;
        budget -= size;
        if (!answering_ || written_ < frame_.size) continue;
        link_.watch_departure();
        watched_id_ = answer_id_;
        answering_ = false;
        watching_ = true;
    }
    return false;
}

void Transmitter::count_drops(wire::Health& health) const {
    health.dropped_exposures = exposures_.dropped();
    health.dropped_clock_answers = clock_answers_.dropped();
    health.dropped_events = events_.dropped();
    health.dropped_imu_samples = samples_.dropped();
    health.dropped_logs = logs_.dropped();
}

std::uint32_t Transmitter::take_high_water() {
    const std::size_t most = high_water_;
    high_water_ = 0;
    return static_cast<std::uint32_t>(most);
}

}  // namespace versavis::firmware

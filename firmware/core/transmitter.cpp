// SPDX-License-Identifier: BSD-3-Clause
#include "transmitter.hpp"

namespace versavis::firmware {

namespace {

/// 0, for unknown, when the age is negative or does not fit the field.
std::uint32_t age(Nanoseconds of, Nanoseconds now) {
    const auto passed = static_cast<std::uint64_t>(now - of);
    return passed > UINT32_MAX ? 0 : static_cast<std::uint32_t>(passed);
}

}  // namespace

Transmitter::Transmitter(ByteLink& link, Clock64& clock, std::uint32_t nonce)
    : link_(link), clock_(clock), nonce_(nonce) {}

void Transmitter::begin() {
    for (Waiting& waiting : waiting_) waiting.count = 0;
    total_ = 0;
    frame_.bytes[0] = 0;  // ends the packet that was being written
    frame_.size = 1;
    written_ = 0;
    answering_ = watching_ = false;
}

std::uint8_t* Transmitter::place(unsigned queue, unsigned index) {
    const MessageQueue& kind = message_queues[queue];
    if (index >= kind.capacity) index -= kind.capacity;
    return messages_ + kind.offset + index * kind.message_size;
}

void Transmitter::push(unsigned queue, const void* message) {
    const MessageQueue& kind = message_queues[queue];
    Waiting& waiting = waiting_[queue];
    if (waiting.count == kind.capacity) {
        pop(queue);
        ++waiting.dropped;
    }
    std::memcpy(place(queue, waiting.first + waiting.count), message, kind.message_size);
    ++waiting.count;
    ++total_;
    if (total_ > high_water_) high_water_ = total_;
}

void Transmitter::pop(unsigned queue) {
    Waiting& waiting = waiting_[queue];
    if (++waiting.first == message_queues[queue].capacity) waiting.first = 0;
    --waiting.count;
    --total_;
}

/// The packet that matters most of those that wait.
void Transmitter::stage() {
    unsigned queue = 0;
    while (waiting_[queue].count == 0) ++queue;
    const MessageQueue& kind = message_queues[queue];
    std::uint8_t* const message = place(queue, waiting_[queue].first);
    stamp(queue, message);
    wire::encode(kind.type, message, kind.message_size, nonce_, sequence_++, frame_);
    written_ = 0;
    pop(queue);
}

template <class Message>
constexpr bool is_aligned() {
    constexpr MessageQueue queue = message_queues[queue_of(Message::type)];
    return queue.offset % alignof(Message) == 0;
}
static_assert(is_aligned<wire::ClockAnswer>() && is_aligned<wire::ImuSample>());

/// With the current time.
void Transmitter::stamp(unsigned queue, std::uint8_t* message) {
    if (queue == queue_of(wire::Type::clock_answer)) {
        auto& answer = *reinterpret_cast<wire::ClockAnswer*>(message);
        answer.sent_ns = clock_.now();
        answer_id_ = answer.id;
        answering_ = true;
    } else if (queue == queue_of(wire::Type::imu_sample)) {
        auto& sample = *reinterpret_cast<wire::ImuSample*>(message);
        sample.departure_ns = age(sample.time_ns, clock_.now());
    }
}

void Transmitter::follow_up() {
    Nanoseconds left = 0;
    if (!watching_ || !link_.take_departure(left)) return;
    watching_ = false;
    send(wire::ClockFollowUp{watched_id_, 0, left});
}

bool Transmitter::pump() {
    follow_up();
    std::size_t budget = bytes_a_pump;
    while (written_ < frame_.size || total_ != 0) {
        const std::size_t free = link_.free_space();
        const std::size_t space = free < budget ? free : budget;
        if (space == 0) return free != 0;
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
    const auto dropped = [this](wire::Type type) { return waiting_[queue_of(type)].dropped; };
    health.dropped_exposures = dropped(wire::Type::exposure);
    health.dropped_clock_answers = dropped(wire::Type::clock_answer);
    health.dropped_events = dropped(wire::Type::event);
    health.dropped_imu_samples = dropped(wire::Type::imu_sample);
    health.dropped_logs = dropped(wire::Type::log);
}

std::uint32_t Transmitter::take_high_water() {
    const std::uint32_t most = high_water_;
    high_water_ = total_;
    return most;
}

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// Packets that wait for the host, by class: when it does not read, the newest of each class are
// kept, and the missing ones are counted.
#pragma once

#include "hal.hpp"
#include "wire/packet.hpp"

namespace versavis::firmware {

/// First in, first out; when full, the oldest is dropped.
template <class Message, std::size_t Capacity>
class MessageQueue {
 public:
    void push(const Message& message) {
        if (size_ == Capacity) {
            pop();
            ++dropped_;
        }
        messages_[(first_ + size_) % Capacity] = message;
        ++size_;
    }
    bool empty() const { return size_ == 0; }
    std::size_t size() const { return size_; }
    Message& front() { return messages_[first_]; }
    void pop() {
        first_ = (first_ + 1) % Capacity;
        --size_;
    }
    void clear() { size_ = 0; }
    std::uint32_t dropped() const { return dropped_; }

 private:
    Message messages_[Capacity] = {};
    std::size_t first_ = 0;
    std::size_t size_ = 0;
    std::uint32_t dropped_ = 0;
};

/// Sends what matters most first: answers, exposures, events, health, samples, text. Packets are
/// numbered as they leave, so that a gap is a loss on the line.
class Transmitter {
 public:
    Transmitter(ByteLink& link, Clock64& clock, std::uint32_t nonce)
        : link_(link), clock_(clock), nonce_(nonce) {}

    /// A new connection: what is waiting was meant for the previous one.
    void begin();

    void send(const wire::BoardHello& message) { hellos_.push(message); }
    void send(const wire::Refusal& message) { refusals_.push(message); }
    void send(const wire::ConfigurationAnswer& message) { answers_.push(message); }
    /// Its time of sending is filled in when it is handed to the link; a second message says when
    /// it really left.
    void send(const wire::ClockAnswer& message) { clock_answers_.push(message); }
    void send(const wire::Exposure& message) { exposures_.push(message); }
    void send(const wire::Event& message) { events_.push(message); }
    void send(const wire::Health& message) { healths_.push(message); }
    /// Its age is filled in when it leaves.
    void send(const wire::ImuSample& message) { samples_.push(message); }
    void send(const wire::Log& message) { logs_.push(message); }

    /// Writes as much as the link accepts, and at most `bytes_a_pump`. True: it would accept more.
    bool pump();

    void count_drops(wire::Health& health) const;
    /// High-water mark of waiting packets since the last call.
    std::uint32_t take_high_water();

 private:
    /// Bounds the work of one poll: four packets of USB. At half, a poll more is needed for a
    /// burst; at twice, a poll takes longer.
    static constexpr std::size_t bytes_a_pump = 256;

    std::size_t waiting_packets() const;
    void follow_up();
    void stamp();
    void stage();
    template <class Queue>
    bool stage_first_of(Queue& queue);

    ByteLink& link_;
    Clock64& clock_;
    std::uint32_t nonce_;
    std::uint32_t sequence_ = 0;
    std::size_t high_water_ = 0;
    wire::Frame frame_{};      ///< the packet that is being written
    std::size_t written_ = 0;  ///< of its bytes
    bool answering_ = false;   ///< it is a clock answer
    bool watching_ = false;    ///< the link was asked when an answer leaves
    std::uint32_t answer_id_ = 0;
    std::uint32_t watched_id_ = 0;

    MessageQueue<wire::BoardHello, 1> hellos_;
    MessageQueue<wire::Refusal, 48> refusals_;
    MessageQueue<wire::ConfigurationAnswer, 1> answers_;
    MessageQueue<wire::ClockFollowUp, 1> follow_ups_;
    MessageQueue<wire::ClockAnswer, 8> clock_answers_;
    MessageQueue<wire::Exposure, 256> exposures_;
    MessageQueue<wire::Event, 128> events_;
    MessageQueue<wire::Health, 1> healths_;
    MessageQueue<wire::ImuSample, 256> samples_;
    MessageQueue<wire::Log, 8> logs_;
};

}  // namespace versavis::firmware

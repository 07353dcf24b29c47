// SPDX-License-Identifier: BSD-3-Clause
// Packets that wait for the host, by class: when it does not read, the newest of each class are
// kept, and the missing ones are counted.
#pragma once

#include <array>

#include "base/hal.hpp"
#include "wire/packet.hpp"

namespace versavis::firmware {

/// Messages of one type that wait, first in, first out; when they are too many, the oldest is
/// dropped.
struct MessageQueue {
    wire::Type type;
    std::uint16_t capacity;
    std::uint16_t message_size;
    std::uint32_t offset;  ///< of its place among all that wait
};

constexpr auto make_message_queues() {
    // What matters most leaves first.
    std::array<MessageQueue, 11> queues{{{wire::Type::board_hello, 1, 0, 0},
                                         {wire::Type::clock_follow_up, 1, 0, 0},
                                         {wire::Type::clock_answer, 8, 0, 0},
                                         {wire::Type::refusal, 48, 0, 0},
                                         {wire::Type::exposure, 256, 0, 0},
                                         {wire::Type::event, 128, 0, 0},
                                         {wire::Type::configuration_answer, 1, 0, 0},
                                         {wire::Type::health, 1, 0, 0},
                                         {wire::Type::imu_sample, 256, 0, 0},
                                         {wire::Type::sentence, 32, 0, 0},
                                         {wire::Type::log, 8, 0, 0}}};
    std::uint32_t offset = 0;
    for (MessageQueue& queue : queues) {
        queue.message_size = wire::payload_size(queue.type);
        queue.offset = offset;
        offset += std::uint32_t{queue.capacity} * queue.message_size;
    }
    return queues;
}

inline constexpr auto message_queues = make_message_queues();

constexpr unsigned queue_of(wire::Type type) {
    unsigned queue = 0;
    while (message_queues[queue].type != type) ++queue;
    return queue;
}

/// Sends what matters most first: answers, exposures, events, health, samples, sentences, text.
/// Packets are numbered as they leave, so that a gap is a loss on the line.
class Transmitter {
 public:
    Transmitter(ByteLink& link, Clock64& clock, std::uint32_t nonce);

    /// A new connection: what is waiting was meant for the previous one.
    void begin();

    /// Of a clock answer, the time of sending is filled in when it is handed to the link, and a
    /// second message reports when it really left; of a sample, its age when it leaves.
    template <class Message>
    void send(const Message& message) {
        constexpr unsigned queue = queue_of(Message::type);
        push(queue, &message);
    }

    /// Writes as much as the link accepts, and at most `bytes_a_pump`. True: it would accept more.
    bool pump();

    void count_drops(wire::Health& health) const;
    /// High-water mark of waiting packets since the last call.
    std::uint32_t take_high_water();

 private:
    /// Bounds the work of one poll: four packets of USB. If lower, a poll more is needed for a
    /// burst.
    static constexpr std::size_t bytes_a_pump = 256;

    struct Waiting {
        std::uint16_t first = 0;
        std::uint16_t count = 0;
        std::uint32_t dropped = 0;
    };

    void push(unsigned queue, const void* message);
    void pop(unsigned queue);
    std::uint8_t* place(unsigned queue, unsigned index);
    void follow_up();
    void stamp(unsigned queue, std::uint8_t* message);
    void stage();

    ByteLink& link_;
    Clock64& clock_;
    std::uint32_t nonce_;
    std::uint32_t sequence_ = 0;
    std::uint32_t high_water_ = 0;
    wire::Frame frame_{};      ///< the packet that is being written
    std::size_t written_ = 0;  ///< of its bytes
    bool answering_ = false;   ///< it is a clock answer
    bool watching_ = false;    ///< the link was asked when an answer leaves
    std::uint32_t answer_id_ = 0;
    std::uint32_t watched_id_ = 0;

    std::uint32_t total_ = 0;  ///< packets that wait
    Waiting waiting_[message_queues.size()];
    alignas(8)
        std::uint8_t messages_[message_queues.back().offset +
                               message_queues.back().capacity * message_queues.back().message_size];
};

}  // namespace versavis::firmware

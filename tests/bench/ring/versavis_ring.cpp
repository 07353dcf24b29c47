// SPDX-License-Identifier: BSD-3-Clause
#include <sys/mman.h>

#include <climits>
#include <stdexcept>
#include <thread>
#include <vector>

#include "client/futex.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"
#include "transport.hpp"
#include "versavis/ring_reader.hpp"

namespace versavis::bench {

namespace {

constexpr auto ring_name = "ring";
constexpr unsigned crowd_size = 1000;

template <class T>
T checked(Expected<T> made) {
    if (!made) throw std::runtime_error(made.error().message());
    return std::move(*made);
}

ring::Shape shape_of(const Channel& channel) {
    if (channel.size == imu_size) return {ring_name, ring::StreamKind::imu, 4096};
    return {ring_name, ring::StreamKind::frames, 64, frame_slots, channel.size};
}

ring::Shape shape_without_history(const Channel& channel) {
    ring::Shape shape = shape_of(channel);
    shape.kept = ring::newest_kept;
    shape.descriptor_count = ring::descriptors_of_kept(shape.kept);
    return shape;
}

class RingSender : public Sender {
 public:
    RingSender(const Channel& channel, const ring::Shape& shape, bool is_sealed = false)
        : size_(static_cast<std::uint32_t>(channel.size)),
          writer_(checked(ring::Writer::create({channel.directory, is_sealed}, shape))) {}

    std::byte* loan() override {
        // As often as the service does, and like there not within the publication.
        if (const HostTime now = host_now(); now > beaten_ + milliseconds(50)) {
            writer_.heartbeat(now);
            beaten_ = now;
        }
        if (size_ == imu_size) return reinterpret_cast<std::byte*>(sample_.data());
        slot_ = writer_.acquire().value();
        return writer_.slot_data(slot_);
    }

    void publish() override {
        if (size_ == imu_size)
            writer_.publish({}, sample_);
        else
            writer_.publish(slot_, size_, {}, {});
    }

 private:
    std::uint32_t size_;
    ring::Writer writer_;
    ring::Metadata sample_{};
    std::uint32_t slot_ = 0;
    HostTime beaten_{};
};

class RingReceiver : public Receiver {
 public:
    explicit RingReceiver(const Channel& channel)
        : polling_(channel.polling),
          reader_(checked(ring::Reader::open(channel.directory / ring_name))) {}

    const std::byte* receive() override {
        item_ = polling_ ? reader_.next() : reader_.next(milliseconds(20));
        if (!item_) return nullptr;
        return item_->payload.size() > 0 ? item_->payload.data()
                                         : reinterpret_cast<const std::byte*>(&item_->metadata);
    }

    bool valid() override { return item_->valid(); }

 private:
    bool polling_;
    ring::Reader reader_;
    ring::Received item_ = Unexpected<ring::NoItem>({});
};

class Crowd : public Receiver {
 public:
    explicit Crowd(const Channel& channel)
        : mapping_(checked(ring::Mapping::open(channel.directory / ring_name,
                                               ring::Mapping::Access::read_only))) {
        for (unsigned i = 0; i < crowd_size; ++i)
            threads_.emplace_back([this] { wait_in_a_loop(); });
    }
    ~Crowd() override {
        stop_ = true;
        ring::futex_wake(mapping_.header().wake, INT_MAX);
        for (std::thread& thread : threads_) thread.join();
    }

    const std::byte* receive() override {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        return nullptr;
    }

 private:
    void wait_in_a_loop() const {
        const auto& word = mapping_.header().wake;
        while (!stop_) ring::futex_wait(word, word.load(), 1'000'000'000);
    }

    ring::Mapping mapping_;
    std::atomic<bool> stop_{false};
    std::vector<std::thread> threads_;
};

std::unique_ptr<Sender> sender(const Channel& channel) {
    return std::make_unique<RingSender>(channel, shape_of(channel));
}

std::unique_ptr<Sender> sender_without_history(const Channel& channel) {
    return std::make_unique<RingSender>(channel, shape_without_history(channel));
}

std::unique_ptr<Sender> sender_of_sealed(const Channel& channel) {
    return std::make_unique<RingSender>(channel, shape_of(channel), true);
}

std::unique_ptr<Receiver> receiver(const Channel& channel, unsigned) {
    return std::make_unique<RingReceiver>(channel);
}

std::unique_ptr<Receiver> receiver_or_crowd(const Channel& channel, unsigned reader) {
    if (reader == 0) return receiver(channel, 0);
    return std::make_unique<Crowd>(channel);
}

}  // namespace

Transport versavis_ring() { return {"ring", sender, receiver}; }
Transport ring_without_history() { return {without_history, sender_without_history, receiver}; }
Transport sealed_ring() { return {sealed, sender_of_sealed, receiver}; }
Transport crowded_ring() { return {"ring among a crowd", sender, receiver_or_crowd}; }

}  // namespace versavis::bench

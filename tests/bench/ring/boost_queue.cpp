// SPDX-License-Identifier: BSD-3-Clause
#include <boost/date_time/posix_time/posix_time_types.hpp>
#include <boost/interprocess/ipc/message_queue.hpp>
#include <vector>

#include "transport.hpp"

namespace versavis::bench {

namespace {

namespace ipc = boost::interprocess;

/// Queues have names of their own below /dev/shm.
std::string queue_name(const Channel& channel) {
    return channel.directory.filename().string() + ".queue";
}

class QueueSender : public Sender {
 public:
    explicit QueueSender(const Channel& channel)
        : name_(queue_name(channel)),
          queue_(ipc::create_only, name_.c_str(), frame_slots, channel.size),
          item_(channel.size) {}
    ~QueueSender() override { ipc::message_queue::remove(name_.c_str()); }
    std::byte* loan() override { return item_.data(); }
    void publish() override { queue_.send(item_.data(), item_.size(), 0); }

 private:
    std::string name_;
    ipc::message_queue queue_;
    std::vector<std::byte> item_;
};

class QueueReceiver : public Receiver {
 public:
    explicit QueueReceiver(const Channel& channel)
        : queue_(ipc::open_only, queue_name(channel).c_str()), item_(channel.size) {}
    const std::byte* receive() override {
        using namespace boost::posix_time;
        ipc::message_queue::size_type size = 0;
        unsigned priority = 0;
        const ptime until = microsec_clock::universal_time() + milliseconds(20);
        const bool got = queue_.timed_receive(item_.data(), item_.size(), size, priority, until);
        return got ? item_.data() : nullptr;
    }

 private:
    ipc::message_queue queue_;
    std::vector<std::byte> item_;
};

std::unique_ptr<Sender> sender(const Channel& channel) {
    return std::make_unique<QueueSender>(channel);
}

std::unique_ptr<Receiver> receiver(const Channel& channel, unsigned) {
    return std::make_unique<QueueReceiver>(channel);
}

}  // namespace

Transport boost_queue() { return {"Boost message_queue", sender, receiver, 1}; }

}  // namespace versavis::bench

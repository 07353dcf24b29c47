// SPDX-License-Identifier: BSD-3-Clause
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <climits>
#include <cstring>
#include <fstream>

#include "client/futex.hpp"
#include "transport.hpp"

namespace versavis::bench {

namespace {

namespace ipc = boost::interprocess;

/// A file in shared memory: two words, then the items.
class Memory {
 public:
    Memory(const Channel& channel, ipc::mode_t mode, bool create)
        : stride_((channel.size + 4095) / 4096 * 4096) {
        const auto path = channel.directory / "bare";
        if (create) {
            std::ofstream(path).flush();
            std::filesystem::resize_file(path, 4096 + frame_slots * stride_);
        }
        region_ = {ipc::file_mapping(path.c_str(), mode), mode, 0, 0, nullptr, MAP_POPULATE};
        if (create) std::memset(item(0), 1, frame_slots * stride_);
    }

    std::byte* item(std::uint32_t number) const {
        return bytes() + 4096 + number % frame_slots * stride_;
    }
    std::atomic<std::uint32_t>& count() const {
        return *reinterpret_cast<std::atomic<std::uint32_t>*>(bytes());
    }
    std::atomic<std::int64_t>& stamp() const {
        return *reinterpret_cast<std::atomic<std::int64_t>*>(bytes() + 128);
    }

 private:
    std::byte* bytes() const { return static_cast<std::byte*>(region_.get_address()); }

    std::size_t stride_;
    ipc::mapped_region region_;
};

class FutexSender : public Sender {
 public:
    explicit FutexSender(const Channel& channel) : memory_(channel, ipc::read_write, true) {}
    std::byte* loan() override { return memory_.item(memory_.count().load()); }
    void publish() override {
        memory_.count().fetch_add(1, std::memory_order_release);
        ring::futex_wake(memory_.count(), INT_MAX);
    }

 private:
    Memory memory_;
};

class FutexReceiver : public Receiver {
 public:
    explicit FutexReceiver(const Channel& channel) : memory_(channel, ipc::read_only, false) {}
    const std::byte* receive() override {
        if (!come()) ring::futex_wait(memory_.count(), seen_, ring::longest_sleep_ns);
        return come() ? memory_.item(seen_++) : nullptr;
    }

 private:
    bool come() const { return memory_.count().load(std::memory_order_acquire) != seen_; }

    Memory memory_;
    std::uint32_t seen_ = memory_.count().load();
};

class WordSender : public Sender {
 public:
    explicit WordSender(const Channel& channel) : memory_(channel, ipc::read_write, true) {}
    std::byte* loan() override { return reinterpret_cast<std::byte*>(&item_); }
    void publish() override { memory_.stamp().store(item_[0], std::memory_order_release); }

 private:
    Memory memory_;
    std::array<std::int64_t, imu_size / 8> item_{};
};

class WordReceiver : public Receiver {
 public:
    explicit WordReceiver(const Channel& channel) : memory_(channel, ipc::read_only, false) {}
    const std::byte* receive() override {
        const std::int64_t stamp = memory_.stamp().load(std::memory_order_acquire);
        if (stamp == item_[0]) return nullptr;
        item_[0] = stamp;
        return reinterpret_cast<const std::byte*>(&item_);
    }

 private:
    Memory memory_;
    std::array<std::int64_t, imu_size / 8> item_{memory_.stamp().load()};
};

template <class T>
std::unique_ptr<Sender> sender(const Channel& channel) {
    return std::make_unique<T>(channel);
}

template <class T>
std::unique_ptr<Receiver> receiver(const Channel& channel, unsigned) {
    return std::make_unique<T>(channel);
}

}  // namespace

Transport bare_futex() { return {"bare futex", sender<FutexSender>, receiver<FutexReceiver>}; }
Transport shared_word() { return {"shared word", sender<WordSender>, receiver<WordReceiver>}; }

}  // namespace versavis::bench

// SPDX-License-Identifier: BSD-3-Clause
#include "transport.hpp"

#ifdef VERSAVIS_BENCH_ZEROMQ
#include <vector>
#include <zmq.hpp>
#endif

namespace versavis::bench {

#ifdef VERSAVIS_BENCH_ZEROMQ

namespace {

std::string address(const Channel& channel) {
    return "ipc://" + (channel.directory / "zeromq").string();
}

class ZeromqSender : public Sender {
 public:
    explicit ZeromqSender(const Channel& channel) : item_(channel.size) {
        socket_.bind(address(channel));
    }
    std::byte* loan() override { return item_.data(); }
    void publish() override { socket_.send(zmq::buffer(item_), zmq::send_flags::none); }

 private:
    zmq::context_t context_;
    zmq::socket_t socket_{context_, zmq::socket_type::push};
    std::vector<std::byte> item_;
};

class ZeromqReceiver : public Receiver {
 public:
    explicit ZeromqReceiver(const Channel& channel) {
        socket_.set(zmq::sockopt::rcvtimeo, 20);
        socket_.connect(address(channel));
    }
    const std::byte* receive() override {
        return socket_.recv(item_) ? item_.data<std::byte>() : nullptr;
    }

 private:
    zmq::context_t context_;
    zmq::socket_t socket_{context_, zmq::socket_type::pull};
    zmq::message_t item_;
};

std::unique_ptr<Sender> sender(const Channel& channel) {
    return std::make_unique<ZeromqSender>(channel);
}

std::unique_ptr<Receiver> receiver(const Channel& channel, unsigned) {
    return std::make_unique<ZeromqReceiver>(channel);
}

}  // namespace

std::optional<Transport> zeromq() { return Transport{"ZeroMQ ipc", sender, receiver, 1}; }

#else

std::optional<Transport> zeromq() { return std::nullopt; }

#endif

}  // namespace versavis::bench

// SPDX-License-Identifier: BSD-3-Clause
#include "camera/message_channel.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <condition_variable>
#include <mutex>

using namespace versavis;
using namespace versavis::daemon;

namespace {

/// ExposureEnd of a Blackfly S by its description (id 9C43), of frame 7 at tick 2^32 + 5.
const std::vector<std::uint8_t> exposure_end{0x42, 1, 0, 0xC0, 0, 16, 0x12, 0x34, 0, 0, 0x9C, 0x43,
                                             0,    0, 0, 7,    0, 0,  0,    1,    0, 0, 0,    5};

std::vector<std::uint8_t> extended_data() {
    std::vector<std::uint8_t> packet{0x42, 0x10, 0, 0xC2, 0, 28, 0, 9, 0, 28, 0, 4, 0, 0, 0, 0};
    for (int i = 0; i < 7; ++i) packet.push_back(0);
    packet.push_back(0x21);  // block id
    for (int i = 0; i < 7; ++i) packet.push_back(0);
    packet.push_back(0x43);                              // ticks
    for (int i = 0; i < 4; ++i) packet.push_back(0xEE);  // data
    return packet;
}

class AnsweringCamera {
 public:
    AnsweringCamera() : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {}
    ~AnsweringCamera() { ::close(socket_); }

    void send_from(const char* address, std::uint16_t port, std::span<const std::uint8_t> packet) {
        sockaddr_in own = at(address, 0);
        if (bound_.empty()) ::bind(socket_, reinterpret_cast<sockaddr*>(&own), sizeof own);
        bound_ = address;
        const sockaddr_in to = at("127.0.0.1", port);
        ::sendto(socket_, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                 sizeof to);
    }

    std::vector<std::uint8_t> answer() const {
        std::vector<std::uint8_t> bytes(100);
        const ssize_t size = ::recv(socket_, bytes.data(), bytes.size(), 0);
        bytes.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
        return bytes;
    }

 private:
    static sockaddr_in at(const char* address, std::uint16_t port) {
        sockaddr_in made{};
        made.sin_family = AF_INET;
        made.sin_port = htons(port);
        inet_pton(AF_INET, address, &made.sin_addr);
        return made;
    }

    int socket_;
    std::string bound_;
};

}  // namespace

TEST_CASE("message_channel: an event has a number, a frame and a time") {
    const auto packet = parse_events(exposure_end);
    REQUIRE(packet);
    CHECK(packet->acknowledge);
    CHECK(packet->request == 0x1234);
    REQUIRE(packet->items.size() == 1);
    CHECK(packet->items[0].id == 0x9C43);
    CHECK(packet->items[0].block_id == 7);
    CHECK(packet->items[0].ticks == 0x100000005U);
    CHECK(event_acknowledge(*packet) == std::vector<std::uint8_t>{0, 0, 0, 0xC1, 0, 0, 0x12, 0x34});
}

TEST_CASE("message_channel: extended ids, and data that only their maker knows") {
    const auto packet = parse_events(extended_data());
    REQUIRE(packet);
    CHECK_FALSE(packet->acknowledge);
    REQUIRE(packet->items.size() == 1);
    CHECK(packet->items[0].id == 4);
    CHECK(packet->items[0].block_id == 0x21);
    CHECK(packet->items[0].ticks == 0x43);
    CHECK(event_acknowledge(*packet)[3] == 0xC3);
}

TEST_CASE("message_channel: several events in one packet, up to what it holds") {
    auto packet = exposure_end;
    packet[5] = 48;
    packet.insert(packet.end(), exposure_end.begin() + 8, exposure_end.end());
    CHECK_FALSE(parse_events(packet));  // less than it says
    packet.insert(packet.end(), exposure_end.begin() + 8, exposure_end.end());
    CHECK(parse_events(packet)->items.size() == 3);
}

TEST_CASE("message_channel: whatever is cut or damaged is no event, and is read no further") {
    for (std::size_t size = 0; size < exposure_end.size(); ++size)
        CHECK_FALSE(parse_events(std::vector<std::uint8_t>(
            exposure_end.begin(), exposure_end.begin() + static_cast<long>(size))));
    for (std::size_t at = 0; at < 8; ++at)
        for (unsigned value = 0; value < 256; ++value) {
            auto packet = exposure_end;
            packet[at] = static_cast<std::uint8_t>(value);
            if (const auto parsed = parse_events(packet)) CHECK(parsed->items.size() == 1);
        }
}

TEST_CASE("message_channel: events of the camera arrive once and are answered, others' are not") {
    std::mutex mutex;
    std::condition_variable wake;
    std::vector<CameraEvent> events;
    in_addr loopback{};
    inet_pton(AF_INET, "127.0.0.1", &loopback);
    in_addr address{};
    inet_pton(AF_INET, "127.0.77.2", &address);
    const auto channel =
        MessageChannel::open(loopback, address, {{0x9C43, CameraEventKind::exposure_end}},
                             1'000'000, [&](const auto& e) {
                                 const std::lock_guard lock(mutex);
                                 events.push_back(e);
                                 wake.notify_all();
                             });
    REQUIRE(channel);
    AnsweringCamera camera;
    AnsweringCamera stranger;
    auto another = exposure_end;
    another[15] = 8;
    another[6] = 0x55;
    stranger.send_from("127.0.77.3", channel->port(), another);
    camera.send_from("127.0.77.2", channel->port(), std::vector<std::uint8_t>(2000, 0x42));
    camera.send_from("127.0.77.2", channel->port(), exposure_end);
    CHECK(camera.answer() == event_acknowledge(*parse_events(exposure_end)));
    camera.send_from("127.0.77.2", channel->port(), exposure_end);  // as if the answer were lost
    CHECK(camera.answer().size() == 8);
    another[15] = 9;
    camera.send_from("127.0.77.2", channel->port(), another);
    CHECK(camera.answer().size() == 8);
    std::unique_lock lock(mutex);
    REQUIRE(wake.wait_for(lock, std::chrono::seconds(10), [&] { return events.size() >= 2; }));
    REQUIRE(events.size() == 2);
    CHECK(events[0].block_id == 7);
    CHECK(events[0].kind == CameraEventKind::exposure_end);
    CHECK(events[0].at.ns == 4'294'967'301'000);
    CHECK(events[1].block_id == 9);
}

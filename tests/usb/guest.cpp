// SPDX-License-Identifier: BSD-3-Clause
// What a program on a Linux machine does with the board's serial port, /dev/ttyACM0 of cdc_acm. It
// is linked statically and runs in a machine that has nothing but a kernel.
//
//   usb_guest talk PORT    asks for hello, then for the time, 200 times
//   usb_guest hold PORT    asks 4000 times without reading, then reads: only whole packets come
//   usb_guest touch PORT   1200 baud and no DTR: the board enters its boot loader
#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>

#include "wire/messages.hpp"
#include "wire/packet.hpp"
#include "wire/type.hpp"

namespace {

using namespace versavis;

/// What the board has not said by then it never says; the machine is an emulated one.
constexpr std::chrono::seconds patience(20);

[[noreturn]] void fail(const std::string& what) {
    throw std::runtime_error(what + ": " + std::strerror(errno));
}

class Port {
 public:
    explicit Port(const char* path) : file_(::open(path, O_RDWR | O_NOCTTY | O_CLOEXEC)) {
        if (file_ < 0) fail(path);
        if (::tcgetattr(file_, &settings_) != 0) fail("tcgetattr");
        ::cfmakeraw(&settings_);
        apply();
    }
    ~Port() { ::close(file_); }
    Port(const Port&) = delete;
    Port& operator=(const Port&) = delete;

    void set_speed(speed_t speed) {
        ::cfsetspeed(&settings_, speed);
        apply();
    }

    /// A board that leaves by this leaves in the middle of it.
    void drop_ready() {
        const int line = TIOCM_DTR;
        if (::ioctl(file_, TIOCMBIC, &line) != 0 && errno != ESHUTDOWN) fail("TIOCMBIC");
    }

    template <class T>
    void send(const T& message) {
        wire::Frame frame;
        wire::encode(message, nonce, sequence_++, frame);
        write(frame.bytes, frame.size);
    }

    /// Ends what the terminal has echoed to the board before it was switched off.
    void begin() { write(std::array<std::uint8_t, 1>{}.data(), 1); }

    /// Calls on_packet with each that comes, until it returns true. False: it was in vain.
    template <class OnPacket>
    bool read_until(OnPacket&& on_packet) {
        const auto until = std::chrono::steady_clock::now() + patience;
        for (bool done = false; !done;) {
            using std::chrono::milliseconds;
            const auto left =
                std::chrono::duration_cast<milliseconds>(until - std::chrono::steady_clock::now());
            pollfd wait{file_, POLLIN, 0};
            if (left.count() <= 0 || ::poll(&wait, 1, static_cast<int>(left.count())) <= 0)
                return false;
            std::uint8_t bytes[4096];
            const ssize_t size = ::read(file_, bytes, sizeof bytes);
            if (size <= 0) fail("read");
            decoder_.feed(bytes, static_cast<std::size_t>(size),
                          [&](const wire::Packet& packet) { done = on_packet(packet) || done; });
        }
        return true;
    }

    /// Packets that came damaged after hello. Before it, the rest of one that was for the program
    /// before this may come.
    std::uint32_t errors() const { return decoder_.errors() - errors_before_; }
    void count_errors_from_here() { errors_before_ = decoder_.errors(); }

 private:
    static constexpr std::uint32_t nonce = 0x5EA11E57;

    void write(const std::uint8_t* bytes, std::size_t size) {
        for (std::size_t sent = 0; sent < size;) {
            const ssize_t written = ::write(file_, bytes + sent, size - sent);
            if (written < 0) fail("write");
            sent += static_cast<std::size_t>(written);
        }
    }

    void apply() {
        if (::tcsetattr(file_, TCSANOW, &settings_) != 0) fail("tcsetattr");
    }

    int file_;
    termios settings_{};
    std::uint32_t sequence_ = 0;
    wire::Decoder decoder_;
    std::uint32_t errors_before_ = 0;
};

void greet(Port& port) {
    port.begin();
    port.send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
    const bool greeted = port.read_until([](const wire::Packet& packet) {
        wire::BoardHello hello;
        return packet.read(hello) && hello.major == wire::protocol_major;
    });
    port.count_errors_from_here();
    if (!greeted) throw std::runtime_error("no hello");
}

void talk(Port& port) {
    greet(port);
    std::int64_t last_ns = 0;
    for (std::uint32_t id = 1; id <= 200; ++id) {
        port.send(wire::ClockRequest{id, 0});
        wire::ClockAnswer answer{};
        const bool answered = port.read_until(
            [&](const wire::Packet& packet) { return packet.read(answer) && answer.id == id; });
        if (!answered) throw std::runtime_error("no answer to request " + std::to_string(id));
        if (answer.received_ns <= last_ns || answer.sent_ns < answer.received_ns)
            throw std::runtime_error("the board's time does not go on");
        last_ns = answer.sent_ns;
    }
    if (port.errors() != 0) throw std::runtime_error("damaged packets");
}

/// More answers than fit on the way: the board waits, and gives up whole messages only.
void hold(Port& port) {
    constexpr std::uint32_t requests = 4000;
    greet(port);
    for (std::uint32_t id = 1; id <= requests; ++id) port.send(wire::ClockRequest{id, 0});
    std::uint32_t answers = 0;
    std::uint32_t newest = 0;
    bool in_order = true;
    port.read_until([&](const wire::Packet& packet) {
        wire::ClockAnswer answer{};
        if (!packet.read(answer)) return false;
        in_order = in_order && answer.id > newest;
        newest = answer.id;
        return ++answers == requests || newest == requests;
    });
    std::printf("%u of %u requests were answered, %u packets were damaged\n", answers, requests,
                port.errors());
    if (newest != requests || !in_order || port.errors() != 0)
        throw std::runtime_error("answers are damaged, out of order, or missing at the end");
    talk(port);
}

void touch(Port& port) {
    greet(port);
    port.set_speed(B1200);
    port.drop_ready();
}

}  // namespace

int main(int count, char** arguments) {
    try {
        if (count != 3) throw std::runtime_error("usage: usb_guest talk|hold|touch PORT");
        const std::string task = arguments[1];
        Port port(arguments[2]);
        if (task == "talk") talk(port);
        if (task == "hold") hold(port);
        if (task == "touch") touch(port);
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "usb_guest: %s\n", error.what());
        return 1;
    }
}

// SPDX-License-Identifier: BSD-3-Clause
// Every shape of a method, on a device that is recorded and on one that is replayed.
#include "taped.hpp"

#include <catch2/catch.hpp>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace versavis::firmware::replay;

enum class Colour : std::uint8_t { none, red, green };

struct Inner {
    std::int64_t time = 0;
    bool valid = false;
};
struct Message {
    Inner inner[2];
    std::uint8_t bytes[6] = {};
    Colour colour = Colour::none;
};
template <class Visit>
void each_field(Inner& inner, Visit visit) {
    visit(inner.time, inner.valid);
}
template <class Visit>
void each_field(Message& message, Visit visit) {
    visit(message.inner, message.bytes, message.colour);
}

struct Device {
    virtual std::int64_t value(std::int64_t at, std::uint32_t word) = 0;
    virtual void send(const Message& message) = 0;
    virtual Message exchange(const Message& message, bool force) = 0;
    virtual bool fill(Message& message, std::int64_t& at) = 0;
    virtual bool fill_all(Inner (&all)[3]) = 0;
    virtual void write(const std::uint8_t* data, std::size_t size) = 0;
    virtual std::size_t read(std::uint8_t* data, std::size_t capacity, std::int64_t& at) = 0;
    virtual std::size_t read_packet(std::uint8_t* data, std::int64_t& at) = 0;
    virtual Colour colour() = 0;

 protected:
    ~Device() = default;
};

struct RealDevice final : Device {
    std::int64_t value(std::int64_t at, std::uint32_t word) override { return -at - word; }
    void send(const Message&) override {}
    Message exchange(const Message& message, bool force) override {
        Message answer = message;
        answer.inner[force ? 1 : 0].time = INT64_MIN;
        return answer;
    }
    bool fill(Message& message, std::int64_t& at) override {
        if (at == 0) return false;
        message.inner[1] = {INT64_MAX, true};
        message.bytes[5] = 7;
        at = -1;
        return true;
    }
    bool fill_all(Inner (&all)[3]) override {
        all[2] = {3, true};
        return true;
    }
    void write(const std::uint8_t*, std::size_t) override {}
    std::size_t read(std::uint8_t* data, std::size_t capacity, std::int64_t& at) override {
        std::memcpy(data, "stored", capacity);
        at = 5;
        return 6;
    }
    std::size_t read_packet(std::uint8_t* data, std::int64_t& at) override {
        std::memcpy(data, "packet", 5);
        at = 6;
        return 5;
    }
    Colour colour() override { return Colour::green; }
};

template <class Tape>
struct TapedDevice final : Taped<Device, Tape> {
    using Taped<Device, Tape>::Taped;
    std::int64_t value(std::int64_t at, std::uint32_t word) override {
        return this->call("value", &Device::value, at, word);
    }
    void send(const Message& message) override { this->call("send", &Device::send, message); }
    Message exchange(const Message& message, bool force) override {
        return this->call("exchange", &Device::exchange, message, force);
    }
    bool fill(Message& message, std::int64_t& at) override {
        return this->call("fill", &Device::fill, message, at);
    }
    bool fill_all(Inner (&all)[3]) override {
        return this->call("fill_all", &Device::fill_all, all);
    }
    void write(const std::uint8_t* data, std::size_t size) override {
        this->call("write", &Device::write, data, size);
    }
    std::size_t read(std::uint8_t* data, std::size_t capacity, std::int64_t& at) override {
        return this->call("read", &Device::read, data, capacity, at);
    }
    std::size_t read_packet(std::uint8_t* data, std::int64_t& at) override {
        return this->call("read_packet", &Device::read_packet, data, at);
    }
    Colour colour() override { return this->call("colour", &Device::colour); }
};

struct Given {
    std::string name;
    std::vector<std::uint32_t> words;
    bool operator==(const Given&) const = default;
};

struct RecordingTape {
    void begin(const char* name) { given.push_back({name, {}}); }
    void argument(std::uint32_t word) { given.back().words.push_back(word); }
    void end_arguments() {}
    template <class Result, class Real>
    Result perform(Real real) {
        return real();
    }
    std::uint32_t result(std::uint32_t word) { return results.emplace_back(word); }

    std::vector<Given> given;
    std::vector<std::uint32_t> results;
};

struct ReplayingTape {
    void begin(const char* name) { given.push_back({name, {}}); }
    void argument(std::uint32_t word) { given.back().words.push_back(word); }
    void end_arguments() {}
    template <class Result, class Real>
    Result perform(Real) {
        if constexpr (!std::is_void_v<Result>) return Result{};
    }
    std::uint32_t result(std::uint32_t) { return results.at(next++); }

    std::vector<std::uint32_t> results;
    std::size_t next = 0;
    std::vector<Given> given{};
};

/// Calls everything. Returns what it got, as text.
std::string use(Device& device) {
    std::string got;
    const auto note = [&got](auto value) { got += std::to_string(value) + ' '; };
    const auto note_message = [&](const Message& message) {
        for (const Inner& inner : message.inner) note(inner.time), note(inner.valid);
        for (const std::uint8_t byte : message.bytes) note(byte);
        note(static_cast<int>(message.colour));
    };
    note(device.value(-(std::int64_t{1} << 40), 0xFFFFFFFF));
    Message message{{{1, true}, {-2, false}}, {1, 2, 3, 4, 5, 6}, Colour::red};
    device.send(message);
    note_message(device.exchange(message, true));
    std::int64_t at = 0;
    note(device.fill(message, at));
    note_message(message);
    at = 1;
    note(device.fill(message, at));
    note_message(message);
    note(at);
    Inner all[3];
    note(device.fill_all(all));
    for (const Inner& inner : all) note(inner.time);
    const std::uint8_t bytes[] = {9, 8, 7, 6, 5};
    device.write(bytes, sizeof bytes);
    std::uint8_t buffer[8] = {};
    note(device.read(buffer, 4, at));  // more is stored than fits
    note(at);
    for (const std::uint8_t byte : buffer) note(byte);
    note(device.read_packet(buffer, at));
    for (const std::uint8_t byte : buffer) note(byte);
    note(static_cast<int>(device.colour()));
    return got;
}

}  // namespace

TEST_CASE("taped: what was recorded is replayed, and the device notices nothing") {
    RealDevice real;
    RecordingTape recording;
    TapedDevice<RecordingTape> recorded(recording, &real);
    const std::string got = use(recorded);
    RealDevice bare;
    CHECK(got == use(bare));
    ReplayingTape replaying{recording.results};
    TapedDevice<ReplayingTape> replayed(replaying, nullptr);
    CHECK(use(replayed) == got);
    CHECK(replaying.given == recording.given);
    CHECK(replaying.next == recording.results.size());
}

TEST_CASE("taped: arguments are passed as the signature says") {
    RealDevice real;
    RecordingTape tape;
    TapedDevice<RecordingTape> device(tape, &real);
    use(device);
    using Words = std::vector<std::uint32_t>;
    CHECK(tape.given[0].words == Words{0, 0xFFFFFF00, 0xFFFFFFFF});
    CHECK(tape.given[1].words == Words{1, 0, 1, 0xFFFFFFFE, 0xFFFFFFFF, 0, 0x04030201, 0x0605, 1});
    CHECK(tape.given[3].words.empty());  // what is filled is no argument
    const auto named = [&tape](const char* name) {
        for (const Given& given : tape.given)
            if (given.name == name) return given.words;
        throw std::logic_error(name);
    };
    CHECK(named("write") == Words{5, 0x06070809, 0x05});
    CHECK(named("read") == Words{4});
}

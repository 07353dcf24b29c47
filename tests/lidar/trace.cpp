// SPDX-License-Identifier: BSD-3-Clause
// What a LiDAR at a time output gets while all goes wrong that can: the firmware in virtual time,
// a host whose messages are lost, late or wrong, whose clock steps and has a leap second, a service
// and a board that restart. Prints what happened, in true time; `lidars.py` knows what is right.
//
//     lidar_trace SEED SECONDS FIRST_UTC_S LEAP_UTC_S DELAY_NS PULSE_NS BAUD SENTENCES FLAGS
//
// Lines, with instants in true ns since the begin:
//     clock AT UTC        UTC, ns since 1970, that the host's clock shows from then on
//     announced AT UTC FROM  a message with the time reached the board: at FROM it is UTC
//     unknown AT          one without
//     restart AT          the board restarted
//     level AT 0|1        of the pulse's pin, from then on
//     bytes BEGIN END HEX what was sent on the line
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "native_board.hpp"
#include "wire/packet.hpp"

namespace {

using namespace versavis;
using firmware::Nanoseconds;

constexpr Nanoseconds second = 1'000'000'000;
constexpr Nanoseconds ms = 1'000'000;
constexpr Nanoseconds us = 1'000;
constexpr Nanoseconds step = 10 * ms;

struct Task {
    std::uint64_t seed = 1;
    Nanoseconds duration = 0;
    std::int64_t first_utc_s = 0;
    std::int64_t leap_utc_s = 0;  ///< a leap second comes before it; 0: none
    wire::TimeOutput settings{};
};

class Random {
 public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    std::int64_t between(std::int64_t low, std::int64_t high) {
        return std::uniform_int_distribution<std::int64_t>(low, high)(engine_);
    }
    double normal(double sigma) { return std::normal_distribution<double>(0, sigma)(engine_); }
    bool one_of(std::int64_t count) { return between(1, count) == 1; }

 private:
    std::mt19937_64 engine_;
};

/// The board's clock over true time: the rate of a crystal that warms up and cools down.
class Crystal {
 public:
    Crystal(Random& random, Nanoseconds duration) {
        double ppm = static_cast<double>(random.between(-60, 60));
        Nanoseconds at = 0;
        for (Nanoseconds t = 0; t <= duration + 100 * second; t += second) {
            begins_.push_back(at);
            ppm += random.normal(0.005);
            at += second + std::llround(ppm * 1e3);
        }
    }

    Nanoseconds board(Nanoseconds true_time) const {
        const auto k = static_cast<std::size_t>(true_time / second);
        const Nanoseconds length = begins_[k + 1] - begins_[k];
        return begins_[k] + static_cast<Nanoseconds>(static_cast<__int128>(true_time % second) *
                                                     length / second);
    }
    Nanoseconds true_time(Nanoseconds board) const {
        const auto next = std::upper_bound(begins_.begin(), begins_.end(), board);
        const auto k = static_cast<std::size_t>(next - begins_.begin()) - 1;
        const Nanoseconds length = begins_[k + 1] - begins_[k];
        return static_cast<Nanoseconds>(k) * second +
               static_cast<Nanoseconds>(static_cast<__int128>(board - begins_[k]) * second /
                                        length);
    }
    std::int32_t pace_ppb(Nanoseconds true_time) const {
        const auto k = static_cast<std::size_t>(true_time / second);
        return static_cast<std::int32_t>(begins_[k + 1] - begins_[k] - second);
    }

 private:
    std::vector<Nanoseconds> begins_;  ///< board time of each true second
};

class Trial {
 public:
    explicit Trial(const Task& task)
        : task_(task), random_(task.seed), crystal_(random_, task.duration) {}

    void run();

 private:
    struct Sent {
        Nanoseconds begin, end;
        Nanoseconds character;
        std::vector<std::uint8_t> bytes;
    };
    /// What is on its way to the board.
    struct Message {
        std::vector<std::uint8_t> bytes;
        std::string line;  ///< when it arrives, with its instant
        std::string rest;
    };

    Nanoseconds utc(Nanoseconds at) const { return task_.first_utc_s * second + at + offset_; }
    Nanoseconds board_time(Nanoseconds at) const { return crystal_.board(at) - boot_; }
    Nanoseconds true_time(Nanoseconds board) const { return crystal_.true_time(board + boot_); }

    void boot(Nanoseconds at, wire::ResetCause cause);
    void connect(Nanoseconds at);
    template <class T>
    void post(Nanoseconds at, const T& message, std::string line = "", std::string rest = "");
    void deliver(Nanoseconds now);
    void announce(Nanoseconds at);
    void misbehave(Nanoseconds now);
    void set_clock(Nanoseconds now, Nanoseconds by);
    void pass_leap_second(Nanoseconds now);
    void outputs_changed(Nanoseconds at, std::uint32_t pins);
    void uart_sent(Nanoseconds at, std::uint32_t baud, std::span<const std::uint8_t> bytes);
    void show_sent(Nanoseconds until);

    Task task_;
    Random random_;
    Crystal crystal_;
    std::unique_ptr<firmware::NativeBoard> board_;
    Nanoseconds boot_ = 0;
    Nanoseconds offset_ = 0;  ///< of the host's clock against true UTC
    std::uint32_t nonce_ = 1;
    std::uint32_t sequence_ = 0;
    std::uint32_t id_ = 0;
    std::multimap<Nanoseconds, Message> under_way_;
    std::vector<Sent> sent_;
    std::optional<bool> level_;
    Nanoseconds next_message_ = 0;
    Nanoseconds cut_until_ = 0;      ///< nothing reaches the board
    Nanoseconds connects_ = 0;       ///< the host does, then
    Nanoseconds trusted_from_ = 0;   ///< the host calls the time known
    Nanoseconds stalled_until_ = 0;  ///< the board's code
    bool wrong_ = false;             ///< the newest message
    bool leapt_ = false;
};

void Trial::boot(Nanoseconds at, wire::ResetCause cause) {
    firmware::Environment environment;
    environment.outputs_changed = [this](auto when, auto pins) { outputs_changed(when, pins); };
    environment.uart_sent = [this](auto when, auto baud, auto bytes) {
        uart_sent(when, baud, bytes);
    };
    // What the chip was sending is cut off.
    show_sent(at);
    for (const Sent& cut : sent_) {
        const auto whole = static_cast<std::ptrdiff_t>((at - cut.begin) / cut.character);
        if (whole <= 0) continue;
        std::string hex;
        for (auto byte = cut.bytes.begin(); byte != cut.bytes.begin() + whole; ++byte)
            hex += fmt::format("{:02x}", *byte);
        fmt::print("bytes {} {} {}\n", cut.begin, at, hex);
    }
    sent_.clear();
    boot_ = crystal_.board(at);
    level_.reset();
    if (board_) fmt::print("restart {}\n", at);
    board_ = std::make_unique<firmware::NativeBoard>(
        firmware::Identity{static_cast<std::uint32_t>(random_.between(1, 1 << 30)), cause, "TRACE"},
        std::move(environment), 0, firmware::slow_model(2 * us, task_.seed));
    connects_ = at + random_.between(1500, 3000) * ms;
    trusted_from_ = connects_ + random_.between(4, 8) * second;
    under_way_.clear();
}

template <class T>
void Trial::post(Nanoseconds at, const T& message, std::string line, std::string rest) {
    wire::Frame frame{};
    wire::encode(message, nonce_, sequence_++, frame);
    if (at < cut_until_) return;
    under_way_.emplace(
        at, Message{{frame.bytes, frame.bytes + frame.size}, std::move(line), std::move(rest)});
}

void Trial::connect(Nanoseconds at) {
    nonce_ = static_cast<std::uint32_t>(random_.between(1, 1 << 30));
    sequence_ = 0;
    wire::HostHello hello{};
    hello.major = wire::protocol_major;
    hello.minor = wire::protocol_minor;
    post(at, hello);
    wire::Configuration configuration{};
    configuration.id = ++id_;
    configuration.ports.inputs = static_cast<std::uint8_t>(random_.between(0, 15));
    post(at + 5 * ms, configuration);
    next_message_ = at + 300 * ms;
}

void Trial::announce(Nanoseconds now) {
    const Nanoseconds arrives = now + random_.between(100, 3000) * us;
    wire::TimeOutput message = task_.settings;
    const std::int64_t utc_s = utc(now) / second + 1;
    const bool near_leap =
        !leapt_ && task_.leap_utc_s != 0 && std::llabs(utc_s - task_.leap_utc_s) <= 4;
    if (now < trusted_from_ || near_leap) return post(arrives, message, "unknown", "");
    const Nanoseconds begins = utc_s * second - utc(now) + now;
    message.flags |= wire::time_known;
    message.utc_s = utc_s;
    message.board_ns = board_time(begins) + std::llround(random_.normal(2e3));
    message.pace_ppb = crystal_.pace_ppb(now) + static_cast<std::int32_t>(random_.normal(20));
    if (task_.leap_utc_s != 0 && !leapt_)
        message.holdover_s = static_cast<std::uint16_t>(
            std::clamp<std::int64_t>(task_.leap_utc_s - 3 - utc_s, 1, message.holdover_s));
    // The board believes two messages that agree. So one that is wrong is never followed by
    // another, nor is it wrong by what the clock steps: it would confirm what was true before.
    wrong_ = random_.one_of(200) && !wrong_;
    if (wrong_) {
        if (random_.one_of(2))
            message.utc_s += random_.between(2, 100) * (random_.one_of(2) ? 1 : -1);
        else
            message.board_ns += random_.between(-400'000, 400'000) * us;
    }
    post(arrives, message, "announced", fmt::format(" {} {}", utc_s * second, begins));
}

void Trial::set_clock(Nanoseconds now, Nanoseconds by) {
    offset_ += by;
    fmt::print("clock {} {}\n", now, utc(now));
    trusted_from_ = std::max(trusted_from_, now + 3 * second);
    next_message_ = now + 50 * ms;  // the next tick of the service
}

void Trial::pass_leap_second(Nanoseconds now) {
    if (leapt_ || task_.leap_utc_s == 0 || utc(now) < task_.leap_utc_s * second) return;
    leapt_ = true;
    set_clock(now, -second);
}

void Trial::misbehave(Nanoseconds now) {
    if (!random_.one_of(20 * second / step)) return;
    switch (random_.between(1, 9)) {
        case 1: cut_until_ = now + random_.between(1, 5) * second; break;
        case 2: cut_until_ = now + random_.between(10, 60) * second; break;
        case 3:  // the service restarts
            cut_until_ = now + random_.between(1, 10) * second;
            connects_ = cut_until_ + step;
            trusted_from_ = connects_ + random_.between(4, 8) * second;
            break;
        case 4: boot(now, wire::ResetCause::watchdog); break;
        case 5: {
            const Nanoseconds steps[] = {second, 300 * ms, 20 * ms, 2 * ms, 200 * us};
            set_clock(now, steps[random_.between(0, 4)] * (random_.one_of(2) ? 1 : -1));
            break;
        }
        case 6: {
            wire::Configuration configuration{};
            configuration.id = ++id_;
            configuration.ports.inputs = static_cast<std::uint8_t>(random_.between(0, 15));
            post(now, configuration);
            break;
        }
        case 7: stalled_until_ = now + random_.between(1, 60) * step; break;
        case 8: {  // noise on the line to the board
            Message noise;
            for (std::int64_t i = random_.between(1, 100); i > 0; --i)
                noise.bytes.push_back(static_cast<std::uint8_t>(random_.between(0, 255)));
            noise.bytes.push_back(0);
            under_way_.emplace(now, std::move(noise));
            break;
        }
        default: break;
    }
}

void Trial::deliver(Nanoseconds now) {
    while (!under_way_.empty() && under_way_.begin()->first <= now) {
        const auto& [at, message] = *under_way_.begin();
        board_->receive(message.bytes, std::max(board_time(at), board_->time()));
        if (!message.line.empty()) fmt::print("{} {}{}\n", message.line, at, message.rest);
        under_way_.erase(under_way_.begin());
    }
}

void Trial::outputs_changed(Nanoseconds at, std::uint32_t pins) {
    const bool level = (pins >> firmware::pin_test & 1U) != 0;
    if (level_ == level) return;
    level_ = level;
    fmt::print("level {} {}\n", true_time(at), level ? 1 : 0);
}

void Trial::uart_sent(Nanoseconds at, std::uint32_t baud, std::span<const std::uint8_t> bytes) {
    const Nanoseconds asked = true_time(at);
    const Nanoseconds begin = sent_.empty() ? asked : std::max(asked, sent_.back().end);
    const Nanoseconds character = 10 * second / baud;
    sent_.push_back({begin,
                     begin + character * static_cast<Nanoseconds>(bytes.size()),
                     character,
                     {bytes.begin(), bytes.end()}});
}

/// What has been sent whole.
void Trial::show_sent(Nanoseconds until) {
    while (!sent_.empty() && sent_.front().end <= until) {
        std::string hex;
        for (const std::uint8_t byte : sent_.front().bytes) hex += fmt::format("{:02x}", byte);
        fmt::print("bytes {} {} {}\n", sent_.front().begin, sent_.front().end, hex);
        sent_.erase(sent_.begin());
    }
}

void Trial::run() {
    offset_ = random_.between(0, second - 1);
    fmt::print("clock 0 {}\n", utc(0));
    boot(0, wire::ResetCause::power_on);
    for (Nanoseconds now = step; now <= task_.duration; now += step) {
        if (now > 10 * second) misbehave(now);
        pass_leap_second(now);
        if (connects_ != 0 && now >= connects_) {
            connects_ = 0;
            connect(now);
        }
        if (connects_ == 0 && now >= next_message_) {
            next_message_ += second;
            announce(now);
        }
        deliver(now);
        board_->set_stalled(now < stalled_until_);
        board_->run_until(board_time(now));
        board_->consume(board_->transmitted().size(), board_time(now));
        show_sent(now);
    }
}

Task task_of(const std::vector<std::string>& arguments) {
    const auto number = [&](std::size_t i) { return std::stoll(arguments.at(i)); };
    Task task;
    task.seed = static_cast<std::uint64_t>(number(0));
    task.duration = number(1) * second;
    task.first_utc_s = number(2);
    task.leap_utc_s = number(3);
    task.settings.delay_ns = static_cast<std::int32_t>(number(4));
    task.settings.pulse_ns = static_cast<std::uint32_t>(number(5));
    task.settings.baud = static_cast<std::uint32_t>(number(6));
    task.settings.sentences = static_cast<std::uint8_t>(number(7));
    task.settings.flags = static_cast<std::uint8_t>(number(8));
    task.settings.holdover_s = 30;
    task.settings.sentence_delay_ms = 90;
    task.settings.talker[0] = 'G';
    task.settings.talker[1] = 'P';
    return task;
}

}  // namespace

int main(int count, char** arguments) {
    if (count != 10) {
        fmt::print(stderr,
                   "usage: lidar_trace SEED SECONDS FIRST_UTC_S LEAP_UTC_S DELAY_NS PULSE_NS BAUD "
                   "SENTENCES FLAGS\n");
        return 2;
    }
    Trial(task_of({arguments + 1, arguments + count})).run();
    return 0;
}

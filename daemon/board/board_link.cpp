// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_link.hpp"

#include <fmt/ranges.h>

#include <cstring>
#include <random>

#include "configuration/board_configuration.hpp"

namespace versavis::daemon {

namespace {

/// Between looks for a board that is not there. At half, an idle service scans the bus twice as
/// often; at twice, frames come a third of a second later after the board is plugged in.
constexpr Duration retry_interval = milliseconds(300);

/// For a board that only the user can make fit. At half, the log fills twice as fast; at twice,
/// the user waits longer after mending it.
constexpr Duration retry_refused = seconds(5);

/// Time for one answer; the board takes milliseconds. At half, a loaded host gives up on a healthy
/// board; at twice, a dead one is noticed later.
constexpr Duration answer_timeout = milliseconds(1000);

/// Hellos until the board is given up, and the time for the answer to each. At half, a board that
/// boots is missed at first; at twice, a foreign device on the port holds the link up longer.
constexpr int hello_attempts = 5;
constexpr Duration hello_timeout = milliseconds(250);

/// The board reports its health every second: so long without a packet, it is gone. At half, two
/// lost packets end the connection; at twice, a dead board is noticed later.
constexpr Duration silence_limit = seconds(3);

/// Exchanges before cameras may start, so that the first frame can be stamped. At half, the first
/// stamps are worse; at twice, the first frame comes 0.1 s later.
constexpr unsigned exchanges_to_start = 4;

/// For the follow-ups of the first exchanges, which nothing else paces. At half, those of a slow
/// link are lost; at twice, a link without any starts 0.2 s later.
constexpr Duration follow_up_patience = milliseconds(50);

/// Longest wait for bytes, and so for the end of the thread. At half, it wakes up twice as often
/// for nothing; at twice, it ends later.
constexpr Duration longest_read = milliseconds(100);

/// Shortest wait for bytes: a request that is due may be late by so much. At half, it hardly wakes
/// more often; at twice, neither.
constexpr Duration shortest_read = microseconds(100);

/// A board whose clock is off by more than this is in another life, whatever its nonce says. At
/// half, a stalled link begins a new epoch for nothing; at twice, a restart with an equal nonce
/// within a second of the last one is missed.
constexpr Duration largest_clock_surprise = milliseconds(500);

constexpr std::uint8_t all_cameras = 0xFF;

std::string text(const char* padded, std::size_t capacity) {
    return {padded, strnlen(padded, capacity)};
}

}  // namespace

const char* to_string(BoardState state) {
    switch (state) {
        case BoardState::absent: return "absent";
        case BoardState::handshake: return "handshake";
        case BoardState::running: return "running";
        case BoardState::incompatible: return "incompatible";
        case BoardState::refused: return "refused";
    }
    return "unknown";
}

BoardLink::BoardLink(OpenStream open, const Configuration& configuration, double exchange_rate_hz,
                     clock::Translator& translator, ClockRecorder& recorder,
                     BoardListener& listener)
    : open_(std::move(open)),
      file_(configuration),
      configuration_(board_configuration(configuration)),
      translator_(translator),
      listener_(listener),
      clock_(exchange_rate_hz, translator, recorder) {}

BoardLink::~BoardLink() { stop(); }

void BoardLink::start() {
    thread_ = std::thread([this] { run(); });
}

void BoardLink::stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
}

bool BoardLink::pause(Duration duration) const {
    const HostTime end = host_now() + duration;
    while (!stop_ && host_now() < end) {
        const timespec step{0, 20'000'000};
        nanosleep(&step, nullptr);
    }
    return !stop_;
}

void BoardLink::set_state(BoardState state, const std::string& hint) {
    const std::lock_guard lock(report_mutex_);
    if (report_.state != state || report_.hint != hint) {
        log(state == BoardState::running || state == BoardState::handshake ? LogLevel::info
                                                                           : LogLevel::warning,
            "board", "{}{}{}", to_string(state), hint.empty() ? "" : ": ", hint);
        report_.since = host_now();
    }
    report_.state = state;
    report_.hint = hint;
}

BoardReport BoardLink::report() const {
    const std::lock_guard lock(report_mutex_);
    return report_;
}

void BoardLink::run() {
    set_state(BoardState::absent, "looking for it");
    do {
        auto stream = open_();
        if (!stream) {
            set_state(BoardState::absent, stream.error().message());
            continue;
        }
        {
            const std::lock_guard lock(send_mutex_);
            stream_ = std::move(*stream);
            host_nonce_ = std::random_device{}();
            host_sequence_ = 0;
        }
        const auto ended = serve();
        accepting_ = false;
        if (connected_) listener_.board_lost();
        connected_ = false;
        if (ended) stop_cameras(all_cameras);
        {
            const std::lock_guard lock(send_mutex_);
            stream_.reset();
        }
        if (!ended && !explained()) set_state(BoardState::absent, ended.error().message());
    } while (pause(explained() ? retry_refused : retry_interval));
}

/// True when the board is there, but of no use until the user changes something.
bool BoardLink::explained() const {
    const BoardState state = report().state;
    return state == BoardState::incompatible || state == BoardState::refused;
}

/// One connection, from hello to its end. A value: the link was asked to stop.
Expected<> BoardLink::serve() {
    if (!explained()) set_state(BoardState::handshake, "");
    if (auto done = handshake(); !done) return done;
    if (auto done = configure(); !done) return done;
    if (auto done = synchronise(); !done) return done;
    set_state(BoardState::running, "");
    listener_.board_synchronised();
    connected_ = true;
    accepting_ = true;
    listener_.board_connected();
    while (!stop_) {
        const HostTime now = host_now();
        if (now - last_packet_ > silence_limit)
            return failure("board", "the board went silent", "check cable and power");
        if (now >= clock_.next_request())
            if (auto sent = send(clock_.request()); !sent) return sent;
        if (auto done = read(std::min(longest_read,
                                      std::max(clock_.next_request() - host_now(), shortest_read)));
            !done)
            return done;
        if (!greeted_) return failure("board", "the board was reset");
    }
    return {};
}

Expected<> BoardLink::handshake() {
    decoder_ = {};
    greeted_ = false;
    // A delimiter first: whatever an earlier connection left unfinished ends here.
    const std::uint8_t delimiter = 0;
    if (auto sent = stream_->write({&delimiter, 1}); !sent) return sent;
    for (int attempt = 0; attempt < hello_attempts && !greeted_; ++attempt) {
        if (auto sent = send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
            !sent)
            return sent;
        auto done = read_until([this] { return greeted_; }, hello_timeout, "does not answer");
        if (!done && attempt == hello_attempts - 1) return done;
    }
    if (hello_.major != wire::protocol_major) {
        set_state(
            BoardState::incompatible,
            fmt::format("it speaks protocol {}.{}, this service {}.{}: update its firmware",
                        hello_.major, hello_.minor, wire::protocol_major, wire::protocol_minor));
        return failure("board", "incompatible protocol");
    }
    const std::lock_guard lock(report_mutex_);
    report_.port = stream_->port();
    report_.serial = text(hello_.serial, sizeof hello_.serial);
    report_.firmware = text(hello_.firmware, sizeof hello_.firmware);
    report_.nonce = nonce_;
    report_.capabilities = hello_.capabilities;
    ++report_.connections;
    return {};
}

Expected<> BoardLink::configure() {
    answered_ = false;
    refusals_.clear();
    ++configuration_.id;
    if (auto sent = send(configuration_); !sent) return sent;
    if (auto done = read_until([this] { return answered_; }, answer_timeout,
                               "does not answer its configuration");
        !done)
        return done;
    if (answer_.status == wire::ConfigurationStatus::taken) return {};
    refusals_.emplace_back(answer_.status == wire::ConfigurationStatus::running
                               ? "its cameras are running: reset it"
                               : "change the configuration");
    set_state(BoardState::refused, fmt::format("{}", fmt::join(refusals_, "; ")));
    return failure("board", "rejected its configuration");
}

/// A few exchanges in a row, so that the first frame can be stamped.
Expected<> BoardLink::synchronise() {
    clock_.begin(hello_.minor);
    while (clock_.answers() < exchanges_to_start) {
        const unsigned before = clock_.answers();
        if (auto sent = send(clock_.request()); !sent) return sent;
        if (auto done = read_until([&] { return clock_.answers() > before; }, answer_timeout,
                                   "does not answer clock requests");
            !done)
            return done;
        // A link that cannot tell when the answer left is no failure.
        static_cast<void>(read_until([&] { return !clock_.expects_follow_up(); },
                                     follow_up_patience, "sends no follow-up"));
    }
    clock_.settle();
    return {};
}

Expected<> BoardLink::read_until(const std::function<bool()>& done, Duration timeout,
                                 const char* what) {
    const HostTime deadline = host_now() + timeout;
    while (!done()) {
        const Duration left = deadline - host_now();
        if (left.ns <= 0 || stop_) return failure("board", what, "check cable, power and firmware");
        if (auto result = read(std::min(left, longest_read)); !result) return result;
    }
    return {};
}

Expected<> BoardLink::read(Duration timeout) {
    auto chunk = stream_->read(timeout);
    if (!chunk) return Unexpected(chunk.error());
    if (chunk->bytes.empty()) return {};
    decoder_.feed(chunk->bytes.data(), chunk->bytes.size(),
                  [&](const wire::Packet& packet) { take(packet, chunk->received); });
    const std::lock_guard lock(report_mutex_);
    report_.malformed = decoder_.errors();
    return {};
}

void BoardLink::take(const wire::Packet& packet, HostTime received) {
    last_packet_ = received;
    if (packet.read(hello_)) {
        greeted_ = true;
        clock_.abandon();
        nonce_ = packet.header.nonce;
        next_sequence_ = packet.header.sequence + 1;
        if (!same_life(packet.header, received)) {
            listener_.board_restarted();
            clock_.board_restarted(nonce_);
        }
        last_life_ = nonce_;
        return;
    }
    if (!greeted_) return;
    if (packet.header.nonce != nonce_) {
        greeted_ = false;
        return;
    }
    count_losses(packet.header);
    wire::Exposure exposure{};
    wire::ImuSample sample{};
    wire::Event event{};
    wire::ClockAnswer answer{};
    wire::ClockFollowUp follow_up{};
    wire::Health health{};
    wire::Log line{};
    wire::Refusal refusal{};
    if (packet.read(exposure)) return listener_.exposure(exposure);
    if (packet.read(sample)) {
        clock_.take(sample, received);
        return listener_.imu_sample(sample);
    }
    if (packet.read(event)) return listener_.board_event(event);
    if (packet.read(answer)) return clock_.take(answer, received);
    if (packet.read(follow_up)) return clock_.take(follow_up);
    if (packet.read(line))
        return log(static_cast<LogLevel>(line.level), "board", "{}",
                   text(line.text, sizeof line.text));
    if (packet.read(refusal)) {
        if (refusal.id == configuration_.id) refusals_.push_back(describe(file_, refusal));
        return;
    }
    if (packet.read(answer_)) {
        answered_ = answer_.id == configuration_.id;
        return;
    }
    if (packet.read(health)) {
        const std::lock_guard lock(report_mutex_);
        report_.health = health;
    }
}

/// The nonce says so, and the clock must agree: a nonce could be drawn twice.
bool BoardLink::same_life(const wire::Header& header, HostTime received) const {
    if (header.nonce != last_life_) return false;
    const auto expected = translator_.to_host(BoardTime{hello_.board_time_ns});
    return !expected || absolute(received - expected->time) < largest_clock_surprise;
}

void BoardLink::count_losses(const wire::Header& header) {
    const std::uint32_t lost = header.sequence - next_sequence_;
    next_sequence_ = header.sequence + 1;
    const std::lock_guard lock(report_mutex_);
    ++report_.packets;
    report_.lost_packets += lost;
}

template <class T>
Expected<> BoardLink::send(const T& message) {
    const std::lock_guard lock(send_mutex_);
    if (!stream_) return failure("board", "is not connected");
    wire::Frame frame{};
    wire::encode(message, host_nonce_, host_sequence_++, frame);
    return stream_->write({frame.bytes, frame.size});
}

void BoardLink::start_cameras(std::uint8_t mask, pairing::Start how) {
    if (!accepting_) return;  // board_connected() starts what streams by then
    wire::Start message{};
    message.cameras = mask;
    if (how == pairing::Start::pattern) message.flags = wire::start_pattern;
    if (how == pairing::Start::slow) message.flags = wire::start_slow;
    // A failed write shows in the link's own thread, too, which then begins anew.
    static_cast<void>(send(message));
}

void BoardLink::stop_cameras(std::uint8_t mask) { static_cast<void>(send(wire::Stop{mask, {}})); }

void BoardLink::align_grid(const wire::AlignGrid& message) { static_cast<void>(send(message)); }

void BoardLink::announce_exposure(unsigned output, std::uint64_t trigger, Duration exposure) {
    wire::ExpectedExposure message{};
    message.camera = static_cast<std::uint8_t>(output);
    message.trigger = trigger;
    message.exposure_ns = exposure.ns;
    static_cast<void>(send(message));
}

}  // namespace versavis::daemon

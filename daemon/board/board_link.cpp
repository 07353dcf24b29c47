// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_link.hpp"

#include <fmt/ranges.h>

#include <cstring>

namespace versavis::daemon {

namespace {

constexpr Duration retry_interval = milliseconds(300);
constexpr Duration retry_refused = seconds(5);  // only the user can change that
constexpr Duration answer_timeout = milliseconds(1000);
constexpr Duration silence_limit = seconds(3);  // the board reports its health every second
constexpr Duration request_timeout = milliseconds(500);
constexpr unsigned exchanges_to_start = 4;
constexpr Duration follow_up_patience =
    milliseconds(50);  // of the first exchanges, which nothing else paces
constexpr std::uint8_t first_minor_with_follow_up = 2;
constexpr Duration longest_read = milliseconds(100);
constexpr Duration largest_clock_surprise = milliseconds(500);

/// Key of the configuration file, and the unit in which the board has it.
std::pair<const char*, const char*> field_name(wire::ConfigurationField field) {
    using Field = wire::ConfigurationField;
    switch (field) {
        case Field::rate: return {"rate_hz", "micro-hertz"};
        case Field::pulse: return {"pulse_us", "ns"};
        case Field::latency: return {"latency_us", "ns"};
        case Field::gap: return {"gap_us", "ns"};
        case Field::exposure: return {"exposure_us", "ns"};
        case Field::max_exposure: return {"max_exposure_us", "ns"};
        case Field::phase: return {"phase_us", "ns"};
        case Field::imu_kind: return {"model", "by number"};
        case Field::imu_rate: return {"rate_hz", "milli-hertz"};
        case Field::master: return {"master", "output of a camera"};
        case Field::imu_filter: return {"filter", "strength"};
        case Field::imu_options: return {"data_ready", "bits"};
        case Field::cameras: return {"cameras", "bits"};
        case Field::lead: return {"lead_us", "ns"};
        case Field::max_on: return {"max_on_us", "ns"};
        case Field::duty: return {"duty_percent", "ppm"};
        case Field::inputs: return {"inputs", "bits"};
        case Field::test: return {"test", "source"};
        case Field::sync_rate: return {"sync_rate_hz", "micro-hertz"};
        case Field::port_options:
            return {"imu_output' or 'nmea",
                    "bits; the one needs an IMU on the SPI port, the other none on the UART"};
        case Field::nmea_baud: return {"nmea_baud", "baud"};
    }
    return {"an unknown field", "?"};
}

std::string describe(const wire::Refusal& refusal) {
    const char* table = "[ports]";
    switch (refusal.part) {
        case wire::ConfigurationPart::camera: table = "the camera at output"; break;
        case wire::ConfigurationPart::imu: table = "the IMU at port"; break;
        case wire::ConfigurationPart::illumination: table = "[illumination]"; break;
        case wire::ConfigurationPart::ports: break;
    }
    const bool numbered = refusal.part == wire::ConfigurationPart::camera ||
                          refusal.part == wire::ConfigurationPart::imu;
    const auto [key, unit] = field_name(refusal.field);
    return fmt::format("'{}' of {}{} is {}: allowed are {} to {} ({})", key, table,
                       numbered ? fmt::format(" {}", refusal.index) : "", refusal.value,
                       refusal.minimum, refusal.maximum, unit);
}

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

BoardLink::BoardLink(OpenStream open, const wire::Configuration& configuration,
                     double exchange_rate_hz, clock::Translator& translator,
                     ClockRecorder& recorder, BoardListener& listener)
    : open_(std::move(open)),
      configuration_(configuration),
      exchange_interval_{static_cast<std::int64_t>(1e9 / exchange_rate_hz)},
      translator_(translator),
      recorder_(recorder),
      listener_(listener) {}

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
            host_nonce_ = random_();
            host_sequence_ = 0;
        }
        const auto ended = serve();
        accepting_ = false;
        if (connected_) listener_.board_lost();
        connected_ = false;
        if (ended)
            static_cast<void>(
                send(wire::Stop{0xFF, {}}));  // asked to stop: leave no camera triggered
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
            return failure("board", "it fell silent", "check cable and power");
        if (now >= next_request_)
            if (auto sent = request_clock(); !sent) return sent;
        if (auto done = read(
                std::min(longest_read, std::max(next_request_ - host_now(), microseconds(100))));
            !done)
            return done;
        if (!greeted_) return failure("board", "it was reset");
    }
    return {};
}

Expected<> BoardLink::handshake() {
    decoder_ = {};
    greeted_ = false;
    // A delimiter first: whatever an earlier connection left unfinished ends here.
    const std::uint8_t delimiter = 0;
    if (auto sent = stream_->write({&delimiter, 1}); !sent) return sent;
    for (int attempt = 0; attempt < 5 && !greeted_; ++attempt) {
        if (auto sent = send(wire::HostHello{wire::protocol_major, wire::protocol_minor, {}});
            !sent)
            return sent;
        auto done = read_until([this] { return greeted_; }, answer_timeout / 4, "does not answer");
        if (!done && attempt == 4) return done;
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
                               "does not take its configuration");
        !done)
        return done;
    if (answer_.status == wire::ConfigurationStatus::taken) return {};
    refusals_.emplace_back(answer_.status == wire::ConfigurationStatus::running
                               ? "its cameras are running: reset it"
                               : "change the configuration");
    set_state(BoardState::refused, fmt::format("{}", fmt::join(refusals_, "; ")));
    return failure("board", "refuses its configuration");
}

/// A few exchanges in a row, so that the first frame can be stamped.
Expected<> BoardLink::synchronise() {
    answers_ = 0;
    request_open_ = false;
    exchange_.reset();
    while (answers_ < exchanges_to_start) {
        const unsigned before = answers_;
        if (auto sent = request_clock(); !sent) return sent;
        if (auto done = read_until([&] { return answers_ > before; }, answer_timeout,
                                   "does not answer clock requests");
            !done)
            return done;
        // A link that cannot tell when the answer left is no failure.
        static_cast<void>(
            read_until([&] { return !exchange_; }, follow_up_patience, "sends no follow-up"));
    }
    hand_on_exchange();
    plan_next_request();
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
        exchange_.reset();
        nonce_ = packet.header.nonce;
        next_sequence_ = packet.header.sequence + 1;
        if (!same_life(packet.header, received)) {
            listener_.board_restarted();
            translator_.board_restarted();
            recorder_.board_restarted(nonce_);
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
    if (packet.read(sample)) return take_sample(sample, received);
    if (packet.read(event)) return listener_.board_event(event);
    if (packet.read(answer)) return take_answer(answer, received);
    if (packet.read(follow_up)) return take_follow_up(follow_up);
    if (packet.read(line))
        return log(static_cast<LogLevel>(line.level), "board", "{}",
                   text(line.text, sizeof line.text));
    if (packet.read(refusal)) {
        if (refusal.id == configuration_.id) refusals_.push_back(describe(refusal));
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

Expected<> BoardLink::request_clock() {
    hand_on_exchange();
    request_open_ = true;
    wire::ClockRequest request{};
    request.id = ++request_id_;
    plan_next_request();
    request_sent_ = host_now();
    return send(request);
}

/// Dithered, so that the requests do not beat with the schedule of the bus.
void BoardLink::plan_next_request() {
    std::uniform_real_distribution<> dither(0.75, 1.25);
    next_request_ = host_now() + Duration{static_cast<std::int64_t>(
                                     dither(random_) * static_cast<double>(exchange_interval_.ns))};
}

/// Its departure tells of the clock, too; that of a board before 2.2 is unknown.
void BoardLink::take_sample(const wire::ImuSample& sample, HostTime received) {
    if (sample.departure_ns != 0) {
        const clock::OneWay message{BoardTime{sample.time_ns} + Duration{sample.departure_ns},
                                    received};
        recorder_.one_way(message);
        translator_.add(message);
    }
    listener_.imu_sample(sample);
}

void BoardLink::take_answer(const wire::ClockAnswer& answer, HostTime received) {
    if (!request_open_ || answer.id != request_id_ || received - request_sent_ > request_timeout)
        return;
    request_open_ = false;
    exchange_ = clock::Exchange{request_sent_, {answer.received_ns}, {answer.sent_ns}, received};
    ++answers_;
    if (hello_.minor < first_minor_with_follow_up) hand_on_exchange();
}

/// One that says that the answer left before it was written is not believed.
void BoardLink::take_follow_up(const wire::ClockFollowUp& follow_up) {
    if (!exchange_ || follow_up.id != request_id_ || follow_up.sent_ns < exchange_->answered.ns)
        return;
    exchange_->answered.ns = follow_up.sent_ns;
    hand_on_exchange();
}

void BoardLink::hand_on_exchange() {
    if (!exchange_) return;
    recorder_.exchange(request_id_, *exchange_);
    translator_.add(*exchange_);
    exchange_.reset();
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

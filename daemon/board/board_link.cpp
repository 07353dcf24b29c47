// SPDX-License-Identifier: BSD-3-Clause
#include "board/board_link.hpp"

#include <fmt/ranges.h>

#include <cstring>

#include "base/thread_watch.hpp"
#include "board/camera_change.hpp"
#include "engine/board/board_words.hpp"
#include "engine/board/firmware_file.hpp"
#include "posix/thread.hpp"
#include "settings/board_configuration.hpp"
#include "settings/board_parts.hpp"

namespace versavis::daemon {

namespace {

/// Between looks for a board that is not there.
constexpr Duration retry_interval = milliseconds(300);

/// For a board that only the user can make fit.
constexpr Duration retry_refused = seconds(5);

/// Time for one answer; the board takes milliseconds.
constexpr Duration answer_timeout = milliseconds(1000);

/// The board reports its health every second: one that is silent for so long may have begun a new
/// life, and is greeted again.
constexpr Duration silence_limit = milliseconds(1500);

/// Exchanges before cameras may start, so that the first frame can be stamped.
constexpr unsigned exchanges_to_start = 4;

/// For the follow-ups of the first exchanges, which nothing else paces.
constexpr Duration follow_up_patience = milliseconds(50);

/// Longest wait for bytes and commands.
constexpr Duration longest_wait = milliseconds(100);

/// Shortest wait for bytes: a request that is due may be late by so much.
constexpr Duration shortest_wait = microseconds(100);

/// A board whose clock is off by more than this is in another life, whatever its nonce says.
constexpr Duration largest_clock_surprise = milliseconds(500);

/// Packets in a row with one and the same unknown nonce that are a new life of the board.
constexpr int strangers_to_believe = 3;

constexpr std::uint8_t all_cameras = 0xFF;

/// In the kernel, which may be resetting a USB device; it is stuck if that takes longer.
constexpr Duration longest_link_block = seconds(20);

/// Why a board of another major version cannot be used, and what to do.
std::string describe_mismatch(const wire::BoardHello& hello) {
    const bool older = hello.major < wire::protocol_major;
    return fmt::format("its protocol is {}.{}, the service's is {}.{}: {}", hello.major,
                       hello.minor, wire::protocol_major, wire::protocol_minor,
                       older ? "stop the service, then flash the firmware of this release with "
                               "'versavis flash " +
                                   board::firmware_file().string() + "'"
                             : "install the release of the service that matches the firmware, or "
                               "flash the firmware of this release");
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
    thread_ = start_thread("link", [this] { run(); });
}

void BoardLink::stop() {
    stop_ = true;
    wake_.signal();
    if (thread_.joinable()) thread_.join();
}

void BoardLink::reconfigure(const Configuration& configuration) {
    {
        const std::lock_guard lock(command_mutex_);
        next_file_ = configuration;
        accepting_ = false;
        changes_ = true;
    }
    wake_.signal();
}

void BoardLink::adopt_configuration() {
    const std::lock_guard lock(command_mutex_);
    changes_ = false;
    if (!next_file_) return;
    file_ = *std::exchange(next_file_, std::nullopt);
    const std::uint32_t id = configuration_.id;
    configuration_ = board_configuration(file_);
    configuration_.id = id;
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
    const auto watched = thread_watch().watch("link", longest_link_block);
    set_state(BoardState::absent, "searching");
    for (bool go_on = true; go_on;) {
        auto stream = open_();
        if (!stream) {
            set_state(BoardState::absent, stream.error().message());
            go_on = pause(retry_interval);
            continue;
        }
        stream_ = std::move(*stream);
        reader_.emplace(*stream_, wake_);
        encoder_ = {};
        decoder_ = {};
        dropped_bytes_ = 0;
        const auto ended = serve();
        const bool was_running = report().state == BoardState::running;
        // Whatever else is wrong, cameras are not to be triggered without a service.
        if (ended || stop_ || explained()) static_cast<void>(send(wire::Stop{all_cameras, {}}));
        reader_.reset();
        stream_.reset();
        if (!ended && !explained()) set_state(BoardState::absent, ended.error().message());
        // A link that worked is tried again at once.
        go_on = was_running ? !stop_ : pause(explained() ? retry_refused : retry_interval);
    }
}

/// True when the board is there, but of no use until the user changes something.
bool BoardLink::explained() const {
    const BoardState state = report().state;
    return state == BoardState::incompatible || state == BoardState::refused;
}

/// One connection, to its end. A value: the link was asked to stop.
Expected<> BoardLink::serve() {
    for (;;) {
        auto ended = converse();
        const bool was_connected = std::exchange(connected_, false);
        accepting_ = false;
        await_sync(false);
        forget_commands();
        if (was_connected) listener_.board_lost();
        // A board that does not get as far as to run is given a pause.
        if (ended || !anew_ || report().state != BoardState::running) return ended;
        log(LogLevel::warning, "board", "{}: reconnecting", ended.error().message());
    }
}

/// One conversation, from hello to its end.
Expected<> BoardLink::converse() {
    if (!explained()) set_state(BoardState::handshake, "");
    adopt_configuration();
    if (auto done = handshake(); !done) return done;
    if (auto done = configure(); !done) return done;
    if (auto done = synchronise(); !done) return done;
    set_state(BoardState::running, "");
    {
        const std::lock_guard lock(command_mutex_);
        takes_commands_ = true;
    }
    listener_.board_synchronised();
    if (auto sent = send_commands(); !sent) return sent;
    if (file_.ports.follow_sync) {
        await_sync(true);
        if (auto sent = send(wire::Start{0, wire::start_on_sync, {}}); !sent) return sent;
    }
    while (!stop_) {
        if (!connected_ && !report_.awaits_sync) {
            connected_ = true;
            accept_starts();
            listener_.board_connected();
        }
        if (auto sent = send_commands(); !sent) return sent;
        if (host_now() >= clock_.next_request())
            if (auto sent = send(clock_.request()); !sent) return sent;
        if (auto done = read(std::min(longest_wait,
                                      std::max(clock_.next_request() - host_now(), shortest_wait)));
            !done)
            return done;
        if (changes_)
            if (auto changed = change(); !changed) return changed;
        anew_ = host_now() - last_packet_ > silence_limit;
        if (anew_) return failure("board", "went silent", "check cable and power");
    }
    return {};
}

Expected<> BoardLink::handshake() {
    greeted_ = false;
    anew_ = false;
    strangers_ = 0;
    Expected<> waited;
    const auto answered = device::greet(
        encoder_, [this](auto bytes) { return stream_->write(bytes); },
        [&](Duration timeout) -> Expected<bool> {
            waited = read_until([this] { return greeted_; }, timeout, "does not answer");
            return greeted_;
        });
    if (!answered) return Unexpected(answered.error());
    if (!*answered) return waited;
    if (!greeting_.understood) {
        set_state(BoardState::incompatible, describe_mismatch(greeting_.hello));
        return failure("board", "incompatible protocol");
    }
    const std::lock_guard lock(report_mutex_);
    report_.port = stream_->port();
    report_.serial = greeting_.serial();
    report_.firmware = greeting_.firmware();
    report_.nonce = nonce_;
    report_.capabilities = greeting_.hello.capabilities;
    report_.present = greeting_.hello.present;
    report_.fastest_imu_millihertz = greeting_.hello.fastest_imu_millihertz;
    ++report_.connections;
    return {};
}

Expected<> BoardLink::configure() {
    // The board would refuse it, too, but cannot say what it has instead.
    if (const auto missing = missing_parts(file_, greeting_.hello); !missing.empty()) {
        set_state(BoardState::refused, fmt::format("{}", fmt::join(missing, "; ")));
        return failure("board", "lacks parts that the configuration uses");
    }
    answered_ = false;
    refusals_.clear();
    ++configuration_.id;
    if (auto sent = send(configuration_); !sent) return sent;
    const bool others_run = (configuration_.flags & wire::configuration_cameras) != 0;
    const auto answered = [&] {
        // What fails here fails when it is read, too.
        if (others_run) static_cast<void>(send_commands());
        return answered_;
    };
    if (auto done = read_until(answered, answer_timeout, "does not answer the configuration");
        !done)
        return done;
    if (answer_.status == wire::ConfigurationStatus::taken) {
        listener_.board_configured(answer_);
        return {};
    }
    if (answer_.status == wire::ConfigurationStatus::running &&
        (configuration_.flags & wire::configuration_cameras) != 0) {
        anew_ = true;
        return failure("board", "its configuration changes");
    }
    refusals_.emplace_back(answer_.status == wire::ConfigurationStatus::running
                               ? "its cameras are already running: reset the board"
                               : "change the configuration");
    set_state(BoardState::refused, fmt::format("{}", fmt::join(refusals_, "; ")));
    return failure("board", "refused the configuration");
}

/// What differs in the new configuration, if that can be while cameras run. Otherwise the
/// conversation ends, and the next one begins with it.
Expected<> BoardLink::change() {
    const wire::Configuration before = configuration_;
    const bool followed_sync = file_.ports.follow_sync;
    adopt_configuration();
    const bool same_grid = file_.ports.follow_sync == followed_sync;
    const bool able =
        same_grid && (greeting_.hello.capabilities & wire::capability_camera_change) != 0;
    const CameraChange change = able ? camera_change(before, configuration_) : CameraChange{};
    if (same_grid && std::memcmp(&before, &configuration_, sizeof before) == 0) {  // taken back
        listener_.cameras_changed(accept_starts(), 0);
        return {};
    }
    if (change.outputs == 0) {
        anew_ = true;
        return failure("board", "its configuration changes");
    }
    if (auto sent = send(wire::Stop{change.outputs, {}}); !sent) return sent;
    configuration_.flags |= wire::configuration_cameras;
    auto done = configure();
    configuration_.flags &= ~std::uint32_t{wire::configuration_cameras};
    if (!done) return done;
    const std::uint8_t missed = accept_starts();
    listener_.cameras_changed(static_cast<std::uint8_t>(change.outputs | missed),
                              change.other_rate);
    return {};
}

/// Returns those that were not taken before.
std::uint8_t BoardLink::accept_starts() {
    const std::lock_guard lock(command_mutex_);
    accepting_ = connected_ && !changes_;
    return accepting_ ? std::exchange(missed_starts_, 0) : 0;
}

/// A few exchanges in a row, so that the first frame can be stamped.
Expected<> BoardLink::synchronise() {
    clock_.begin();
    while (clock_.answers() < exchanges_to_start) {
        const unsigned before = clock_.answers();
        if (auto sent = send(clock_.request()); !sent) return sent;
        if (auto done = read_until([&] { return clock_.answers() > before; }, answer_timeout,
                                   "does not answer clock requests");
            !done)
            return done;
        // A link that does not know when the answer left is no failure.
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
        if (auto result = read(std::min(left, longest_wait)); !result) return result;
    }
    return {};
}

Expected<> BoardLink::read(Duration timeout) {
    wake_.wait(timeout);
    auto drained = reader_->drain([&](std::span<const std::uint8_t> bytes, HostTime received) {
        decoder_.feed(bytes.data(), bytes.size(),
                      [&](const wire::Packet& packet) { take(packet, received); });
    });
    if (!drained) return drained;
    if (anew_) return failure("board", "was reset");
    const std::uint64_t dropped = reader_->dropped();
    if (dropped > dropped_bytes_)
        log(LogLevel::warning, "board",
            "{} bytes lost: they arrived faster than they were processed",
            dropped - dropped_bytes_);
    const std::lock_guard lock(report_mutex_);
    report_.malformed = decoder_.errors();
    report_.dropped_bytes += dropped - std::exchange(dropped_bytes_, dropped);
    return {};
}

void BoardLink::take(const wire::Packet& packet, HostTime received) {
    if (const auto greeting = device::read_greeting(packet))
        return take(*greeting, packet.header, received);
    if (!greeted_ || anew_ || !of_this_life(packet.header)) return;
    last_packet_ = received;
    const bool used =
        use<wire::Exposure>(packet,
                            [&](const auto& record) { listener_.exposure(record, received); }) ||
        use<wire::ImuSample>(packet,
                             [&](const auto& sample) {
                                 if (listener_.imu_sample(sample, received))
                                     clock_.take(sample, received);
                             }) ||
        use<wire::Event>(packet,
                         [&](const auto& event) { listener_.board_event(event, received); }) ||
        use<wire::Sentence>(packet,
                            [&](const auto& line) { listener_.sentence(line, received); }) ||
        use<wire::ClockAnswer>(packet,
                               [&](const auto& answer) { note(clock_.take(answer, received)); }) ||
        use<wire::ClockFollowUp>(packet,
                                 [&](const auto& follow_up) { note(clock_.take(follow_up)); });
    if (!used) take_answer(packet);
}

/// True: it is a T, and if what it says can be, it was used.
template <class T, class Use>
bool BoardLink::use(const wire::Packet& packet, Use&& use) {
    T message{};
    if (!packet.read(message)) return false;
    if (possible(message))
        use(message);
    else
        count_impossible();
    return true;
}

void BoardLink::take_answer(const wire::Packet& packet) {
    wire::Health health{};
    wire::Log line{};
    wire::Refusal refusal{};
    if (packet.read(line))
        log(static_cast<LogLevel>(line.level), "board", "{}", board::text(line.text));
    if (packet.read(refusal) && refusal.id == configuration_.id)
        refusals_.push_back(describe(file_, refusal));
    if (packet.read(answer_)) answered_ = answer_.id == configuration_.id;
    if (!packet.read(health)) return;
    if (!possible(health)) return count_impossible();
    const std::lock_guard lock(report_mutex_);
    report_.health = counters_.since_start(health);
    if (health.sync_state != wire::SyncState::none) report_.awaits_sync = false;
}

/// Its grid is to begin with a pulse of the sync input, before any camera is started.
void BoardLink::await_sync(bool awaited) {
    const std::lock_guard lock(report_mutex_);
    report_.awaits_sync = awaited;
}

/// The answer to ours, or one that nobody asked for: then the board begins a new life.
void BoardLink::take(const device::Greeting& greeting, const wire::Header& header,
                     HostTime received) {
    if (!greeting.understood) {  // more cannot be read of it
        // Flashed while the link stayed open; else the second answer to two hellos.
        anew_ = anew_ || (greeted_ && greeting_.understood);
        greeted_ = true;
        greeting_ = greeting;
        return;
    }
    if (!possible(greeting.hello)) return count_impossible();
    const bool same = same_life(greeting.hello, header.nonce, received);
    if (greeted_) {
        anew_ = anew_ || !same;  // else the second answer to two hellos
        if (same) of_this_life(header);
        return;
    }
    last_packet_ = received;
    greeted_ = true;
    greeting_ = greeting;
    clock_.abandon();
    nonce_ = header.nonce;
    sequence_.begin(header.sequence);
    if (!same) {
        listener_.board_restarted();
        clock_.board_restarted(nonce_);
        counters_.board_restarted();
    }
    last_life_ = nonce_;
}

void BoardLink::note(const std::optional<Implausibility>& doubt) {
    if (!doubt) return;
    {
        const std::lock_guard lock(report_mutex_);
        ++report_.exchanges_doubted;
    }
    listener_.exchange_doubted(*doubt);
}

/// The nonce says so, and the clock must agree: a nonce could be drawn twice.
bool BoardLink::same_life(const wire::BoardHello& hello, std::uint32_t nonce,
                          HostTime received) const {
    if (nonce != last_life_) return false;
    const auto expected = translator_.to_host(BoardTime{hello.board_time_ns});
    return !expected || absolute(received - expected->time) < largest_clock_surprise;
}

/// False: its nonce is another. One such packet is an error, a few that agree are a new life.
bool BoardLink::of_this_life(const wire::Header& header) {
    if (header.nonce != nonce_) {
        strangers_ = header.nonce == stranger_ ? strangers_ + 1 : 1;
        stranger_ = header.nonce;
        anew_ = strangers_ >= strangers_to_believe;
        count_impossible();
        return false;
    }
    strangers_ = 0;
    const std::uint64_t lost_before = sequence_.lost();
    if (!sequence_.add(header.sequence)) count_impossible();
    const std::lock_guard lock(report_mutex_);
    ++report_.packets;
    report_.lost_packets += sequence_.lost() - lost_before;
    return true;
}

void BoardLink::count_impossible() {
    const std::lock_guard lock(report_mutex_);
    ++report_.impossible;
}

template <class T>
Expected<> BoardLink::send(const T& message) {
    const wire::Frame frame = encoder_.encode(message);
    if constexpr (std::is_same_v<T, wire::ClockRequest>) clock_.leaves();
    return stream_->write({frame.bytes, frame.size});
}

void BoardLink::give(const Command& command) {
    {
        const std::lock_guard lock(command_mutex_);
        if (!takes_commands_) return;
        commands_.push_back(command);
    }
    wake_.signal();
}

void BoardLink::forget_commands() {
    const std::lock_guard lock(command_mutex_);
    takes_commands_ = false;
    commands_.clear();
}

Expected<> BoardLink::send_commands() {
    std::vector<Command> commands;
    {
        const std::lock_guard lock(command_mutex_);
        commands.swap(commands_);
    }
    for (const Command& command : commands)
        if (auto sent = std::visit([this](const auto& message) { return send(message); }, command);
            !sent)
            return sent;
    return {};
}

void BoardLink::start_cameras(std::uint8_t mask, pairing::Start how) {
    wire::Start message{};
    message.cameras = mask;
    if (how == pairing::Start::pattern) message.flags = wire::start_pattern;
    if (how == pairing::Start::slow) message.flags = wire::start_slow;
    {
        const std::lock_guard lock(command_mutex_);
        // board_connected() or cameras_changed() starts what streams by then.
        if (!accepting_) {
            missed_starts_ |= mask;
            return;
        }
    }
    give(message);
}

void BoardLink::stop_cameras(std::uint8_t mask) { give(wire::Stop{mask, {}}); }

void BoardLink::align_grid(const wire::AlignGrid& message) { give(message); }

void BoardLink::announce_time(const wire::TimeOutput& message) { give(message); }

void BoardLink::announce_exposure(unsigned output, std::uint64_t trigger, Duration exposure) {
    wire::ExpectedExposure message{};
    message.camera = static_cast<std::uint8_t>(output);
    message.trigger = trigger;
    message.exposure_ns = exposure.ns;
    give(message);
}

}  // namespace versavis::daemon

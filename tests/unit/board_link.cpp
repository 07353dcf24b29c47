// SPDX-License-Identifier: BSD-3-Clause
// The link against a board that is played: what it makes of answers, follow-ups and other versions.
#include "board/board_link.hpp"
#include "engine/board/firmware_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <catch2/catch.hpp>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <future>

#include "../support/temporary_directory.hpp"
#include "configuration_check.hpp"
#include "native_board.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr Duration on_the_way =
    milliseconds(100);  // an answer waits so long before it leaves the board

/// What kind of board is played.
struct Manner {
    bool follows_up = true;
    wire::HelloVersion version{wire::protocol_major, wire::protocol_minor};
    std::size_t hello_size = sizeof(wire::BoardHello);
    std::uint32_t present = wire::present_all;
};

/// Answers at once; time stands still on the way, but for what the stamps say.
class PlayedBoard final : public ByteStream {
 public:
    std::string port() const override { return "played"; }
    explicit PlayedBoard(const Manner& manner = {}, std::vector<wire::Type>* heard = nullptr)
        : manner_(manner), heard_(heard) {}

    Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) override {
        std::unique_lock lock(mutex_);
        const auto any = [this] { return !packets_.empty(); };
        if (!came_.wait_for(lock, std::chrono::nanoseconds(timeout.ns), any)) return Chunk{};
        const Arriving packet = packets_.front();
        packets_.pop_front();
        std::copy_n(packet.frame.bytes, packet.frame.size, into.begin());
        return Chunk{packet.at, packet.frame.size};
    }

    Expected<> write(std::span<const std::uint8_t> bytes) override {
        {
            std::unique_lock lock(mutex_);
            came_.wait(lock, [this] { return !writes_held_; });
        }
        decoder_.feed(bytes.data(), bytes.size(),
                      [this](const wire::Packet& packet) { answer(packet); });
        return {};
    }

    ~PlayedBoard() override { closed(); }
    std::function<void()> closed = [] {};

    /// From now on writes wait, or no longer.
    void hold_writes(bool held) {
        const std::lock_guard lock(mutex_);
        writes_held_ = held;
        came_.notify_all();
    }

    void set_nonce(std::uint32_t nonce) { nonce_ = nonce; }
    /// It answers nothing until it is greeted.
    void mute() { mute_ = true; }
    void skip_numbers(std::uint32_t count) { sequence_ += count; }

    template <class T>
    void send(const T& message) {
        send(message, host_now());
    }

 private:
    struct Arriving {
        HostTime at;
        wire::Frame frame;
    };

    /// Refuses what real boards refuse.
    struct Judge final : firmware::RefusalSink {
        Judge(PlayedBoard& played, std::uint32_t about) : board(played), id(about) {}
        void refuse(const wire::Refusal& refusal) override {
            wire::Refusal message = refusal;
            message.id = id;
            board.send(message, host_now());
            refused = true;
        }
        PlayedBoard& board;
        std::uint32_t id;
        bool refused = false;
    };

    void answer(const wire::Packet& packet) {
        wire::HostHello hello{};
        wire::Configuration configuration{};
        wire::ClockRequest request{};
        const HostTime now = host_now();
        if (heard_ != nullptr) heard_->push_back(packet.header.type);
        if (mute_ && packet.header.type != wire::Type::host_hello) return;
        mute_ = false;
        if (packet.read(hello)) {
            say_hello(now);
        } else if (packet.read(configuration)) {
            Judge judge(*this, configuration.id);
            firmware::check(configuration, {wire::present_all, 8'000'000}, judge);
            wire::ConfigurationAnswer message{};
            message.id = configuration.id;
            if (judge.refused) message.status = wire::ConfigurationStatus::refused;
            send(message, now);
        } else if (packet.read(request)) {
            send(wire::ClockAnswer{request.id, 0, now.ns, now.ns}, now + on_the_way);
            const Duration until = on_the_way - microseconds(10);
            if (manner_.follows_up)
                send(wire::ClockFollowUp{request.id, 0, (now + until).ns}, now + on_the_way);
        }
    }

    /// Of the size that it has in the board's version.
    void say_hello(HostTime now) {
        wire::BoardHello message{};
        message.major = manner_.version.major;
        message.minor = manner_.version.minor;
        message.cameras = static_cast<std::uint8_t>(std::popcount(manner_.present & 0xFU));
        message.capabilities = wire::capability_host_grid;
        message.board_time_ns = now.ns;
        message.present = manner_.present;
        message.fastest_imu_millihertz = 8'000'000;
        std::strcpy(message.serial, "PLAYED");
        std::strcpy(message.firmware, "versavis 0.1");
        if (manner_.hello_size == sizeof message) return send(message, now);
        std::vector<std::uint8_t> raw(sizeof(wire::Header) + manner_.hello_size);
        const wire::Header header{wire::Type::board_hello, {}, nonce_, sequence_++};
        std::memcpy(raw.data(), &header, sizeof header);
        std::memcpy(raw.data() + sizeof header, &message,
                    std::min(manner_.hello_size, sizeof message));
        const std::uint32_t crc = wire::crc32(raw.data(), raw.size());
        raw.resize(raw.size() + wire::crc_size);
        std::memcpy(raw.data() + raw.size() - wire::crc_size, &crc, wire::crc_size);
        wire::Frame frame{};
        frame.size = wire::cobs_encode(raw.data(), raw.size(), frame.bytes);
        frame.bytes[frame.size++] = 0;
        const std::lock_guard lock(mutex_);
        packets_.push_back({now, frame});
        came_.notify_one();
    }

    template <class T>
    void send(const T& message, HostTime arrives) {
        wire::Frame frame{};
        const std::lock_guard lock(mutex_);
        wire::encode(message, nonce_, sequence_++, frame);
        packets_.push_back({arrives, frame});
        came_.notify_one();
    }

    Manner manner_;
    std::vector<wire::Type>* heard_;
    wire::Decoder decoder_;
    std::atomic<std::uint32_t> nonce_{7};
    std::atomic<std::uint32_t> sequence_{0};
    std::atomic<bool> mute_{false};
    bool writes_held_ = false;
    std::mutex mutex_;
    std::condition_variable came_;
    std::deque<Arriving> packets_;
};

/// Counts its calls; the test waits for counts.
class LinkListener final : public BoardListener {
 public:
    struct Counts {
        unsigned restarted = 0;
        unsigned connected = 0;
        unsigned lost = 0;
        unsigned samples = 0;
        unsigned exposures = 0;
        unsigned changed = 0;
    };

    std::function<void()> synchronised = [] {};
    std::pair<std::uint8_t, std::uint8_t> changes;  ///< the newest
    std::vector<std::uint64_t> ticks;               ///< of camera 0; the link's thread adds to it
    std::vector<std::int64_t> triggers_ns;          ///< the same
    void board_restarted() override { count(&Counts::restarted); }
    void board_synchronised() override { synchronised(); }
    void board_connected() override { count(&Counts::connected); }
    void cameras_changed(std::uint8_t outputs, std::uint8_t other_rate) override {
        changes = {outputs, other_rate};
        count(&Counts::changed);
    }
    void board_lost() override { count(&Counts::lost); }
    void exposure(const wire::Exposure& record, HostTime /*received*/) override {
        if (record.camera == 0) {
            ticks.push_back(record.tick);
            triggers_ns.push_back(record.trigger_ns);
        }
        count(&Counts::exposures);
    }
    bool imu_sample(const wire::ImuSample& /*sample*/, HostTime /*received*/) override {
        count(&Counts::samples);
        return true;
    }
    void exchange_doubted(const Implausibility& /*doubt*/) override {}
    void board_event(const wire::Event& /*event*/, HostTime /*received*/) override {}

    Counts counts() {
        const std::lock_guard lock(mutex_);
        return counts_;
    }
    bool wait(unsigned Counts::*counter, unsigned value) {
        std::unique_lock lock(mutex_);
        return changed_.wait_for(lock, std::chrono::seconds(10),
                                 [&] { return counts_.*counter >= value; });
    }

 private:
    void count(unsigned Counts::*counter) {
        const std::lock_guard lock(mutex_);
        ++(counts_.*counter);
        changed_.notify_all();
    }

    std::mutex mutex_;
    std::condition_variable changed_;
    Counts counts_;
};

struct LinkClock {
    clock::Translator translator{
        *clock::OutputClock::create(clock::OutputClockKind::monotonic_raw)};
    test::TemporaryDirectory directory{"/dev/shm"};
    ClockRecorder recorder{
        *ring::Writer::create(directory.path(), {"clock", ring::StreamKind::clock, 64}),
        translator};
};

/// The clock as it stands when the cameras may be started.
clock::ClockReport connect_board(const Manner& manner) {
    LinkClock clock;
    LinkListener listener;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            return std::make_unique<PlayedBoard>(manner);
        },
        {}, 1, clock.translator, clock.recorder, listener);
    link.start();
    REQUIRE(listener.wait(&LinkListener::Counts::connected, 1));
    return clock.translator.report();
}

/// What is reported of a board of which nothing can be made.
BoardReport end_of_connection(const Configuration& configuration, const Manner& manner,
                              std::vector<wire::Type>* heard = nullptr) {
    LinkClock clock;
    LinkListener listener;
    std::promise<BoardReport> closed;
    std::once_flag first;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            auto board = std::make_unique<PlayedBoard>(manner, heard);
            board->closed = [&] {
                std::call_once(first, [&] { closed.set_value(link.report()); });
            };
            return board;
        },
        configuration, 1, clock.translator, clock.recorder, listener);
    link.start();
    auto end = closed.get_future();
    REQUIRE(end.wait_for(std::chrono::seconds(10)) == std::future_status::ready);
    link.stop();
    return end.get();
}

/// A link to a board that the test plays, while it runs.
struct RunningLink {
    RunningLink() {
        link.start();
        REQUIRE(listener.wait(&LinkListener::Counts::connected, 1));
    }
    ~RunningLink() { board.load()->hold_writes(false); }

    /// What was sent until now was taken.
    void settle() {
        const unsigned before = listener.counts().samples;
        board.load()->send(wire::ImuSample{});
        REQUIRE(listener.wait(&LinkListener::Counts::samples, before + 1));
    }

    LinkClock clock;
    LinkListener listener;
    std::atomic<PlayedBoard*> board{nullptr};
    BoardLink link{[&]() -> Expected<std::unique_ptr<ByteStream>> {
                       auto made = std::make_unique<PlayedBoard>();
                       board = made.get();
                       return made;
                   },
                   {},
                   10,
                   clock.translator,
                   clock.recorder,
                   listener};
};

/// The board's own program, on a link that stays open whatever happens to the board.
class NativeStream final : public ByteStream {
 public:
    NativeStream() { boot(); }

    Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) override {
        const HostTime end = host_now() + timeout;
        for (;;) {
            {
                const std::lock_guard lock(mutex_);
                board_->run_until(board_now());
                const auto out = board_->transmitted();
                const std::size_t size = std::min(out.size(), into.size());
                std::copy_n(out.begin(), size, into.begin());
                board_->consume(size, board_now());
                if (size > 0) return Chunk{host_now(), size};
            }
            if (host_now() > end) return Chunk{};
            const timespec step{0, 1'000'000};
            nanosleep(&step, nullptr);
        }
    }
    Expected<> write(std::span<const std::uint8_t> bytes) override {
        const std::lock_guard lock(mutex_);
        board_->receive(bytes, board_now());
        board_->run_until(board_now());
        return {};
    }
    std::string port() const override { return "native"; }

    /// At so many whole tenths of a second of its clock, from the next one on.
    void pulse_sync(unsigned count) {
        constexpr firmware::Nanoseconds tenth = 100'000'000;
        const auto input =
            static_cast<std::uint8_t>(firmware::input_pulse + unsigned{wire::pulse_sync});
        const std::lock_guard lock(mutex_);
        for (auto at = (board_now() / tenth + 1) * tenth; count > 0; at += tenth, --count) {
            board_->schedule_edge({at, input, true});
            board_->schedule_edge({at + tenth / 10, input, false});
        }
    }

    /// A new life, that the link does not report.
    void boot() {
        const std::lock_guard lock(mutex_);
        booted_ = host_now();
        board_.emplace(firmware::Identity{++nonce_, wire::ResetCause::watchdog, {}},
                       firmware::Environment{});
    }

 private:
    firmware::Nanoseconds board_now() const { return (host_now() - booted_).ns; }

    std::mutex mutex_;
    std::uint32_t nonce_ = 0;
    HostTime booted_;
    std::optional<firmware::NativeBoard> board_;
};

wire::ImuSample sample_at(std::int64_t ns) {
    wire::ImuSample sample{};
    sample.time_ns = ns;
    return sample;
}

}  // namespace

TEST_CASE("board_link: an exchange ends when the answer truly left, if the board reports it") {
    const clock::ClockReport clock = connect_board({});
    CHECK(clock.exchanges == 4);
    CHECK(clock.round_trip < on_the_way / 2);
}

TEST_CASE("board_link: without a follow-up the answer's own stamp is used") {
    const clock::ClockReport clock = connect_board({false});
    CHECK(clock.exchanges == 4);
    CHECK(clock.round_trip >= on_the_way);
}

TEST_CASE("board_link: the grid is aligned before any camera can be started") {
    LinkClock clock;
    LinkListener listener;
    std::vector<wire::Type> heard;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            return std::make_unique<PlayedBoard>(Manner{}, &heard);
        },
        {}, 1, clock.translator, clock.recorder, listener);
    listener.synchronised = [&] {
        link.start_cameras(1, pairing::Start::steady);  // too early
        link.align_grid({1, 2, 3});
    };
    link.start();
    REQUIRE(listener.wait(&LinkListener::Counts::connected, 1));
    CHECK((link.report().capabilities & wire::capability_host_grid) != 0);
    link.stop();
    CHECK(std::count(heard.begin(), heard.end(), wire::Type::align_grid) == 1);
    CHECK(std::count(heard.begin(), heard.end(), wire::Type::start) == 0);
}

TEST_CASE("board_link: a board that reboots while the link stays open is back within a second") {
    LinkClock clock;
    LinkListener listener;
    std::atomic<NativeStream*> board{nullptr};
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            auto made = std::make_unique<NativeStream>();
            board = made.get();
            return made;
        },
        {}, 10, clock.translator, clock.recorder, listener);
    link.start();
    for (unsigned life = 1; life <= 3; ++life) {
        REQUIRE(listener.wait(&LinkListener::Counts::connected, life));
        const HostTime rebooted = host_now();
        board.load()->boot();
        REQUIRE(listener.wait(&LinkListener::Counts::connected, life + 1));
        CHECK(host_now() - rebooted < seconds(1));
        CHECK(listener.counts().restarted == life + 1);
        CHECK(listener.counts().lost == life);
    }
}

namespace {

/// Triggered at 50 Hz, but for the second one.
Configuration two_cameras(double second_hz) {
    Configuration configuration;
    for (unsigned i = 0; i < 2; ++i) {
        CameraConfiguration camera;
        camera.name = "cam" + std::to_string(i);
        camera.output = i;
        camera.rate_hz = i == 0 ? 50 : second_hz;
        camera.max_exposure_us = 10'000;
        camera.strobe = Strobe::none;
        configuration.cameras.push_back(camera);
    }
    return configuration;
}

}  // namespace

TEST_CASE("board_link: settings of one camera change while another is triggered") {
    LinkClock clock;
    LinkListener listener;
    BoardLink link(
        []() -> Expected<std::unique_ptr<ByteStream>> { return std::make_unique<NativeStream>(); },
        two_cameras(50), 10, clock.translator, clock.recorder, listener);
    link.start();
    REQUIRE(listener.wait(&LinkListener::Counts::connected, 1));
    link.start_cameras(0b11, pairing::Start::steady);
    REQUIRE(listener.wait(&LinkListener::Counts::exposures, 20));
    link.reconfigure(two_cameras(20));
    link.start_cameras(0b10, pairing::Start::steady);  // too early: whoever hears of it starts it
    REQUIRE(listener.wait(&LinkListener::Counts::changed, 1));
    CHECK(listener.changes == std::pair<std::uint8_t, std::uint8_t>(0b10, 0b10));
    const unsigned before = listener.counts().exposures;
    REQUIRE(listener.wait(&LinkListener::Counts::exposures, before + 20));
    link.reconfigure(two_cameras(20));  // which is in force
    REQUIRE(listener.wait(&LinkListener::Counts::changed, 2));
    CHECK(listener.changes == std::pair<std::uint8_t, std::uint8_t>(0, 0));
    // Back to the rate, and so to the ticks, of the other one.
    link.reconfigure(two_cameras(50));
    REQUIRE(listener.wait(&LinkListener::Counts::connected, 2));
    CHECK(listener.counts().lost == 1);
    link.stop();
    CHECK(listener.counts().changed == 2);
    CHECK(listener.counts().restarted == 1);
    REQUIRE(listener.ticks.size() > 20);
    for (std::size_t i = 1; i < listener.ticks.size(); ++i)
        CHECK(listener.ticks[i] == listener.ticks[i - 1] + 1);
}

TEST_CASE(
    "board_link: cameras that follow another board begin after its pulses, until told not to") {
    LinkClock clock;
    LinkListener listener;
    std::atomic<NativeStream*> board{nullptr};
    Configuration configuration = two_cameras(50);
    configuration.ports.inputs = {"sync"};
    configuration.ports.follow_sync = true;
    configuration.ports.sync_rate_hz = 10;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            auto made = std::make_unique<NativeStream>();
            board = made.get();
            return made;
        },
        configuration, 10, clock.translator, clock.recorder, listener);
    listener.synchronised = [&] {
        if (configuration.ports.follow_sync) board.load()->pulse_sync(1000);
    };
    link.start();
    REQUIRE(listener.wait(&LinkListener::Counts::connected, 1));
    CHECK_FALSE(link.report().awaits_sync);
    CHECK(link.report().health.sync_state == wire::SyncState::followed);
    link.start_cameras(0b11, pairing::Start::steady);
    REQUIRE(listener.wait(&LinkListener::Counts::exposures, 20));
    // Stopped and started, they are on the same grid, without another pulse.
    link.stop_cameras(0b11);
    link.start_cameras(0b11, pairing::Start::steady);
    const unsigned before = listener.counts().exposures;
    REQUIRE(listener.wait(&LinkListener::Counts::exposures, before + 20));
    for (std::size_t i = 1; i < listener.ticks.size(); ++i)
        REQUIRE(listener.ticks[i] > listener.ticks[i - 1]);
    const auto ahead_ns = static_cast<std::int64_t>(configuration.cameras[0].exposure_us * 1e3 / 2);
    for (const std::int64_t at : listener.triggers_ns) REQUIRE((at + ahead_ns) % 20'000'000 == 0);
    // Nothing that the board is told of differs, and all the same its grid begins anew.
    configuration.ports.follow_sync = false;
    link.reconfigure(configuration);
    REQUIRE(listener.wait(&LinkListener::Counts::connected, 2));
    link.stop();
}

TEST_CASE("board_link: a board that cannot change single cameras is greeted anew") {
    RunningLink running;
    running.link.reconfigure(two_cameras(20));
    REQUIRE(running.listener.wait(&LinkListener::Counts::connected, 2));
    running.link.reconfigure(two_cameras(30));
    REQUIRE(running.listener.wait(&LinkListener::Counts::connected, 3));
    CHECK(running.listener.counts().changed == 0);
}

TEST_CASE("board_link: a board that falls silent is greeted again on the same link") {
    RunningLink running;
    PlayedBoard* board = running.board;
    board->mute();
    REQUIRE(running.listener.wait(&LinkListener::Counts::connected, 2));
    CHECK(running.board == board);
    CHECK(running.listener.counts().restarted == 1);  // it is the same life
}

TEST_CASE("board_link: packets of an unknown nonce are a new life when some agree") {
    RunningLink running;
    PlayedBoard& board = *running.board;
    board.set_nonce(8);
    board.send(sample_at(1));
    board.set_nonce(7);
    running.settle();
    CHECK(running.listener.counts().samples == 1);
    CHECK(running.link.report().impossible == 1);
    CHECK(running.listener.counts().connected == 1);
    board.set_nonce(9);
    const HostTime begin = host_now();
    for (int i = 0; i < 3; ++i) board.send(sample_at(1));
    REQUIRE(running.listener.wait(&LinkListener::Counts::connected, 2));
    CHECK(host_now() - begin < seconds(1));
    CHECK(running.listener.counts().restarted == 2);
    CHECK(running.listener.counts().samples == 1);
}

TEST_CASE("board_link: a wrong packet number is an error and no loss") {
    RunningLink running;
    running.board.load()->skip_numbers(0xFFFFFFF0U);
    running.settle();
    running.settle();  // goes on from there
    running.board.load()->skip_numbers(3);
    running.settle();
    const BoardReport report = running.link.report();
    CHECK(report.impossible == 1);
    CHECK(report.lost_packets == 3);
}

TEST_CASE("board_link: times that cannot be reach nobody") {
    RunningLink running;
    PlayedBoard& board = *running.board;
    board.send(sample_at(std::numeric_limits<std::int64_t>::max()));
    board.send(sample_at(-1));
    wire::Exposure record{};
    record.trigger_ns = std::numeric_limits<std::int64_t>::min();
    board.send(record);
    wire::BoardHello hello{};
    hello.major = wire::protocol_major;
    hello.board_time_ns = std::numeric_limits<std::int64_t>::max();
    board.send(hello);
    wire::Health report{};
    report.glitches = 1;
    report.sync_state = wire::SyncState::lost;
    board.send(report);  // counters begin with the first one
    report.glitches = 4;
    board.send(report);
    report.glitches = 9;
    report.sync_state = static_cast<wire::SyncState>(77);
    board.send(report);
    running.settle();
    CHECK(running.link.report().impossible == 5);
    CHECK(running.link.report().health.glitches == 3);
    CHECK(running.link.report().health.sync_state == wire::SyncState::lost);
    CHECK(running.listener.counts().samples == 1);
    CHECK(running.listener.counts().exposures == 0);
    CHECK(running.listener.counts().connected == 1);
}

TEST_CASE("board_link: nobody who gives a command waits for a slow board") {
    RunningLink running;
    running.board.load()->hold_writes(true);
    auto given = std::async(std::launch::async, [&] {
        running.link.stop_cameras(1);
        running.link.start_cameras(1, pairing::Start::pattern);
        running.link.announce_exposure(0, 1, milliseconds(1));
        running.link.align_grid({});
        return running.link.report().state;
    });
    const bool at_once = given.wait_for(std::chrono::seconds(5)) == std::future_status::ready;
    running.board.load()->hold_writes(false);
    CHECK(at_once);
    CHECK(given.get() == BoardState::running);
}

TEST_CASE("board_link: what the board refuses is reported in the words of the file") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.write(
        "v.toml", "[[camera]]\nname = \"left\"\ndevice = \"x\"\nrate_hz = 50\nlatency_us = 60\n");
    Configuration configuration = *load_configuration(path);
    configuration.cameras[0].rate_hz = 2000;  // past the check of the file
    const BoardReport report = end_of_connection(configuration, {});
    CHECK(report.state == BoardState::refused);
    CHECK(
        report.hint ==
        path +
            ":4:11: 'rate_hz' of [[camera]] \"left\" is 2000 Hz: the board accepts 0.1 to 1000 Hz; "
            "change the configuration");
}

TEST_CASE("board_link: what the board lacks is reported with what it has, and it is not asked") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.write(
        "v.toml",
        "[[camera]]\nname = \"left\"\ndevice = \"x\"\noutput = 2\n[board]\nkeep_configuration = "
        "true\n");
    Manner manner;
    manner.present = wire::present_camera0 * 3U | wire::present_memory;
    std::vector<wire::Type> heard;
    const BoardReport report = end_of_connection(*load_configuration(path), manner, &heard);
    CHECK(report.state == BoardState::refused);
    CHECK(report.hint ==
          path +
              ":4:10: 'output' of [[camera]] \"left\" is 2: the board (versavis 0.1, "
              "serial PLAYED) has outputs 0 and 1; use one that it has, or another "
              "board");
    CHECK(report.present == manner.present);
    CHECK(report.fastest_imu_millihertz == 8'000'000);
    CHECK(std::count(heard.begin(), heard.end(), wire::Type::configuration) == 0);
}

TEST_CASE("board_link: a board of another major version is reported, with what to do") {
    const auto hint = [](std::uint8_t major, std::uint8_t minor, std::size_t size) {
        Manner manner;
        manner.version = {major, minor};
        manner.hello_size = size;
        const BoardReport report = end_of_connection({}, manner);
        CHECK(report.state == BoardState::incompatible);
        return report.hint;
    };
    const std::string own = fmt::format("{}.{}", wire::protocol_major, wire::protocol_minor);
    for (const std::size_t size : {std::size_t{48}, sizeof(wire::BoardHello)})
        CHECK(hint(2, 2, size) ==
              "its protocol is 2.2, the service's is " + own +
                  ": stop the service, then flash the firmware of this release with 'versavis "
                  "flash " +
                  board::firmware_file().string() + "'");
    CHECK(hint(9, 1, 80) ==
          "its protocol is 9.1, the service's is " + own +
              ": install the release of the service that matches the firmware, or flash the "
              "firmware of this release");
}

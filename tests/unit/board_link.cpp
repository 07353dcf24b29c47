// SPDX-License-Identifier: BSD-3-Clause
// The link against a board that is played: what it makes of answers, follow-ups and older boards.
#include "board/board_link.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <condition_variable>
#include <deque>
#include <future>

#include "../support/temporary_directory.hpp"
#include "configuration_check.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr Duration on_the_way =
    milliseconds(100);  // an answer waits so long before it leaves the board

/// Answers at once; time stands still on the way, but for what the stamps say.
class PlayedBoard final : public ByteStream {
 public:
    std::string port() const override { return "played"; }
    PlayedBoard(std::uint8_t minor, bool follows_up, std::vector<wire::Type>* heard = nullptr)
        : minor_(minor), follows_up_(follows_up), heard_(heard) {}

    Expected<Chunk> read(Duration timeout) override {
        std::unique_lock lock(mutex_);
        const auto any = [this] { return !chunks_.empty(); };
        if (!came_.wait_for(lock, std::chrono::nanoseconds(timeout.ns), any))
            return Chunk{host_now(), {}};
        Chunk chunk = std::move(chunks_.front());
        chunks_.pop_front();
        return chunk;
    }

    Expected<> write(std::span<const std::uint8_t> bytes) override {
        decoder_.feed(bytes.data(), bytes.size(),
                      [this](const wire::Packet& packet) { answer(packet); });
        return {};
    }

    ~PlayedBoard() override { closed(); }
    std::function<void()> closed = [] {};

 private:
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
        if (packet.read(hello)) {
            wire::BoardHello message{};
            message.major = wire::protocol_major;
            message.minor = minor_;
            message.capabilities = wire::capability_host_grid;
            message.board_time_ns = now.ns;
            send(message, now);
        } else if (packet.read(configuration)) {
            Judge judge(*this, configuration.id);
            firmware::check(configuration, judge);
            wire::ConfigurationAnswer message{};
            message.id = configuration.id;
            if (judge.refused) message.status = wire::ConfigurationStatus::refused;
            send(message, now);
        } else if (packet.read(request)) {
            send(wire::ClockAnswer{request.id, 0, now.ns, now.ns}, now + on_the_way);
            const Duration until = on_the_way - microseconds(10);
            if (follows_up_)
                send(wire::ClockFollowUp{request.id, 0, (now + until).ns}, now + on_the_way);
        }
    }

    template <class T>
    void send(const T& message, HostTime arrives) {
        wire::Frame frame{};
        wire::encode(message, 7, sequence_++, frame);
        const std::lock_guard lock(mutex_);
        chunks_.push_back({arrives, {frame.bytes, frame.bytes + frame.size}});
        came_.notify_one();
    }

    std::uint8_t minor_;
    bool follows_up_;
    std::vector<wire::Type>* heard_;
    wire::Decoder decoder_;
    std::uint32_t sequence_ = 0;
    std::mutex mutex_;
    std::condition_variable came_;
    std::deque<Chunk> chunks_;
};

struct Listener final : BoardListener {
    std::promise<void> connected;
    std::function<void()> synchronised = [] {};
    void board_restarted() override {}
    void board_synchronised() override { synchronised(); }
    void board_connected() override { connected.set_value(); }
    void board_lost() override {}
    void exposure(const wire::Exposure& /*record*/) override {}
    void imu_sample(const wire::ImuSample& /*sample*/) override {}
    void board_event(const wire::Event& /*event*/) override {}
};

struct Clock {
    clock::Translator translator{
        *clock::OutputClock::create(clock::OutputClockKind::monotonic_raw)};
    test::TemporaryDirectory directory{"/dev/shm"};
    ClockRecorder recorder{
        *ring::Writer::create(directory.path(), {"clock", ring::StreamKind::clock, 64}),
        translator};
};

/// The clock as it stands when the cameras may be started.
clock::ClockReport connect(std::uint8_t minor, bool follows_up) {
    Clock clock;
    Listener listener;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            return std::make_unique<PlayedBoard>(minor, follows_up);
        },
        {}, 1, clock.translator, clock.recorder, listener);
    link.start();
    REQUIRE(listener.connected.get_future().wait_for(std::chrono::seconds(10)) ==
            std::future_status::ready);
    return clock.translator.report();
}

}  // namespace

TEST_CASE("board_link: an exchange ends when the answer truly left, if the board tells") {
    const clock::ClockReport clock = connect(2, true);
    CHECK(clock.exchanges == 4);
    CHECK(clock.round_trip < on_the_way / 2);
}

TEST_CASE(
    "board_link: without a follow-up the answer's own stamp is used, whether one could come or "
    "not") {
    for (const std::uint8_t minor : {std::uint8_t{1}, std::uint8_t{2}}) {
        const clock::ClockReport clock = connect(minor, false);
        CHECK(clock.exchanges == 4);
        CHECK(clock.round_trip >= on_the_way);
    }
}

TEST_CASE("board_link: the grid is aligned before any camera can be started") {
    Clock clock;
    Listener listener;
    std::vector<wire::Type> heard;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            return std::make_unique<PlayedBoard>(2, true, &heard);
        },
        {}, 1, clock.translator, clock.recorder, listener);
    listener.synchronised = [&] {
        link.start_cameras(1, pairing::Start::steady);  // too early
        link.align_grid({1, 2, 3});
    };
    link.start();
    REQUIRE(listener.connected.get_future().wait_for(std::chrono::seconds(10)) ==
            std::future_status::ready);
    CHECK((link.report().capabilities & wire::capability_host_grid) != 0);
    link.stop();
    CHECK(std::count(heard.begin(), heard.end(), wire::Type::align_grid) == 1);
    CHECK(std::count(heard.begin(), heard.end(), wire::Type::start) == 0);
}

TEST_CASE("board_link: what the board refuses is told in the words of the file") {
    Clock clock;
    Listener listener;
    const std::string path = clock.directory.write(
        "v.toml", "[[camera]]\nname = \"left\"\ndevice = \"x\"\nrate_hz = 50\nlatency_us = 60\n");
    Configuration configuration = *load_configuration(path);
    configuration.cameras[0].rate_hz = 2000;  // past the check of the file
    std::promise<BoardReport> closed;
    std::once_flag first;
    BoardLink link(
        [&]() -> Expected<std::unique_ptr<ByteStream>> {
            auto board = std::make_unique<PlayedBoard>(2, true);
            board->closed = [&] {
                std::call_once(first, [&] { closed.set_value(link.report()); });
            };
            return board;
        },
        configuration, 1, clock.translator, clock.recorder, listener);
    link.start();
    auto end = closed.get_future();
    REQUIRE(end.wait_for(std::chrono::seconds(10)) == std::future_status::ready);
    const BoardReport report = end.get();
    CHECK(report.state == BoardState::refused);
    CHECK(report.hint ==
          path +
              ":4:11: 'rate_hz' of [[camera]] \"left\" is 2000 Hz: the board takes 0.1 to 1000 Hz; "
              "change the configuration");
    link.stop();
}

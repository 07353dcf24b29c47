// SPDX-License-Identifier: BSD-3-Clause
// Talks to the board: finds it, configures it, exchanges stamps for the clock, and hands on what it
// reports.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "base/wake_up.hpp"
#include "board/board_counters.hpp"
#include "board/byte_stream.hpp"
#include "board/clock_exchange.hpp"
#include "board/stamping_reader.hpp"
#include "device/handshake.hpp"
#include "engine/clock/translator.hpp"
#include "engine/pairing/pairing.hpp"
#include "plausibility/packet_check.hpp"
#include "settings/configuration.hpp"

namespace versavis::daemon {

/// Called on the link's thread.
class BoardListener {
 public:
    virtual ~BoardListener() = default;
    virtual void
    board_restarted() = 0;  ///< its clock and numbers begin anew; nothing of its new life came yet
    /// Also when settings of cameras alone were changed.
    virtual void board_configured(const wire::ConfigurationAnswer& /*answer*/) {}
    virtual void board_synchronised() = 0;  ///< its clock is known; no camera can be started yet
    virtual void board_connected() = 0;     ///< configured, its clock known: cameras may be started
    /// Cameras of these outputs were stopped and have other settings, `other_rate` another rate;
    /// they may be started. Nothing else changed.
    virtual void cameras_changed(std::uint8_t outputs, std::uint8_t other_rate) = 0;
    virtual void board_lost() = 0;
    virtual void exposure(const wire::Exposure& record, HostTime received) = 0;
    /// False: the sample is doubted, and nothing may be made of its times.
    virtual bool imu_sample(const wire::ImuSample& sample, HostTime received) = 0;
    virtual void exchange_doubted(const Implausibility& doubt) = 0;
    virtual void board_event(const wire::Event& event, HostTime received) = 0;
    virtual void sentence(const wire::Sentence& /*sentence*/, HostTime /*received*/) {}
};

enum class BoardState { absent, handshake, running, incompatible, refused };
const char* to_string(BoardState state);

struct BoardReport {
    BoardState state = BoardState::absent;
    HostTime since;
    std::string hint;  ///< what to do about it
    std::string port;  ///< where it is plugged in
    std::string serial;
    std::string firmware;
    std::uint32_t nonce = 0;
    std::uint32_t capabilities = 0;            ///< bits of wire::Capability
    std::uint32_t present = 0;                 ///< bits of wire::Present
    std::uint32_t fastest_imu_millihertz = 0;  ///< samples that it can read
    std::uint64_t connections = 0;
    std::uint64_t packets = 0;
    std::uint64_t lost_packets = 0;
    std::uint64_t malformed = 0;
    std::uint64_t exchanges_doubted = 0;  ///< answers to clock requests that cannot be true
    std::uint64_t impossible = 0;         ///< packets with a number, nonce or time that cannot be
    std::uint64_t dropped_bytes = 0;      ///< the service did not take them in time
    bool unkept = false;                  ///< it could not store its configuration
    bool awaits_sync = false;             ///< no camera is started before sync pulses come
    wire::Health health{};                ///< its counters began with the service
};

class BoardLink {
 public:
    using OpenStream = std::function<Expected<std::unique_ptr<ByteStream>>()>;

    BoardLink(OpenStream open, const Configuration& configuration, double exchange_rate_hz,
              clock::Translator& translator, ClockRecorder& recorder, BoardListener& listener);
    ~BoardLink();
    BoardLink(const BoardLink&) = delete;
    BoardLink& operator=(const BoardLink&) = delete;

    void start();
    void stop();

    /// The board gets another configuration. If it changes settings of cameras alone, the board
    /// can do so and ticks stay equal among cameras of one rate, these are stopped until
    /// cameras_changed(). Else the board is greeted anew, which stops all until board_connected().
    /// From any thread.
    void reconfigure(const Configuration& configuration);

    /// Starts or stops triggering the cameras of the mask, if the board is there. From any thread.
    void start_cameras(std::uint8_t mask, pairing::Start how);
    void stop_cameras(std::uint8_t mask);

    /// The camera at this output will expose for so long from this trigger on.
    void announce_exposure(unsigned output, std::uint64_t trigger, Duration exposure);

    /// The board's grid shall lie there, if it has that capability. From any thread.
    void align_grid(const wire::AlignGrid& message);

    /// What a time output shall send, if the board has that capability. From any thread.
    void announce_time(const wire::TimeOutput& message);

    BoardReport report() const;
    bool running() const { return accepting_; }

 private:
    using Command = std::variant<wire::Start, wire::Stop, wire::ExpectedExposure, wire::AlignGrid,
                                 wire::TimeOutput>;

    void run();
    bool explained() const;
    Expected<> serve();
    Expected<> converse();
    Expected<> handshake();
    void adopt_configuration();
    Expected<> configure();
    Expected<> change();
    std::uint8_t accept_starts();
    void await_sync(bool awaited);
    Expected<> synchronise();
    Expected<> read(Duration timeout);
    Expected<> read_until(const std::function<bool()>& done, Duration timeout, const char* what);
    void take(const wire::Packet& packet, HostTime received);
    void take(const device::Greeting& greeting, const wire::Header& header, HostTime received);
    void take_answer(const wire::Packet& packet);
    bool same_life(const wire::BoardHello& hello, std::uint32_t nonce, HostTime received) const;
    bool of_this_life(const wire::Header& header);
    void note(const std::optional<Implausibility>& doubt);
    void count_impossible();
    template <class T, class Use>
    bool use(const wire::Packet& packet, Use&& use);
    template <class T>
    Expected<> send(const T& message);
    void give(const Command& command);
    void forget_commands();
    Expected<> send_commands();
    void set_state(BoardState state, const std::string& hint);
    bool pause(Duration duration) const;

    OpenStream open_;
    Configuration file_;  ///< for the words of a refusal
    wire::Configuration configuration_;
    clock::Translator& translator_;
    BoardListener& listener_;

    WakeUp wake_;  ///< of the link's thread: bytes or commands came
    std::mutex command_mutex_;
    std::vector<Command> commands_;  ///< to be sent by the link's thread, so that no other waits
    bool takes_commands_ = false;
    std::optional<Configuration> next_file_;  ///< to be adopted; under the same lock
    std::uint8_t missed_starts_ = 0;          ///< of cameras, while none was taken; the same lock
    std::atomic<bool> changes_{false};        ///< next_file_ is there

    // Of the link's thread.
    std::unique_ptr<ByteStream> stream_;
    std::optional<StampingReader> reader_;
    device::Encoder encoder_;
    ClockExchange clock_;
    wire::Decoder decoder_;
    SequenceWatch sequence_;
    BoardCounters counters_;
    bool greeted_ = false;
    bool connected_ = false;
    std::uint64_t dropped_bytes_ = 0;  ///< of this connection, reported so far
    bool anew_ = false;  ///< the board began a new life, or seems to: greet it at once
    device::Greeting greeting_;
    std::uint32_t nonce_ = 0;
    std::uint32_t stranger_ = 0;  ///< nonce of the last packets that are of no known life
    int strangers_ = 0;           ///< how many of them came in a row
    std::uint32_t last_life_ = 0;
    bool answered_ = false;
    wire::ConfigurationAnswer answer_{};
    std::vector<std::string> refusals_;
    HostTime last_packet_;

    mutable std::mutex report_mutex_;
    BoardReport report_;
    std::atomic<bool> stop_{false};
    std::atomic<bool> accepting_{false};  ///< configured: cameras may be started
    std::thread thread_;
};

}  // namespace versavis::daemon

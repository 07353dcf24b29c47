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
#include <string>
#include <thread>
#include <vector>

#include "board/byte_stream.hpp"
#include "board/clock_exchange.hpp"
#include "configuration/configuration.hpp"
#include "engine/clock/translator.hpp"
#include "engine/pairing/pairing.hpp"
#include "wire/packet.hpp"

namespace versavis::daemon {

/// Called on the link's thread.
class BoardListener {
 public:
    virtual ~BoardListener() = default;
    virtual void
    board_restarted() = 0;  ///< its clock and numbers begin anew; nothing of its new life came yet
    virtual void board_synchronised() = 0;  ///< its clock is known; no camera can be started yet
    virtual void board_connected() = 0;     ///< configured, its clock known: cameras may be started
    virtual void board_lost() = 0;
    virtual void exposure(const wire::Exposure& record) = 0;
    virtual void imu_sample(const wire::ImuSample& sample) = 0;
    virtual void board_event(const wire::Event& event) = 0;
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
    std::uint32_t capabilities = 0;  ///< bits of wire::Capability
    std::uint64_t connections = 0;
    std::uint64_t packets = 0;
    std::uint64_t lost_packets = 0;
    std::uint64_t malformed = 0;
    wire::Health health{};
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

    /// Starts or stops triggering the cameras of the mask, if the board is there. From any thread.
    void start_cameras(std::uint8_t mask, pairing::Start how);
    void stop_cameras(std::uint8_t mask);

    /// The camera at this output will expose for so long from this trigger on.
    void announce_exposure(unsigned output, std::uint64_t trigger, Duration exposure);

    /// The board's grid shall lie there, if it has that capability. From any thread.
    void align_grid(const wire::AlignGrid& message);

    BoardReport report() const;
    bool running() const { return accepting_; }

 private:
    void run();
    bool explained() const;
    Expected<> serve();
    Expected<> handshake();
    Expected<> configure();
    Expected<> synchronise();
    Expected<> read(Duration timeout);
    Expected<> read_until(const std::function<bool()>& done, Duration timeout, const char* what);
    void take(const wire::Packet& packet, HostTime received);
    bool same_life(const wire::Header& header, HostTime received) const;
    void count_losses(const wire::Header& header);
    template <class T>
    Expected<> send(const T& message);
    void set_state(BoardState state, const std::string& hint);
    bool pause(Duration duration) const;

    OpenStream open_;
    Configuration file_;  ///< for the words of a refusal
    wire::Configuration configuration_;
    clock::Translator& translator_;
    BoardListener& listener_;

    std::mutex send_mutex_;  ///< guards stream_ against senders, and the sequence
    std::unique_ptr<ByteStream> stream_;
    std::uint32_t host_nonce_ = 0;
    std::uint32_t host_sequence_ = 0;

    // Of the link's thread.
    ClockExchange clock_;
    wire::Decoder decoder_;
    bool greeted_ = false;
    bool connected_ = false;
    wire::BoardHello hello_{};
    std::uint32_t nonce_ = 0;
    std::uint32_t next_sequence_ = 0;
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

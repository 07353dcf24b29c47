// SPDX-License-Identifier: BSD-3-Clause
// Compares the board's clock with the host's: requests, answers, and when those truly left.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>

#include "engine/clock/translator.hpp"
#include "engine/plausibility/implausibility.hpp"
#include "publish/clock_recorder.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// Belongs to the link's thread.
class ClockExchange {
 public:
    ClockExchange(double rate_hz, clock::Translator& translator, ClockRecorder& recorder);

    /// A conversation begins: nothing that was asked before counts.
    void begin();

    /// Drops an answer that waits for its follow-up: the board may have begun a new life.
    void abandon() { exchange_.reset(); }

    /// The board's clock began anew, and with it the nonce of its life.
    void board_restarted(std::uint32_t nonce);

    wire::ClockRequest request();

    /// The request leaves now: it must be written at once.
    void leaves();
    HostTime next_request() const { return next_request_; }

    /// Doubted: what contradicts causality is not used.
    std::optional<Implausibility> take(const wire::ClockAnswer& answer, HostTime received);
    std::optional<Implausibility> take(const wire::ClockFollowUp& follow_up);

    /// When a sample left is evidence of the clock, too.
    void take(const wire::ImuSample& sample, HostTime received);

    unsigned answers() const { return answers_; }  ///< since begin()
    bool expects_follow_up() const { return exchange_.has_value(); }

    /// Hands on an answer whose follow-up did not come.
    void settle();

 private:
    struct Request {
        std::uint32_t id = 0;
        HostTime sent;
    };

    void plan_next_request();
    std::optional<Request> request_of(const wire::ClockAnswer& answer);

    Duration interval_;
    clock::Translator& translator_;
    ClockRecorder& recorder_;
    std::mt19937 random_{std::random_device{}()};
    std::uint32_t request_id_ = 0;
    std::deque<Request> open_;  ///< in their order: a slow link holds several of them
    std::optional<clock::Exchange> exchange_;  ///< answered; when the answer left may still follow
    std::uint32_t exchange_id_ = 0;            ///< of its request
    unsigned answers_ = 0;
    HostTime next_request_;
};

}  // namespace versavis::daemon

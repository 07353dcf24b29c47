// SPDX-License-Identifier: BSD-3-Clause
#include "board/clock_exchange.hpp"

#include <algorithm>

namespace versavis::daemon {

namespace {

/// An answer that takes longer says little and may be of another request.
constexpr Duration request_timeout = milliseconds(500);

/// Requests come between these parts of the interval, so that they do not beat with the schedule of
/// the bus.
constexpr double earliest_part = 0.75;
constexpr double latest_part = 1.25;

std::optional<Implausibility> contradicts_causality(const clock::Exchange& exchange) {
    const Duration waited = exchange.arrived - exchange.sent;
    const Duration held = exchange.answered - exchange.received;
    if (held.ns >= 0 && held < waited) return std::nullopt;
    return Implausibility{EventReason::implausible_time, exchange.answered.ns,
                          (exchange.received + waited).ns};
}

}  // namespace

ClockExchange::ClockExchange(double rate_hz, clock::Translator& translator, ClockRecorder& recorder)
    : interval_{static_cast<std::int64_t>(1e9 / rate_hz)},
      translator_(translator),
      recorder_(recorder) {}

void ClockExchange::begin() {
    answers_ = 0;
    open_.clear();
    exchange_.reset();
}

void ClockExchange::board_restarted(std::uint32_t nonce) {
    translator_.board_restarted();
    recorder_.board_restarted(nonce);
}

wire::ClockRequest ClockExchange::request() {
    settle();
    const HostTime now = host_now();
    while (!open_.empty() && now - open_.front().sent > request_timeout) open_.pop_front();
    wire::ClockRequest request{};
    request.id = ++request_id_;
    open_.push_back({request.id, now});
    plan_next_request();
    leaves();
    return request;
}

void ClockExchange::leaves() {
    if (!open_.empty()) open_.back().sent = host_now();
}

void ClockExchange::plan_next_request() {
    std::uniform_real_distribution<> dither(earliest_part, latest_part);
    const double ns = dither(random_) * static_cast<double>(interval_.ns);
    next_request_ = host_now() + Duration{static_cast<std::int64_t>(ns)};
}

/// What was asked before it is answered in order, or was lost.
std::optional<ClockExchange::Request> ClockExchange::request_of(const wire::ClockAnswer& answer) {
    const auto found = std::find_if(open_.begin(), open_.end(), [&](const Request& request) {
        return request.id == answer.id;
    });
    if (found == open_.end()) return std::nullopt;
    const Request request = *found;
    open_.erase(open_.begin(), found + 1);
    return request;
}

/// The board cannot have had the request for longer than the host waited.
std::optional<Implausibility> ClockExchange::take(const wire::ClockAnswer& answer,
                                                  HostTime received) {
    const auto request = request_of(answer);
    if (!request || received - request->sent > request_timeout) return std::nullopt;
    settle();
    ++answers_;
    const clock::Exchange exchange{request->sent, {answer.received_ns}, {answer.sent_ns}, received};
    if (const auto doubt = contradicts_causality(exchange)) return doubt;
    exchange_ = exchange;
    exchange_id_ = answer.id;
    return std::nullopt;
}

/// The answer left after it was written.
std::optional<Implausibility> ClockExchange::take(const wire::ClockFollowUp& follow_up) {
    if (!exchange_ || follow_up.id != exchange_id_) return std::nullopt;
    clock::Exchange exchange = *exchange_;
    if (follow_up.sent_ns < exchange.answered.ns)
        return Implausibility{EventReason::implausible_time, follow_up.sent_ns,
                              exchange.answered.ns};
    exchange.answered.ns = follow_up.sent_ns;
    if (const auto doubt = contradicts_causality(exchange)) return doubt;
    exchange_ = exchange;
    settle();
    return std::nullopt;
}

/// A board whose link does not know it leaves the departure open.
void ClockExchange::take(const wire::ImuSample& sample, HostTime received) {
    if (sample.departure_ns == 0) return;
    const clock::OneWay message{BoardTime{sample.time_ns} + Duration{sample.departure_ns},
                                received};
    recorder_.one_way(message);
    translator_.add(message);
}

void ClockExchange::settle() {
    if (!exchange_) return;
    recorder_.exchange(exchange_id_, *exchange_);
    translator_.add(*exchange_);
    exchange_.reset();
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "native_board.hpp"

#include <algorithm>
#include <utility>

namespace versavis::firmware {

namespace {

constexpr Nanoseconds spi_byte_ns = 8'000;  // 1 MHz

}  // namespace

NativeBoard::NativeBoard(const Identity& identity, Surroundings surroundings)
    : surroundings_(std::move(surroundings)),
      board_(Hal{*this, *this, *this, *this, *this, *this}, identity) {}

void NativeBoard::receive(std::span<const std::uint8_t> bytes, Nanoseconds at) {
    received_.insert(received_.end(), bytes.begin(), bytes.end());
    received_at_ = at;
}

Nanoseconds NativeBoard::burst_end() const {
    return burst_ ? burst_->at + static_cast<Nanoseconds>(burst_->transmitted.size()) * spi_byte_ns
                  : INT64_MAX;
}

Nanoseconds NativeBoard::next_wake() const {
    Nanoseconds wake = std::min(board_.next_wake(), burst_end());
    if (!words_.empty()) wake = std::min(wake, words_.front().at);
    if (!edges_.empty()) wake = std::min(wake, edges_.top().at);
    return wake;
}

void NativeBoard::run_until(Nanoseconds until) {
    for (Nanoseconds wake = next_wake(); wake <= until; wake = next_wake()) {
        now_ = std::max(now_, wake);
        while (!words_.empty() && words_.front().at <= now_) {
            const Word word = words_.front();
            words_.pop_front();
            surroundings_.outputs_changed(word.at, word.levels);
        }
        board_.poll();
    }
    now_ = std::max(now_, until);
    board_.poll();
}

void NativeBoard::consume(std::size_t size) {
    transmitted_.erase(transmitted_.begin(), transmitted_.begin() + static_cast<std::ptrdiff_t>(size));
}

bool NativeBoard::push(Nanoseconds at, std::uint32_t levels) {
    if (words_.size() == word_capacity) return false;
    lateness_ = std::max(lateness_, now_ - at);
    words_.push_back({std::max(at, now_), levels});
    return true;
}

Nanoseconds NativeBoard::take_lateness() { return std::exchange(lateness_, 0); }

bool NativeBoard::pop(Edge& edge) {
    if (edges_.empty() || edges_.top().at > now_) return false;
    edge = edges_.top();
    edges_.pop();
    return true;
}

bool NativeBoard::start(Nanoseconds at, const std::uint8_t* transmit, std::size_t size) {
    if (burst_) return false;
    burst_ = Burst{std::max(at, now_), {transmit, transmit + size}};
    return true;
}

bool NativeBoard::complete(Transfer& transfer) {
    if (burst_end() > now_) return false;
    const Burst burst = *std::exchange(burst_, std::nullopt);
    transfer = {};
    transfer.started = burst.at;
    transfer.size = std::min(burst.transmitted.size(), max_burst);
    surroundings_.imu_burst(burst.at, burst.transmitted, std::span(transfer.received, transfer.size));
    return true;
}

void NativeBoard::write(const std::uint8_t* data, std::size_t size) {
    transmitted_.insert(transmitted_.end(), data, data + size);
}

std::size_t NativeBoard::read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) {
    const std::size_t size = std::min(capacity, received_.size());
    std::copy_n(received_.begin(), size, data);
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(size));
    received = received_at_;
    return size;
}

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
#include "native_board.hpp"

#include <algorithm>
#include <utility>

namespace versavis::firmware {

NativeBoard::NativeBoard(const Identity& identity, Environment environment, Nanoseconds boot)
    : environment_(std::move(environment)),
      now_(boot),
      fed_(boot),
      board_(hardware(identity), identity) {}

Hal NativeBoard::hardware(const Identity& identity) {
    const Hal hal{*this, *this, *this, *this, *this, uart_, *this, *this, *this, *this, *this};
    return environment_.tap == nullptr ? hal : environment_.tap->tap(hal, identity);
}

void NativeBoard::poll() {
    if (environment_.tap != nullptr) environment_.tap->poll_begins(now_);
    board_.poll();
    if (environment_.tap != nullptr) environment_.tap->poll_ended(board_.next_wake());
}

void NativeBoard::set_input(std::uint8_t input, bool level) {
    const std::uint32_t bit = 1U << input;
    inputs_ = level ? inputs_ | bit : inputs_ & ~bit;
}

void NativeBoard::set_level(std::uint8_t input, bool level) {
    set_input(input, level);
    drive_pins(now_);
}

void NativeBoard::receive(std::span<const std::uint8_t> bytes, Nanoseconds at) {
    received_.insert(received_.end(), bytes.begin(), bytes.end());
    received_at_ = at;
    attention_ = true;
}

void NativeBoard::uart_receive(std::span<const std::uint8_t> bytes, Nanoseconds at) {
    uart_bytes_.push_back({at, {bytes.begin(), bytes.end()}});
}

Nanoseconds NativeBoard::burst_end() const {
    if (!burst_ || imu_bus_stuck_) return never;
    const ImuTransfer& transfer = burst_->transfer;
    const Nanoseconds bits = Nanoseconds{transfer.size} * 8;
    const Nanoseconds gaps = Nanoseconds{transfer.size} / 2 * transfer.word_gap_ns;
    return burst_->at + bits * 1'000'000'000 / std::max<std::uint32_t>(transfer.clock_hz, 1) + gaps;
}

Nanoseconds NativeBoard::next_wake() const {
    if (attention_) return now_;
    Nanoseconds wake = std::min(board_.next_wake(), burst_end());
    if (!words_.empty()) wake = std::min(wake, words_.front().at);
    if (!edges_.empty()) wake = std::min(wake, edges_.top().at);
    wake = std::min(wake, light_cut());
    if (!uart_bytes_.empty()) wake = std::min(wake, uart_bytes_.front().at);
    return wake;
}

void NativeBoard::run_until(Nanoseconds until) {
    for (Nanoseconds wake = next_wake(); wake <= until && !stalled_; wake = next_wake()) {
        now_ = std::max(now_, wake);
        attention_ = false;
        advance_hardware();
        poll();
        // What is not read in time is lost.
        while (!uart_bytes_.empty() && uart_bytes_.front().at <= now_) uart_bytes_.pop_front();
    }
    now_ = std::max(now_, until);
    if (stalled_) advance_hardware();
    watchdog_bit_ = watchdog_bit_ || now_ - fed_ > watchdog_limit;
}

/// Words and edges in the order of their times.
void NativeBoard::advance_hardware() {
    for (;;) {
        const Nanoseconds word = words_.empty() ? never : words_.front().at;
        const Nanoseconds edge = edges_.empty() ? never : edges_.top().at;
        const Nanoseconds cut = light_cut();
        if (std::min({word, edge, cut}) > now_) return;
        if (cut <= std::min(word, edge)) {
            light_cut_ = true;
            drive_pins(cut);
        } else if (word <= edge) {
            levels_ = words_.front().levels;
            words_.pop_front();
            drive_pins(word);
        } else {
            const Edge next = edges_.top();
            edges_.pop();
            apply(next);
        }
    }
}

Nanoseconds NativeBoard::light_cut() const {
    return lit_since_ == never ? never : lit_since_ + routes_.light_limit;
}

void NativeBoard::apply(const Edge& edge) {
    set_input(edge.input, edge.level);
    drive_pins(edge.at + routing_latency);
    if ((listened_ >> edge.input & 1U) == 0) return;
    const bool data_ready = edge.input >= input_imu_ready && edge.input < input_pulse;
    if (data_ready && !edge.level) return;
    if (stamped_.size() == edge_capacity)
        ++lost_edges_;
    else
        stamped_.push_back(edge);
}

bool NativeBoard::exposing(unsigned camera) const {
    return (inputs_ >> camera & 1U) != (routes_.inverted_exposures >> camera & 1U);
}

void NativeBoard::drive_pins(Nanoseconds at) {
    const auto scheduled = [this](unsigned output) { return (levels_ >> output & 1U) != 0; };
    std::uint32_t pins = 0;
    const auto drive = [&pins](unsigned pin, bool level) { pins |= (level ? 1U : 0U) << pin; };
    bool lit = scheduled(output_light_lead);
    for (unsigned camera = 0; camera < camera_count; ++camera) {
        const std::uint8_t master = routes_.master[camera];
        const bool inverted = (routes_.inverted_triggers >> camera & 1U) != 0;
        drive(camera, master == not_routed ? scheduled(camera) : exposing(master) != inverted);
        lit = lit || ((routes_.light_cameras >> camera & 1U) != 0 && exposing(camera));
    }
    light_cut_ = light_cut_ && scheduled(output_light_gate);
    lit = lit && scheduled(output_light_gate) && !light_cut_;
    lit_since_ = lit ? std::min(lit_since_, at) : never;
    drive(pin_light, lit != routes_.light_inverted);
    drive(pin_sync, scheduled(output_sync));
    drive(pin_test, routes_.test_input == not_routed ? scheduled(output_test)
                                                     : (inputs_ >> routes_.test_input & 1U) != 0);
    if (pins == pins_) return;
    pins_ = pins;
    if (environment_.outputs_changed) environment_.outputs_changed(at, pins);
}

void NativeBoard::consume(std::size_t size, Nanoseconds at) {
    transmitted_.erase(transmitted_.begin(),
                       transmitted_.begin() + static_cast<std::ptrdiff_t>(size));
    consumed_ += size;
    if (watched_ && consumed_ >= *watched_) {
        departure_ = at;
        watched_.reset();
    }
    attention_ = attention_ || size > 0;
}

bool NativeBoard::push(Nanoseconds at, std::uint32_t levels) {
    if (words_.size() == word_capacity) return false;
    Nanoseconds leaves = std::max(at, now_);
    if (!words_.empty()) leaves = std::max(leaves, words_.back().at);
    if (leaves > at) late_.push_back({at, leaves});
    words_.push_back({leaves, levels});
    return true;
}

bool NativeBoard::take_late(Late& late) {
    if (late_.empty()) return false;
    late = late_.front();
    late_.pop_front();
    return true;
}

bool NativeBoard::pop(Edge& edge) {
    if (stamped_.empty()) return false;
    edge = stamped_.front();
    stamped_.pop_front();
    return true;
}

std::uint32_t NativeBoard::take_lost() { return std::exchange(lost_edges_, 0); }

void NativeBoard::route(const Routes& routes) {
    routes_ = routes;
    drive_pins(now_);
}

bool NativeBoard::start(Nanoseconds at, const ImuTransfer& transfer) {
    if (burst_) return false;
    burst_ = Burst{std::max(at, now_), transfer};
    return true;
}

bool NativeBoard::complete(ImuReply& reply) {
    if (burst_end() > now_) return false;
    const Burst burst = *std::exchange(burst_, std::nullopt);
    reply = {};
    reply.started = burst.at;
    if (environment_.imu_transfer)
        environment_.imu_transfer(burst.at, burst.transfer,
                                  std::span(reply.bytes, burst.transfer.size));
    return true;
}

void NativeBoard::Uart::write(const std::uint8_t* data, std::size_t size) {
    if (board.environment_.uart_sent)
        board.environment_.uart_sent(board.now_, board.baud_, std::span(data, size));
}

std::size_t NativeBoard::Uart::read(std::uint8_t* data, std::size_t capacity,
                                    Nanoseconds& received) {
    if (board.uart_bytes_.empty() || board.uart_bytes_.front().at > board.now_ || capacity == 0)
        return 0;
    UartBytes& first = board.uart_bytes_.front();
    const std::size_t size = std::min(capacity, first.bytes.size());
    std::copy_n(first.bytes.begin(), size, data);
    first.bytes.erase(first.bytes.begin(), first.bytes.begin() + static_cast<std::ptrdiff_t>(size));
    // Ten bits for each byte still to be read.
    received =
        first.at - static_cast<Nanoseconds>(first.bytes.size()) * 10'000'000'000 / board.baud_;
    if (first.bytes.empty()) board.uart_bytes_.pop_front();
    return size;
}

std::size_t NativeBoard::free_space() {
    return link_capacity_ - std::min(link_capacity_, transmitted_.size());
}

void NativeBoard::write(const std::uint8_t* data, std::size_t size) {
    transmitted_.insert(transmitted_.end(), data, data + size);
    written_ += size;
}

void NativeBoard::watch_departure() {
    watched_ = written_;
    departure_.reset();
}

bool NativeBoard::take_departure(Nanoseconds& at) {
    if (!departure_) return false;
    at = *std::exchange(departure_, std::nullopt);
    return true;
}

std::size_t NativeBoard::read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) {
    const std::size_t size = std::min(capacity, received_.size());
    std::copy_n(received_.begin(), size, data);
    received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(size));
    received = received_at_;
    return size;
}

void NativeBoard::publish(const ImuImage& image) {
    image_ = image;
    if (environment_.imu_output_ready) environment_.imu_output_ready(now_);
}

std::vector<std::uint16_t> NativeBoard::read_imu_output(std::span<const std::uint16_t> words) {
    constexpr std::uint16_t burst = 0x3E00;
    std::vector<std::uint16_t> answer(words.size());
    if (!words.empty() && words[0] == burst) {
        for (std::size_t i = 1; i < words.size() && i <= std::size(image_.burst); ++i)
            answer[i] = image_.burst[i - 1];
        return answer;
    }
    // Registers: each answer comes with the word after its question.
    for (std::size_t i = 1; i < words.size(); ++i) {
        const unsigned address = words[i - 1] >> 8U;
        if (address >= 0x04 && address <= 0x18)
            answer[i] = image_.burst[1 + (address - 0x04) / 2];
        else if (address == 0x3C)
            answer[i] = image_.burst[0];
        else if (address == 0x56)
            answer[i] = image_.product;
    }
    return answer;
}

std::size_t NativeBoard::load(std::uint8_t* data, std::size_t capacity) {
    if (environment_.flash == nullptr) return 0;
    std::copy_n(environment_.flash->begin(), std::min(capacity, environment_.flash->size()), data);
    return environment_.flash->size();
}

void NativeBoard::store(const std::uint8_t* data, std::size_t size) {
    if (environment_.flash != nullptr) environment_.flash->assign(data, data + size);
}

void NativeBoard::reboot(bool to_boot_loader) {
    if (environment_.reboot) environment_.reboot(to_boot_loader);
}

}  // namespace versavis::firmware

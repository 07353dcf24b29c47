// SPDX-License-Identifier: BSD-3-Clause
#include "native_board.hpp"

#include <algorithm>
#include <utility>

namespace versavis::firmware {

NativeBoard::NativeBoard(const Identity& identity, Environment environment, Nanoseconds boot,
                         const PortModel& model)
    : environment_(std::move(environment)),
      model_(model),
      random_(model.seed),
      now_(boot),
      fed_(boot),
      board_(hardware(identity), identity) {}

Hal NativeBoard::hardware(const Identity& identity) {
    const PortFacts facts{model_.present, model_.fastest_imu_millihertz, model_.output_grain_bits,
                          model_.output_step_ns};
    const Hal hal{*this, *this, *this, *this, *this, uart_,
                  *this, *this, *this, *this, *this, facts};
    return environment_.tap == nullptr ? hal : environment_.tap->tap(hal, identity);
}

Nanoseconds NativeBoard::draw(Nanoseconds most) {
    return most == 0 ? 0 : static_cast<Nanoseconds>(random_() % static_cast<std::uint64_t>(most));
}

/// Time passes in each call of the core, and interrupts come in between.
void NativeBoard::spend() {
    if (model_.call_ns == 0) return;
    Nanoseconds cost = model_.call_ns + draw(model_.jitter_ns);
    if (draw(8) == 0) cost += draw(model_.interrupt_ns);
    advance_to(now_ + cost);
}

Nanoseconds NativeBoard::now() {
    spend();
    return now_;
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
    for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), link_packet_size))) {
        const auto packet = bytes.first(std::min(bytes.size(), link_packet_size));
        received_.push_back({at, {packet.begin(), packet.end()}});
    }
    attention_ = true;
}

void NativeBoard::uart_receive(std::span<const std::uint8_t> bytes, Nanoseconds at) {
    uart_bytes_.push_back({at, {bytes.begin(), bytes.end()}});
}

Nanoseconds NativeBoard::transfer_end(Nanoseconds at, const ImuTransfer& transfer) const {
    const bool spi = transfer.bus == ImuTransfer::Bus::spi;
    if (!spi && i2c_held_) return at + i2c_patience;
    // On I2C each byte is acknowledged, and a read sends the address twice, each after a start; a
    // stop ends both.
    const bool read = transfer.bus == ImuTransfer::Bus::i2c_read;
    const Nanoseconds bits =
        spi ? Nanoseconds{transfer.size} * 8
            : (Nanoseconds{transfer.size} + (read ? 2 : 1)) * 9 + (read ? 3 : 2);
    const Nanoseconds gaps = Nanoseconds{transfer.size} / 2 * transfer.word_gap_ns;
    return at + bits * 1'000'000'000 / std::max<std::uint32_t>(transfer.clock_hz, 1) + gaps;
}

Nanoseconds NativeBoard::job_end() const {
    if (!armed_ || armed_->at == never || imu_bus_stuck_) return never;
    Nanoseconds at = armed_->at;
    for (unsigned i = armed_->taken; i < armed_->job.count; ++i) {
        if (i > armed_->taken) at += armed_->job.pause;
        at = transfer_end(at, armed_->job.transfers[i]);
    }
    return at;
}

/// When the port calls the core.
Nanoseconds NativeBoard::next_attention() const {
    if (attention_ || !received_.empty()) return now_;
    Nanoseconds next = std::min(board_.next_wake(), job_end());
    const auto edge =
        std::find_if(stamped_.begin(), stamped_.end(),
                     [](const StampedEdge& waiting) { return !is_data_ready(waiting.edge.input); });
    if (edge != stamped_.end()) next = std::min(next, edge->edge.at + model_.edge_lag_ns);
    if (stamped_.size() >= model_.edges / 2)
        next = std::min(next, stamped_.front().edge.at + model_.edge_lag_ns);
    if (!uart_bytes_.empty()) next = std::min(next, uart_bytes_.front().at);
    return next;
}

Nanoseconds NativeBoard::next_in_hardware() const {
    Nanoseconds next = light_cut();
    if (!words_.empty()) next = std::min(next, words_.front().at);
    if (!edges_.empty()) next = std::min(next, edges_.top().at);
    if (environment_.next_event) next = std::min(next, environment_.next_event());
    return next;
}

Nanoseconds NativeBoard::next_wake() const {
    return std::min(next_attention(), next_in_hardware());
}

void NativeBoard::run_until(Nanoseconds until) {
    for (Nanoseconds wake = next_wake(); wake <= until && !stalled_; wake = next_wake()) {
        advance_to(std::max(now_, wake));
        if (next_attention() <= now_) poll_core();
    }
    advance_to(until);
    watchdog_bit_ = watchdog_bit_ || now_ - fed_ > watchdog_limit;
}

void NativeBoard::poll_core() {
    advance_to(now_ + draw(model_.wake_ns));
    attention_ = false;
    const Nanoseconds began = now_;
    if (environment_.tap != nullptr) environment_.tap->poll_begins(now_);
    board_.poll();
    if (environment_.tap != nullptr) environment_.tap->poll_ended(board_.next_wake());
    // What nobody reads is lost.
    while (!uart_bytes_.empty() && uart_bytes_.front().at <= began) uart_bytes_.pop_front();
}

/// Words, edges and what happens around the board, in the order of their times.
void NativeBoard::advance_to(Nanoseconds until) {
    for (Nanoseconds next = next_in_hardware(); next <= until; next = next_in_hardware()) {
        now_ = std::max(now_, next);
        const Nanoseconds word = words_.empty() ? never : words_.front().at;
        const Nanoseconds edge = edges_.empty() ? never : edges_.top().at;
        if (light_cut() <= next) {
            light_cut_ = true;
            drive_pins(next);
        } else if (word <= next) {
            levels_ = words_.front().levels;
            words_.pop_front();
            attention_ = attention_ || std::exchange(words_full_, false);
            drive_pins(word);
        } else if (edge <= next) {
            const Edge due = edges_.top();
            edges_.pop();
            apply(due);
        } else {
            environment_.fire(next);
        }
    }
    now_ = std::max(now_, until);
}

Nanoseconds NativeBoard::light_cut() const {
    return lit_since_ == never ? never : lit_since_ + routes_.light_limit;
}

void NativeBoard::apply(const Edge& edge) {
    set_input(edge.input, edge.level);
    drive_pins(edge.at + routing_latency);
    const Nanoseconds stamp = edge.at / model_.edge_grain_ns * model_.edge_grain_ns;
    if (is_data_ready(edge.input)) {
        if (!edge.level) return;
        ready_at_[edge.input] = stamp;
        if (armed_ && armed_->at == never && armed_->job.input == edge.input &&
            stamp > armed_->job.after)
            begin_job(edge.at + model_.imu_start_ns);
    }
    if ((listened_ >> edge.input & 1U) == 0) return;
    if (stamped_.size() == model_.edges)
        ++lost_edges_;
    else
        stamped_.push_back({{stamp, edge.input, edge.level}, std::exchange(lost_edges_, 0)});
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
        departure_ = at - model_.departure_ns;
        watched_.reset();
        attention_ = true;
    }
    if (size > 0) attention_ = attention_ || std::exchange(link_full_, false);
}

Nanoseconds NativeBoard::push(Nanoseconds at, std::uint32_t levels) {
    spend();
    if (words_.size() == model_.words) {
        words_full_ = true;
        return never;
    }
    const Nanoseconds grain = Nanoseconds{1} << model_.output_grain_bits;
    Nanoseconds leaves =
        std::max({at, now_ + model_.word_lead_ns, last_word_ + model_.output_step_ns});
    leaves = (leaves + grain - 1) / grain * grain;
    last_word_ = leaves;
    words_.push_back({leaves, levels});
    return leaves;
}

void NativeBoard::listen(std::uint32_t inputs) {
    spend();
    listened_ = inputs;
}

bool NativeBoard::pop(Edge& edge) {
    spend();
    if (stamped_.empty() || stamped_.front().lost_before != 0 || !visible(stamped_.front().edge))
        return false;
    edge = stamped_.front().edge;
    stamped_.pop_front();
    return true;
}

Nanoseconds NativeBoard::settled() {
    spend();
    const Nanoseconds known = now_ - model_.edge_lag_ns;
    return stamped_.empty() ? known : std::min(known, stamped_.front().edge.at);
}

std::uint32_t NativeBoard::take_lost() {
    spend();
    return std::exchange(stamped_.empty() ? lost_edges_ : stamped_.front().lost_before, 0);
}

Routing::Switched NativeBoard::route(const Routes& routes, bool force) {
    spend();
    bool clean = true;
    for (unsigned i = 0; i < camera_count; ++i) {
        if (routes.master[i] == routes_.master[i]) continue;
        for (const std::uint8_t master : {routes.master[i], routes_.master[i]})
            if (master != not_routed && exposing(master)) clean = false;
    }
    if (!clean && !force) return {};
    if (!driven_) levels_ |= routes.inverted_triggers;
    driven_ = true;
    routes_ = routes;
    drive_pins(now_);
    return {now_ + 1, clean};
}

bool NativeBoard::arm(const ImuJob& job) {
    spend();
    if (armed_) return false;
    armed_ = ArmedJob{never, job};
    if (job.input == not_routed)
        begin_job(std::max(job.after, now_));
    else if (ready_at_[job.input] > job.after)
        begin_job(std::max(ready_at_[job.input] + model_.imu_start_ns, now_));
    return true;
}

void NativeBoard::begin_job(Nanoseconds at) {
    armed_->at = std::max(at, imu_free_at_ + armed_->job.pause);
}

bool NativeBoard::take_reply(ImuReply& reply) {
    spend();
    if (job_end() > now_) return false;
    const ImuTransfer& transfer = armed_->job.transfers[armed_->taken];
    reply = {};
    reply.started = armed_->at;
    reply.ended = transfer_end(reply.started, transfer);
    const bool spi = transfer.bus == ImuTransfer::Bus::spi;
    bool acknowledged = !i2c_held_;
    if (environment_.imu_transfer && (spi || !i2c_held_))
        acknowledged = environment_.imu_transfer(reply.started, transfer,
                                                 std::span(reply.bytes, transfer.size));
    reply.refused = !spi && !acknowledged;
    imu_free_at_ = reply.ended;
    armed_->at = reply.ended + armed_->job.pause;
    if (++armed_->taken == armed_->job.count) armed_.reset();
    return true;
}

void NativeBoard::disarm() {
    spend();
    if (armed_ && armed_->at <= now_) imu_free_at_ = now_;
    armed_.reset();
}

void NativeBoard::Uart::set_baud(std::uint32_t baud) {
    board.spend();
    board.baud_ = baud;
}

/// Bytes are bytes here, however their bits are sent.
void NativeBoard::Uart::invert_transmitter(bool /*inverted*/) { board.spend(); }

void NativeBoard::Uart::write(const std::uint8_t* data, std::size_t size) {
    board.spend();
    if (board.environment_.uart_sent)
        board.environment_.uart_sent(board.now_, board.baud_, std::span(data, size));
}

std::size_t NativeBoard::Uart::read(std::uint8_t* data, std::size_t capacity,
                                    Nanoseconds& received) {
    board.spend();
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
    spend();
    const std::size_t space = link_capacity_ - std::min(link_capacity_, transmitted_.size());
    link_full_ = space == 0;
    return space;
}

void NativeBoard::write(const std::uint8_t* data, std::size_t size) {
    spend();
    transmitted_.insert(transmitted_.end(), data, data + size);
    written_ += size;
}

void NativeBoard::watch_departure() {
    spend();
    watched_ = written_;
    departure_.reset();
}

bool NativeBoard::take_departure(Nanoseconds& at) {
    spend();
    if (!departure_) return false;
    at = *std::exchange(departure_, std::nullopt);
    return true;
}

std::size_t NativeBoard::read(std::uint8_t* data, Nanoseconds& received) {
    spend();
    if (received_.empty()) return 0;
    const Packet packet = std::move(received_.front());
    received_.pop_front();
    std::copy(packet.bytes.begin(), packet.bytes.end(), data);
    received = packet.at;
    return packet.bytes.size();
}

void NativeBoard::publish(const ImuImage& image) {
    spend();
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
    spend();
    if (environment_.flash == nullptr) return 0;
    std::copy_n(environment_.flash->begin(), std::min(capacity, environment_.flash->size()), data);
    return environment_.flash->size();
}

bool NativeBoard::store(const std::uint8_t* data, std::size_t size) {
    spend();
    if (stored_at_ != never) return false;
    storing_.assign(data, data + size);
    stored_at_ = now_ + model_.store_ns;
    return true;
}

Persist::Outcome NativeBoard::take_outcome() {
    spend();
    if (stored_at_ == never) return Outcome::none;
    if (now_ < stored_at_) return Outcome::busy;
    stored_at_ = never;
    if (environment_.flash == nullptr) return Outcome::failed;
    *environment_.flash = storing_;
    return Outcome::stored;
}

void NativeBoard::reboot(bool to_boot_loader) {
    if (environment_.reboot) environment_.reboot(to_boot_loader);
}

void NativeBoard::feed() {
    spend();
    fed_ = now_;
}

}  // namespace versavis::firmware

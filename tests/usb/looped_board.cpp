// SPDX-License-Identifier: BSD-3-Clause
#include "looped_board.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace versavis::test {

namespace {

/// A stop is noticed after this time.
constexpr std::int64_t longest_wait_ns = 20'000'000;

}  // namespace

LoopedBoard::LoopedBoard(UMockdevTestbed* testbed, std::string serial, std::vector<LoopWire> wires)
    : testbed_(testbed), serial_(std::move(serial)), wires_(std::move(wires)) {
    std::unique_lock lock(mutex_);
    bool plugged = false;
    thread_ = std::thread([&] {
        boot(wire::ResetCause::power_on);
        {
            const std::lock_guard booted(mutex_);
            plugged = true;
            plugged_.notify_all();
        }
        run();
    });
    plugged_.wait(lock, [&] { return plugged; });
}

LoopedBoard::~LoopedBoard() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    heard_.notify_all();
    thread_.join();
}

unsigned LoopedBoard::reboots() const {
    const std::lock_guard lock(mutex_);
    return reboots_;
}

std::vector<OutputChange> LoopedBoard::output_changes() const {
    const std::lock_guard lock(mutex_);
    return output_changes_;
}

void LoopedBoard::wait_for_changes(std::size_t count) const {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return output_changes_.size() >= count; });
}

void LoopedBoard::boot(wire::ResetCause cause) {
    device_.reset();
    rebooting_ = false;
    pins_ = 0;
    booted_ = host_now();
    firmware::Environment environment;
    environment.outputs_changed = [this](auto at, auto pins) { outputs_changed(at, pins); };
    environment.reboot = [this](bool) { rebooting_ = true; };
    firmware::Identity identity{++nonce_, cause, {}};
    serial_.copy(identity.serial, sizeof identity.serial - 1);
    board_ = std::make_unique<firmware::NativeBoard>(identity, std::move(environment));
    device_ = std::make_unique<SimulatedUsbDevice>(
        testbed_, serial_, [this](std::span<const std::byte> bytes) {
            const auto* begin = reinterpret_cast<const std::uint8_t*>(bytes.data());
            {
                const std::lock_guard lock(mutex_);
                received_.insert(received_.end(), begin, begin + bytes.size());
            }
            heard_.notify_all();
        });
}

void LoopedBoard::outputs_changed(firmware::Nanoseconds at, std::uint32_t pins) {
    const std::uint32_t changed = pins ^ std::exchange(pins_, pins);
    {
        const std::lock_guard lock(mutex_);
        output_changes_.push_back({at, pins});
    }
    changed_.notify_all();
    for (const LoopWire& wire : wires_) {
        if ((changed >> wire.pin & 1U) == 0) continue;
        const bool level = (pins >> wire.pin & 1U) != 0;
        board_->schedule_edge({at + (level ? wire.late_rise : wire.late_fall), wire.input, level});
    }
}

void LoopedBoard::run() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
        lock.unlock();
        exchange_bytes();
        if (rebooting_) boot(wire::ResetCause::software);
        const std::int64_t wait_ns =
            std::clamp<std::int64_t>(board_->next_wake() - now(), 0, longest_wait_ns);
        lock.lock();
        heard_.wait_for(lock, std::chrono::nanoseconds(wait_ns),
                        [this] { return stop_ || !received_.empty(); });
    }
    lock.unlock();
    device_.reset();
}

void LoopedBoard::exchange_bytes() {
    std::vector<std::uint8_t> bytes;
    {
        const std::lock_guard lock(mutex_);
        bytes.swap(received_);
    }
    const firmware::Nanoseconds at = now();
    board_->run_until(at);
    if (!bytes.empty()) {
        board_->receive(bytes, at);
        board_->run_until(at);
    }
    const auto out = board_->transmitted();
    if (!out.empty()) {
        device_->send(std::as_bytes(out));
        board_->consume(out.size(), at);
    }
    if (!rebooting_) return;
    const std::lock_guard lock(mutex_);
    ++reboots_;
    received_.clear();
}

}  // namespace versavis::test

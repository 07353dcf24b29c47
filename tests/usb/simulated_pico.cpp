// SPDX-License-Identifier: BSD-3-Clause
#include "simulated_pico.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "../support/uf2_file.hpp"

namespace versavis::test {

namespace {

constexpr std::size_t version_at = client::flash_page;

}  // namespace

std::vector<std::uint8_t> pico_firmware(const std::string& version, std::size_t pages) {
    auto image = flash_image(pages, static_cast<std::uint8_t>(version.size() + version.back()));
    std::copy_n(version.c_str(), version.size() + 1, image.begin() + version_at);
    seal(image);
    return image;
}

SimulatedPico::SimulatedPico(UMockdevTestbed* testbed, PicoSettings settings)
    : testbed_(testbed),
      settings_(std::move(settings)),
      faults_(settings_.faults),
      protocol_(settings_.protocol),
      hangs_(settings_.hangs) {
    if (!settings_.version.empty()) flash_.load(pico_firmware(settings_.version));
    thread_ = std::thread([this] { run(); });
    plug(false);
}

SimulatedPico::~SimulatedPico() {
    unplug();
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
}

void SimulatedPico::set_faults(const BootLoaderFaults& faults) {
    const std::lock_guard lock(mutex_);
    faults_ = faults;
}

void SimulatedPico::plug(bool boot_loader) {
    become(Mode::absent);
    become(boot_loader ? Mode::boot_loader : Mode::firmware);
    wait_until_idle();
}

void SimulatedPico::unplug() {
    become(Mode::absent);
    wait_until_idle();
}

unsigned SimulatedPico::touches() const {
    const std::lock_guard lock(mutex_);
    return touches_;
}

unsigned SimulatedPico::boots() const {
    const std::lock_guard lock(mutex_);
    return boots_;
}

void SimulatedPico::release() {
    post([this] {
        if (boot_loader_device_) boot_loader_->release();
    });
}

void SimulatedPico::post(Task task) {
    {
        const std::lock_guard lock(mutex_);
        tasks_.push_back(std::move(task));
    }
    changed_.notify_all();
}

void SimulatedPico::become(Mode mode) {
    post([this, mode] { enter(mode); });
}

void SimulatedPico::wait_until_idle() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return tasks_.empty(); });
}

void SimulatedPico::run() {
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return stop_ || !tasks_.empty(); });
        if (tasks_.empty()) return;
        const Task task = tasks_.front();
        lock.unlock();
        task();
        lock.lock();
        tasks_.pop_front();
        changed_.notify_all();
    }
}

void SimulatedPico::enter(Mode mode) {
    firmware_.reset();
    boot_loader_device_.reset();
    if (mode == Mode::absent) return;
    {
        const std::lock_guard lock(mutex_);
        ++boots_;
    }
    // The chip looks itself whether there is something to start.
    if (mode == Mode::firmware && flash_.starts())
        start_firmware();
    else
        start_boot_loader();
}

void SimulatedPico::start_firmware() {
    decoder_ = {};
    sequence_ = 0;
    ++nonce_;
    const auto touched = [this] {
        {
            const std::lock_guard lock(mutex_);
            ++touches_;
        }
        if (settings_.obeys) become(Mode::boot_loader);
    };
    firmware_ = std::make_unique<SimulatedUsbDevice>(
        testbed_, settings_.serial, [this](std::span<const std::byte> bytes) { heard(bytes); },
        settings_.port, touched);
}

void SimulatedPico::start_boot_loader() {
    hangs_ = false;
    protocol_ = wire::protocol_major;
    BootLoaderFaults faults;
    {
        const std::lock_guard lock(mutex_);
        faults = faults_;
    }
    BootLoaderEvents events{[this](unsigned) { become(Mode::firmware); },
                            [this] { become(Mode::absent); }};
    boot_loader_ = std::make_shared<BootLoader>(flash_, faults, std::move(events));
    boot_loader_device_ = std::make_unique<SimulatedDevice>(testbed_, settings_.port, boot_loader_);
}

void SimulatedPico::heard(std::span<const std::byte> bytes) {
    if (hangs_ || flash_.read(version_at, 1).front() == 0) return;
    decoder_.feed(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(),
                  [this](const wire::Packet& packet) { obey(packet); });
}

void SimulatedPico::obey(const wire::Packet& packet) {
    wire::HostHello hello{};
    wire::Reboot reboot{};
    if (packet.read(hello)) post([this] { say_hello(); });
    if (packet.read(reboot) && reboot.magic == wire::reboot_magic && settings_.obeys)
        become(reboot.to_boot_loader != 0 ? Mode::boot_loader : Mode::firmware);
}

void SimulatedPico::say_hello() {
    if (!firmware_) return;
    wire::BoardHello answer{};
    answer.major = protocol_;
    answer.minor = wire::protocol_minor;
    answer.reset_cause = wire::ResetCause::software;
    const auto version = flash_.read(version_at, sizeof answer.firmware);
    std::memcpy(answer.firmware, version.data(), version.size());
    settings_.serial.copy(answer.serial, sizeof answer.serial);
    wire::Frame frame{};
    wire::encode(answer, nonce_, sequence_++, frame);
    firmware_->send(std::as_bytes(std::span(frame.bytes, frame.size)));
}

}  // namespace versavis::test

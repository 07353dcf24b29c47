// SPDX-License-Identifier: BSD-3-Clause
#include "board/usb_stream.hpp"

#include <fmt/format.h>
#include <libusb.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/container/static_vector.hpp>
#include <condition_variable>
#include <mutex>
#include <optional>

#include "device/cdc_port.hpp"
#include "wire/usb_identity.hpp"

namespace versavis::daemon {

namespace {

/// Reads that are always under way, so that the host controller never waits for the service.
constexpr std::size_t transfer_count = 4;

constexpr unsigned usb_timeout_ms = device::transfer_timeout.ns / 1'000'000;

struct TransferDeleter {
    void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
};

Unexpected<> usb_failure(const std::string& what, const device::UsbError& error) {
    return Unexpected(error.as_error("USB board", what));
}

Unexpected<> not_read(int code) { return usb_failure("cannot be read", device::usb_error(code)); }

Unexpected<> not_written(int code) {
    return usb_failure("cannot be written to", device::usb_error(code));
}

class UsbStream final : public ByteStream {
 public:
    UsbStream(device::UsbBus bus, device::CdcPort port)
        : bus_(std::move(bus)), port_(std::move(port)) {}

    ~UsbStream() override {
        for (Slot& slot : slots_)
            if (slot.pending) libusb_cancel_transfer(slot.transfer.get());
        if (writing_.pending) libusb_cancel_transfer(writing_.transfer.get());
        timeval limit{0, 100'000};
        for (int tries = 0; tries < 20 && pending() > 0; ++tries)
            libusb_handle_events_timeout_completed(bus_.get(), &limit, nullptr);
        // A transfer that never came back still points here: leaking it is safer than freeing it.
        for (Slot& slot : slots_)
            if (slot.pending) static_cast<void>(slot.transfer.release());
        if (writing_.pending) static_cast<void>(writing_.transfer.release());
    }
    UsbStream(const UsbStream&) = delete;
    UsbStream& operator=(const UsbStream&) = delete;

    Expected<> start() {
        for (Slot& slot : slots_) {
            prepare(slot, port_.data().endpoint_in, &UsbStream::read_completed, 0);
            if (const int code = libusb_submit_transfer(slot.transfer.get()); code != 0)
                return not_read(code);
            slot.pending = true;
        }
        prepare(writing_, port_.data().endpoint_out, &UsbStream::write_completed, usb_timeout_ms);
        return {};
    }

    std::string port() const override { return port_.handle().device().port(); }

    /// Only here are events handled, so what completes is seen, and stamped, by this thread: none
    /// of it can complete between the look and the wait.
    Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) override {
        if (completed_.empty() && !gone_) {
            timeval limit{timeout.ns / 1'000'000'000, timeout.ns % 1'000'000'000 / 1000};
            libusb_handle_events_timeout_completed(bus_.get(), &limit, nullptr);
        }
        if (!completed_.empty()) return take_first(into);
        if (gone_) return not_read(LIBUSB_ERROR_NO_DEVICE);
        return Chunk{};
    }

    Expected<> write(std::span<const std::uint8_t> bytes) override {
        std::unique_lock lock(write_mutex_);
        if (gone_) return not_written(LIBUSB_ERROR_NO_DEVICE);
        if (writing_.pending) return not_written(LIBUSB_ERROR_TIMEOUT);
        if (bytes.size() > writing_.buffer.size()) return not_written(LIBUSB_ERROR_OVERFLOW);
        libusb_transfer& transfer = *writing_.transfer;
        std::copy(bytes.begin(), bytes.end(), writing_.buffer.begin());
        transfer.length = static_cast<int>(bytes.size());
        if (const int code = libusb_submit_transfer(&transfer); code != 0) return not_written(code);
        writing_.pending = true;
        // libusb ends it at its time-out: twice that is only waited for when nobody reads.
        written_.wait_for(lock, std::chrono::milliseconds(2 * usb_timeout_ms),
                          [this] { return !writing_.pending; });
        if (writing_.pending || transfer.status != LIBUSB_TRANSFER_COMPLETED ||
            transfer.actual_length != transfer.length)
            return not_written(LIBUSB_ERROR_TIMEOUT);
        return {};
    }

 private:
    struct Slot {
        UsbStream* owner = nullptr;
        std::unique_ptr<libusb_transfer, TransferDeleter> transfer;
        std::array<std::uint8_t, largest_chunk> buffer{};
        HostTime received;
        std::atomic<bool> pending{false};
    };

    void prepare(Slot& slot, std::uint8_t endpoint, libusb_transfer_cb_fn completed,
                 unsigned timeout_ms) {
        slot.owner = this;
        slot.transfer.reset(libusb_alloc_transfer(0));
        libusb_fill_bulk_transfer(slot.transfer.get(), port_.handle().get(), endpoint,
                                  slot.buffer.data(), static_cast<int>(slot.buffer.size()),
                                  completed, &slot, timeout_ms);
    }

    static void LIBUSB_CALL read_completed(libusb_transfer* transfer) {
        auto& slot = *static_cast<Slot*>(transfer->user_data);
        slot.received = host_now();
        UsbStream& stream = *slot.owner;
        slot.pending = false;
        if (transfer->status == LIBUSB_TRANSFER_COMPLETED && transfer->actual_length > 0)
            stream.completed_.push_back(&slot);
        else if (transfer->status == LIBUSB_TRANSFER_COMPLETED)
            stream.submit(slot);
        else
            stream.gone_ = true;
    }

    static void LIBUSB_CALL write_completed(libusb_transfer* transfer) {
        auto& slot = *static_cast<Slot*>(transfer->user_data);
        const std::lock_guard lock(slot.owner->write_mutex_);
        slot.pending = false;
        slot.owner->written_.notify_one();
    }

    Chunk take_first(std::span<std::uint8_t> into) {
        Slot& slot = *completed_.front();
        completed_.erase(completed_.begin());
        const Chunk chunk{slot.received, static_cast<std::size_t>(slot.transfer->actual_length)};
        std::copy_n(slot.buffer.begin(), chunk.size, into.begin());
        submit(slot);
        return chunk;
    }

    void submit(Slot& slot) {
        slot.pending = libusb_submit_transfer(slot.transfer.get()) == 0;
        if (!slot.pending) gone_ = true;
    }

    int pending() const {
        int count = writing_.pending ? 1 : 0;
        for (const Slot& slot : slots_) count += slot.pending ? 1 : 0;
        return count;
    }

    device::UsbBus bus_;
    device::CdcPort port_;
    std::array<Slot, transfer_count> slots_;
    boost::container::static_vector<Slot*, transfer_count> completed_;  ///< of the reading thread
    Slot writing_;
    std::mutex write_mutex_;  ///< guards writing_.pending
    std::condition_variable written_;
    std::atomic<bool> gone_{false};
};

/// What a boot loader means for a board that is not there. None: there is none.
std::optional<Error> boot_loader(const device::UsbBus& bus) {
    if (const auto found = bus.find(wire::boot_loader_vendor, wire::boot_loader_rp2040);
        !found.empty())
        return Error{"", "a board is in its boot loader at " + found.front().port(),
                     "flash it with 'versavis flash', or start its current firmware with "
                     "'versavis board reset'"};
    if (const auto found = bus.find(wire::boot_loader_vendor, wire::boot_loader_rp2350);
        !found.empty())
        return Error{
            "", "there is a Pico 2 (RP2350), which is not supported, at " + found.front().port(),
            "use a board with an RP2040: a Pico, Pico H, Pico W or Pico WH"};
    return std::nullopt;
}

/// The first device of the vendor and product whose serial number fits.
Expected<device::UsbHandle> find_board(const device::UsbBus& bus,
                                       const BoardConfiguration& wanted) {
    std::optional<device::UsbError> refused;
    bool hangs = false;
    for (const device::UsbDevice& candidate : bus.find(wanted.usb_vendor, wanted.usb_product)) {
        auto handle = candidate.open();
        if (!handle) {
            refused = handle.error();
            continue;
        }
        const auto serial = handle->serial();
        if (serial && (wanted.serial.empty() || *serial == wanted.serial))
            return std::move(*handle);
        if (serial) continue;
        // Its controller hangs. It starts anew when nothing comes after a reset of the bus.
        handle->reset();
        hangs = true;
    }
    if (refused) return usb_failure("cannot be opened", *refused);
    if (hangs)
        return failure("USB board", "does not answer; it was reset",
                       "replug it if it does not come back");
    const auto waiting = boot_loader(bus);
    return failure("USB board",
                   fmt::format("no device {:04x}:{:04x}{}{}", wanted.usb_vendor, wanted.usb_product,
                               wanted.serial.empty() ? "" : " with serial " + wanted.serial,
                               waiting ? ", but " + waiting->what : ""),
                   waiting ? waiting->cure : "plug it in; 'lsusb' lists connected devices");
}

}  // namespace

Expected<std::unique_ptr<ByteStream>> open_usb_stream(const BoardConfiguration& configuration) {
    auto bus = device::UsbBus::open();
    if (!bus) return failure("USB board", bus.error().what);
    auto handle = find_board(*bus, configuration);
    if (!handle) return Unexpected(handle.error());
    auto port = device::CdcPort::open(std::move(*handle));
    if (!port && port.error().fault == device::UsbFault::foreign)
        return failure("USB board", "has no CDC-ACM function", "update its firmware");
    if (!port) return usb_failure("cannot be claimed", port.error());
    auto stream = std::make_unique<UsbStream>(std::move(*bus), std::move(*port));
    if (auto started = stream->start(); !started) return Unexpected(started.error());
    return stream;
}

}  // namespace versavis::daemon

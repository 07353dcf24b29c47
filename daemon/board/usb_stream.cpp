// SPDX-License-Identifier: BSD-3-Clause
#include "board/usb_stream.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/container/static_vector.hpp>
#include <condition_variable>
#include <mutex>
#include <optional>

#include "base/usb_handles.hpp"
#include "wire/usb_identity.hpp"

namespace versavis::daemon {

namespace {

/// Reads that are always under way, so that the host controller never waits for the service. At
/// half, a late thread loses a USB frame; at twice, 16 KiB more are locked.
constexpr std::size_t transfer_count = 4;

/// A board that does not take data for so long is gone. At half, one that erases its flash is lost;
/// at twice, those who wait to send wait longer.
constexpr unsigned write_timeout_ms = 500;

/// The same for a control request. At half, a board that boots is missed at first; at twice, a
/// foreign device holds the search up longer.
constexpr unsigned control_timeout_ms = 500;

constexpr std::uint8_t class_interface_out =
    0x21;  // request type: class, interface, host to device
constexpr std::uint8_t set_control_line_state = 0x22;
constexpr std::uint16_t dtr_rts = 0x03;

struct TransferDeleter {
    void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
};

/// Where the CDC function lies.
struct CdcFunction {
    int control_interface = -1;
    int data_interface = -1;
    std::uint8_t endpoint_in = 0;
    std::uint8_t endpoint_out = 0;
};

Unexpected<> usb_failure(const std::string& what, int code) {
    return failure("USB board", fmt::format("{}: {}", what, libusb_error_name(code)),
                   code == LIBUSB_ERROR_ACCESS
                       ? "install the udev rule and join the group 'versavis'"
                   : code == LIBUSB_ERROR_BUSY ? "another program has the board open: close it"
                                               : "");
}

/// As the kernel names it: bus, then the ports of the hubs on the way.
std::string port_of(libusb_device* device) {
    std::array<std::uint8_t, 7> ports{};
    const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
    std::string name = fmt::format("usb:{}", libusb_get_bus_number(device));
    for (int i = 0; i < depth; ++i)
        name += fmt::format("{}{}", i == 0 ? '-' : '.', ports[static_cast<std::size_t>(i)]);
    return name;
}

class UsbStream final : public ByteStream {
 public:
    UsbStream(UsbContext context, UsbHandle handle, const CdcFunction& function)
        : context_(std::move(context)), handle_(std::move(handle)), function_(function) {}

    ~UsbStream() override {
        for (Slot& slot : slots_)
            if (slot.pending) libusb_cancel_transfer(slot.transfer.get());
        if (writing_.pending) libusb_cancel_transfer(writing_.transfer.get());
        timeval limit{0, 100'000};
        for (int tries = 0; tries < 20 && pending() > 0; ++tries)
            libusb_handle_events_timeout_completed(context_.get(), &limit, nullptr);
        // A transfer that never came back still points here: leaking it is safer than freeing it.
        for (Slot& slot : slots_)
            if (slot.pending) static_cast<void>(slot.transfer.release());
        if (writing_.pending) static_cast<void>(writing_.transfer.release());
        libusb_release_interface(handle_.get(), function_.data_interface);
        libusb_release_interface(handle_.get(), function_.control_interface);
    }
    UsbStream(const UsbStream&) = delete;
    UsbStream& operator=(const UsbStream&) = delete;

    Expected<> start() {
        for (Slot& slot : slots_) {
            prepare(slot, function_.endpoint_in, &UsbStream::read_completed, 0);
            if (const int code = libusb_submit_transfer(slot.transfer.get()); code != 0)
                return usb_failure("cannot read", code);
            slot.pending = true;
        }
        prepare(writing_, function_.endpoint_out, &UsbStream::write_completed, write_timeout_ms);
        return {};
    }

    std::string port() const override { return port_of(libusb_get_device(handle_.get())); }

    /// Only here are events handled, so what completes is seen, and stamped, by this thread: none
    /// of it can complete between the look and the wait.
    Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) override {
        if (completed_.empty() && !gone_) {
            timeval limit{timeout.ns / 1'000'000'000, timeout.ns % 1'000'000'000 / 1000};
            libusb_handle_events_timeout_completed(context_.get(), &limit, nullptr);
        }
        if (!completed_.empty()) return take_first(into);
        if (gone_) return failure("USB board", "the board was unplugged or reset");
        return Chunk{};
    }

    Expected<> write(std::span<const std::uint8_t> bytes) override {
        std::unique_lock lock(write_mutex_);
        if (writing_.pending || gone_ || bytes.size() > writing_.buffer.size())
            return usb_failure("the board does not accept data", LIBUSB_ERROR_BUSY);
        libusb_transfer& transfer = *writing_.transfer;
        std::copy(bytes.begin(), bytes.end(), writing_.buffer.begin());
        transfer.length = static_cast<int>(bytes.size());
        if (const int code = libusb_submit_transfer(&transfer); code != 0)
            return usb_failure("the board does not accept data", code);
        writing_.pending = true;
        // libusb ends it at its time-out: twice that is only waited for when nobody reads.
        written_.wait_for(lock, std::chrono::milliseconds(2 * write_timeout_ms),
                          [this] { return !writing_.pending; });
        if (writing_.pending || transfer.status != LIBUSB_TRANSFER_COMPLETED ||
            transfer.actual_length != transfer.length)
            return usb_failure("the board does not accept data", LIBUSB_ERROR_TIMEOUT);
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
        libusb_fill_bulk_transfer(slot.transfer.get(), handle_.get(), endpoint, slot.buffer.data(),
                                  static_cast<int>(slot.buffer.size()), completed, &slot,
                                  timeout_ms);
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

    UsbContext context_;
    UsbHandle handle_;
    CdcFunction function_;
    std::array<Slot, transfer_count> slots_;
    boost::container::static_vector<Slot*, transfer_count> completed_;  ///< of the reading thread
    Slot writing_;
    std::mutex write_mutex_;  ///< guards writing_.pending
    std::condition_variable written_;
    std::atomic<bool> gone_{false};
};

CdcFunction find_function(libusb_device* device) {
    CdcFunction function;
    libusb_config_descriptor* configuration = nullptr;
    if (libusb_get_active_config_descriptor(device, &configuration) != 0) return function;
    for (int i = 0; i < configuration->bNumInterfaces; ++i) {
        const libusb_interface_descriptor& setting = configuration->interface[i].altsetting[0];
        if (setting.bInterfaceClass == LIBUSB_CLASS_COMM)
            function.control_interface = setting.bInterfaceNumber;
        if (setting.bInterfaceClass != LIBUSB_CLASS_DATA) continue;
        function.data_interface = setting.bInterfaceNumber;
        for (int e = 0; e < setting.bNumEndpoints; ++e) {
            const std::uint8_t address = setting.endpoint[e].bEndpointAddress;
            ((address & LIBUSB_ENDPOINT_IN) != 0 ? function.endpoint_in : function.endpoint_out) =
                address;
        }
    }
    libusb_free_config_descriptor(configuration);
    return function;
}

/// What a boot loader means for a board that is not there. None: it is no boot loader.
std::optional<Error> boot_loader(libusb_device* device, const libusb_device_descriptor& found) {
    if (found.idVendor != wire::boot_loader_vendor) return std::nullopt;
    if (found.idProduct == wire::boot_loader_rp2040)
        return Error{"", "a board waits in its boot loader at " + port_of(device),
                     "put firmware into it with 'versavis flash', or start what it has with "
                     "'versavis board reset'"};
    if (found.idProduct == wire::boot_loader_rp2350)
        return Error{"", "there is a Pico 2, whose chip is another, at " + port_of(device),
                     "take a board with an RP2040: a Pico, Pico H, Pico W or Pico WH"};
    return std::nullopt;
}

/// The first device of the vendor and product whose serial number fits.
Expected<UsbHandle> find_board(libusb_context* context, const BoardConfiguration& wanted) {
    libusb_device** devices = nullptr;
    const ssize_t count = libusb_get_device_list(context, &devices);
    UsbHandle found;
    std::optional<int> refused;
    bool hangs = false;
    std::optional<Error> waiting;
    for (ssize_t i = 0; i < count && !found; ++i) {
        libusb_device_descriptor descriptor{};
        libusb_get_device_descriptor(devices[i], &descriptor);
        if (!waiting) waiting = boot_loader(devices[i], descriptor);
        if (descriptor.idVendor != wanted.usb_vendor || descriptor.idProduct != wanted.usb_product)
            continue;
        libusb_device_handle* handle = nullptr;
        if (const int code = libusb_open(devices[i], &handle); code != 0) {
            refused = code;
            continue;
        }
        UsbHandle candidate(handle);
        const std::string serial = text_descriptor(handle, descriptor.iSerialNumber);
        if (serial.empty() && descriptor.iSerialNumber != 0) {
            // Its controller hangs. It starts anew when nothing comes after a reset of the bus.
            libusb_reset_device(handle);
            hangs = true;
        } else if (wanted.serial.empty() || serial == wanted.serial) {
            found = std::move(candidate);
        }
    }
    if (count >= 0) libusb_free_device_list(devices, 1);
    if (found) return found;
    if (refused) return usb_failure("cannot be opened", *refused);
    if (hangs)
        return failure("USB board", "does not answer; it was reset",
                       "unplug it if it does not come back");
    return failure("USB board",
                   fmt::format("no device {:04x}:{:04x}{}{}", wanted.usb_vendor, wanted.usb_product,
                               wanted.serial.empty() ? "" : " with serial " + wanted.serial,
                               waiting ? ", but " + waiting->what : ""),
                   waiting ? waiting->cure : "plug it in; 'lsusb' lists what is there");
}

}  // namespace

Expected<std::unique_ptr<ByteStream>> open_usb_stream(const BoardConfiguration& configuration) {
    libusb_context* raw_context = nullptr;
    if (const int code = libusb_init(&raw_context); code != 0)
        return usb_failure("libusb cannot start", code);
    UsbContext context(raw_context);
    auto handle = find_board(context.get(), configuration);
    if (!handle) return Unexpected(handle.error());
    const CdcFunction function = find_function(libusb_get_device(handle->get()));
    if (function.control_interface < 0 || function.endpoint_in == 0 || function.endpoint_out == 0)
        return failure("USB board", "has no CDC-ACM function", "update its firmware");
    libusb_set_auto_detach_kernel_driver(handle->get(), 1);
    for (const int interface : {function.control_interface, function.data_interface})
        if (const int code = libusb_claim_interface(handle->get(), interface); code != 0)
            return usb_failure("cannot be claimed", code);
    libusb_control_transfer(handle->get(), class_interface_out, set_control_line_state, dtr_rts,
                            static_cast<std::uint16_t>(function.control_interface), nullptr, 0,
                            control_timeout_ms);
    auto stream = std::make_unique<UsbStream>(std::move(context), std::move(*handle), function);
    if (auto started = stream->start(); !started) return Unexpected(started.error());
    return stream;
}

}  // namespace versavis::daemon

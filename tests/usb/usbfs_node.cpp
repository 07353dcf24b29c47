// SPDX-License-Identifier: BSD-3-Clause
#include "usbfs_node.hpp"

#include <linux/usb/ch9.h>
#include <sys/ioctl.h>  // the _IOR family that the USBDEVFS_ constants use

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace versavis::test {

namespace {

using Client = UsbfsNode::Client;
using DataPtr = GObjectPtr<UMockdevIoctlData>;
using Task = std::function<void()>;

constexpr std::size_t setup_size = 8;

// Runs the task once on the thread of the context; dropping the result cancels it.
GSourcePtr schedule(GMainContext* context, std::chrono::milliseconds delay, Task task) {
    GSourcePtr source{g_timeout_source_new(static_cast<guint>(delay.count()))};
    g_source_set_callback(
        source.get(),
        [](gpointer data) -> gboolean {
            (*static_cast<Task*>(data))();
            return G_SOURCE_REMOVE;
        },
        new Task{std::move(task)}, [](gpointer data) { delete static_cast<Task*>(data); });
    g_source_attach(source.get(), context);
    return source;
}

Bytes string_descriptor(const std::string& ascii) {
    Bytes result{static_cast<std::uint8_t>(2 + 2 * ascii.size()), 3};
    for (char c : ascii) result.insert(result.end(), {static_cast<std::uint8_t>(c), 0});
    return result;
}

void complete(Client* client, int result) {
    umockdev_ioctl_client_complete(client, result < 0 ? -1 : result, result < 0 ? -result : 0);
}

// The ioctl's argument as the struct it points to; null if the pointer is.
DataPtr resolve_argument(Client* client, std::size_t size) {
    UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
    return DataPtr{umockdev_ioctl_data_resolve(argument, 0, size, nullptr)};
}

template <typename T>
T read_argument(Client* client, T fallback) {
    const DataPtr data = resolve_argument(client, sizeof(T));
    if (data) std::memcpy(&fallback, data->data, sizeof(T));
    return fallback;
}

template <typename T>
T pointer_value(const UMockdevIoctlData* data) {
    T value;
    std::memcpy(&value, data->data, sizeof value);
    return value;
}

}  // namespace

std::span<std::uint8_t> UsbfsNode::Urb::payload() const {
    if (!buffer) return {};
    return {buffer->data, static_cast<std::size_t>(buffer->data_len)};
}

int UsbFunction::control(std::span<const std::uint8_t> /*setup*/,
                         std::span<const std::uint8_t> /*out*/, Bytes& /*reply*/) {
    return -EPIPE;
}

UsbfsNode::UsbfsNode(std::shared_ptr<UsbFunction> function, std::chrono::milliseconds idle_hold)
    : function_{std::move(function)}, idle_hold_{idle_hold} {
    parse_configuration();
    function_->node_ = this;
}

void UsbfsNode::parse_configuration() {
    constexpr std::uint8_t interface_type = 4;
    constexpr std::uint8_t endpoint_type = 5;
    const Bytes& text = function_->description().configuration;
    interface_count_ = text.at(4);
    unsigned interface = 0;
    for (std::size_t at = 0; at < text.size(); at += text.at(at)) {
        const std::uint8_t type = text.at(at + 1);
        if (type == interface_type) interface = text.at(at + 2);
        if (type != endpoint_type) continue;
        Pipe& pipe = pipes_[text.at(at + 2)];
        pipe.interface = interface;
        pipe.packet_size = static_cast<std::size_t>(text.at(at + 4) | text.at(at + 5) << 8);
    }
}

void UsbfsNode::attach(std::string path) {
    {
        const std::lock_guard lock{mutex_};
        path_ = std::move(path);
    }
    function_->plugged(true);
}

void UsbfsNode::detach() {
    function_->plugged(false);
    {
        const std::lock_guard lock{mutex_};
        path_.clear();
        for (auto& [address, pipe] : pipes_) {
            pipe.transfers.clear();
            pipe.halted = false;
        }
    }
    post_pump();
}

void UsbfsNode::send(std::uint8_t endpoint, Bytes bytes) {
    {
        const std::lock_guard lock{mutex_};
        Pipe& pipe = pipes_.at(endpoint);
        if (path_.empty() || pipe.halted) return;
        pipe.transfers.push_back({std::move(bytes), 0});
    }
    post_pump();
}

std::size_t UsbfsNode::queued(std::uint8_t endpoint) const {
    const std::lock_guard lock{mutex_};
    std::size_t sum = 0;
    for (const Transfer& transfer : pipes_.at(endpoint).transfers)
        sum += transfer.bytes.size() - transfer.sent;
    return sum;
}

void UsbfsNode::flush(std::uint8_t endpoint) {
    const std::lock_guard lock{mutex_};
    pipes_.at(endpoint).transfers.clear();
}

void UsbfsNode::halt(std::uint8_t endpoint) {
    {
        const std::lock_guard lock{mutex_};
        Pipe& pipe = pipes_.at(endpoint);
        pipe.halted = true;
        pipe.transfers.clear();
    }
    post_pump();
}

bool UsbfsNode::halted(std::uint8_t endpoint) const {
    const std::lock_guard lock{mutex_};
    return pipes_.at(endpoint).halted;
}

void UsbfsNode::hang() {
    hangs_ = true;
    post_pump();
}

int UsbfsNode::clear_halt(std::uint8_t endpoint) {
    {
        const std::lock_guard lock{mutex_};
        const auto pipe = pipes_.find(endpoint);
        if (pipe == pipes_.end()) return -ENOENT;
        pipe->second.halted = false;
    }
    function_->halt_cleared(endpoint);
    return 0;
}

int UsbfsNode::reset() {
    if (!hangs_) return 0;
    detach();
    hangs_ = false;
    return -ENODEV;
}

// The testbed's context is private; this is the first chance to learn it, and
// before a client is connected there is no urb to work on.
void UsbfsNode::on_connected(Client* client) {
    g_object_weak_ref(
        G_OBJECT(client),
        [](gpointer self, GObject* gone) {
            static_cast<UsbfsNode*>(self)->forget(reinterpret_cast<Client*>(gone));
        },
        this);
    const std::lock_guard lock{mutex_};
    if (context_ == nullptr) context_ = g_main_context_get_thread_default();
}

void UsbfsNode::on_ioctl(Client* client) {
    const unsigned long request = umockdev_ioctl_client_get_request(client);
    if (request == USBDEVFS_REAPURB || request == USBDEVFS_REAPURBNDELAY) {
        reap(client, request == USBDEVFS_REAPURB);
        return;
    }
    complete(client, is_current(client) ? execute(client, request) : -ENODEV);
}

// A file descriptor opened before an unplug never becomes useful again.
bool UsbfsNode::is_current(Client* client) {
    const std::lock_guard lock{mutex_};
    return path_ == umockdev_ioctl_client_get_devnode(client);
}

// The process closed the node or died.
void UsbfsNode::forget(Client* client) {
    std::erase_if(pending_, [client](const Urb& urb) { return urb.client == client; });
    std::erase_if(done_, [client](const Urb& urb) { return urb.client == client; });
    std::erase_if(claims_, [client](const auto& claim) { return claim.second == client; });
    busy_.erase(client);
}

int UsbfsNode::execute(Client* client, unsigned long request) {
    switch (request) {
        case USBDEVFS_GET_CAPABILITIES: return capabilities(client);
        case USBDEVFS_GET_SPEED: return speed();
        case USBDEVFS_CLAIMINTERFACE:
        case USBDEVFS_DISCONNECT_CLAIM:  // the interface number is its first member
            return claim(client, read_argument<unsigned>(client, interface_count_));
        case USBDEVFS_RELEASEINTERFACE:
            return release(client, read_argument<unsigned>(client, interface_count_));
        case USBDEVFS_SETCONFIGURATION:
            return read_argument<unsigned>(client, 0) == 1 ? 0 : -EINVAL;
        case USBDEVFS_SETINTERFACE:
            return read_argument(client, usbdevfs_setinterface{}).altsetting == 0 ? 0 : -EINVAL;
        case USBDEVFS_CLEAR_HALT:
            return clear_halt(static_cast<std::uint8_t>(read_argument(client, 0U)));
        case USBDEVFS_RESET: return reset();
        case USBDEVFS_GETDRIVER:
        case USBDEVFS_IOCTL: return -ENODATA;  // no kernel driver is ever bound
        case USBDEVFS_SUBMITURB: return submit(client);
        case USBDEVFS_DISCARDURB: return discard(client);
        default: return -ENOTTY;
    }
}

// No USBDEVFS_CAP_MMAP: the fake node is a regular file and cannot be mapped.
int UsbfsNode::capabilities(Client* client) {
    constexpr std::uint32_t usbfs_capabilities =
        USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
        USBDEVFS_CAP_BULK_SCATTER_GATHER | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
    const DataPtr data = resolve_argument(client, sizeof usbfs_capabilities);
    if (!data) return -EFAULT;
    std::memcpy(data->data, &usbfs_capabilities, sizeof usbfs_capabilities);
    return 0;
}

int UsbfsNode::speed() const {  // enum usb_device_speed of linux/usb/ch9.h
    const unsigned mbit = function_->description().speed_mbit;
    return mbit >= 5000 ? 5 : mbit >= 480 ? 3 : 2;
}

int UsbfsNode::claim(Client* client, unsigned interface) {
    if (interface >= interface_count_) return -ENOENT;
    const auto [claim, added] = claims_.try_emplace(interface, client);
    return claim->second == client ? 0 : -EBUSY;
}

int UsbfsNode::release(Client* client, unsigned interface) {
    const auto claim = claims_.find(interface);
    if (claim == claims_.end() || claim->second != client) return -EINVAL;
    claims_.erase(claim);
    return 0;
}

int UsbfsNode::submit(Client* client) {
    Urb urb{client, resolve_argument(client, sizeof(usbdevfs_urb)), nullptr};
    if (!urb.data) return -EFAULT;
    const int length = urb.fields().buffer_length;
    if (length < 0) return -EINVAL;
    if (length > 0) {
        urb.buffer.reset(umockdev_ioctl_data_resolve(urb.data.get(), offsetof(usbdevfs_urb, buffer),
                                                     static_cast<gsize>(length), nullptr));
        if (!urb.buffer) return -EFAULT;
    }
    return start(std::move(urb));
}

int UsbfsNode::start(Urb urb) {
    const usbdevfs_urb& fields = urb.fields();
    if (hangs_) {
        finish(std::move(urb), -EPROTO);
        return 0;
    }
    if (fields.type == USBDEVFS_URB_TYPE_CONTROL) {
        if (urb.payload().size() < setup_size) return -EINVAL;
        control(urb);
        return 0;
    }
    const std::uint8_t endpoint = fields.endpoint;
    const auto pipe = pipes_.find(endpoint);
    if (pipe == pipes_.end()) return -ENOENT;
    // Like the kernel, take an interface the caller forgot to claim.
    const int claimed = claim(urb.client, pipe->second.interface);
    if (claimed < 0) return claimed;
    if (halted(endpoint)) {
        finish(std::move(urb), -EPIPE);
    } else if ((endpoint & USB_DIR_IN) == 0) {
        urb.fields().actual_length = urb.fields().buffer_length;
        function_->receive(endpoint, urb.payload());
        finish(std::move(urb), 0);
    } else {
        urb.fields().actual_length = 0;
        pending_.push_back(std::move(urb));
        post_pump();
    }
    return 0;
}

int UsbfsNode::discard(Client* client) {
    const auto address = pointer_value<gulong>(umockdev_ioctl_client_get_arg(client));
    const auto urb = std::ranges::find_if(pending_, [&](const Urb& candidate) {
        return candidate.client == client && candidate.data->client_addr == address;
    });
    if (urb == pending_.end()) return -EINVAL;
    Urb discarded = std::move(*urb);
    pending_.erase(urb);
    finish(std::move(discarded), -ENOENT);
    return 0;
}

void UsbfsNode::control(Urb& urb) {
    const auto setup = urb.payload().first(setup_size);
    const auto data = urb.payload().subspan(setup_size);
    const bool to_host = (setup[0] & 0x80) != 0;
    std::vector<std::uint8_t> reply;
    const auto out = to_host ? std::span<std::uint8_t>{} : data;
    const int status = answer_control(setup, out, reply);
    std::size_t length = to_host ? std::min(reply.size(), data.size()) : data.size();
    if (status < 0) length = 0;
    if (to_host) std::copy_n(reply.begin(), length, data.begin());
    urb.fields().actual_length = static_cast<int>(length);
    finish(std::move(urb), status);
}

int UsbfsNode::answer_control(std::span<const std::uint8_t> setup,
                              std::span<const std::uint8_t> out, Bytes& reply) {
    constexpr int get_descriptor = 0x8006;
    constexpr int clear_endpoint_feature = 0x0201;
    constexpr int set_endpoint_feature = 0x0203;
    const auto endpoint = setup[4];
    const bool endpoint_halt = setup[2] == 0 && setup[3] == 0 && pipes_.contains(endpoint);
    switch (setup[0] << 8 | setup[1]) {
        case get_descriptor: return descriptor(setup[3], setup[2], reply);
        case set_endpoint_feature:
            if (!endpoint_halt) return -EPIPE;
            halt(endpoint);
            return 0;
        case clear_endpoint_feature: return endpoint_halt ? clear_halt(endpoint) : -EPIPE;
        default: return function_->control(setup, out, reply);
    }
}

int UsbfsNode::descriptor(unsigned type, unsigned index, Bytes& reply) const {
    const UsbDescription& description = function_->description();
    if (type == 1) {
        reply = description.device;
    } else if (type == 2 && index == 0) {
        reply = description.configuration;
    } else if (type == 3 && index == 0) {
        reply = {4, 3, 0x09, 0x04};  // US English
    } else if (type == 3 && index <= description.strings.size()) {
        reply = string_descriptor(description.strings[index - 1]);
    } else {
        return -EPIPE;
    }
    return 0;
}

void UsbfsNode::finish(Urb urb, int status) {
    urb.fields().status = status;
    done_.push_back(std::move(urb));
}

void UsbfsNode::reap(Client* client, bool wait) {
    if (answer_reap(client)) return;
    // libusb reaps until nothing is left before it returns to its caller, so the
    // first such question after an urb must not cost the caller the hold.
    const bool just_drained = busy_.erase(client) > 0;
    if (!wait && (just_drained || idle_hold_.count() == 0)) {
        answer_empty_reap(client);
    } else {
        hold_reap(client, wait);
    }
}

bool UsbfsNode::answer_reap(Client* client) {
    const auto urb = std::ranges::find(done_, client, &Urb::client);
    if (urb == done_.end()) return false;
    const DataPtr slot = resolve_argument(client, sizeof(void*));
    if (slot) umockdev_ioctl_data_set_ptr(slot.get(), 0, urb->data.get());
    done_.erase(urb);
    busy_.insert(client);
    complete(client, slot ? 0 : -EFAULT);
    return true;
}

void UsbfsNode::answer_empty_reap(Client* client) {
    complete(client, is_current(client) ? -EAGAIN : -ENODEV);
}

void UsbfsNode::hold_reap(Client* client, bool wait) {
    HeldReap held{GObjectPtr<Client>{static_cast<Client*>(g_object_ref(client))}, nullptr};
    if (!wait) {
        held.timeout = schedule(context_, idle_hold_, [self = shared_from_this(), client] {
            const auto expired = self->held_.extract(client);
            self->answer_empty_reap(client);
        });
    }
    held_.insert_or_assign(client, std::move(held));
}

// Urbs are handled later on the GLib thread, whoever asks: umockdev copies
// their memory without a lock while it finishes the current ioctl.
void UsbfsNode::post_pump() {
    const std::lock_guard lock{mutex_};
    if (context_ == nullptr || pump_posted_) return;
    pump_posted_ = true;
    // Unreferenced, not destroyed: the context keeps it until it has run.
    g_source_unref(schedule(context_, std::chrono::milliseconds{0}, [self = shared_from_this()] {
                       self->pump();
                   }).release());
}

void UsbfsNode::pump() {
    {
        const std::lock_guard lock{mutex_};
        pump_posted_ = false;
    }
    shut_down_stale_urbs();
    fill_in_urbs();
    for (auto held = held_.begin(); held != held_.end();) {
        const auto next = std::next(held);
        if (answer_reap(held->first)) held_.erase(held);
        held = next;
    }
}

void UsbfsNode::shut_down_stale_urbs() {
    std::deque<Urb> kept;
    for (Urb& urb : std::exchange(pending_, {})) {
        if (is_current(urb.client)) {
            kept.push_back(std::move(urb));
        } else {
            finish(std::move(urb), -ESHUTDOWN);
        }
    }
    pending_ = std::move(kept);
}

void UsbfsNode::fill_in_urbs() {
    const std::lock_guard lock{mutex_};
    std::deque<Urb> kept;
    std::set<std::uint8_t> waiting;  // endpoints whose first urb is not full: later ones must wait
    for (Urb& urb : std::exchange(pending_, {})) {
        const std::uint8_t endpoint = urb.fields().endpoint;
        Pipe& pipe = pipes_.at(endpoint);
        if (pipe.halted || hangs_) {
            finish(std::move(urb), hangs_ ? -EPROTO : -EPIPE);
            continue;
        }
        const Progress progress = waiting.contains(endpoint) ? Progress::waiting : fill(urb, pipe);
        if (progress == Progress::waiting) {
            waiting.insert(endpoint);
            kept.push_back(std::move(urb));
        } else {
            finish(std::move(urb), progress == Progress::overflow ? -EOVERFLOW : 0);
        }
    }
    pending_ = std::move(kept);
}

// Packet by packet as on the wire: an urb ends when it is full or a short packet arrives. A packet
// that does not fit is an overflow; the rest of its transfer is lost.
UsbfsNode::Progress UsbfsNode::fill(const Urb& urb, Pipe& pipe) {
    const std::span<std::uint8_t> payload = urb.payload();
    while (!pipe.transfers.empty()) {
        Transfer& transfer = pipe.transfers.front();
        const auto filled = static_cast<std::size_t>(urb.fields().actual_length);
        const std::size_t room = payload.size() - filled;
        const std::size_t left = transfer.bytes.size() - transfer.sent;
        const bool fits = left <= room;
        const std::size_t length = fits ? left : room / pipe.packet_size * pipe.packet_size;
        std::copy_n(transfer.bytes.begin() + static_cast<std::ptrdiff_t>(transfer.sent), length,
                    payload.begin() + static_cast<std::ptrdiff_t>(filled));
        transfer.sent += length;
        urb.fields().actual_length += static_cast<int>(length);
        if (!fits && length < room) {
            pipe.transfers.pop_front();
            return Progress::overflow;
        }
        if (!fits) return Progress::finished;
        pipe.transfers.pop_front();
        if (left == 0 || left % pipe.packet_size != 0 || length == room) return Progress::finished;
    }
    return Progress::waiting;
}

}  // namespace versavis::test

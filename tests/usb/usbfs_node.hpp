// SPDX-License-Identifier: BSD-3-Clause
// The kernel's side of a usbfs node, played by the simulator: it answers the ioctls of
// linux/usbdevice_fs.h for any device that its descriptors describe.
#pragma once

#include <linux/usbdevice_fs.h>
#include <umockdev.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace versavis::test {

template <typename T>
struct GObjectUnref {
    void operator()(T* object) const { g_object_unref(object); }
};
template <typename T>
using GObjectPtr = std::unique_ptr<T, GObjectUnref<T>>;

struct GSourceDestroy {
    void operator()(GSource* source) const {
        g_source_destroy(source);
        g_source_unref(source);
    }
};
using GSourcePtr = std::unique_ptr<GSource, GSourceDestroy>;

using Bytes = std::vector<std::uint8_t>;

/// Everything that a host learns about a device before it talks to it.
struct UsbDescription {
    Bytes device;
    Bytes configuration;
    std::vector<std::string> strings;  ///< ASCII; the first has index 1
    unsigned speed_mbit = 12;
};

class UsbfsNode;

/// What the device itself does; its virtual functions are called on the testbed's GLib thread only.
class UsbFunction {
 public:
    virtual ~UsbFunction() = default;
    /// Must not change while the device exists.
    virtual const UsbDescription& description() const = 0;
    /// Answers a class or vendor request: 0, or -EPIPE for a stall. Standard requests never arrive
    /// here.
    virtual int control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                        Bytes& reply);
    /// One transfer of the host to a bulk OUT endpoint. Must not block; may send.
    virtual void receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) = 0;
    /// The host has cleared a halt of this endpoint.
    virtual void halt_cleared(std::uint8_t /*endpoint*/) {}
    /// The device was plugged in or pulled out; called on the thread that did it.
    virtual void plugged(bool /*in*/) {}

 protected:
    /// From any thread, while the node lives.
    UsbfsNode* node() const { return node_; }

 private:
    friend class UsbfsNode;
    UsbfsNode* node_ = nullptr;
};

/// The members from mutex_ to pipes_ are shared; everything about urbs is
/// touched on the testbed's GLib thread only.
class UsbfsNode : public std::enable_shared_from_this<UsbfsNode> {
 public:
    using Client = UMockdevIoctlClient;

    UsbfsNode(std::shared_ptr<UsbFunction> function, std::chrono::milliseconds idle_hold);

    void attach(std::string path);
    void detach();

    /// Queues one transfer of the device to an IN endpoint. Its last packet is short, and so ends
    /// the host's urb, unless its size is a multiple of the packet size; an empty one is a packet
    /// of length zero.
    void send(std::uint8_t endpoint, Bytes bytes);
    /// Bytes that the host has not fetched.
    std::size_t queued(std::uint8_t endpoint) const;
    void flush(std::uint8_t endpoint);
    /// The endpoint answers STALL, and what it had queued is gone, until the host clears the halt.
    void halt(std::uint8_t endpoint);
    bool halted(std::uint8_t endpoint) const;
    /// No transfer succeeds any more, until the host resets the device, which then leaves the bus.
    void hang();
    bool hangs() const { return hangs_; }

    /// The handler's signals, on the testbed's GLib thread.
    void on_connected(Client* client);
    void on_ioctl(Client* client);

 private:
    struct Urb {
        Client* client;  // identity only: urbs are dropped when the client goes away
        GObjectPtr<UMockdevIoctlData> data;
        GObjectPtr<UMockdevIoctlData> buffer;  // null for a transfer without data

        usbdevfs_urb& fields() const { return *reinterpret_cast<usbdevfs_urb*>(data->data); }
        std::span<std::uint8_t> payload() const;
    };
    struct HeldReap {
        GObjectPtr<Client> client;
        GSourcePtr timeout;  // null for a reap that may wait for ever
    };
    struct Transfer {
        Bytes bytes;
        std::size_t sent = 0;
    };
    struct Pipe {
        unsigned interface = 0;
        std::size_t packet_size = 64;
        bool halted = false;
        std::deque<Transfer> transfers;  // of an IN endpoint
    };
    enum class Progress { waiting, finished, overflow };

    void parse_configuration();
    bool is_current(Client* client);
    void forget(Client* client);
    int execute(Client* client, unsigned long request);
    int capabilities(Client* client);
    int speed() const;
    int claim(Client* client, unsigned interface);
    int release(Client* client, unsigned interface);
    int submit(Client* client);
    int start(Urb urb);
    int discard(Client* client);
    int clear_halt(std::uint8_t endpoint);
    int reset();
    void control(Urb& urb);
    int answer_control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                       Bytes& reply);
    int descriptor(unsigned type, unsigned index, Bytes& reply) const;
    void finish(Urb urb, int status);
    void reap(Client* client, bool wait);
    bool answer_reap(Client* client);
    void answer_empty_reap(Client* client);
    void hold_reap(Client* client, bool wait);
    void post_pump();
    void pump();
    void shut_down_stale_urbs();
    void fill_in_urbs();
    static Progress fill(const Urb& urb, Pipe& pipe);

    const std::shared_ptr<UsbFunction> function_;
    const std::chrono::milliseconds idle_hold_;
    unsigned interface_count_ = 0;

    mutable std::mutex mutex_;
    std::string path_;  // empty while detached
    GMainContext* context_ = nullptr;
    bool pump_posted_ = false;
    std::atomic<bool> hangs_ = false;
    std::map<std::uint8_t, Pipe> pipes_;  // by endpoint address; its keys never change

    std::deque<Urb> pending_;
    std::deque<Urb> done_;
    std::map<Client*, HeldReap> held_;
    std::set<Client*> busy_;  // reaped an urb since the last time nothing was done
    std::map<unsigned, Client*> claims_;
};

}  // namespace versavis::test

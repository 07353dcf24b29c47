// SPDX-License-Identifier: BSD-3-Clause
// The kernel's side of a usbfs node, played by the simulator: it answers the ioctls of linux/usbdevice_fs.h.
#pragma once

#include <linux/usbdevice_fs.h>
#include <umockdev.h>

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

/// What the device itself does; called on the testbed's GLib thread only.
class UsbFunction {
 public:
    static constexpr unsigned interface_count = 2;
    static constexpr std::uint8_t interrupt_in_endpoint = 0x81;  // interface 0
    static constexpr std::uint8_t bulk_out_endpoint = 0x02;      // interface 1
    static constexpr std::uint8_t bulk_in_endpoint = 0x82;       // interface 1

    virtual ~UsbFunction() = default;
    /// Answers a control request: 0, or -EPIPE for a stall.
    virtual int control(std::span<const std::uint8_t> setup, std::span<const std::uint8_t> out,
                        std::vector<std::uint8_t>& reply) = 0;
    virtual void receive(std::span<const std::byte> bytes) = 0;
};

/// The members from mutex_ to to_host_ are shared; everything about urbs is
/// touched on the testbed's GLib thread only.
class UsbfsNode : public std::enable_shared_from_this<UsbfsNode> {
 public:
    using Client = UMockdevIoctlClient;

    UsbfsNode(std::shared_ptr<UsbFunction> function, std::chrono::milliseconds idle_hold)
        : function_{std::move(function)}, idle_hold_{idle_hold} {}

    void attach(std::string path);
    void detach();
    void send(std::span<const std::byte> bytes);

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

    bool is_current(Client* client);
    void forget(Client* client);
    int execute(Client* client, unsigned long request);
    int capabilities(Client* client);
    int claim(Client* client, unsigned interface);
    int release(Client* client, unsigned interface);
    int submit(Client* client);
    int start(Urb urb);
    int discard(Client* client);
    void control(Urb& urb);
    void receive(Urb& urb);
    void finish(Urb urb, int status);
    void reap(Client* client, bool wait);
    bool answer_reap(Client* client);
    void answer_empty_reap(Client* client);
    void hold_reap(Client* client, bool wait);
    void post_pump();
    void pump();
    void shut_down_stale_urbs();
    void fill_bulk_in();

    const std::shared_ptr<UsbFunction> function_;
    const std::chrono::milliseconds idle_hold_;

    std::mutex mutex_;
    std::string path_;  // empty while detached
    GMainContext* context_ = nullptr;
    bool pump_posted_ = false;
    std::deque<std::uint8_t> to_host_;

    std::deque<Urb> pending_;
    std::deque<Urb> done_;
    std::map<Client*, HeldReap> held_;
    std::set<Client*> busy_;  // reaped an urb since the last time nothing was done
    std::map<unsigned, Client*> claims_;
};

}  // namespace versavis::test

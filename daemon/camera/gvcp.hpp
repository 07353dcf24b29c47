// SPDX-License-Identifier: BSD-3-Clause
// Asks GigE Vision devices over their control protocol, without taking control: who is there, and
// what its registers hold. Each call ends in bounded time, whatever the device sends.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// Each message begins with the key, in a header of so many bytes.
constexpr std::uint8_t gvcp_key = 0x42;
constexpr std::size_t gvcp_header_size = 8;

/// Appends a field in network order.
inline void put(std::vector<std::uint8_t>& out, std::uint64_t value, unsigned bytes) {
    while (bytes-- > 0) out.push_back(static_cast<std::uint8_t>(value >> (8 * bytes)));
}

/// A field of two bytes in network order.
inline std::uint16_t half_at(const std::uint8_t* bytes) {
    return static_cast<std::uint16_t>(bytes[0] << 8U | bytes[1]);
}

/// Until a camera that is asked by its address is taken for absent: some answer after a third of a
/// second.
constexpr Duration address_patience = seconds(1);

/// For the answer with one register.
constexpr Duration register_patience = milliseconds(500);

/// Asked by what waits, so often: true ends it.
using Cancelled = std::function<bool()>;
constexpr Duration cancelled_interval = milliseconds(20);

/// What a device says of itself when it is looked for.
struct NetworkDevice {
    in_addr address{};
    in_addr interface {};  ///< own address that it answers to
    std::string mac;       ///< as aa:bb:cc:dd:ee:ff
    std::string vendor;
    std::string model;
    std::string version;
    std::string serial;
    std::string user_name;
};

std::optional<in_addr> parse_address(const std::string& text);
std::string to_text(in_addr address);

/// What a device's clock shows, by its ticks per second, which must not be zero.
CameraTime camera_time(std::uint64_t ticks, std::uint64_t ticks_per_second);

/// Does this host have an interface in the network of the address?
bool in_own_network(in_addr address);

struct OwnInterface {
    std::string name;
    in_addr address{};
    in_addr mask{};

    bool contains(in_addr other) const {
        return (address.s_addr & mask.s_addr) == (other.s_addr & mask.s_addr);
    }
    std::string text() const;  ///< as "eth0 (192.168.1.1/24)"
};

/// The interface with this address of this host.
std::optional<OwnInterface> own_interface(in_addr address);

/// Looks for one device by address, MAC, serial number, name, or "vendor-serial"; without a name,
/// for all.
class DeviceSearch {
 public:
    explicit DeviceSearch(std::string name);

    /// Asks, again and again, for at most `patience`.
    std::optional<NetworkDevice> wait(Duration patience, const Cancelled& cancelled);

    /// The same for all that answer within `patience`; a device once for each interface.
    std::vector<NetworkDevice> collect(Duration patience);

 private:
    struct Socket {
        FileDescriptor descriptor;
        in_addr interface {};
    };
    /// Until `enough` says so of a device that is looked for.
    void look(Duration patience, const Cancelled& cancelled,
              const std::function<bool(const NetworkDevice&)>& enough);
    void ask() const;
    void add_broadcast_receiver(const Socket& socket);
    std::optional<NetworkDevice> receive(const Socket& socket) const;

    std::string name_;
    std::optional<in_addr> address_;
    std::vector<Socket> sockets_;
    std::vector<Socket> receivers_;  ///< of what is answered by broadcast
};

/// Memory of one device. Not thread-safe.
class GvcpClient {
 public:
    GvcpClient(in_addr interface, in_addr address);

    /// `size` bytes from a multiple of four on. Each block is asked for until `patience` is over.
    Expected<std::vector<std::uint8_t>> read(std::uint32_t address, std::size_t size,
                                             Duration patience, const Cancelled& cancelled);
    std::optional<std::uint32_t> read_register(std::uint32_t address, Duration patience);

 private:
    std::optional<std::vector<std::uint8_t>> request(std::uint16_t command,
                                                     const std::vector<std::uint8_t>& body,
                                                     std::size_t answer_size, Duration patience,
                                                     const Cancelled& cancelled);

    std::string name_;
    FileDescriptor socket_;
    std::uint16_t id_ = 0;
    Duration repeat_after_;  ///< twice the time that the newest answer took, or what is usual
};

/// Port of every device.
inline constexpr std::uint16_t gvcp_port = 3956;

/// GigE Vision bootstrap registers.
inline constexpr std::uint32_t gvcp_description_url = 0x200;
inline constexpr std::uint32_t gvcp_control_privilege = 0xA00;
inline constexpr std::uint32_t gvcp_controlled = 3;  ///< bits of it: some program has control

}  // namespace versavis::daemon

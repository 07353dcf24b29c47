// SPDX-License-Identifier: BSD-3-Clause
#include "camera/packet_ring.hpp"

#include <linux/filter.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <sys/mman.h>
#include <sys/socket.h>

#include <atomic>
#include <cstring>
#include <utility>

#include "camera/bandwidth_plan.hpp"

namespace versavis::daemon {

namespace {

/// What the kernel keeps while the receive thread is late: 0.2 s of gigabit Ethernet.
constexpr std::size_t ring_size = 32 << 20;

/// The kernel allocates it in blocks, which slots do not cross.
constexpr std::size_t block_size = 1 << 20;

constexpr std::size_t block_count = ring_size / block_size;

/// Where the IP header begins in a slot, as the kernel reckons for sockets without link headers.
constexpr std::size_t ip_offset = TPACKET_ALIGN(TPACKET2_HDRLEN) + 16;

/// Whole UDP packets from one address to another and a port, as the kernel's packet filter wants
/// it. Offsets count from the IP header.
void receive_only(int socket, in_addr from, in_addr own, std::uint16_t port) {
    sock_filter program[] = {BPF_STMT(BPF_LD | BPF_B | BPF_ABS, 9),  // protocol
                             BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, IPPROTO_UDP, 0, 9),
                             BPF_STMT(BPF_LD | BPF_W | BPF_ABS, 12),
                             BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ntohl(from.s_addr), 0, 7),
                             BPF_STMT(BPF_LD | BPF_W | BPF_ABS, 16),
                             BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ntohl(own.s_addr), 0, 5),
                             BPF_STMT(BPF_LD | BPF_H | BPF_ABS, 6),
                             BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, 0x3FFF, 3, 0),  // a fragment
                             BPF_STMT(BPF_LDX | BPF_B | BPF_MSH, 0),
                             BPF_STMT(BPF_LD | BPF_H | BPF_IND, 2),
                             BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, port, 1, 0),
                             BPF_STMT(BPF_RET | BPF_K, 0),
                             BPF_STMT(BPF_RET | BPF_K, 0xFFFFFFFF)};
    const sock_fprog filter{sizeof program / sizeof program[0], program};
    ::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter);
}

/// Nothing arrives any more; requests for packets still leave. Nobody reads it: it would fill.
void receive_nothing(int socket) {
    sock_filter drop_all[] = {BPF_STMT(BPF_RET | BPF_K, 0)};
    const sock_fprog filter{1, drop_all};
    ::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter);
}

Unexpected<Error> failed(const char* step) {
    return failure("packet socket", std::string(step) + ": " + std::strerror(errno),
                   "set receive = \"socket\"");
}

}  // namespace

PacketRing::PacketRing(in_addr from, std::size_t packet_size)
    : from_(from),
      datagrams_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)),
      packets_(::socket(AF_PACKET, SOCK_DGRAM | SOCK_CLOEXEC, 0)),  // receives nothing yet
      slot_size_(TPACKET_ALIGN(ip_offset + packet_size)) {}

PacketRing::PacketRing(PacketRing&& other) noexcept
    : from_(other.from_),
      datagrams_(std::move(other.datagrams_)),
      packets_(std::move(other.packets_)),
      port_(other.port_),
      slot_size_(other.slot_size_),
      memory_(std::exchange(other.memory_, nullptr)),
      next_(other.next_) {}

PacketRing::~PacketRing() {
    if (memory_ != nullptr) ::munmap(memory_, ring_size);
}

Expected<PacketRing> PacketRing::open(in_addr own, in_addr from, std::size_t packet_size) {
    PacketRing ring(from, packet_size);
    if (auto done = ring.bind(own); !done) return Unexpected(done.error());
    return ring;
}

Expected<> PacketRing::bind(in_addr own) {
    if (!datagrams_ || !packets_) return failed("is not made");
    receive_nothing(datagrams_.get());
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr = own;
    socklen_t size = sizeof address;
    if (::bind(datagrams_.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
        ::getsockname(datagrams_.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0)
        return failed("no UDP port");
    port_ = ntohs(address.sin_port);

    const int version = TPACKET_V2;
    tpacket_req request{};
    request.tp_block_size = block_size;
    request.tp_block_nr = block_count;
    request.tp_frame_size = static_cast<unsigned>(slot_size_);
    request.tp_frame_nr = static_cast<unsigned>(block_size / slot_size_ * block_count);
    if (::setsockopt(packets_.get(), SOL_PACKET, PACKET_VERSION, &version, sizeof version) != 0 ||
        ::setsockopt(packets_.get(), SOL_PACKET, PACKET_RX_RING, &request, sizeof request) != 0)
        return failed("no ring");
    void* memory =
        ::mmap(nullptr, ring_size, PROT_READ | PROT_WRITE, MAP_SHARED, packets_.get(), 0);
    if (memory == MAP_FAILED) return failed("no memory");
    memory_ = static_cast<std::uint8_t*>(memory);

    receive_only(packets_.get(), from_, own, port_);
    sockaddr_ll link{};
    link.sll_family = AF_PACKET;
    link.sll_protocol = htons(ETH_P_IP);
    link.sll_ifindex = static_cast<int>(if_nametoindex(interface_of(own.s_addr).c_str()));
    if (::bind(packets_.get(), reinterpret_cast<const sockaddr*>(&link), sizeof link) != 0)
        return failed("is not bound");
    return {};
}

std::uint8_t* PacketRing::slot() const {
    const std::size_t per_block = block_size / slot_size_;
    return memory_ + next_ / per_block * block_size + next_ % per_block * slot_size_;
}

std::span<const std::uint8_t> PacketRing::front() const {
    auto* header = reinterpret_cast<tpacket2_hdr*>(slot());
    const std::uint32_t status =
        std::atomic_ref(header->tp_status).load(std::memory_order_acquire);  // the kernel's writes
    if ((status & TP_STATUS_USER) == 0) return {};
    constexpr std::size_t shortest = 20;  // an IP header
    const bool whole = header->tp_snaplen == header->tp_len;
    return {slot() + header->tp_net, whole ? header->tp_snaplen : shortest};
}

void PacketRing::release() {
    auto* header = reinterpret_cast<tpacket2_hdr*>(slot());
    std::atomic_ref(header->tp_status).store(TP_STATUS_KERNEL, std::memory_order_release);
    next_ = (next_ + 1) % (block_size / slot_size_ * block_count);
}

void PacketRing::send(std::span<const std::uint8_t> datagram, std::uint16_t to_port) const {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr = from_;
    to.sin_port = htons(to_port);
    ::sendto(datagrams_.get(), datagram.data(), datagram.size(), 0,
             reinterpret_cast<sockaddr*>(&to), sizeof to);
}

}  // namespace versavis::daemon

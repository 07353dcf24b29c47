// SPDX-License-Identifier: BSD-3-Clause
#include "camera/image_receiver.hpp"

#include <poll.h>
#include <sys/eventfd.h>

#include <algorithm>

#include "posix/thread.hpp"

namespace versavis::daemon {

namespace {

/// Registers of the first stream channel, and what the device can.
constexpr std::uint64_t stream_port = 0x0D00;
constexpr std::uint64_t stream_address = 0x0D18;
constexpr std::uint64_t capabilities = 0x0934;
constexpr std::uint32_t capability_resend = 1U << 2U;

/// While a frame comes, the thread sleeps until its last packet should be there, within these
/// limits. In the longest, fast links fill a quarter of the ring.
constexpr Duration shortest_sleep = microseconds(500);
constexpr Duration longest_sleep = milliseconds(8);

timespec as_timespec(Duration duration) {
    constexpr std::int64_t second_ns = 1'000'000'000;
    return {duration.ns / second_ns, duration.ns % second_ns};
}

}  // namespace

Expected<std::unique_ptr<FrameSource>> ImageReceiver::create(
    ArvCamera* camera, const NetworkDevice& device, const CameraConfiguration& configuration,
    const CameraSetup& setup, CameraPipeline& pipeline, FrameMeter* meter, DetachedTasks& patient) {
    ArvDevice* control = arv_camera_get_device(camera);
    GlibError error;
    Stream stream;
    stream.packet_size = arv_camera_gv_get_packet_size(camera, error.out());
    guint32 can = 0;
    if (!error.set()) arv_device_read_register(control, capabilities, &can, error.out());
    stream.sends_again = (can & capability_resend) != 0;
    if (!error.set())
        stream.ticks_per_second =
            arv_gv_device_get_timestamp_tick_frequency(ARV_GV_DEVICE(control), error.out());
    if (error.set()) return failure("stream", error.text());
    auto ring = PacketRing::open(device.interface, device.address, stream.packet_size);
    if (!ring) return Unexpected(ring.error());
    arv_device_write_register(control, stream_address, ntohl(device.interface.s_addr), error.out());
    if (!error.set()) arv_device_write_register(control, stream_port, ring->port(), error.out());
    if (error.set()) return failure("stream", error.text());
    return std::unique_ptr<FrameSource>(new ImageReceiver(
        control, std::move(*ring), stream, configuration, setup, pipeline, meter, patient));
}

ImageReceiver::ImageReceiver(ArvDevice* device, PacketRing ring, const Stream& stream,
                             const CameraConfiguration& configuration, const CameraSetup& setup,
                             CameraPipeline& pipeline, FrameMeter* meter, DetachedTasks& patient)
    : FrameSource(configuration, setup, pipeline, meter),
      device_(device),
      patient_(patient),
      ring_(std::move(ring)),
      stream_(stream),
      assembler_(
          {setup.payload, stream.packet_size, stream.sends_again, frame_retention(configuration)},
          *this),
      stop_(::eventfd(0, EFD_CLOEXEC)),
      thread_(start_thread("receive " + configuration.name, [this] { run(); })) {}

ImageReceiver::~ImageReceiver() {
    ::eventfd_write(stop_.get(), 1);
    thread_.join();
    for (const std::uint32_t slot : assembler_.close())
        pipeline_.abandon(slot, EventReason::none, 0);
    ArvDevice* device = device_;
    g_object_ref(device);  // which may be mute
    patient_.run(
        [device] {
            arv_device_write_register(device, stream_port, 0, nullptr);
            g_object_unref(device);
        },
        release_timeout);
}

void ImageReceiver::run() {
    pollfd stopped{stop_.get(), POLLIN, 0};
    while (::poll(&stopped, 1, 0) == 0) {
        const HostTime now = host_now();
        const std::uint32_t arrived = drain(now);
        assembler_.advance(host_now());
        wait(arrived, now);
    }
}

/// Takes what is there. Returns how much it was.
std::uint32_t ImageReceiver::drain(HostTime now) {
    std::uint32_t count = 0;
    for (auto packet = ring_.front(); !packet.empty(); packet = ring_.front()) {
        assembler_.take(gvsp::udp_body(packet), now);
        ring_.release();
        ++count;
    }
    packets_ += count;
    return count;
}

/// While packets come, nobody needs to be woken by each: it sleeps until the frame's last one
/// should be there. In silence, the next packet wakes it.
void ImageReceiver::wait(std::uint32_t arrived, HostTime now) const {
    pollfd ready[] = {{stop_.get(), POLLIN, 0}, {ring_.descriptor(), POLLIN, 0}};
    const auto left = assembler_.time_left(now);
    if (arrived > 0 && left) {
        const timespec sleep = as_timespec(std::clamp(*left, shortest_sleep, longest_sleep));
        ::ppoll(ready, 1, &sleep, nullptr);
        return;
    }
    const HostTime since = host_now();
    const auto deadline = assembler_.deadline(since);
    const timespec patience = as_timespec(deadline ? *deadline - since : Duration{});
    ::ppoll(ready, 2, deadline ? &patience : nullptr, nullptr);
}

std::optional<FrameAssembler::Memory> ImageReceiver::begin_frame() {
    const auto slot = pipeline_.acquire();
    if (!slot) {
        pipeline_.buffer_underrun(1);
        return std::nullopt;
    }
    return FrameAssembler::Memory{*slot,
                                  reinterpret_cast<std::uint8_t*>(pipeline_.slot_data(*slot))};
}

void ImageReceiver::end_frame(const FrameAssembler::Frame& frame) {
    if (frame.leader && !frame.leader->image) {
        no_image_ = true;
        pipeline_.abandon(frame.memory.slot, EventReason::none, 0);
        return;
    }
    Received received;
    received.slot = frame.memory.slot;
    received.block_id = block_ids_.unwrap(frame.block_id);
    received.arrived = host_now();
    received.complete = frame.complete;
    received.size = frame.size;
    received.pixels = reinterpret_cast<const std::byte*>(frame.memory.data);
    if (frame.leader) {
        received.width = frame.leader->width;
        received.height = frame.leader->height;
        received.pixel_format = frame.leader->pixel_format;
        received.padding_x = frame.leader->padding_x;
        if (stream_.ticks_per_second != 0)
            received.camera_time = camera_time(frame.leader->ticks, stream_.ticks_per_second);
    }
    hand_over(received);
}

void ImageReceiver::ask(const gvsp::PacketRange& range) {
    request_ = static_cast<std::uint16_t>(request_ % 0xFFFFU + 1U);  // zero is none
    ring_.send(gvsp::resend_request(range, request_), gvcp_port);
}

}  // namespace versavis::daemon

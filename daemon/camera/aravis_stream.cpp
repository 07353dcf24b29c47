// SPDX-License-Identifier: BSD-3-Clause
#include "camera/aravis_stream.hpp"

#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>

namespace versavis::daemon {

namespace {

unsigned in_us(Duration duration) { return static_cast<unsigned>(duration.ns / 1000); }

/// Bytes that the kernel keeps while the receive thread is late: 0.27 s of gigabit Ethernet.
constexpr int receive_buffer = 32 << 20;

/// Silence within a frame after which its last packets are asked for, and asked for again.
constexpr Duration packet_timeout = milliseconds(2);

/// Complete frames in a row that paused for longer than that.
constexpr unsigned frames_with_pauses = 3;

/// The socket of the stream with this port, which Aravis does not hand out.
std::optional<int> find_socket(std::uint16_t port) {
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", ignored)) {
        const int descriptor =
            static_cast<int>(std::strtol(entry.path().filename().c_str(), nullptr, 10));
        sockaddr_in self{};
        socklen_t size = sizeof self;
        if (::getsockname(descriptor, reinterpret_cast<sockaddr*>(&self), &size) != 0) continue;
        if (self.sin_family == AF_INET && ntohs(self.sin_port) == port) return descriptor;
    }
    return std::nullopt;
}

}  // namespace

Expected<> set_up_packets(ArvCamera* camera, const CameraConfiguration& configuration) {
    GlibError error;
    arv_camera_gv_set_packet_size_adjustment(camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
    arv_camera_gv_set_stream_options(camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    if (configuration.packet_size != 0)
        arv_camera_gv_set_packet_size(camera, static_cast<gint>(configuration.packet_size),
                                      error.out());
    else
        arv_camera_gv_auto_packet_size(camera, error.out());
    if (!error.set()) return {};
    return failure("packet size", error.text(), "set 'packet_size' to what the network passes");
}

Expected<std::unique_ptr<FrameSource>> AravisStream::create(
    ArvCamera* camera, const CameraConfiguration& configuration, const CameraSetup& setup,
    CameraPipeline& pipeline, FrameMeter* meter, Object<ArvChunkParser> chunks,
    DetachedTasks& patient) {
    std::unique_ptr<AravisStream> self(
        new AravisStream(configuration, setup, pipeline, meter, patient));
    self->calls_back_ = ARV_IS_GV_DEVICE(arv_camera_get_device(camera));
    self->chunk_parser_ = std::move(chunks);
    GlibError error;
    self->stream_.reset(arv_camera_create_stream(
        camera, self->calls_back_ ? &AravisStream::on_stream : nullptr, self.get(), error.out()));
    if (!self->stream_) return failure("stream", error.text());
    if (ARV_IS_GV_STREAM(self->stream_.get())) {
        self->packet_timeout_us_ = in_us(packet_timeout);
        // No wait before a gap is asked for: a link keeps its packets in order.
        g_object_set(self->stream_.get(), "frame-retention", in_us(frame_retention(configuration)),
                     "initial-packet-timeout", 0U, "packet-timeout", self->packet_timeout_us_,
                     nullptr);
        self->enlarge_receive_buffer();
    }
    self->refill();
    return std::unique_ptr<FrameSource>(std::move(self));
}

AravisStream::~AravisStream() {
    closing_ = true;  // buffers that Aravis flushes are not frames
    // Ends the stream's thread, which may still read stream_, and then writes to the camera, which
    // may be mute. The slots are free as soon as nobody writes into them.
    ArvStream* stream = stream_.get();
    if (stream != nullptr && calls_back_) {
        patient_.run([stream] { g_object_unref(stream); }, release_timeout);
        ended_->get_future().wait();
    } else if (stream != nullptr) {
        g_object_unref(stream);
    }
    static_cast<void>(stream_.release());
    for (const std::uint32_t slot : queued_) pipeline_.abandon(slot, EventReason::none, 0);
}

/// The default of 208 KiB does not hold one frame. Aravis sets its own property only when the first
/// frame opens, and loses that frame: so it is enlarged here.
void AravisStream::enlarge_receive_buffer() const {
    const auto socket = find_socket(arv_gv_stream_get_port(ARV_GV_STREAM(stream_.get())));
    if (!socket) return;
    if (::setsockopt(*socket, SOL_SOCKET, SO_RCVBUFFORCE, &receive_buffer, sizeof receive_buffer) ==
        0)
        return;
    ::setsockopt(*socket, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    int got = 0;
    socklen_t size = sizeof got;
    ::getsockopt(*socket, SOL_SOCKET, SO_RCVBUF, &got, &size);
    if (static_cast<std::uint64_t>(got) < setup_.payload)
        log(LogLevel::warning, configuration_.name,
            "the receive buffer is only {} KiB, frames will be lost; raise net.core.rmem_max or "
            "give the service CAP_NET_ADMIN",
            got >> 10);
}

void AravisStream::on_stream(void* self, ArvStreamCallbackType type, ArvBuffer* /*buffer*/) {
    auto& stream = *static_cast<AravisStream*>(self);
    if (type == ARV_STREAM_CALLBACK_TYPE_EXIT) {
        const auto ended = stream.ended_;  // the stream may be gone before this returns
        ended->set_value();
        return;
    }
    if (type != ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) return;
    if (stream.closing_) return;
    if (ArvBuffer* done = arv_stream_try_pop_buffer(stream.stream_.get())) stream.take(done);
}

void AravisStream::poll(Duration timeout) {
    if (ArvBuffer* done =
            arv_stream_timeout_pop_buffer(stream_.get(), static_cast<guint64>(timeout.ns / 1000)))
        take(done);
}

std::uint64_t AravisStream::packets() const {
    return ARV_IS_GV_STREAM(stream_.get())
               ? arv_stream_get_info_uint64_by_name(stream_.get(), "n_received_packets")
               : 0;
}

/// Zero: the camera's number did not arrive. USB3 Vision counts from 0: one is added.
std::uint64_t AravisStream::block_id(ArvBuffer* buffer) {
    const std::uint64_t id = arv_buffer_get_frame_id(buffer);
    if (!calls_back_)
        return arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS ? id + 1 : 0;
    return id == 0 ? 0 : block_ids_.unwrap(id);
}

/// NaN: the frame does not carry it.
double AravisStream::chunk_value(ArvBuffer* buffer, const ChunkFeature& feature) const {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    if (!chunk_parser_ || feature.name.empty() || arv_buffer_has_chunks(buffer) == FALSE)
        return none;
    GlibError error;
    ArvChunkParser* parser = chunk_parser_.get();
    const char* name = feature.name.c_str();
    const double value = feature.is_integer
                             ? static_cast<double>(arv_chunk_parser_get_integer_value(
                                   parser, buffer, name, error.out()))
                             : arv_chunk_parser_get_float_value(parser, buffer, name, error.out());
    return error.set() ? none : value;
}

/// Aravis counts packets that find no buffer, and drops their frame without a word.
void AravisStream::note_starvation() {
    guint64 completed = 0;
    guint64 failures = 0;
    guint64 underruns = 0;
    arv_stream_get_statistics(stream_.get(), &completed, &failures, &underruns);
    if (underruns > underruns_) pipeline_.buffer_underrun(1);
    underruns_ = underruns;
}

/// Some cameras pause within a frame, as after a leader that is sent when the exposure begins:
/// Aravis then misses all packets that follow, and asks for none of this frame any more. Complete
/// frames show that nothing was lost, and that the pause must be waited for.
void AravisStream::note_pauses(bool good) {
    if (!ARV_IS_GV_STREAM(stream_.get())) return;
    const std::uint64_t given_up =
        arv_stream_get_info_uint64_by_name(stream_.get(), "n_resend_ratio_reached");
    const bool paused = given_up != given_up_ && good;
    given_up_ = given_up;
    pauses_ = paused ? pauses_ + 1 : 0;
    if (pauses_ < frames_with_pauses ||
        packet_timeout_us_ >= in_us(frame_retention(configuration_)))
        return;
    pauses_ = 0;
    packet_timeout_us_ *= 2;
    g_object_set(stream_.get(), "packet-timeout", packet_timeout_us_, nullptr);
}

void AravisStream::take(ArvBuffer* buffer) {
    Received frame;
    frame.arrived = host_now();
    frame.slot = static_cast<std::uint32_t>(GPOINTER_TO_UINT(arv_buffer_get_user_data(buffer)));
    queued_.erase(std::remove(queued_.begin(), queued_.end(), frame.slot), queued_.end());
    frame.block_id = block_id(buffer);
    frame.complete = arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS;
    if (frame.complete) {
        std::size_t size = 0;
        frame.pixels = static_cast<const std::byte*>(arv_buffer_get_data(buffer, &size));
        frame.size = size;
        const auto positive = [](gint value) {
            return static_cast<std::uint32_t>(std::max(value, 0));
        };
        frame.width = positive(arv_buffer_get_image_width(buffer));
        frame.height = positive(arv_buffer_get_image_height(buffer));
        frame.pixel_format = arv_buffer_get_image_pixel_format(buffer);
        gint padding_x = 0;
#if ARAVIS_CHECK_VERSION(0, 8, 23)  // which Ubuntu 22.04 has not
        gint padding_y = 0;
        arv_buffer_get_image_padding(buffer, &padding_x, &padding_y);
#endif
        frame.padding_x = positive(padding_x);
        frame.camera_time = {static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer))};
        const double exposure_us =
            chunk_value(buffer, setup_.chunk_exposure) * setup_.chunk_exposure_unit_us;
        if (!std::isnan(exposure_us)) frame.exposure = {std::llround(exposure_us * 1e3)};
        frame.gain = static_cast<float>(chunk_value(buffer, setup_.chunk_gain));
    }
    g_object_unref(buffer);  // the pixels are the slot's
    note_starvation();
    note_pauses(hand_over(frame));
    refill();
}

void AravisStream::refill() {
    while (queued_.size() < configuration_.buffers) {
        const auto slot = pipeline_.acquire();
        if (!slot) return;
        ArvBuffer* buffer = arv_buffer_new_full(setup_.payload, pipeline_.slot_data(*slot),
                                                GUINT_TO_POINTER(*slot), nullptr);
        // What a lost leader leaves untouched reads as zero, not as the frame before.
        arv_buffer_set_frame_id(buffer, 0);
        arv_buffer_set_timestamp(buffer, 0);
        queued_.push_back(*slot);
        arv_stream_push_buffer(stream_.get(), buffer);
    }
}

}  // namespace versavis::daemon

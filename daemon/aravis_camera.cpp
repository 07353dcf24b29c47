// SPDX-License-Identifier: BSD-3-Clause
#include "aravis_camera.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>

namespace versavis::daemon {

namespace {

constexpr int receive_buffer = 32 << 20;
constexpr unsigned frame_retention_us = 500'000;

/// A GError that must be looked at.
class GlibError {
 public:
    GlibError() = default;
    ~GlibError() { g_clear_error(&error_); }
    GlibError(const GlibError&) = delete;
    GlibError& operator=(const GlibError&) = delete;

    GError** out() { return &error_; }
    bool set() const { return error_ != nullptr; }
    std::string text() const { return set() ? error_->message : ""; }

 private:
    GError* error_ = nullptr;
};

std::vector<std::string> allowed_values(ArvDevice* device, const std::string& feature) {
    guint count = 0;
    const char** names = arv_device_dup_available_enumeration_feature_values_as_strings(
        device, feature.c_str(), &count, nullptr);
    std::vector<std::string> values(names, names + (names == nullptr ? 0 : count));
    g_free(names);
    return values;
}

std::string range_text(ArvGcNode* node) {
    if (ARV_IS_GC_FLOAT(node))
        return fmt::format("{} to {}", arv_gc_float_get_min(ARV_GC_FLOAT(node), nullptr),
                           arv_gc_float_get_max(ARV_GC_FLOAT(node), nullptr));
    if (ARV_IS_GC_INTEGER(node))
        return fmt::format("{} to {}", arv_gc_integer_get_min(ARV_GC_INTEGER(node), nullptr),
                           arv_gc_integer_get_max(ARV_GC_INTEGER(node), nullptr));
    return "";
}

/// The whole text as a number. Throws std::invalid_argument or std::out_of_range.
double to_real(const std::string& text) {
    std::size_t used = 0;
    const double value = std::stod(text, &used);
    if (used != text.size()) throw std::invalid_argument(text);
    return value;
}

gint64 to_integer(const std::string& text) {
    const double value = to_real(text);
    if (value != std::floor(value) || std::abs(value) > 9e15) throw std::invalid_argument(text);
    return static_cast<gint64>(value);
}

/// Sets a feature that a camera may lack without harm.
void set_if_available(ArvDevice* device, const char* name, const char* value) {
    if (arv_device_get_feature(device, name) != nullptr) static_cast<void>(set_feature(device, name, value));
}

Expected<> set_all(ArvDevice* device, const std::vector<std::pair<std::string, std::string>>& features) {
    for (const auto& [name, value] : features)
        if (auto done = set_feature(device, name, value); !done) return done;
    return {};
}

Expected<> configure_triggered(ArvDevice* device, const CameraConfiguration& configuration) {
    const char* edge = configuration.trigger_inverted ? "FallingEdge" : "RisingEdge";
    set_if_available(device, "TriggerSelector", "FrameStart");
    set_if_available(device, "TriggerMode", "Off");
    if (auto done =
            set_all(device, {{"TriggerSource", configuration.trigger_line}, {"TriggerActivation", edge}});
        !done)
        return done;
    set_if_available(device, "TriggerOverlap", "ReadOut");
    if (auto done = set_feature(device, "TriggerMode", "On"); !done) return done;
    if (configuration.strobe == Strobe::none) return {};
    if (auto done = set_feature(device, "LineSelector", configuration.strobe_line); !done) return done;
    set_if_available(device, "LineMode", "Output");
    return set_feature(device, "LineSource", "ExposureActive");
}

}  // namespace

Expected<Object<ArvCamera>> open_camera(const std::string& device) {
    GlibError error;
    Object<ArvCamera> camera(arv_camera_new(device.c_str(), error.out()));
    if (!camera)
        return failure(
            device, "no such camera: " + error.text(),
            "check cable, power and address ('arv-tool-0.8' lists cameras); its network must be this host's");
    ArvDevice* raw = arv_camera_get_device(camera.get());
    if (ARV_IS_GV_DEVICE(raw) && arv_gv_device_is_controller(ARV_GV_DEVICE(raw)) == FALSE)
        return failure(device, "is controlled by another program", "close that program");
    return camera;
}

Expected<> set_feature(ArvDevice* device, const std::string& name, const std::string& value) {
    ArvGcNode* node = arv_device_get_feature(device, name.c_str());
    const std::string where = "feature " + name;
    if (node == nullptr)
        return failure(where, "the camera has none of this name", "'arv-tool-0.8 features' lists them");
    GlibError error;
    std::string allowed;
    try {
        if (ARV_IS_GC_ENUMERATION(node)) {
            const auto values = allowed_values(device, name);
            allowed = fmt::format("{}", fmt::join(values, ", "));
            arv_device_set_string_feature_value(device, name.c_str(), value.c_str(), error.out());
        } else if (ARV_IS_GC_BOOLEAN(node)) {
            allowed = "true, false";
            if (value != "true" && value != "false") throw std::invalid_argument(value);
            arv_device_set_boolean_feature_value(device, name.c_str(), value == "true" ? TRUE : FALSE,
                                                 error.out());
        } else if (ARV_IS_GC_FLOAT(node)) {
            allowed = range_text(node);
            arv_device_set_float_feature_value(device, name.c_str(), to_real(value), error.out());
        } else if (ARV_IS_GC_INTEGER(node)) {
            allowed = range_text(node);
            arv_device_set_integer_feature_value(device, name.c_str(), to_integer(value), error.out());
        } else if (ARV_IS_GC_COMMAND(node)) {
            arv_device_execute_command(device, name.c_str(), error.out());
        } else {
            arv_device_set_string_feature_value(device, name.c_str(), value.c_str(), error.out());
        }
    } catch (const std::exception&) {
        return failure(where, fmt::format("'{}' is of the wrong type", value), "allowed: " + allowed);
    }
    if (error.set())
        return failure(where, fmt::format("'{}' is refused: {}", value, error.text()),
                       allowed.empty() ? "" : "allowed: " + allowed);
    return {};
}

Expected<> configure_camera(ArvCamera* camera, const CameraConfiguration& configuration) {
    ArvDevice* device = arv_camera_get_device(camera);
    arv_camera_stop_acquisition(camera, nullptr);  // somebody may have left it running
    set_if_available(device, "AcquisitionMode", "Continuous");
    if (configuration.trigger == TriggerSource::board) {
        if (auto done = configure_triggered(device, configuration); !done) return done;
    } else {
        set_if_available(device, "TriggerMode", "Off");
    }
    return set_all(device, configuration.features);
}

Expected<std::unique_ptr<AravisStream>> AravisStream::create(ArvCamera* camera,
                                                             const CameraConfiguration& configuration,
                                                             CameraPipeline& pipeline,
                                                             std::uint64_t payload) {
    std::unique_ptr<AravisStream> self(new AravisStream(configuration, pipeline, payload));
    self->calls_back_ = ARV_IS_GV_DEVICE(arv_camera_get_device(camera));
    GlibError error;
    if (self->calls_back_) {
        arv_camera_gv_set_packet_size_adjustment(camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
        arv_camera_gv_set_stream_options(camera, configuration.receive == ReceiveMode::socket
                                                     ? ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED
                                                     : ARV_GV_STREAM_OPTION_NONE);
        if (configuration.packet_size != 0)
            arv_camera_gv_set_packet_size(camera, static_cast<gint>(configuration.packet_size), error.out());
        else
            arv_camera_gv_auto_packet_size(camera, error.out());
        if (error.set())
            return failure("packet size", error.text(), "set 'packet_size' to what the network passes");
    }
    self->stream_.reset(arv_camera_create_stream(
        camera, self->calls_back_ ? &AravisStream::on_stream : nullptr, self.get(), error.out()));
    if (!self->stream_) return failure("stream", error.text());
    if (ARV_IS_GV_STREAM(self->stream_.get())) {
        g_object_set(self->stream_.get(), "frame-retention", frame_retention_us, nullptr);
        self->enlarge_receive_buffer();
    }
    self->refill();
    return self;
}

AravisStream::~AravisStream() {
    closing_ = true;  // buffers that Aravis flushes are not frames
    // Waits for the stream's thread, which may still read stream_: then nobody writes into the slots any
    // more.
    if (stream_) g_object_unref(stream_.get());
    static_cast<void>(stream_.release());
    for (const std::uint32_t slot : queued_) pipeline_.abandon(slot, EventReason::none, 0);
}

/// The default of 208 KiB does not hold one frame. Aravis sets its own property only when the first frame
/// opens, and loses that frame: so the socket is found by its port and enlarged here.
void AravisStream::enlarge_receive_buffer() const {
    const std::uint16_t port = arv_gv_stream_get_port(ARV_GV_STREAM(stream_.get()));
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", ignored)) {
        const int descriptor = static_cast<int>(std::strtol(entry.path().filename().c_str(), nullptr, 10));
        sockaddr_in self{};
        socklen_t size = sizeof self;
        if (::getsockname(descriptor, reinterpret_cast<sockaddr*>(&self), &size) != 0) continue;
        if (self.sin_family != AF_INET || ntohs(self.sin_port) != port) continue;
        if (::setsockopt(descriptor, SOL_SOCKET, SO_RCVBUFFORCE, &receive_buffer, sizeof receive_buffer) == 0)
            continue;
        ::setsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
        int got = 0;
        size = sizeof got;
        ::getsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &got, &size);
        if (static_cast<std::uint64_t>(got) < payload_)
            log(LogLevel::warning, configuration_.name,
                "the receive buffer is only {} KiB, frames will be lost; raise net.core.rmem_max or give the "
                "service "
                "CAP_NET_ADMIN",
                got >> 10);
    }
}

void AravisStream::on_stream(void* self, ArvStreamCallbackType type, ArvBuffer* /*buffer*/) {
    if (type != ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) return;
    auto& stream = *static_cast<AravisStream*>(self);
    if (stream.closing_) return;
    if (ArvBuffer* done = arv_stream_try_pop_buffer(stream.stream_.get())) stream.take(done);
}

void AravisStream::poll(Duration timeout) {
    if (ArvBuffer* done =
            arv_stream_timeout_pop_buffer(stream_.get(), static_cast<guint64>(timeout.ns / 1000)))
        take(done);
}

/// Success is no proof of size: a frame may be cut, or fill only half of the buffer.
EventReason AravisStream::refusal(ArvBuffer* buffer) const {
    if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS) return EventReason::frame_incomplete;
    std::size_t size = 0;
    arv_buffer_get_data(buffer, &size);
    const gint height = arv_buffer_get_image_height(buffer);
    const bool whole = size == payload_ && arv_buffer_get_image_width(buffer) > 0 && height > 0 &&
                       payload_ % static_cast<std::uint64_t>(height) == 0;
    return whole ? EventReason::none : EventReason::wrong_size;
}

void AravisStream::take(ArvBuffer* buffer) {
    pairing::Arrival arrival;
    arrival.arrived = host_now();
    arrival.slot = static_cast<std::uint32_t>(GPOINTER_TO_UINT(arv_buffer_get_user_data(buffer)));
    queued_.erase(std::remove(queued_.begin(), queued_.end(), arrival.slot), queued_.end());
    const std::uint64_t frame_id = arv_buffer_get_frame_id(buffer);
    if (frame_id != 0) arrival.block_id = block_ids_.unwrap(frame_id);
    const EventReason refused = refusal(buffer);
    if (refused == EventReason::none) {
        arrival.camera_time = {static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer))};
        arrival.width = static_cast<std::uint32_t>(arv_buffer_get_image_width(buffer));
        arrival.height = static_cast<std::uint32_t>(arv_buffer_get_image_height(buffer));
        arrival.pixel_format = arv_buffer_get_image_pixel_format(buffer);
        arrival.size = static_cast<std::uint32_t>(payload_);
    }
    g_object_unref(buffer);
    if (refused == EventReason::none)
        pipeline_.add(arrival);
    else
        pipeline_.abandon(arrival.slot, refused, arrival.block_id);
    refill();
}

void AravisStream::refill() {
    while (queued_.size() < configuration_.buffers) {
        const auto slot = pipeline_.acquire();
        if (!slot) return;
        ArvBuffer* buffer =
            arv_buffer_new_full(payload_, pipeline_.slot_data(*slot), GUINT_TO_POINTER(*slot), nullptr);
        // What a lost leader leaves untouched reads as zero, not as the frame before.
        arv_buffer_set_frame_id(buffer, 0);
        arv_buffer_set_timestamp(buffer, 0);
        queued_.push_back(*slot);
        arv_stream_push_buffer(stream_.get(), buffer);
    }
}

}  // namespace versavis::daemon

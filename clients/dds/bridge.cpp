// SPDX-License-Identifier: BSD-3-Clause
#include "bridge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "diagnostics.hpp"
#include "picture.hpp"
#include "recording/ros_messages.hpp"
#include "ros_client/names.hpp"
#include "ros_client/status_reader.hpp"

namespace versavis::dds {

namespace {

constexpr Duration report_period = seconds(1);
constexpr const char* diagnostics_topic = "/diagnostics";
constexpr const char* image_type = "sensor_msgs/msg/Image";
constexpr const char* jpeg_type = "sensor_msgs/msg/CompressedImage";
constexpr const char* sentence_type = "nmea_msgs/msg/Sentence";

std::string base_of(const std::string& stream) { return "/" + ros_client::topic_part(stream); }
std::string image_topic(const std::string& stream) { return base_of(stream) + "/image_raw"; }
std::string jpeg_topic(const std::string& stream) { return image_topic(stream) + "/compressed"; }
std::string sentence_topic(const std::string& stream) { return base_of(stream) + "/nmea_sentence"; }

}  // namespace

Bridge::Bridge(const Participant& participant, BridgeSettings settings)
    : participant_(participant),
      settings_(std::move(settings)),
      streams_(settings_.instance, {}, *this) {}

void Bridge::warn_once(const std::string& text) {
    if (!text.empty() && warned_.insert(text).second) fmt::print(stderr, "{}\n", text);
}

Expected<Writer*> Bridge::writer(const std::string& topic, const char* type) {
    const std::string name = topic == diagnostics_topic ? topic : settings_.prefix + topic;
    const auto found = writers_.find(name);
    if (found != writers_.end()) return &found->second;
    auto made = Writer::create(participant_, name, type);
    if (!made) return Unexpected(made.error());
    return &writers_.emplace(name, std::move(*made)).first->second;
}

Expected<> Bridge::on_stream(const std::string& name, ring::StreamKind kind) {
    std::vector<std::pair<std::string, const char*>> topics;
    if (kind == ring::StreamKind::frames)
        topics = {{image_topic(name), image_type},
                  {jpeg_topic(name), jpeg_type},
                  {base_of(name) + "/camera_info", "sensor_msgs/msg/CameraInfo"}};
    if (kind == ring::StreamKind::imu)
        topics = {{base_of(name) + "/data_raw", "sensor_msgs/msg/Imu"}};
    if (kind == ring::StreamKind::nmea) topics = {{sentence_topic(name), sentence_type}};
    if (kind == ring::StreamKind::events) topics = {{"/utc", "sensor_msgs/msg/TimeReference"}};
    for (const auto& [topic, type] : topics)
        if (const auto made = writer(topic, type); !made) return Unexpected(made.error());
    return {};
}

Expected<> Bridge::send(const std::string& topic, const char* type, const std::string& message) {
    const auto to = writer(topic, type);
    if (!to) return Unexpected(to.error());
    if (!(*to)->has_readers()) return {};
    ++sent_;
    return (*to)->write(message);
}

Expected<> Bridge::send_jpeg(const std::string& name, const Frame& frame) {
    const auto to = writer(jpeg_topic(name), jpeg_type);
    if (!to) return Unexpected(to.error());
    const HostTime begun = host_now();
    if (!(*to)->has_readers() || begun < next_jpeg_) return {};
    std::vector<std::byte> pixels(frame.payload.size());
    if (!frame.payload.copy_to(pixels.data())) {
        ++overtaken_;
        return {};
    }
    const auto picture =
        client::make_picture(name, frame.data, pixels, std::max(frame.data.width, 1U));
    const HostTime ended = host_now();
    next_jpeg_ = ended + (ended - begun);  // at most half of the time, so that all else goes on
    if (!picture) {
        warn_once(picture.error().message());
        return {};
    }
    const auto length = static_cast<std::uint32_t>(picture->jpeg.size());
    ++sent_;
    return (*to)->write(client::ros_compressed_head(frame.time.output(), name, "jpeg", length) +
                        picture->jpeg);
}

Expected<> Bridge::on_frame(const std::string& name, const Frame& frame) {
    const OutputTime time = frame.time.output();
    const auto images = writer(image_topic(name), image_type);
    if (!images) return Unexpected(images.error());
    if ((*images)->has_readers()) {
        const auto length = static_cast<std::uint32_t>(frame.payload.size());
        const auto sent =
            (*images)->write(client::ros_image_head(time, name, frame.data, length), frame.payload);
        if (!sent) return Unexpected(sent.error());
        ++(*sent ? sent_ : overtaken_);
        if (!*sent) return {};
    }
    if (auto sent = send_jpeg(name, frame); !sent) return sent;
    warn_once(settings_.lenses.misfit(name, frame.data.width, frame.data.height));
    return send(base_of(name) + "/camera_info", "sensor_msgs/msg/CameraInfo",
                client::ros_camera_info(time, name, frame.data, settings_.lenses.find(name)));
}

Expected<> Bridge::on_sample(const std::string& name, const ImuSample& sample) {
    const OutputTime time = sample.time.output();
    if (!std::isnan(sample.data.magnetic[0]))
        if (auto sent = send(base_of(name) + "/mag", "sensor_msgs/msg/MagneticField",
                             client::ros_magnetic_field(time, name, sample.data));
            !sent)
            return sent;
    if (!std::isnan(sample.data.temperature))
        if (auto sent = send(base_of(name) + "/temperature", "sensor_msgs/msg/Temperature",
                             client::ros_temperature(time, name, sample.data));
            !sent)
            return sent;
    return send(base_of(name) + "/data_raw", "sensor_msgs/msg/Imu",
                client::ros_imu(time, name, sample.data));
}

Expected<> Bridge::on_event(const std::string& /*name*/, const Event& event) {
    if (event.data.kind != EventKind::utc_label) return {};
    const OutputTime utc{event.data.value * 1'000'000'000};
    return send("/utc", "sensor_msgs/msg/TimeReference", client::ros_utc(event.time.output(), utc));
}

Expected<> Bridge::on_sentence(const std::string& name, const NmeaSentence& sentence) {
    std::string text(sentence.payload.size(), '\0');
    if (!sentence.payload.copy_to(reinterpret_cast<std::byte*>(text.data()))) return {};
    return send(sentence_topic(name), sentence_type,
                client::ros_sentence(sentence.time.output(), name, text));
}

Expected<> Bridge::publish_diagnostics() {
    constexpr const char* type = "diagnostic_msgs/msg/DiagnosticArray";
    const auto to = writer(diagnostics_topic, type);
    if (!to) return Unexpected(to.error());
    if (!(*to)->has_readers()) return {};
    const auto status = ros_client::read_status(settings_.instance);
    return send(diagnostics_topic, type,
                diagnostics_message(
                    ros_client::diagnostics(settings_.instance, status ? *status : nlohmann::json(),
                                            status ? "" : status.error().message()),
                    ros_client::time_of_day()));
}

Expected<> Bridge::turn(Duration timeout) {
    if (const HostTime now = host_now(); !reported_ || now - *reported_ >= report_period) {
        reported_ = now;
        if (auto reported = publish_diagnostics(); !reported) return reported;
    }
    return streams_.turn(timeout);
}

}  // namespace versavis::dds

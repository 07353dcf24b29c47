// SPDX-License-Identifier: BSD-3-Clause
#include "bridge.hpp"

#include <chrono>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>
#include <thread>
#include <variant>

#include "diagnostics.hpp"
#include "recording/item_messages.hpp"
#include "recording/ros_messages.hpp"
#include "status/status_document.hpp"

namespace versavis::dds {

namespace {

constexpr Duration search_period = seconds(1);
constexpr Duration report_period = seconds(1);

OutputTime time_of_day() {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    return OutputTime{now.tv_sec * 1'000'000'000 + now.tv_nsec};
}

}  // namespace

struct Bridge::Source {
    std::string name;
    std::variant<FrameStream, ImuStream, EventStream> stream;
    std::map<std::string, Writer> writers{};  ///< by topic

    ring::Reader& reader() {
        return std::visit([](auto& one) -> ring::Reader& { return one.reader(); }, stream);
    }
};

Bridge::Bridge(const Participant& participant, std::string instance, std::string prefix)
    : participant_(participant), instance_(std::move(instance)), prefix_(std::move(prefix)) {}

Bridge::~Bridge() = default;

Expected<Writer*> Bridge::writer(Source& source, const std::string& topic, const char* type) {
    const auto found = source.writers.find(topic);
    if (found != source.writers.end()) return &found->second;
    auto made = Writer::create(participant_, prefix_ + topic, type);
    if (!made) return Unexpected(made.error());
    return &source.writers.emplace(topic, std::move(*made)).first->second;
}

Expected<> Bridge::look_for_streams() {
    StreamOptions options;
    options.instance = instance_;
    const auto streams = list_streams(options);
    if (!streams) return {};  // none yet
    bool found = false;
    for (const StreamInfo& info : *streams) {
        if (info.error || sources_.count(info.name) != 0) continue;
        const auto take = [&](auto stream) {
            if (!stream) return;  // gone meanwhile: it is looked for again
            sources_[info.name] = std::make_unique<Source>(Source{info.name, std::move(*stream)});
            found = true;
        };
        if (info.kind == ring::StreamKind::frames) take(FrameStream::open(info.name, options));
        if (info.kind == ring::StreamKind::imu) take(ImuStream::open(info.name, options));
        if (info.kind == ring::StreamKind::events) take(EventStream::open(info.name, options));
    }
    if (!found) return {};
    wait_set_.emplace();
    waiting_.clear();
    for (auto& [name, source] : sources_) {
        if (auto added = wait_set_->add(source->reader()); !added) return added;
        waiting_.push_back(source.get());
        if (auto made = announce(*source); !made) return made;
    }
    return {};
}

/// Topics are there before the first message, so that nodes find them.
Expected<> Bridge::announce(Source& source) {
    const std::string base = "/" + client::ros_topic_part(source.name);
    std::vector<std::pair<std::string, const char*>> topics;
    if (std::holds_alternative<FrameStream>(source.stream))
        topics = {{base + "/image_raw", "sensor_msgs/msg/Image"},
                  {base + "/camera_info", "sensor_msgs/msg/CameraInfo"}};
    if (std::holds_alternative<ImuStream>(source.stream))
        topics = {{base + "/data_raw", "sensor_msgs/msg/Imu"}};
    if (std::holds_alternative<EventStream>(source.stream))
        topics = {{"/utc", "sensor_msgs/msg/TimeReference"}};
    for (const auto& [topic, type] : topics)
        if (const auto made = writer(source, topic, type); !made) return Unexpected(made.error());
    return {};
}

Expected<> Bridge::send(Source& source, const std::string& topic, const char* type,
                        const std::string& message) {
    const auto to = writer(source, topic, type);
    if (!to) return Unexpected(to.error());
    if (!(*to)->has_readers()) return {};
    ++counts_.sent;
    return (*to)->write(message);
}

Expected<> Bridge::publish_frame(Source& source, const Frame& frame) {
    const std::string base = "/" + client::ros_topic_part(source.name);
    const OutputTime time = frame.time.output();
    const auto images = writer(source, base + "/image_raw", "sensor_msgs/msg/Image");
    if (!images) return Unexpected(images.error());
    if ((*images)->has_readers()) {
        const auto length = static_cast<std::uint32_t>(frame.payload.size());
        const auto sent = (*images)->write(
            client::ros_image_head(time, source.name, frame.data, length), frame.payload);
        if (!sent) return Unexpected(sent.error());
        ++(*sent ? counts_.sent : counts_.overtaken);
        if (!*sent) return {};
    }
    return send(source, base + "/camera_info", "sensor_msgs/msg/CameraInfo",
                client::ros_camera_info(time, source.name, frame.data));
}

Expected<> Bridge::publish_sample(Source& source, const ImuSample& sample) {
    const std::string base = "/" + client::ros_topic_part(source.name);
    const OutputTime time = sample.time.output();
    if (!std::isnan(sample.data.magnetic[0]))
        if (auto sent = send(source, base + "/mag", "sensor_msgs/msg/MagneticField",
                             client::ros_magnetic_field(time, source.name, sample.data));
            !sent)
            return sent;
    if (!std::isnan(sample.data.temperature))
        if (auto sent = send(source, base + "/temperature", "sensor_msgs/msg/Temperature",
                             client::ros_temperature(time, source.name, sample.data));
            !sent)
            return sent;
    return send(source, base + "/data_raw", "sensor_msgs/msg/Imu",
                client::ros_imu(time, source.name, sample.data));
}

Expected<> Bridge::publish_event(Source& source, const Event& event) {
    if (event.data.kind != EventKind::utc_label) return {};
    const OutputTime utc{event.data.value * 1'000'000'000};
    return send(source, "/utc", "sensor_msgs/msg/TimeReference",
                client::ros_utc(event.time.output(), utc));
}

Expected<> Bridge::publish(Source& source) {
    const auto all = [&](auto& stream, auto publish_one) -> Expected<> {
        for (;;) {
            const auto item = stream.next();
            if (!item) {
                counts_.lost += item.error().lost;
                const Pause why = item.error().why;
                if (why == Pause::nothing || why == Pause::gone) return {};
                continue;
            }
            if (auto done = (this->*publish_one)(source, *item); !done) return done;
        }
    };
    if (auto* frames = std::get_if<FrameStream>(&source.stream))
        return all(*frames, &Bridge::publish_frame);
    if (auto* samples = std::get_if<ImuStream>(&source.stream))
        return all(*samples, &Bridge::publish_sample);
    return all(std::get<EventStream>(source.stream), &Bridge::publish_event);
}

Expected<> Bridge::publish_diagnostics() {
    if (!diagnostics_) {
        auto made =
            Writer::create(participant_, "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray");
        if (!made) return Unexpected(made.error());
        diagnostics_.emplace(std::move(*made));
    }
    if (!diagnostics_->has_readers()) return {};
    const auto status = client::read_status(instance_);
    const std::string silence = status ? "" : status.error().message();
    return diagnostics_->write(diagnostics_message(instance_, status ? *status : nlohmann::json(),
                                                   silence, time_of_day()));
}

Expected<> Bridge::turn(Duration timeout) {
    const auto due = [now = host_now()](HostTime& last, Duration period) {
        if (last != HostTime{INT64_MIN} && now - last < period) return false;
        last = now;
        return true;
    };
    if (due(searched_, search_period))
        if (auto looked = look_for_streams(); !looked) return looked;
    if (due(reported_, report_period))
        if (auto reported = publish_diagnostics(); !reported) return reported;
    if (!wait_set_) {
        std::this_thread::sleep_for(std::chrono::nanoseconds(timeout.ns));
        return {};
    }
    const auto ready = wait_set_->wait(timeout);
    return ready ? publish(*waiting_[*ready]) : Expected<>{};
}

}  // namespace versavis::dds

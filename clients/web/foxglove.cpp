// SPDX-License-Identifier: BSD-3-Clause
#include "foxglove.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "base/shallow_json.hpp"
#include "http.hpp"
#include "recording/item_messages.hpp"
#include "recording/ros_messages.hpp"
#include "ros_client/names.hpp"

namespace versavis::web {

namespace {

using nlohmann::json;

/// The newer name first, which Foxglove's own servers take alone.
constexpr std::array<std::string_view, 2> protocols{"foxglove.sdk.v1", "foxglove.websocket.v1"};
constexpr Duration look_period = seconds(1);
constexpr Duration report_period = seconds(5);
/// A viewer has some dozen panels.
constexpr std::size_t most_subscriptions = 256;
/// That wait for a viewer, which may send nonsense and read nothing.
constexpr std::size_t most_texts = 1000;
constexpr int information = 0;
constexpr int warning = 1;

/// Opcode, subscription and time, before the payload.
std::string message_head(std::uint32_t subscription, OutputTime time) {
    std::string head(13, '\x01');
    std::memcpy(head.data() + 1, &subscription, sizeof subscription);
    std::memcpy(head.data() + 5, &time.ns, sizeof time.ns);
    return head;
}

client::ItemMessage item_of(ring::StreamKind kind, const ring::Item& item) {
    return {item.number, item.time.life, item.time.output(), 0, kind, item.metadata, {}};
}

/// The JSON that names a subscription or a channel; none: no number of 32 bits.
std::optional<std::uint32_t> number_of(const json& object, const char* key) {
    if (!object.is_object()) return std::nullopt;
    const auto found = object.find(key);
    if (found == object.end() || !found->is_number_unsigned()) return std::nullopt;
    const auto number = found->get<std::uint64_t>();
    return number <= UINT32_MAX ? std::optional(static_cast<std::uint32_t>(number)) : std::nullopt;
}

/// Adds the payload of an item; false: the writer needed its memory.
bool add_payload(std::string& message, const ring::Item& item) {
    const std::size_t head = message.size();
    message.resize(head + item.payload.size());
    return item.payload.copy_to(reinterpret_cast<std::byte*>(message.data() + head));
}

}  // namespace

std::string_view foxglove_protocol(std::string_view offered) {
    for (const std::string_view protocol : protocols)
        for (std::string_view rest = offered; !rest.empty();) {
            std::string_view one = rest.substr(0, rest.find(','));
            rest.remove_prefix(std::min(rest.size(), one.size() + 1));
            one.remove_prefix(std::min(one.size(), one.find_first_not_of(' ')));
            if (one.substr(0, one.find(' ')) == protocol) return protocol;
        }
    return "";
}

FoxgloveSession::FoxgloveSession(std::string instance, LiveData& data)
    : instance_(std::move(instance)), data_(&data) {
    texts_.push_back({{"op", "serverInfo"},
                      {"name", "versavis " + instance_},
                      {"capabilities", json::array()},
                      {"metadata", {{"instance", instance_}}}});
}

void FoxgloveSession::report(int level, const std::string& message) {
    if (texts_.size() >= most_texts) return;
    texts_.push_back({{"op", "status"}, {"level", level}, {"message", message}});
}

void FoxgloveSession::advertise(const std::string& stream, ring::StreamKind kind) {
    if (!streams_.emplace(stream, kind).second) return;
    const std::string base = "/" + ros_client::topic_part(stream);
    std::vector<Channel> made;
    if (kind == ring::StreamKind::frames)
        made = {{base + "/image_raw", "sensor_msgs/msg/Image", stream, Content::image},
                {base + "/image_raw/compressed", "sensor_msgs/msg/CompressedImage", stream,
                 Content::jpeg},
                {base + "/camera_info", "sensor_msgs/msg/CameraInfo", stream, Content::camera_info},
                {"/versavis" + base + "/stamp", client::stamp_type, stream, Content::stamp}};
    if (kind == ring::StreamKind::imu)
        made = {{base + "/data_raw", "sensor_msgs/msg/Imu", stream, Content::imu}};
    if (kind == ring::StreamKind::events)
        made = {{"/versavis/events", client::event_type, stream, Content::event}};
    if (kind == ring::StreamKind::nmea)
        made = {{base + "/nmea_sentence", client::sentence_type, stream, Content::sentence}};
    if (kind == ring::StreamKind::status)
        made = {{"/versavis/status", client::text_type, stream, Content::status}};
    json channels = json::array();
    for (Channel& channel : made) {
        const auto id = static_cast<std::uint32_t>(channels_.size() + 1);
        channels.push_back({{"id", id},
                            {"topic", channel.topic},
                            {"encoding", "cdr"},
                            {"schemaName", channel.type},
                            {"schemaEncoding", "ros2msg"},
                            {"schema", client::ros_definition(channel.type)}});
        channels_.emplace(id, std::move(channel));
    }
    if (!channels.empty())
        texts_.push_back({{"op", "advertise"}, {"channels", std::move(channels)}});
}

void FoxgloveSession::look_for_channels() {
    StreamOptions options;
    options.instance = instance_;
    const auto streams = list_streams(options);
    if (!streams) return;
    for (const StreamInfo& stream : *streams)
        if (!stream.error) advertise(stream.name, stream.kind);
}

void FoxgloveSession::subscribe(const json& subscriptions) {
    for (const json& wanted : subscriptions) {
        const auto id = number_of(wanted, "id");
        const auto channel_id = number_of(wanted, "channelId");
        const auto found = channel_id ? channels_.find(*channel_id) : channels_.end();
        if (!id || found == channels_.end()) {
            report(warning,
                   "a subscription needs an 'id' and the 'channelId' of a channel that "
                   "was advertised");
            continue;
        }
        if (subscriptions_.count(*id) != 0 || subscriptions_.size() >= most_subscriptions) {
            report(warning, fmt::format("subscription {} is there already, or one too many", *id));
            continue;
        }
        const Channel& channel = found->second;
        StreamOptions options;
        options.instance = instance_;
        options.start = Position::latest;
        const auto take = [&](auto stream) {
            if (stream)
                subscriptions_.emplace(*id, Subscription{&channel, std::move(*stream)});
            else
                report(warning, stream.error().message());
        };
        switch (streams_.at(channel.stream)) {
            case ring::StreamKind::frames: take(FrameStream::open(channel.stream, options)); break;
            case ring::StreamKind::imu: take(ImuStream::open(channel.stream, options)); break;
            case ring::StreamKind::events:
                options.start = Position::oldest;
                take(EventStream::open(channel.stream, options));
                break;
            case ring::StreamKind::nmea: take(NmeaStream::open(channel.stream, options)); break;
            default: take(StatusStream::open(channel.stream, options)); break;
        }
    }
}

void FoxgloveSession::receive(std::string_view text) {
    const json message = client::parse_shallow_json(text);
    const auto list = [&](const char* key) {
        const auto found = message.find(key);
        return found != message.end() && found->is_array() ? *found : json::array();
    };
    const json operation = message.is_object() ? message.value("op", json()) : json();
    if (operation == "subscribe") return subscribe(list("subscriptions"));
    if (operation == "unsubscribe") {
        for (const json& id : list("subscriptionIds"))
            if (const auto number = number_of({{"id", id}}, "id")) subscriptions_.erase(*number);
        return;
    }
    report(information, "only 'subscribe' and 'unsubscribe' are supported");
}

void FoxgloveSession::report_missed(HostTime now) {
    if (reported_ != HostTime{INT64_MIN} && now - reported_ < report_period) return;
    reported_ = now;
    for (auto& [id, subscription] : subscriptions_) {
        if (subscription.missed == 0) continue;
        report(warning, fmt::format("{}: {} messages were not sent, as newer ones had come",
                                    subscription.channel->topic, subscription.missed));
        subscription.missed = 0;
    }
}

void FoxgloveSession::report_once(Subscription& subscription, const std::string& problem) {
    if (problem != subscription.problem && !problem.empty()) report(warning, problem);
    subscription.problem = problem;
}

std::optional<std::string> FoxgloveSession::next_text(HostTime now) {
    if (searched_ == HostTime{INT64_MIN} || now - searched_ >= look_period) {
        searched_ = now;
        look_for_channels();
    }
    report_missed(now);
    if (texts_.empty()) return std::nullopt;
    const std::string text = dumped(texts_.front());
    texts_.pop_front();
    return text;
}

namespace {

/// A subscription that has not caught up for so long goes on with the newest item.
constexpr Duration longest_behind = seconds(1);

/// Small messages in a row, after which an image goes first: a connection too slow for all of them
/// would show none.
constexpr unsigned most_in_a_row = 64;

/// The next item, or the newest.
template <class Stream, class Subscription>
auto next_fresh(Stream& stream, HostTime now, Subscription& subscription) {
    if (!subscription.caught_up) subscription.caught_up = now;
    auto item = stream.next();
    if (!item) {
        subscription.missed += item.error().lost;
        if (item.error().why != ring::Pause::lost) subscription.caught_up = now;
        return item;
    }
    if (now - *subscription.caught_up <= longest_behind) return item;
    subscription.caught_up = now;
    auto newest = stream.latest();
    if (!newest) return item;
    subscription.missed += newest->number - item->number;
    return newest;
}

}  // namespace

std::optional<std::string> FoxgloveSession::message_of(std::uint32_t id, Subscription& subscription,
                                                       HostTime now) {
    const Channel& channel = *subscription.channel;
    const std::string& stream = channel.stream;
    if (channel.content == Content::jpeg) {
        const ShownPicture* shown = data_->picture(stream, true, now);
        if (shown == nullptr) return std::nullopt;
        report_once(subscription, shown->problem);
        if (!shown->problem.empty() || shown->version == subscription.version) return std::nullopt;
        subscription.version = shown->version;
        const auto length = static_cast<std::uint32_t>(shown->jpeg.size());
        return message_head(id, shown->time) +
               client::ros_compressed_head(shown->time, stream, "jpeg", length) + shown->jpeg;
    }
    if (auto* frames = std::get_if<FrameStream>(&subscription.reader)) {
        const bool newest = channel.content == Content::image;
        const auto frame = newest ? frames->latest() : next_fresh(*frames, now, subscription);
        if (!frame) {
            if (newest) subscription.missed += frame.error().lost;
            return std::nullopt;
        }
        const OutputTime time = frame->time.output();
        std::string message = message_head(id, time);
        if (channel.content == Content::camera_info) {
            const client::Lenses& lenses = data_->lenses();
            report_once(subscription, lenses.misfit(stream, frame->data.width, frame->data.height));
            return message +
                   client::ros_camera_info(time, stream, frame->data, lenses.find(stream));
        }
        if (channel.content == Content::stamp)
            return message +
                   client::note_message(stream, item_of(ring::StreamKind::frames, *frame));
        if (subscription.number != 0 && frame->number > subscription.number)
            subscription.missed += frame->number - subscription.number;
        subscription.number = frame->number + 1;
        const auto length = static_cast<std::uint32_t>(frame->payload.size());
        message += client::ros_image_head(time, stream, frame->data, length);
        if (add_payload(message, *frame)) return message;
        ++subscription.missed;
        return std::nullopt;
    }
    if (auto* samples = std::get_if<ImuStream>(&subscription.reader)) {
        const auto sample = next_fresh(*samples, now, subscription);
        if (!sample) return std::nullopt;
        const OutputTime time = sample->time.output();
        return message_head(id, time) + client::ros_imu(time, stream, sample->data);
    }
    if (auto* events = std::get_if<EventStream>(&subscription.reader)) {
        const auto event = events->next();
        if (!event) {
            subscription.missed += event.error().lost;
            return std::nullopt;
        }
        return message_head(id, event->time.output()) +
               client::note_message(stream, item_of(ring::StreamKind::events, *event));
    }
    if (auto* sentences = std::get_if<NmeaStream>(&subscription.reader)) {
        const auto sentence = sentences->next();
        if (!sentence) subscription.missed += sentence.error().lost;
        std::string text;
        if (!sentence || !add_payload(text, *sentence)) return std::nullopt;
        const OutputTime time = sentence->time.output();
        return message_head(id, time) + client::ros_sentence(time, stream, text);
    }
    const auto status = std::get<StatusStream>(subscription.reader).latest();
    std::string document;
    if (!status || !add_payload(document, *status)) return std::nullopt;
    return message_head(id, status->time.output()) + client::text_message(document);
}

std::optional<std::string> FoxgloveSession::next_message(HostTime now) {
    const bool image_first = small_in_a_row_ >= most_in_a_row;
    for (const bool image : {image_first, !image_first})
        if (auto message = next_message(image, now)) {
            small_in_a_row_ = image ? 0 : small_in_a_row_ + 1;
            return message;
        }
    return std::nullopt;
}

/// Of images, or of what is small: in turns, beginning after the one that was served last.
std::optional<std::string> FoxgloveSession::next_message(bool image, HostTime now) {
    std::uint32_t& last = last_[image ? 1 : 0];
    auto next = subscriptions_.upper_bound(last);
    for (std::size_t i = 0; i < subscriptions_.size(); ++i, ++next) {
        if (next == subscriptions_.end()) next = subscriptions_.begin();
        const Content content = next->second.channel->content;
        if ((content == Content::image || content == Content::jpeg) != image) continue;
        auto message = message_of(next->first, next->second, now);
        if (!message) continue;
        last = next->first;
        return message;
    }
    return std::nullopt;
}

}  // namespace versavis::web

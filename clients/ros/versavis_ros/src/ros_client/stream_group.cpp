// SPDX-License-Identifier: BSD-3-Clause
#include "ros_client/stream_group.hpp"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>
#include <variant>

namespace versavis::ros_client {

namespace {

constexpr Duration search_period = seconds(1);

/// Items of one stream in a row, while others wait: a sink that is slow must not be kept by one.
constexpr int in_a_row = 16;

}  // namespace

struct StreamGroup::Source {
    using Stream = std::variant<FrameStream, ImuStream, EventStream, NmeaStream>;

    Source(std::string stream_name, Stream opened)
        : name(std::move(stream_name)), stream(std::move(opened)) {}

    ring::Reader& reader() {
        return std::visit([](auto& one) -> ring::Reader& { return one.reader(); }, stream);
    }

    std::string name;
    Stream stream;
};

StreamGroup::StreamGroup(std::string instance, std::vector<std::string> wanted, Sink& sink)
    : wanted_(std::move(wanted)), sink_(sink) {
    options_.instance = std::move(instance);
}

StreamGroup::~StreamGroup() = default;

bool StreamGroup::is_wanted(const std::string& name) const {
    return wanted_.empty() || std::find(wanted_.begin(), wanted_.end(), name) != wanted_.end();
}

Expected<> StreamGroup::look_for_streams() {
    const auto streams = list_streams(options_);
    problem_.reset();
    if (!streams) {
        problem_ = streams.error();
        return {};
    }
    for (const std::string& name : wanted_)
        if (std::none_of(streams->begin(), streams->end(),
                         [&](const StreamInfo& info) { return info.name == name; }))
            problem_ = Error{name, "there is no such stream", "see 'versavis list'"};
    std::vector<std::pair<std::string, ring::StreamKind>> found;
    for (const StreamInfo& info : *streams) {
        if (!is_wanted(info.name) || sources_.count(info.name) != 0) continue;
        if (info.error) problem_ = info.error;
        if (info.error) continue;
        const auto take = [&, name = info.name, kind = info.kind](auto stream) {
            if (!stream) return;  // gone meanwhile: it is looked for again
            sources_[name] = std::make_unique<Source>(name, std::move(*stream));
            found.emplace_back(name, kind);
        };
        if (info.kind == ring::StreamKind::frames) take(FrameStream::open(info.name, options_));
        if (info.kind == ring::StreamKind::imu) take(ImuStream::open(info.name, options_));
        if (info.kind == ring::StreamKind::events) take(EventStream::open(info.name, options_));
        if (info.kind == ring::StreamKind::nmea && sink_.takes_sentences())
            take(NmeaStream::open(info.name, options_));
    }
    if (found.empty()) return {};
    wait_set_.emplace();
    waiting_.clear();
    for (auto& [name, source] : sources_) {
        if (auto added = wait_set_->add(source->reader()); !added) return added;
        waiting_.push_back(source.get());
    }
    for (const auto& [name, kind] : found)
        if (auto done = sink_.on_stream(name, kind); !done) return done;
    return {};
}

Expected<> StreamGroup::hand_out(Source& source) {
    const auto all = [&](auto& stream, auto take) -> Expected<> {
        for (int i = 0; i < in_a_row; ++i) {
            const auto item = stream.next();
            if (!item) {
                lost_ += item.error().lost;
                const Pause why = item.error().why;
                if (why == Pause::nothing || why == Pause::gone) return {};
                continue;
            }
            if (auto done = (sink_.*take)(source.name, *item); !done) return done;
        }
        return {};
    };
    if (auto* frames = std::get_if<FrameStream>(&source.stream))
        return all(*frames, &Sink::on_frame);
    if (auto* samples = std::get_if<ImuStream>(&source.stream))
        return all(*samples, &Sink::on_sample);
    if (auto* sentences = std::get_if<NmeaStream>(&source.stream))
        return all(*sentences, &Sink::on_sentence);
    return all(std::get<EventStream>(source.stream), &Sink::on_event);
}

Expected<> StreamGroup::turn(Duration timeout) {
    if (const HostTime now = host_now(); !searched_ || now - *searched_ >= search_period) {
        searched_ = now;
        if (auto looked = look_for_streams(); !looked) return looked;
    }
    if (!wait_set_) {
        std::this_thread::sleep_for(std::chrono::nanoseconds(timeout.ns));
        return {};
    }
    const auto ready = wait_set_->wait(timeout);
    return ready ? hand_out(*waiting_[*ready]) : Expected<>{};
}

}  // namespace versavis::ros_client

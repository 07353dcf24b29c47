// SPDX-License-Identifier: BSD-3-Clause
#include "live_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/json_text.hpp"
#include "doctor/service_checks.hpp"
#include "http.hpp"
#include "status/status_document.hpp"
#include "status/status_metrics.hpp"

namespace versavis::web {

namespace {

using nlohmann::json;

constexpr Duration unwatched_after = seconds(10);
constexpr Duration search_period = seconds(1);
constexpr Duration status_period = milliseconds(500);  // as the service publishes it
/// Why there is none costs a process that asks systemd.
constexpr Duration silence_period = seconds(2);
constexpr Duration state_period = milliseconds(250);
constexpr Duration picture_period = milliseconds(200);
constexpr Duration exposures_kept = seconds(2);
constexpr Duration samples_kept = seconds(5);
constexpr Duration sample_spacing = milliseconds(20);
constexpr Duration clock_kept = seconds(600);
constexpr std::size_t events_kept = 200;
/// What is read of a stream in one turn, at most: a stream of 8 kHz has 800 in a tenth of a second.
constexpr int items_per_turn = 4000;
/// Pixels; a page shows two cameras side by side on a usual screen.
constexpr std::uint32_t overview_width = 800;

double age_s(HostTime now, HostTime then) { return static_cast<double>((now - then).ns) * 1e-9; }

/// JavaScript's numbers are exact up to 2^53 only.
json exact(std::int64_t value) { return std::to_string(value); }

template <class Items>
void forget(Items& items, HostTime before) {
    while (!items.empty() && items.front().time < before) items.pop_front();
}

/// Gives each item that has come to `take`; those that were overwritten are passed over.
template <class Stream, class Take>
void read_all(Stream& stream, Take take) {
    for (int i = 0; i < items_per_turn; ++i)
        if (const auto item = stream.next())
            take(*item);
        else if (item.error().why == Pause::nothing || item.error().why == Pause::gone)
            return;
}

json sigma_of(std::uint32_t sigma_ns) {
    return sigma_ns == sigma_unknown ? json() : json(sigma_ns);
}

json facts_of(const Frame& frame, const client::Picture& picture) {
    const SensorState sensor = frame.sensor();
    const auto known = [](float value) { return std::isnan(value) ? json() : json(value); };
    return {{"number", frame.number},
            {"block_id", exact(static_cast<std::int64_t>(frame.data.block_id))},
            {"trigger", frame.data.trigger},
            {"stamp_ns", exact(frame.time.ns)},
            {"epoch", frame.time.epoch},
            {"kind", to_string(frame.data.stamp_kind())},
            {"sigma_ns", sigma_of(frame.data.sigma_ns)},
            {"suspect", (frame.data.flags & flag_suspect) != 0},
            {"holdover", (frame.data.flags & flag_holdover) != 0},
            {"exposure_ns", frame.data.exposure.ns},
            {"width", frame.data.width},
            {"height", frame.data.height},
            {"format", pixel_format_name(frame.data.pixel_format)},
            {"gain", known(sensor.gain)},
            {"temperature_c", known(sensor.temperature_c)},
            {"shown_width", picture.width},
            {"shown_height", picture.height},
            {"saturated", picture.saturated},
            {"histogram", picture.histogram}};
}

/// What plots show of a clock, of a status document. The output clock is shown against the host's,
/// less `base_ns`: all its digits are more than a page can read.
json clock_facts(const json& clock, std::int64_t base_ns) {
    json facts = json::object();
    for (const char* key : {"sigma_ns", "bound_ns", "residual_ns", "skew_ppm", "epoch"})
        facts[key] = clock.value(key, json());
    if (const auto output = clock.find("output_minus_host_ns");
        output != clock.end() && output->is_number_integer())
        facts["output_ns"] = static_cast<double>(output->get<std::int64_t>() - base_ns);
    return facts;
}

}  // namespace

void LiveData::look_for_streams() {
    StreamOptions options;
    options.instance = instance_;
    const auto streams = list_streams(options);
    if (!streams) return;
    StreamOptions past = options;
    past.start = Position::oldest;
    for (const StreamInfo& stream : *streams) {
        if (stream.error) continue;
        if (stream.kind == ring::StreamKind::frames && cameras_.count(stream.name) == 0) {
            auto frames = FrameStream::open(stream.name, options);
            auto pictures = FrameStream::open(stream.name, options);
            if (frames && pictures)
                cameras_.emplace(stream.name, Camera{std::move(*frames), std::move(*pictures)});
        }
        if (stream.kind == ring::StreamKind::imu && imus_.count(stream.name) == 0)
            if (auto samples = ImuStream::open(stream.name, options))
                imus_.emplace(stream.name, Imu{std::move(*samples)});
        if (stream.kind == ring::StreamKind::events && !event_stream_)
            if (auto events = EventStream::open(stream.name, past))
                event_stream_ = std::move(*events);
    }
}

void LiveData::read_frames(Camera& camera, HostTime now) {
    read_all(camera.frames, [&](const Frame& frame) {
        camera.exposures.push_back(
            {frame.data.host_time,
             {{"tick", frame.data.tick()},
              {"exposure_s", static_cast<double>(frame.data.exposure.ns) * 1e-9},
              {"kind", to_string(frame.data.stamp_kind())},
              {"sigma_ns", sigma_of(frame.data.sigma_ns)},
              {"suspect", (frame.data.flags & flag_suspect) != 0}}});
    });
    forget(camera.exposures, now - exposures_kept);
}

void LiveData::read_samples(Imu& imu, HostTime now) {
    read_all(imu.samples, [&](const ImuSample& sample) {
        const ImuMetadata& data = sample.data;
        if (!imu.shown.empty() && data.host_time - imu.shown.back().time < sample_spacing) return;
        imu.shown.push_back({data.host_time,
                             {data.gyro[0], data.gyro[1], data.gyro[2], data.accel[0],
                              data.accel[1], data.accel[2]}});
    });
    forget(imu.shown, now - samples_kept);
}

void LiveData::read_events() {
    if (!event_stream_) return;
    read_all(*event_stream_, [&](const Event& event) {
        const std::string source = event.data.source_name;
        const char* reason = to_string(event.data.reason);
        events_.push_back({event.data.host_time,
                           {{"kind", to_string(event.data.kind)},
                            {"source", source},
                            {"reason", reason},
                            {"value", exact(event.data.value)},
                            {"epoch", event.data.epoch}}});
        if (events_.size() > events_kept) events_.pop_front();
        const auto camera = cameras_.find(source);
        if (event.data.kind == EventKind::frame_without_trigger && camera != cameras_.end())
            ++camera->second.withheld[reason];
    });
}

void LiveData::read_status(HostTime now) {
    auto status = client::read_status(instance_);
    silence_ = status ? "" : client::explain_silence(status.error()).message();
    status_ = status ? std::optional(std::move(*status)) : std::nullopt;
    forget(clock_, now - clock_kept);
    if (!status_) return;
    const auto clock = status_->find("clock");
    if (clock == status_->end() || !clock->is_object()) return;
    if (clock_.empty()) {
        const json base = clock->value("output_minus_host_ns", json());
        clock_base_ns_ = base.is_number_integer() ? base.get<std::int64_t>() : 0;
    }
    clock_.push_back({now, clock_facts(*clock, clock_base_ns_)});
}

void LiveData::advance(HostTime now) {
    if (watched_ == HostTime{INT64_MIN}) return;
    if (now - watched_ > unwatched_after) {
        *this = LiveData(instance_, std::move(lenses_));
        return;
    }
    if (searched_ == HostTime{INT64_MIN} || now - searched_ >= search_period) {
        look_for_streams();
        searched_ = now;
    }
    for (auto& [name, camera] : cameras_) read_frames(camera, now);
    for (auto& [name, imu] : imus_) read_samples(imu, now);
    read_events();
    const Duration period = silence_.empty() ? status_period : silence_period;
    if (asked_ == HostTime{INT64_MIN} || now - asked_ >= period) {
        read_status(now);
        asked_ = now;
    }
}

json LiveData::document(HostTime now) const {
    const auto conclusion = status_ ? client::conclude(*status_)
                                    : client::Conclusion{client::Conclusion::State::unknown,
                                                         "There is no living service: " + silence_};
    const auto dated = [now](const std::deque<Moment>& moments) {
        json rows = json::array();
        for (const Moment& moment : moments) {
            json facts = moment.facts;
            facts["age_s"] = age_s(now, moment.time);
            rows.push_back(std::move(facts));
        }
        return rows;
    };
    json cameras = json::object();
    for (const auto& [name, camera] : cameras_) {
        cameras[name] = {{"exposures", dated(camera.exposures)}, {"withheld", camera.withheld}};
    }
    json imus = json::object();
    for (const auto& [name, imu] : imus_) {
        json samples = json::array();
        for (const Sample& sample : imu.shown) {
            json row = json::array({age_s(now, sample.time)});
            for (const float value : sample.values)
                row.push_back(std::isnan(value) ? json() : json(value));
            samples.push_back(std::move(row));
        }
        imus[name] = std::move(samples);
    }
    return {{"instance", instance_},
            {"conclusion",
             {{"state", client::to_string(conclusion.state)}, {"sentence", conclusion.sentence}}},
            {"silence", silence_},
            {"host_time_ns", exact(now.ns)},
            {"status", status_ ? *status_ : json()},
            {"cameras", std::move(cameras)},
            {"imus", std::move(imus)},
            {"events", dated(events_)},
            {"clock", dated(clock_)}};
}

void LiveData::watch(HostTime now) {
    const bool first = watched_ == HostTime{INT64_MIN};
    watched_ = now;
    if (first) advance(now);
}

const std::string& LiveData::state(HostTime now) {
    watch(now);
    if (!state_.empty() && now - stated_ < state_period) return state_;
    state_ = dumped(document(now));
    stated_ = now;
    return state_;
}

const ShownPicture* LiveData::picture(const std::string& name, bool whole, HostTime now) {
    watch(now);
    const auto found = cameras_.find(name);
    if (found == cameras_.end()) return nullptr;
    Camera& camera = found->second;
    ShownPicture& shown = whole ? camera.whole : camera.overview;
    if (shown.looked != HostTime{INT64_MIN} && now - shown.looked < picture_period) return &shown;
    shown.looked = now;
    camera.pictures.reader().seek(Position::latest);  // the other size may have taken it
    const auto frame = camera.pictures.latest();
    if (!frame || (shown.number == frame->number && shown.life == frame->time.life)) return &shown;
    std::vector<std::byte> payload(frame->payload.size());
    if (!frame->payload.copy_to(payload.data())) return &shown;  // overtaken: the next one will do
    auto picture = client::make_picture(name, frame->data, payload,
                                        whole ? frame->data.width : overview_width);
    shown.problem = picture ? "" : picture.error().message();
    if (!picture) return &shown;
    ++shown.version;
    shown.life = frame->time.life;
    shown.number = frame->number;
    shown.time = frame->time.output();
    shown.arrival = frame->data.arrival;
    shown.facts = facts_of(*frame, *picture);
    shown.jpeg = std::move(picture->jpeg);
    return &shown;
}

Expected<client::WiredParts> LiveData::wiring() const {
    const auto status = client::read_status(instance_);
    if (!status) return Unexpected(status.error());
    const std::string path = client::text(*status, "configuration");
    auto parts = client::configured_wiring(
        path, [&](const auto& name, const auto&) { return client::preset_of(*status, name); });
    if (parts && parts->empty()) return failure(path, "has no camera, IMU or LiDAR at the board");
    return parts;
}

std::string LiveData::metrics(HostTime now) const {
    const auto status = client::read_status(instance_);
    return client::openmetrics_text(instance_, status ? std::optional(*status) : std::nullopt, now);
}

}  // namespace versavis::web

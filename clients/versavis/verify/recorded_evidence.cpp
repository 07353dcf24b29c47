// SPDX-License-Identifier: BSD-3-Clause
#include "verify/recorded_evidence.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "base/plausible_time.hpp"

namespace versavis::client {

namespace {

/// Fields of an item by their offsets in the contract.
class ItemFields {
 public:
    explicit ItemFields(const ring::Metadata& metadata) {
        static_assert(sizeof metadata == ring::metadata_size);
        std::memcpy(bytes_.data(), metadata.data(), bytes_.size());
    }

    template <class T>
    T at(std::size_t offset) const {
        T value;
        std::memcpy(&value, bytes_.data() + offset, sizeof value);
        return value;
    }
    std::int64_t i64(std::size_t offset) const { return at<std::int64_t>(offset); }
    std::uint64_t u64(std::size_t offset) const { return at<std::uint64_t>(offset); }
    std::uint32_t u32(std::size_t offset) const { return at<std::uint32_t>(offset); }

 private:
    std::array<std::byte, ring::metadata_size> bytes_;
};

template <class... Times>
bool possible(const Times&... times) {
    return (is_plausible(times.ns) && ...);
}

void add_clock_item(const ItemFields& item, ClockEvidence& clock) {
    const std::uint32_t second = item.u32(4);
    switch (item.u32(0)) {
        case 1: {
            const ClockExchange each{
                second, {item.i64(16)}, {item.i64(24)}, {item.i64(32)}, {item.i64(40)}};
            if (possible(each.sent, each.received, each.answered, each.arrived))
                clock.exchanges.push_back(each);
            break;
        }
        case 2: {
            const ClockMessage each{second, {item.i64(8)}, {item.i64(16)}};
            if (possible(each.departed, each.arrived)) clock.messages.push_back(each);
            break;
        }
        case 4: {
            const OutputReading each{
                second, {item.i64(8)}, {item.i64(16)}, {static_cast<std::int64_t>(item.u32(24))}};
            if (possible(each.host, each.minus_host)) clock.outputs.push_back(each);
            break;
        }
        default: break;
    }
}

CameraRun& newest_run(CameraEvidence& camera) {
    if (camera.runs.empty()) camera.runs.emplace_back();
    return camera.runs.back();
}

StampedSample to_sample(const StampedItem& item, const ImuMetadata& imu) {
    return {item,         imu.board_time, imu.host_time, imu.number, imu.filter_delay,
            imu.sigma_ns, imu.epoch,      imu.flags};
}

template <class Device>
Device& named(std::vector<Device>& devices, const std::string& name) {
    const auto found = std::find_if(devices.begin(), devices.end(),
                                    [&](const Device& device) { return device.name == name; });
    if (found != devices.end()) return *found;
    devices.emplace_back().name = name;
    return devices.back();
}

std::string camera_of(const std::string& evidence_stream) {
    constexpr std::string_view end = "-evidence";
    return evidence_stream.substr(0, evidence_stream.size() - end.size());
}

void add_frame(const StampedItem& stamped, const RecordedItem& item, RecordedEvidence& evidence) {
    CameraEvidence& camera = named(evidence.cameras, item.stream);
    const auto frame = unpack<FrameMetadata>(item.metadata);
    if (possible(stamped.time, frame.board_time, frame.host_time, frame.arrival, frame.camera_time,
                 frame.exposure))
        camera.frames.push_back({stamped, frame});
    else
        ++camera.impossible;
}

void add_sample(const StampedItem& stamped, const RecordedItem& item, RecordedEvidence& evidence) {
    ImuEvidence& imu = named(evidence.imus, item.stream);
    const StampedSample sample = to_sample(stamped, unpack<ImuMetadata>(item.metadata));
    if (possible(sample.time, sample.board, sample.host, sample.filter_delay))
        imu.samples.push_back(sample);
    else
        ++imu.impossible;
}

std::string source_of(const EventMetadata& event) {
    const char* name = event.source_name;
    return {name, std::find(name, name + sizeof event.source_name, '\0')};
}

void add_item(const RecordedItem& item, RecordedEvidence& evidence) {
    const StampedItem stamped{item.number, item.life, item.time};
    switch (item.kind) {
        case ring::StreamKind::frames: add_frame(stamped, item, evidence); break;
        case ring::StreamKind::imu: add_sample(stamped, item, evidence); break;
        case ring::StreamKind::events: {
            const auto event = unpack<EventMetadata>(item.metadata);
            constexpr std::int64_t last_year_s = 1'000'000'000'000;
            const bool named = event.value >= 0 && event.value < last_year_s &&
                               possible(event.board_time, event.host_time);
            if (event.kind == EventKind::imu_ready)
                evidence.set_up[source_of(event)].push_back(event.board_time);
            if (event.kind == EventKind::utc_label && named)
                evidence.clock.pulses.push_back(
                    {event.epoch, event.board_time, event.host_time, event.value});
            break;
        }
        case ring::StreamKind::evidence:
            add_camera_evidence(item.metadata, named(evidence.cameras, camera_of(item.stream)));
            break;
        case ring::StreamKind::clock:
            add_clock_item(ItemFields(item.metadata), evidence.clock);
            break;
        default: break;
    }
}

}  // namespace

void add_camera_evidence(const ring::Metadata& metadata, CameraEvidence& camera) {
    const ItemFields item(metadata);
    switch (item.u32(0)) {
        case 1: {
            CameraRun& run = camera.runs.emplace_back();
            run.period = {item.i64(8)};
            run.latest_arrival = {item.i64(24)};
            break;
        }
        case 2: {
            const ExposureEvidence each{item.u64(8),
                                        {item.i64(24)},
                                        {item.i64(32)},
                                        {item.i64(72)},
                                        item.at<std::uint8_t>(60) != 0};
            if (possible(each.start, each.end, each.delay))
                newest_run(camera).exposures.push_back(each);
            break;
        }
        case 3: {
            const ArrivalEvidence each{
                item.u64(16), {item.i64(24)}, {item.i64(32)}, {item.i64(40)}};
            if (possible(each.camera, each.arrived, each.exposure))
                newest_run(camera).arrivals.push_back(each);
            break;
        }
        case 6: {  // of the board, too: it counts anew
            const CameraRun& before = newest_run(camera);
            if (item.at<std::uint8_t>(8) != 0)
                camera.runs.push_back({before.period, before.latest_arrival, {}, {}, {}});
            break;
        }
        case 9: {
            constexpr unsigned both_edges = 1;
            const ExposureRecord record{item.u64(16),
                                        {item.i64(40)},
                                        {item.i64(48)},
                                        (item.at<std::uint16_t>(10) & both_edges) != 0};
            if (possible(record.start, record.end))  // an edge that is missing is no time
                newest_run(camera).records.push_back(record);
            break;
        }
        default: break;
    }
}

Expected<RecordedEvidence> read_evidence(const Recording& recording,
                                         const std::function<bool()>& go_on) {
    RecordedEvidence evidence;
    bool stopped = false;
    const auto read = recording.glance({}, [&](const RecordedItem& item) {
        add_item(item, evidence);
        stopped = !go_on();
        return !stopped;
    });
    if (!read) return Unexpected(read.error());
    if (stopped) return failure("verify", "stopped", "start it again");
    const auto gaps = recording.gaps();
    if (!gaps) return Unexpected(gaps.error());
    for (const RecordedGap& gap : *gaps) {
        for (CameraEvidence& camera : evidence.cameras)
            if (camera.name == gap.stream) camera.gaps.push_back(gap);
        for (ImuEvidence& imu : evidence.imus)
            if (imu.name == gap.stream) imu.gaps.push_back(gap);
    }
    for (const std::string& path : recording.paths())
        if (auto compared = compare_message_stamps(path, evidence.message_stamps); !compared)
            return Unexpected(compared.error());
    const auto& metadata = recording.facts().metadata;
    if (const auto clock = metadata.find("output_clock"); clock != metadata.end())
        evidence.output_clock = clock->second;
    return evidence;
}

}  // namespace versavis::client

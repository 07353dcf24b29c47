// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_evaluation.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/toml/table_reader.hpp"
#include "evaluate/grey_picture.hpp"

namespace versavis::client {

namespace {

bool has(const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

/// The cameras to be read. Error: one that is named is none.
Expected<std::vector<std::string>> chosen_cameras(const Recording& recording,
                                                  const std::vector<std::string>& named) {
    std::vector<std::string> all;
    for (const RecordedStream& stream : recording.streams())
        if (stream.kind == ring::StreamKind::frames) all.push_back(stream.name);
    if (all.empty())
        return failure("", "the recording has no camera", "record one: versavis record");
    for (const std::string& name : named)
        if (!has(all, name))
            return failure(name, "is not a camera of the recording",
                           fmt::format("it has {}", fmt::join(all, ", ")));
    return named.empty() ? all : named;
}

/// Calls `take` with each frame until it fails or says that it is enough.
Expected<> each_frame(const Recording& recording, const std::vector<std::string>& cameras,
                      const std::function<Expected<bool>(const RecordedItem&)>& take) {
    Expected<> failed;
    const auto read = recording.for_each(cameras, [&](const RecordedItem& item) {
        if (item.payload.empty()) return true;  // its image is not in the file
        const auto go_on = take(item);
        if (!go_on) failed = Unexpected(go_on.error());
        return go_on && *go_on;
    });
    return failed ? read : failed;
}

}  // namespace

Expected<> LedEvaluation::look(const std::string& camera, const FrameMetadata& frame,
                               std::span<const std::byte> pixels) {
    if (looked_enough(camera)) return {};
    const auto picture = grey_picture(camera, frame, pixels);
    if (!picture) return Unexpected(picture.error());
    searches_[camera].add(*picture);
    return {};
}

bool LedEvaluation::looked_enough(const std::string& camera) const {
    if (settings_.places.contains(camera)) return true;
    const auto found = searches_.find(camera);
    return found != searches_.end() && found->second.pictures() >= enough_frames;
}

Expected<> LedEvaluation::find(const std::vector<std::string>& required) {
    for (const auto& [camera, search] : searches_) {
        const auto place = search.find(camera);
        if (place)
            settings_.places[camera] = *place;
        else
            not_found_.emplace(camera, place.error());
    }
    for (const auto& [camera, error] : not_found_)
        if (settings_.places.empty() || has(required, camera)) return Unexpected(error);
    if (settings_.places.empty()) return failure("", "there are no frames", "record a camera");
    return {};
}

Expected<> LedEvaluation::add(const std::string& camera, std::uint64_t life, OutputTime time,
                              const FrameMetadata& frame, std::span<const std::byte> pixels) {
    const auto place = settings_.places.find(camera);
    if (place == settings_.places.end() || (frame.flags & flag_suspect) != 0) return {};
    const auto picture = grey_picture(camera, frame, pixels);
    if (!picture) return Unexpected(picture.error());
    const auto given = settings_.exposures.find(camera);
    LedObservation shot;
    shot.life = life;
    shot.epoch = frame.epoch;
    shot.tick = frame.tick();
    shot.triggered = frame.trigger != 0;
    shot.time = time;
    shot.exposure = given != settings_.exposures.end() ? given->second : frame.exposure;
    shot.picture = measure_leds(*picture, place->second);
    shots_[camera].push_back(shot);
    return {};
}

Expected<LedReport> LedEvaluation::report() const {
    auto report = led_report(shots_, settings_.report);
    if (!report) return report;
    for (const auto& [camera, error] : not_found_)
        report->notes.push_back(camera + ": left out, no LED board was found");
    return report;
}

Expected<LedReport> evaluate_leds(const Recording& recording,
                                  const std::vector<std::string>& cameras,
                                  const LedEvaluationSettings& settings,
                                  const std::function<bool(std::size_t frames)>& progress) {
    const auto chosen = chosen_cameras(recording, cameras);
    if (!chosen) return Unexpected(chosen.error());
    LedEvaluation evaluation(settings);
    const auto looked = each_frame(recording, *chosen, [&](const RecordedItem& item) {
        auto done =
            evaluation.look(item.stream, unpack<FrameMetadata>(item.metadata), item.payload);
        if (!done) return Expected<bool>(Unexpected(done.error()));
        return Expected<bool>(progress(0) &&
                              !std::all_of(chosen->begin(), chosen->end(), [&](const auto& name) {
                                  return evaluation.looked_enough(name);
                              }));
    });
    if (!looked) return Unexpected(looked.error());
    if (const auto found = evaluation.find(cameras); !found) return Unexpected(found.error());
    std::vector<std::string> seen;
    for (const auto& [camera, place] : evaluation.places())
        if (has(*chosen, camera)) seen.push_back(camera);
    std::size_t frames = 0;
    const auto added = each_frame(recording, seen, [&](const RecordedItem& item) {
        const auto done = evaluation.add(item.stream, item.life, item.time,
                                         unpack<FrameMetadata>(item.metadata), item.payload);
        if (!done) return Expected<bool>(Unexpected(done.error()));
        return Expected<bool>(progress(++frames));
    });
    if (!added) return Unexpected(added.error());
    return evaluation.report();
}

double recorded_led_rate_hz(const Recording& recording) {
    const std::string name = "configuration.toml";
    const Attachment* configuration = recording.attachment(name);
    if (configuration == nullptr) return 0;
    const auto table = parse_toml(configuration->content, name);
    if (!table) return 0;
    const toml::table* ports = (*table)["ports"].as_table();
    if (ports == nullptr) return 0;
    const double rate = (*ports)["test_rate_hz"].value_or(0.0);
    return rate > 0 ? rate : 0;
}

}  // namespace versavis::client

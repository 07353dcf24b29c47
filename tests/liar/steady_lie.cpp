// SPDX-License-Identifier: BSD-3-Clause
#include "steady_lie.hpp"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <span>
#include <string_view>

namespace versavis::liar {

namespace {

constexpr std::uint8_t pulse_named = 13;  ///< kind of event
constexpr Field event_kind{"kind", 0, 1};

/// Patterns of the kinds that the service fails.
constexpr const char* known_failures[] = {
    // It takes more than the second from the beginning to the end of the lie to be believed again.
    "drift:cam0+imu*",
    "offset:cam0+imu*",
    "trigger:*",
    "drift:cams*",
    // The pairing of the camera does not lock again.
    "offset:cam0+*:-*",
    "offset:cam0+*:+1ms:5s",
    "offset:no-exchanges:-*",
    "offset:no-exchanges:+1ms:5s",
    "drift:no-exchanges*",
    // No wrong stamp, but an honest stream is withheld for longer than a second, or a needless
    // epoch begins.
    "offset:exchanges:?0.2ms:5s",
    "drift:exchanges*",
    "offset:cam-start:*",
    "offset:cams-end:*",
    "offset:cam-edges:*",
    "*-from-start:*",
    "label*",
    "*:60s",
    "*:240s",
};

/// Part of a brief run: a kind for each stream.
constexpr const char* brief_kinds[] = {
    "offset:cam:+1ms:0.2s", "offset:imu:-50ms:0.2s", "offset:exchanges:+1ms:0.2s",
    "every3:cam:+1ms",      "offset:all:+1ms:5s",
};

bool is_one_of(std::span<const char* const> patterns, const std::string& name) {
    return std::any_of(patterns.begin(), patterns.end(), [&](const char* pattern) {
        return ::fnmatch(pattern, name.c_str(), 0) == 0;
    });
}

unsigned stream_of(const Packet& packet) {
    switch (packet.type) {
        case Type::exposure: return 1U << get(packet, exposure::camera);
        case Type::imu_sample: return streams::imu;
        case Type::clock_answer:
        case Type::clock_follow_up: return streams::exchanges;
        default: return streams::other;
    }
}

std::vector<Field> fields_of(Part part, const Packet& packet) {
    const Type type = packet.type;
    const bool is_exposure = type == Type::exposure;
    switch (part) {
        case Part::instants: return instants(type);
        case Part::start:
            if (is_exposure) return {exposure::start};
            break;
        case Part::end:
            if (is_exposure) return {exposure::end};
            break;
        case Part::edges:
            if (is_exposure) return {exposure::start, exposure::end};
            break;
        case Part::trigger:
            if (is_exposure) return {exposure::trigger};
            break;
        case Part::age:
            if (type == Type::imu_sample) return {imu_sample::age};
            break;
        case Part::departure:
            if (type == Type::imu_sample) return {imu_sample::time};
            break;
        case Part::label:
            if (type == Type::event && get(packet, event_kind) == pulse_named)
                return {event::value};
            break;
    }
    return {};
}

std::vector<SteadyLie> make_list() {
    using namespace streams;
    struct Named {
        std::string_view name;
        unsigned streams;
    };
    constexpr Named cam{"cam", cam0};
    constexpr Named cams{"cams", cameras};
    constexpr Named sensor{"imu", imu};
    constexpr Named answers{"exchanges", exchanges};
    constexpr Named singles[] = {cam, cams, sensor, answers};
    constexpr Named shared[] = {{"cam0+cam1", cam0 | cam1},
                                {"cam0+imu", cam0 | imu},
                                {"no-exchanges", all & ~exchanges},
                                {"all", all}};
    constexpr std::int64_t ms = 1'000'000;
    constexpr std::int64_t us = 1'000;

    std::vector<SteadyLie> list;
    const auto in_ms = [](std::int64_t ns) {
        return fmt::format("{:+g}ms", static_cast<double>(ns) * 1e-6);
    };
    const auto offset = [&](Named who, std::int64_t ns, Duration lasts, std::string_view mark = "",
                            Setting setting = Setting::running, Part part = Part::instants) {
        SteadyLie lie{fmt::format("offset:{}{}:{}:{:g}s", who.name, mark, in_ms(ns),
                                  static_cast<double>(lasts.ns) * 1e-9),
                      who.streams, part, ns};
        lie.lasts = lasts;
        lie.setting = setting;
        lie.lengthy = lasts >= seconds(60);
        list.push_back(lie);
    };
    const auto whole_period = [&](Named who, int periods) {
        SteadyLie lie{fmt::format("offset:{}:{:+}period:5s", who.name, periods), who.streams};
        lie.periods = periods;
        lie.lasts = seconds(5);
        list.push_back(lie);
    };
    const auto drift = [&](Named who, std::int64_t ns_per_s, Duration lasts) {
        SteadyLie lie{fmt::format("drift:{}:{:+}us/s:{}s", who.name, ns_per_s / 1000,
                                  lasts.ns / 1'000'000'000),
                      who.streams};
        lie.per_second = ns_per_s;
        lie.lasts = lasts;
        lie.lengthy = lasts >= seconds(60);
        list.push_back(lie);
    };

    for (const Named& who : singles) {
        for (const std::int64_t ns : {ms / 5, -ms / 5, ms, -ms, 5 * ms, -5 * ms, 50 * ms, -50 * ms})
            offset(who, ns, seconds(5));
        for (const std::int64_t ns : {ms, -50 * ms}) offset(who, ns, milliseconds(200));
        for (const std::int64_t ns : {-ms / 5, 5 * ms}) offset(who, ns, seconds(1));
        for (const std::int64_t ns : {ms / 5, -ms / 5, ms, -ms, 5 * ms, -5 * ms})
            offset(who, ns, seconds(60));
        whole_period(who, 1);
        whole_period(who, -1);
        drift(who, 300 * us, seconds(10));
        drift(who, -100 * us, seconds(10));
        drift(who, 30 * us, seconds(12));
        drift(who, -10 * us, seconds(25));
        drift(who, us, seconds(240));
    }
    drift(answers, 1000 * us, seconds(10));

    for (const Named& who : shared) {
        for (const std::int64_t ns : {-ms / 5, ms, -5 * ms, 50 * ms}) offset(who, ns, seconds(5));
        whole_period(who, 1);
        drift(who, 100 * us, seconds(10));
    }

    for (const std::int64_t ns : {ms * 3 / 10, ms})
        for (const Part part : {Part::start, Part::end, Part::edges}) {
            const std::string_view mark = part == Part::start ? "-start"
                                          : part == Part::end ? "-end"
                                                              : "-edges";
            offset(cam, ns, seconds(5), mark, Setting::running, part);
            offset(cams, -ns, seconds(5), mark, Setting::running, part);
        }

    offset(sensor, ms, seconds(5), "-age", Setting::running, Part::age);
    offset(sensor, -ms, seconds(5), "-departure", Setting::running, Part::departure);

    for (const Named& who : singles)
        for (const unsigned every : {2U, 3U, 7U})
            for (const std::int64_t ns : {ms * 3 / 10, ms}) {
                SteadyLie lie{fmt::format("every{}:{}:{}", every, who.name, in_ms(ns)), who.streams,
                              Part::instants, ns};
                lie.every = every;
                lie.lasts = seconds(4);
                list.push_back(lie);
            }

    for (const Named& who : {cam, cams})
        for (const int step : {1, -1}) {
            SteadyLie lie{fmt::format("trigger:{}:{:+}", who.name, step), who.streams,
                          Part::trigger, step};
            lie.lasts = seconds(5);
            list.push_back(lie);
        }

    constexpr Named starting[] = {cam, cams, sensor, answers, shared[0], shared[1], shared[2]};
    for (const Named& who : starting)
        for (const std::int64_t ns : {ms, -ms / 5, -5 * ms})
            offset(who, ns, seconds(6), "-from-start", Setting::from_start);

    for (const Setting setting : {Setting::nmea, Setting::nmea_from_start})
        for (const int step : {1, -1, 2, -2}) {
            SteadyLie lie{
                fmt::format("label{}:{:+}s", from_start(setting) ? "-from-start" : "", step), other,
                Part::label, step};
            lie.lasts = seconds(from_start(setting) ? 12 : 6);
            lie.setting = setting;
            list.push_back(lie);
        }
    for (SteadyLie& lie : list) {
        lie.gate = !is_one_of(known_failures, lie.name);
        lie.brief = is_one_of(brief_kinds, lie.name);
    }
    return list;
}

}  // namespace

const std::vector<SteadyLie>& steady_lies() {
    static const std::vector<SteadyLie> list = make_list();
    return list;
}

bool steps_clock(const SteadyLie& lie) { return lie.streams == streams::all; }

bool SteadyLiar::alter(Packet& packet, HostTime now) {
    if ((stream_of(packet) & lie_->streams) == 0) return false;
    if (packet.type == Type::clock_follow_up && lie_->part == Part::instants) {
        const auto answer =
            answers_.find(static_cast<std::uint32_t>(get(packet, clock_follow_up::id)));
        if (answer == answers_.end()) return false;
        shift_fields({clock_follow_up::sent}, answer->second, packet);
        answers_.erase(answer);
        return true;
    }
    const std::vector<Field> fields = fields_of(lie_->part, packet);
    if (fields.empty()) return false;
    const std::int64_t of =
        packet.type == Type::exposure ? get(packet, exposure::camera) : std::int64_t{0};
    if (++seen_[{packet.type, of}] % lie_->every != 0) return false;
    const std::int64_t by = amount(now);
    if (packet.type == Type::clock_answer)
        answers_[static_cast<std::uint32_t>(get(packet, clock_answer::id))] = by;
    if (lie_->part == Part::departure)
        set(packet, imu_sample::age, get(packet, imu_sample::age) - by);
    return shift_fields(fields, by, packet);
}

std::int64_t SteadyLiar::amount(HostTime now) {
    if (!begin_) begin_ = now;
    const double grown =
        static_cast<double>(lie_->per_second) * static_cast<double>((now - *begin_).ns) * 1e-9;
    return lie_->amount + lie_->periods * period_.ns + static_cast<std::int64_t>(grown);
}

bool shift_fields(const std::vector<Field>& fields, std::int64_t by, Packet& packet) {
    bool shifted = false;
    for (const Field& field : fields) {
        const std::int64_t value = get(packet, field);
        if (value == unobserved) continue;
        set(packet, field,
            static_cast<std::int64_t>(static_cast<std::uint64_t>(value) +
                                      static_cast<std::uint64_t>(by)));
        shifted = true;
    }
    return shifted;
}

}  // namespace versavis::liar

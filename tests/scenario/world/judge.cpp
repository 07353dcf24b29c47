// SPDX-License-Identifier: BSD-3-Clause
// World::judge(): what was reported against what happened.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "engine/imu/imu_model.hpp"
#include "wire/imu_scale.hpp"
#include "world.hpp"

namespace versavis::scenario {

namespace {

constexpr std::size_t longest_report = 2000;
constexpr double radians = 3.14159265358979 / 180;
constexpr double gravity = 9.80665;
constexpr Nanoseconds longest_reading = 20'000;           ///< of registers that change in between
constexpr Duration filter_tolerance = microseconds(150);  ///< data sheets round delays

template <class... Args>
void complain(std::string& out, fmt::format_string<Args...> text, Args&&... args) {
    if (out.size() < longest_report) out += fmt::format(text, std::forward<Args>(args)...) + "\n";
}

bool has(const wire::Exposure& record, wire::ExposureFlag flag) {
    return (record.flags & flag) != 0;
}

/// Neither one, nor the other, nor between them.
bool beyond(double value, double one, double other, double tolerance) {
    return value < std::min(one, other) - tolerance || value > std::max(one, other) + tolerance;
}

}  // namespace

std::string World::judge() {
    std::string out;
    for (const auto& [output, model] : cameras_) judge_camera(output, out);
    judge_imu(0, out);
    judge_imu(1, out);
    judge_pulses(out);
    judge_light(out);
    if (inbox().lost != 0) complain(out, "{} packets are missing, by their numbers", inbox().lost);
    if (spi_imu_ && spi_imu_->breaches() != 0)
        complain(out, "{} violations of the IMU's data sheet", spi_imu_->breaches());
    if (board_->watchdog_bit()) complain(out, "the watchdog bit");
    return out;
}

void World::judge_camera(unsigned camera, std::string& out) {
    const std::vector<TruePulse>& pulses = cameras_.at(camera)->pulses();
    const std::vector<wire::Exposure>& records = inbox().exposures[camera];
    std::uint64_t last = 0;
    for (const wire::Exposure& record : records) {
        if (record.trigger <= last)
            complain(out, "camera {}: trigger {} after {}", camera, record.trigger, last);
        if (record.trigger != last + 1 && !drops_allowed)
            complain(out, "camera {}: trigger {} comes after {}", camera, record.trigger, last);
        last = record.trigger;
        if (record.trigger == 0 || record.trigger > pulses.size())
            complain(out, "camera {}: there was no pulse {}", camera, record.trigger);
        else
            judge_record(record, pulses[record.trigger - 1], out);
    }
    if (last != pulses.size() && !drops_allowed)
        complain(out, "camera {}: {} pulses, but the last record is {}", camera, pulses.size(),
                 last);
    const wire::CameraConfiguration& settings = configuration.cameras[camera];
    for (std::size_t i = 0; i < pulses.size() && (settings.flags & wire::camera_slave) == 0; ++i)
        if (pulses[i].width < settings.pulse_ns || pulses[i].pause < 10 * us)
            complain(out, "camera {}: pulse {} is {} ns wide, {} ns after the one before", camera,
                     i + 1, pulses[i].width, pulses[i].pause);
    for (std::size_t i = 0; i < pulses.size() && !busy_allowed; ++i)
        if (pulses[i].into_busy)
            complain(out, "camera {}: pulse {} was sent into a busy camera", camera, i + 1);
    judge_ticks(camera, out);
}

void World::judge_record(const wire::Exposure& record, const TruePulse& pulse,
                         std::string& out) const {
    const wire::CameraConfiguration& camera = configuration.cameras[record.camera];
    const bool slave = (camera.flags & wire::camera_slave) != 0;
    const bool strobe = (camera.flags & wire::camera_no_strobe) == 0;
    const auto wrong = [&](const char* what) {
        complain(
            out,
            "camera {} trigger {}: {} (flags {:#x}, trigger {}, start {}, end {}; true {}, {}, {})",
            record.camera, record.trigger, what, record.flags, record.trigger_ns, record.start_ns,
            record.end_ns, pulse.at, pulse.start, pulse.end);
    };
    const Nanoseconds off = std::abs(record.trigger_ns - pulse.at);
    if (off > (slave ? firmware::routing_latency_limit : 0)) wrong("trigger time");
    if (!strobe && slave) {
        if (!has(record, wire::exposure_from_master)) wrong("not said to be the master's");
        return;
    }
    if (!strobe) {
        if (!has(record, wire::exposure_predicted) || has(record, wire::exposure_measured))
            wrong("not predicted");
        return;
    }
    const bool overlong = pulse.taken && pulse.end - pulse.start > camera.max_exposure_ns;
    const bool sees_start = pulse.start_seen;
    const bool sees_end = pulse.end_seen && !overlong;
    if (has(record, wire::exposure_measured) != sees_end) wrong("measured or not");
    if (has(record, wire::exposure_no_start) == sees_start) wrong("start seen or not");
    if (sees_start && !is_stamp(record.start_ns, pulse.start)) wrong("start");
    if (!sees_start && record.start_ns != wire::no_time) wrong("start invented");
    if (sees_end && !is_stamp(record.end_ns, pulse.end)) wrong("end");
    if (!sees_end && record.end_ns != wire::no_time) wrong("end invented");
    if (overlong && !has(record, wire::exposure_overlong)) wrong("not overlong");
}

/// Each grid point from the first to the last has a record or an event.
void World::judge_ticks(unsigned camera, std::string& out) {
    if (drops_allowed || gaps_allowed ||
        (configuration.cameras[camera].flags & wire::camera_slave) != 0)
        return;
    std::multiset<std::uint64_t> ticks;
    for (const wire::Exposure& record : inbox().exposures[camera]) ticks.insert(record.tick);
    for (const wire::Event& event : inbox().events_of(wire::BoardEventKind::trigger_skipped))
        if (event.source == camera) ticks.insert(static_cast<std::uint64_t>(event.value));
    for (const wire::Event& event : inbox().events_of(wire::BoardEventKind::triggers_skipped))
        for (unsigned i = 0; i < event.detail && event.source == camera; ++i)
            ticks.insert(static_cast<std::uint64_t>(event.value) + i);
    std::uint64_t expected = ticks.empty() ? 0 : *ticks.begin();
    for (const std::uint64_t tick : ticks)
        if (tick != expected++)
            return complain(out, "camera {}: tick {} is not accounted for", camera, expected - 1);
}

void World::judge_imu(unsigned port, std::string& out) {
    const std::vector<wire::ImuSample>& samples = inbox().samples[port];
    if (samples.empty()) {
        if (configuration.imus[port].kind != wire::ImuKind::none)
            complain(out, "IMU {}: no samples", port);
        return;
    }
    const imu::ImuModel& model = *imu::find_model(samples[0].kind);
    const std::vector<Nanoseconds>& ready = ready_times_[port];
    const bool paced = (configuration.imus[port].options & wire::imu_data_ready) != 0;
    const auto index_of = [&](Nanoseconds stamp) {
        const auto found = std::find_if(
            std::lower_bound(ready.begin(), ready.end(), stamp - stamp_error_), ready.end(),
            [&](Nanoseconds at) { return stamped(at) >= stamp - stamp_error_; });
        return found != ready.end() && is_stamp(stamp, *found) ? found - ready.begin()
                                                               : std::ptrdiff_t{-1};
    };
    const wire::ImuConfiguration& asked = configuration.imus[port];
    const Duration filtered_for =
        imu::filter_delay(model, asked.filter, (paced ? 1 : 4) * asked.rate_millihertz * 1e-3, true)
            .delay;
    // The part shows the motion as late as its registers make it, which the board has written.
    const devices::SampleDelays late =
        port == 0 && spi_imu_ ? spi_imu_->delays() : devices::SampleDelays{};
    if (absolute(Duration{late.gyro} - filtered_for) > filter_tolerance)
        complain(out, "IMU {}: its filters delay by {}, not {}", port, late.gyro, filtered_for.ns);
    const double gyro_lsb = late.gyro == 0 ? 0.6 : 0.7;  // an average also flattens the motion
    std::ptrdiff_t last_index = -1;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const wire::ImuSample& sample = samples[i];
        const std::uint32_t step = i == 0 ? 1 : sample.number - samples[i - 1].number;
        if (step != 1 && (sample.flags & wire::imu_overrun) == 0 && !drops_allowed)
            complain(out, "IMU {}: {} numbers are missing before {}", port, step - 1,
                     sample.number);
        // The first sample of a VN-100 has nothing to check its edge against, and says so.
        if (port == 1 && (sample.flags & wire::imu_stamped) == 0) {
            last_index = -1;
            continue;
        }
        Nanoseconds taken = sample.time_ns;
        Nanoseconds newest = taken;
        if (paced) {
            const std::ptrdiff_t index = index_of(sample.time_ns);
            if (index < 0)
                complain(out, "IMU {} sample {}: stamped {} without an edge", port, sample.number,
                         taken);
            if ((sample.flags & wire::imu_stamped) == 0)
                complain(out, "IMU {} sample {}: not stamped by its edge", port, sample.number);
            const bool begins_anew = drops_allowed && (sample.flags & wire::imu_overrun) != 0;
            if (last_index >= 0 && index >= 0 && index - last_index != step && !begins_anew)
                complain(out, "IMU {} sample {}: {} edges after the one before", port,
                         sample.number, index - last_index);
            last_index = index;
        } else if (spi_imu_ && port == 0) {
            const devices::UpdateTimes times =
                imu_updates_.empty() ? spi_imu_->updates()
                                     : std::prev(imu_updates_.upper_bound(taken))->second;
            taken = times.time(times.index_at(sample.time_ns));
            // New data may come between the bytes that are read.
            newest = times.time(times.index_at(sample.time_ns + longest_reading));
        }
        if ((sample.flags & wire::imu_check_failed) != 0) continue;
        if ((sample.flags & wire::imu_accel_stamped) != 0) judge_accel_age(sample, out);
        const ImuMetadata si = imu::to_si(model, sample);
        const wire::ImuScale scale = wire::imu_scale(sample.kind);
        const Nanoseconds last = paced ? taken : newest;
        const devices::Inertial turned = motion(taken - late.gyro);
        const devices::Inertial felt = motion(taken - late.accel);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double rate = turned.gyro_deg_s[axis] * radians;
            const double acceleration = felt.accel_g[axis] * gravity;
            if (beyond(si.gyro[axis], rate, motion(last - late.gyro).gyro_deg_s[axis] * radians,
                       gyro_lsb * scale.gyro_rad_s + 1e-6))
                complain(out, "IMU {} sample {}: gyro {} is {}, not {}", port, sample.number, axis,
                         si.gyro[axis], rate);
            if (beyond(si.accel[axis], acceleration,
                       motion(last - late.accel).accel_g[axis] * gravity,
                       0.7 * scale.accel_m_s2 + 1e-5))
                complain(out, "IMU {} sample {}: accelerometer {} is {}, not {}", port,
                         sample.number, axis, si.accel[axis], acceleration);
        }
        if (std::abs(si.temperature - felt.temperature_c) > 0.6 * scale.temperature_c)
            complain(out, "IMU {} sample {}: temperature is {}", port, sample.number,
                     si.temperature);
    }
}

/// The accelerometer's values were read soon after the stamp; their age is in 32 ns.
void World::judge_accel_age(const wire::ImuSample& sample, std::string& out) const {
    const auto reads = spi_imu_->accel_reads();
    const auto read = std::lower_bound(reads.begin(), reads.end(),
                                       std::pair(sample.time_ns - stamp_error_, INT64_MIN));
    if (read == reads.end()) return complain(out, "sample {} was not read", sample.number);
    const Nanoseconds age = sample.time_ns - stamped(read->second);
    if (!accel_ready_wired_ ||
        std::abs(age - Nanoseconds{sample.accel_age} * 32) >= 32 + 2 * stamp_error_)
        complain(out, "sample {}: its accelerometer's values are {} ns old, not {}", sample.number,
                 age, sample.accel_age * 32);
}

void World::judge_pulses(std::string& out) {
    for (const PulseSource& source : pulses_) {
        const unsigned input = source.input - firmware::input_pulse;
        const auto kind = input == wire::pulse_pps    ? wire::BoardEventKind::pps
                          : input == wire::pulse_sync ? wire::BoardEventKind::sync_pulse
                                                      : wire::BoardEventKind::aux_pulse;
        std::vector<wire::Event> events = inbox().events_of(kind);
        std::erase_if(events, [&](const wire::Event& event) {
            return kind == wire::BoardEventKind::aux_pulse &&
                   event.source != input - wire::pulse_aux0;
        });
        for (std::size_t i = 1; i < events.size(); ++i)
            if (events[i].value != events[i - 1].value + 1 && !drops_allowed)
                complain(out, "input {}: pulse {} after {}", input, events[i].value,
                         events[i - 1].value);
        std::set<Nanoseconds> edges;
        for (const Nanoseconds at : source.fired) edges.insert(stamped(at));
        for (const wire::Event& event : events) {
            const auto edge = edges.lower_bound(event.time_ns - stamp_error_);
            if (edge == edges.end() || *edge > event.time_ns + stamp_error_)
                complain(out, "input {}: no edge at {}", input, event.time_ns);
            else
                edges.erase(edge);
        }
        if (!drops_allowed && events.size() + 3 < source.fired.size())
            complain(out, "input {}: {} events of {} pulses", input, events.size(),
                     source.fired.size());
    }
}

void World::judge_light(std::string& out) {
    const wire::IlluminationConfiguration& light = configuration.illumination;
    if (light.cameras == 0) return;
    double saved = light.max_on_ns;  // what may still be spent, as on-time
    Nanoseconds before = 0;
    for (const Interval& interval : lights_) {
        const double duty = static_cast<double>(light.duty_ppm) * 1e-6;
        const Nanoseconds on = interval.off - interval.on;
        if (interval.off == firmware::never) {
            complain(out, "the light was left on at {}", interval.on);
            break;
        }
        if (on > light.max_on_ns)
            complain(out, "the light was on for {} ns at {}", on, interval.on);
        saved = std::min<double>(light.max_on_ns,
                                 saved + static_cast<double>(interval.on - before) * duty);
        saved += static_cast<double>(on) * (duty - 1);
        before = interval.off;
        // Hanging code can cost one light of the longest duration, which is made up for later.
        if (saved < -1000 - (drops_allowed ? light.max_on_ns : 0.0))
            complain(out, "the light was on for too much of the time at {}", interval.on);
    }
    if (!inbox().events_of(wire::BoardEventKind::illumination_limited).empty()) return;
    for (const auto& [output, model] : cameras_) {
        if ((light.cameras >> output & 1U) == 0) continue;
        for (const TruePulse& pulse : model->pulses()) {
            if (!pulse.taken || pulse.end == 0 || pulse.fault == Fault::no_strobe) continue;
            const bool lit = std::any_of(
                lights_.begin(), lights_.end(), [&, &model = model](const Interval& interval) {
                    const Nanoseconds latest =
                        pulse.start - light.lead_ns + model->settings().jitter + rounding();
                    return interval.on <= latest && interval.off >= pulse.end - rounding();
                });
            if (!lit)
                complain(out, "camera {}: the exposure at {} was not lit throughout", output,
                         pulse.start);
        }
    }
}

}  // namespace versavis::scenario

// SPDX-License-Identifier: BSD-3-Clause
#include "rig_u3v_camera.hpp"

namespace versavis::test {

std::optional<rig::LineActive> RigU3vCamera::trigger_line(bool level,
                                                          const rig::TriggerPulse& pulse) {
    if (!level) return std::nullopt;
    std::optional<rig::LineActive> line;
    if (camera_->listens(level)) line = expose(pulse);
    truth_.add(rig::TrueTrigger{settings_.name, pulse.board_life, pulse.trigger, pulse.at,
                                line.has_value()});
    return line;
}

std::optional<rig::LineActive> RigU3vCamera::expose(const rig::TriggerPulse& pulse) {
    if (pulse.at < busy_until_) return std::nullopt;
    rig::TrueExposure exposure;
    exposure.camera = settings_.name;
    exposure.board_life = pulse.board_life;
    exposure.trigger = pulse.trigger;
    exposure.serial = exposures_ + 1;
    exposure.start = pulse.at + Duration{std::llround(settings_.trigger_latency_us * 1e3)};
    exposure.end =
        exposure.start + Duration{std::llround(static_cast<double>(camera_->exposure_us()) * 1e3)};
    U3vCamera::Shot shot;
    shot.timestamp_ns = static_cast<std::uint64_t>(
        clock_.device_ns(rig::stamped(settings_, exposure.start, exposure.end)));
    const HostTime due = exposure.end + Duration{std::llround(settings_.readout_us * 1e3)};
    shot.until_sent = std::chrono::nanoseconds{(due - host_now()).ns};
    shot.pixels = wall_.view(motion_.roll_rad(middle(exposure.start, exposure.end)));
    const rig::FrameMark mark{rig::FrameMark::expected_magic, exposure.serial};
    shot.mark.resize(sizeof mark);
    std::memcpy(shot.mark.data(), &mark, sizeof mark);
    shot.done = [this, exposure](bool sent) mutable {
        exposure.sent = sent;
        truth_.add(exposure);
    };
    const auto block_id = camera_->shoot(std::move(shot));
    if (!block_id) return std::nullopt;
    ++exposures_;
    busy_until_ = exposure.end;
    return rig::LineActive{exposure.start, exposure.end};
}

}  // namespace versavis::test

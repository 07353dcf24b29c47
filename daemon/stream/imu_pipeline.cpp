// SPDX-License-Identifier: BSD-3-Clause
#include "stream/imu_pipeline.hpp"

namespace versavis::daemon {

namespace {

/// The board tries a failed part once a second: so many equal failures make one more line. At half,
/// a log has 12 lines an hour of it; at twice, 3.
constexpr std::uint64_t failures_per_line = 600;

/// A failure that did not come for so long is a new one. At half, a part that fails twice a minute
/// fills the log; at twice, one that fails every two minutes does not show there.
constexpr Duration forgotten_after = seconds(60);

}  // namespace

ImuPipeline::ImuPipeline(const ImuConfiguration& configuration, ring::Writer ring,
                         clock::Translator& translator)
    : model_(*configuration.model),
      port_(configuration.port()),
      ring_(std::move(ring)),
      translator_(translator) {
    report_.name = configuration.name;
    report_.model = model_.name;
    report_.rate_hz = configuration.rate_hz;
}

void ImuPipeline::board_restarted() {
    const std::lock_guard lock(mutex_);
    last_number_.reset();
}

bool ImuPipeline::tell(const wire::Event& event, HostTime now) {
    const std::lock_guard lock(mutex_);
    ImuFailure& last = report_.failure;
    report_.working = event.kind == wire::EventKind::imu_ready;
    if (report_.working) return last.times <= 1;
    const bool again = last.kind == event.kind && last.step == event.detail &&
                       last.answer == event.value && now - last.last < forgotten_after;
    last = {event.kind, event.detail, event.value, again ? last.times + 1 : 1, now};
    return last.times % failures_per_line == 1;
}

void ImuPipeline::add(const wire::ImuSample& sample) {
    const std::lock_guard lock(mutex_);
    // 32 bits on the wire are extended by the number before.
    const std::uint64_t number =
        last_number_ ? *last_number_ + (sample.number - static_cast<std::uint32_t>(*last_number_))
                     : sample.number;
    if (last_number_ && number > *last_number_) report_.lost += number - *last_number_ - 1;
    last_number_ = number;
    const auto stamp = translator_.translate(BoardTime{sample.time_ns});
    if (!stamp) {
        ++report_.no_clock;
        return;
    }
    ImuMetadata metadata = imu::to_si(model_, sample);
    metadata.board_time = {sample.time_ns};
    metadata.host_time = stamp->host;
    metadata.number = number;
    metadata.sigma_ns = stamp->sigma_ns;
    metadata.epoch = stamp->epoch;
    if ((metadata.flags & flag_sensor_error) != 0)
        ++report_.faulty;
    else
        report_.last_sample = stamp->host;
    ring_.publish(guard_.guard(*stamp, metadata.flags), pack(metadata));
    ++report_.published;
}

void ImuPipeline::heartbeat(HostTime now) {
    const std::lock_guard lock(mutex_);
    ring_.heartbeat(now);
}

ImuReport ImuPipeline::report() {
    const std::lock_guard lock(mutex_);
    return report_;
}

}  // namespace versavis::daemon

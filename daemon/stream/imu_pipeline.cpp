// SPDX-License-Identifier: BSD-3-Clause
#include "stream/imu_pipeline.hpp"

#include "stream/total_sigma.hpp"

namespace versavis::daemon {

ImuPipeline::ImuPipeline(const ImuConfiguration& configuration, ring::Writer ring,
                         clock::Translator& translator)
    : model_(*configuration.model),
      port_(configuration.port()),
      filter_(configuration.filter_delay()),
      ring_(std::move(ring)),
      translator_(translator) {
    report_.name = configuration.name;
    report_.model = model_.name;
    report_.filter = filter_;
}

void ImuPipeline::board_restarted() {
    const std::lock_guard lock(mutex_);
    last_number_.reset();
}

void ImuPipeline::add(const wire::ImuSample& sample) {
    const std::lock_guard lock(mutex_);
    // 32 bits on the wire are extended by the number before.
    const std::uint64_t number =
        last_number_ ? *last_number_ + (sample.number - static_cast<std::uint32_t>(*last_number_))
                     : sample.number;
    if (last_number_ && number > *last_number_) report_.lost += number - *last_number_ - 1;
    last_number_ = number;
    const auto stamp = translator_.translate(BoardTime{sample.time_ns} - filter_.delay);
    if (!stamp) {
        ++report_.no_clock;
        return;
    }
    ImuMetadata metadata = imu::to_si(model_, sample);
    metadata.board_time = {sample.time_ns};
    metadata.host_time = stamp->host;
    metadata.number = number;
    metadata.sigma_ns = total_sigma_ns(stamp->sigma_ns, filter_.sigma);
    metadata.filter_delay = filter_.delay;
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

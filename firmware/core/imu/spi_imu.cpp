// SPDX-License-Identifier: BSD-3-Clause
#include "imu/spi_imu.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds set_ahead = 500'000;          // of 1 ms at the highest rate on a grid
constexpr Nanoseconds transfer_limit = 10'000'000;  // none takes this long unless the bus hangs
constexpr Nanoseconds power_up_time = 300'000'000;  // of the slowest part
constexpr unsigned max_fast_edges = 20;
constexpr Nanoseconds silence_floor = 100'000'000;
constexpr std::uint16_t while_running = 0xFFFF;

Nanoseconds max(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }

/// When read on a grid, the part must be much faster than the grid, so that its newest sample is
/// never old.
std::uint32_t part_rate(const ImuPart& part, const wire::ImuConfiguration& configuration) {
    const std::uint32_t wanted = configuration.rate_millihertz;
    return part.rate((configuration.options & wire::imu_data_ready) != 0 ? wanted : 4 * wanted);
}

}  // namespace

std::uint32_t SpiImu::true_rate(const wire::ImuConfiguration& configuration) {
    const ImuPart* part = find_part(configuration.kind);
    const bool paced_by_part = (configuration.options & wire::imu_data_ready) != 0;
    return part != nullptr && paced_by_part ? part_rate(*part, configuration)
                                            : configuration.rate_millihertz;
}

void SpiImu::configure(const wire::ImuConfiguration& configuration, Nanoseconds now) {
    bus_.abort();
    pending_ = false;
    configuration_ = configuration;
    part_ = find_part(configuration.kind);
    state_ = State::off;
    if (part_ == nullptr) return;
    if (!paced_by_part()) grid_ = Grid(now + set_ahead, configuration.rate_millihertz * 1000);
    patience_ = silence_floor + 20'000'000'000'000 / configuration.rate_millihertz;  // 20 samples
    setup_ = {};
    const std::uint32_t rate = part_rate(*part_, configuration);
    part_->setup(rate, configuration.filter, setup_);
    period_ = 1'000'000'000'000 / rate;
    begin_setup(max(now, power_up_time));
}

void SpiImu::begin_setup(Nanoseconds at) {
    state_ = State::set_up;
    step_ = 0;
    resume_ = at;
}

bool SpiImu::start(Nanoseconds at, Nanoseconds now) {
    at = max(at, completed_ + part_->pause());
    pending_ = bus_.start(at, transfer_);
    pending_until_ = max(at, now) + transfer_limit;
    return pending_;
}

void SpiImu::next_step(Nanoseconds now) {
    if (step_ == setup_.size()) return run(now);
    transfer_ = {};
    part_->access(setup_[step_], transfer_);
    if (!start(now, now))
        fail(wire::EventKind::imu_silent, now, 0, static_cast<std::uint16_t>(step_));
}

void SpiImu::check_step(const ImuReply& reply, Nanoseconds now) {
    const SetupStep& step = setup_[step_];
    if (step.action == SetupStep::Action::expect) {
        const std::uint16_t answer = part_->answer(transfer_, reply);
        if (answer != step.value)
            return fail(wire::EventKind::imu_failed, now, answer,
                        static_cast<std::uint16_t>(step_));
    }
    ++step_;
    resume_ = now + static_cast<Nanoseconds>(step.pause_us) * 1000;
}

void SpiImu::run(Nanoseconds now) {
    state_ = State::running;
    reading_ = 0;
    if (!paced_by_part()) {
        grid_.skip_before(now + set_ahead);
        while (grid_.next() < now + set_ahead) grid_.advance();
    }
    expect_edge(now);
    served_ = edge_count_;
    fast_edges_ = 0;
    report_event(wire::EventKind::imu_ready, now, part_->identity());
}

void SpiImu::fail(wire::EventKind kind, Nanoseconds now, std::int64_t value, std::uint16_t detail) {
    bus_.abort();
    pending_ = false;
    report_failure(kind, now, value, detail);
    begin_setup(now + retry_interval);
}

void SpiImu::start_reading(Nanoseconds at, Nanoseconds now) {
    transfer_ = {};
    part_->reading(reading_, transfer_);
    edges_[reading_] = {newest_edge_, edge_count_, {}, 0};
    if (!start(at, now)) {
        reading_ = 0;
        miss();
    }
}

void SpiImu::ready_edge(Nanoseconds at, Nanoseconds now) {
    if (state_ != State::running || !paced_by_part()) return;
    expect_edge(now);
    fast_edges_ = at - newest_edge_ < period_ * 3 / 4 ? fast_edges_ + 1 : 0;
    newest_edge_ = at;
    ++edge_count_;
    for (Edges& edges : edges_)
        if (edges.later_count < sizeof edges.later / sizeof *edges.later)
            edges.later[edges.later_count++] = at;
}

/// The data is that of the newest edge before the reading; samples of earlier edges were never
/// read.
Nanoseconds SpiImu::stamp(unsigned reading) {
    const Edges& edges = edges_[reading];
    Nanoseconds stamp = edges.newest;
    std::uint32_t edge = edges.count;
    for (std::size_t i = 0; i < edges.later_count && edges.later[i] <= replies_[reading].started;
         ++i) {
        stamp = edges.later[i];
        ++edge;
    }
    miss(edge - served_ - 1);
    served_ = edge;
    return stamp;
}

bool SpiImu::take(const ImuReply& reply, Nanoseconds now, wire::ImuSample& sample) {
    replies_[reading_++] = reply;
    if (reading_ < part_->readings()) {
        start_reading(now, now);
        return false;
    }
    sample = {};
    if (part_->parse(replies_, reading_, sample) == Verdict::unsure) {
        start_reading(now, now);
        return false;
    }
    // Of the readings that were compared, the first: an update may precede it.
    const unsigned read = reading_ - part_->readings();
    reading_ = 0;
    sample.kind = part_->kind();
    sample.time_ns = paced_by_part() ? stamp(read) : replies_[read].started;
    if (paced_by_part()) sample.flags |= wire::imu_stamped;
    if (!finish(sample)) fail(wire::EventKind::imu_failed, now, 0, while_running);
    return true;
}

/// Sets the reading for the next grid point when it is time.
void SpiImu::pace(Nanoseconds now) {
    while (grid_.next() - set_ahead <= now) {
        if (pending_ || grid_.next() < now)
            miss();
        else
            start_reading(grid_.next(), now);
        grid_.advance();
    }
}

bool SpiImu::poll(Nanoseconds now, wire::ImuSample& sample) {
    bool taken = false;
    ImuReply reply;
    if (pending_ && bus_.complete(reply)) {
        pending_ = false;
        completed_ = now;
        if (state_ == State::set_up) check_step(reply, now);
        if (state_ == State::running) taken = take(reply, now, sample);
    }
    if (pending_ && now >= pending_until_) fail(wire::EventKind::imu_silent, now, 0, while_running);
    if (state_ == State::set_up && !pending_ && now >= resume_) next_step(now);
    if (state_ == State::running && paced_by_part() && now >= silent_at_)
        fail(wire::EventKind::imu_silent, now, 0, while_running);
    // A part that has reset itself continues at another rate.
    if (state_ == State::running && fast_edges_ >= max_fast_edges)
        fail(wire::EventKind::imu_failed, now, 0, while_running);
    if (state_ == State::running && !paced_by_part()) pace(now);
    if (state_ == State::running && paced_by_part() && !pending_ && served_ != edge_count_)
        start_reading(now, now);
    return taken;
}

Nanoseconds SpiImu::next_wake() const {
    const Nanoseconds limit = pending_ ? pending_until_ : never;
    Nanoseconds wake = never;
    if (state_ == State::set_up && !pending_) wake = resume_;
    if (state_ == State::running) wake = paced_by_part() ? silent_at_ : grid_.next() - set_ahead;
    return wake < limit ? wake : limit;
}

}  // namespace versavis::firmware

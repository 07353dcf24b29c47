// SPDX-License-Identifier: BSD-3-Clause
#include "imu/spi_imu.hpp"

namespace versavis::firmware {

namespace {

constexpr Nanoseconds mhz_ns = 1'000'000'000'000;

/// A reading on a grid is armed this long ahead, of 1 ms at the highest rate. If lower, a slow poll
/// misses it; if higher, the highest rate leaves no time between two readings.
constexpr Nanoseconds set_ahead = 500'000;

/// No transfer takes this long unless the bus hangs. If lower, a slow poll restarts a part on I2C;
/// if higher, a bus that hangs is noticed later.
constexpr Nanoseconds transfer_limit = 25'000'000;

/// Of the slowest part. If lower, it does not answer yet; if higher, sampling begins later.
constexpr Nanoseconds power_up_time = 300'000'000;

/// If lower, jitter of a part restarts it; if higher, samples of a part that reset itself are
/// published for longer.
constexpr unsigned max_fast_edges = 20;

/// Added to twenty periods. If lower, a slow poll restarts fast parts; if higher, silence is
/// reported late.
constexpr Nanoseconds silence_floor = 100'000'000;

/// Around the bytes of the accelerometer: how far a port's clock pauses between bytes. If lower,
/// such a port may name the wrong edge; if higher, more samples do not know which it was.
constexpr Nanoseconds accel_margin = 2'000;

/// Clocks of accelerometers are exact to a sixteenth. If lower, a coarse clock goes unstamped; if
/// higher, a clock that jumps is accepted.
constexpr Nanoseconds accel_tolerance = 16;
constexpr Nanoseconds accel_age_step = 32;

constexpr std::uint16_t while_running = 0xFFFF;

/// The fastest that parts on I2C share with cables of a few decimetres. If lower, 1 kHz does not
/// fit; if higher, most pull-ups are too weak.
constexpr std::uint32_t i2c_clock_hz = 400'000;
constexpr std::uint8_t i2c_address = 0x68;  ///< the second is the next one
constexpr std::uint8_t reads = 0x80;        ///< of a register's address on the SPI bus

Nanoseconds max(Nanoseconds a, Nanoseconds b) { return a > b ? a : b; }

/// When read on a grid, the part must be much faster than the grid, so that its newest sample is
/// never old.
std::uint32_t part_rate(const ImuPart& part, const wire::ImuConfiguration& configuration) {
    const std::uint32_t wanted = configuration.rate_millihertz;
    return part.rate((configuration.options & wire::imu_data_ready) != 0 ? wanted : 4 * wanted);
}

}  // namespace

SpiImu::SpiImu(std::uint8_t port, ImuBus& bus, ChannelReports& reports)
    : ImuPort(port, reports), bus_(bus) {}

std::uint32_t SpiImu::true_rate(const wire::ImuConfiguration& configuration) {
    const ImuPart* part = find_part(configuration.kind);
    const bool paced_by_part = (configuration.options & wire::imu_data_ready) != 0;
    return part != nullptr && paced_by_part ? part_rate(*part, configuration)
                                            : configuration.rate_millihertz;
}

void SpiImu::configure(const wire::ImuConfiguration& configuration, Nanoseconds now) {
    bus_.disarm();
    job_state_ = Job::none;
    configuration_ = configuration;
    part_ = find_part(configuration.kind);
    state_ = State::off;
    if (part_ == nullptr) return;
    if (!paced_by_part())
        grid_ = Grid(now + set_ahead, std::int64_t{configuration.rate_millihertz} * 1000);
    patience_ = silence_floor + 20 * mhz_ns / configuration.rate_millihertz;  // 20 samples
    setup_ = {};
    const std::uint32_t rate = part_rate(*part_, configuration);
    part_->setup({rate, configuration.filter, has(wire::imu_accel_ready)}, setup_);
    period_ = mhz_ns / rate;
    ready_edges_.configure(period_);
    accel_period_ = part_->accel_millihertz() == 0 ? 0 : mhz_ns / part_->accel_millihertz();
    accel_edges_.configure(accel_period_);
    begin_setup(max(now, power_up_time));
}

void SpiImu::begin_setup(Nanoseconds at) {
    state_ = State::set_up;
    step_ = 0;
    resume_ = at;
}

/// Parts with 8-bit registers differ between the buses in one bit of the address.
void SpiImu::adapt(ImuTransfer& transfer) const {
    if (!has(wire::imu_i2c)) return;
    const bool read = (transfer.bytes[0] & reads) != 0;
    transfer.bus = read ? ImuTransfer::Bus::i2c_read : ImuTransfer::Bus::i2c_write;
    transfer.chip = static_cast<std::uint8_t>(i2c_address + (has(wire::imu_i2c_second) ? 1 : 0));
    transfer.clock_hz = i2c_clock_hz;
    transfer.bytes[0] = static_cast<std::uint8_t>(transfer.bytes[0] & ~reads);
}

void SpiImu::arm() {
    job_.pause = part_->pause();
    job_until_ = job_.input == not_routed ? job_.after + transfer_limit : never;
    job_state_ = bus_.arm(job_) ? Job::armed : Job::none;
}

void SpiImu::next_step(Nanoseconds now) {
    if (step_ == setup_.size()) return run(now);
    job_.input = not_routed;
    job_.after = now;
    job_.count = 1;
    job_.transfers[0] = {};
    part_->access(setup_[step_], job_.transfers[0]);
    adapt(job_.transfers[0]);
    job_reads_ = false;
    readings_ = 0;
    arm();
    if (job_state_ == Job::none)
        fail(wire::BoardEventKind::imu_silent, now, 0, static_cast<std::uint16_t>(step_));
}

void SpiImu::check_step(Nanoseconds now) {
    const SetupStep& step = setup_[step_];
    const ImuReply& reply = replies_[0];
    const auto at = static_cast<std::uint16_t>(step_);
    if (reply.refused) return fail(wire::BoardEventKind::imu_silent, now, 0, at);
    if (step.action == SetupStep::Action::expect) {
        const std::uint16_t answer = part_->answer(job_.transfers[0], reply);
        if (answer != step.value) return fail(wire::BoardEventKind::imu_failed, now, answer, at);
    }
    ++step_;
    resume_ = now + static_cast<Nanoseconds>(step.pause_us) * 1000;
}

void SpiImu::run(Nanoseconds now) {
    state_ = State::running;
    readings_ = 0;
    if (!paced_by_part()) {
        grid_.skip_before(now + set_ahead);
        while (grid_.next() < now + set_ahead) grid_.advance();
    }
    expect_edge(now);
    began_ = now;
    served_ = ready_edges_.count();
    served_at_ = now;
    edges_lost_ = false;
    fast_edges_ = 0;
    report_event(wire::BoardEventKind::imu_ready, now, part_->identity());
}

void SpiImu::fail(wire::BoardEventKind kind, Nanoseconds now, std::int64_t value,
                  std::uint16_t detail) {
    bus_.disarm();
    job_state_ = Job::none;
    report_failure(kind, now, value, detail);
    begin_setup(now + retry_interval);
}

/// Arms the next `readings` of a sample.
void SpiImu::arm_reading(std::uint8_t input, Nanoseconds after, unsigned readings) {
    job_.input = input;
    job_.after = after;
    job_.count = static_cast<std::uint8_t>(readings);
    const bool begins = readings_ == 0;
    for (unsigned i = 0; i < readings && !(begins && job_reads_); ++i) {
        job_.transfers[i] = {};
        part_->reading(readings_ + i, job_.transfers[i]);
        adapt(job_.transfers[i]);
    }
    job_reads_ = begins;
    arm();
    if (job_state_ != Job::none) return;
    readings_ = 0;
    miss();
}

void SpiImu::ready_edge(Nanoseconds at, Nanoseconds now) {
    const Nanoseconds since = at - ready_edges_.newest();
    if (!ready_edges_.add(at)) return;
    expect_edge(now);
    fast_edges_ = since < period_ * 3 / 4 ? fast_edges_ + 1 : 0;
    if (job_state_ == Job::armed && job_until_ == never) job_until_ = now + transfer_limit;
}

void SpiImu::edges_lost() {
    ready_edges_.forget();
    accel_edges_.forget();
    edges_lost_ = true;
}

/// The data is that of the newest edge before the reading; samples of earlier edges were never
/// read. False: that edge is not known any more, or its sample was read already, or the part took
/// new data in the meantime.
bool SpiImu::stamp(const ImuReply& reply, Nanoseconds now, wire::ImuSample& sample) {
    std::uint32_t edge = 0;
    if (!ready_edges_.find(reply.started, sample.time_ns, edge)) return false;
    Nanoseconds next = 0;
    if (ready_edges_.next(edge, next) && next <= reply.ended)
        return drop(wire::BoardEventKind::imu_failed, now);
    if (static_cast<std::int32_t>(edge - served_) <= 0) return false;
    std::uint32_t due = edge - served_;
    if (edges_lost_) {
        // How many there were follows from the part's period.
        const Nanoseconds since = sample.time_ns - served_at_;
        const auto periods = static_cast<std::uint32_t>((since + period_ / 2) / period_);
        due = periods > due ? periods : due;
    }
    edges_lost_ = false;
    miss(due - 1);
    served_ = edge;
    served_at_ = sample.time_ns;
    sample.flags |= wire::imu_stamped;
    return true;
}

/// The values are those of the newest edge before they were read, if the edge before that shows
/// that no other one was due by then.
void SpiImu::stamp_accel(wire::ImuSample& sample) const {
    if (!has(wire::imu_accel_ready)) return;
    const AccelBytes bytes = part_->accel_bytes();
    const ImuReply& reply = replies_[bytes.reading];
    const std::uint32_t size = job_.transfers[bytes.reading].size;
    const auto length = static_cast<std::uint32_t>(reply.ended - reply.started);
    const Nanoseconds first = reply.started + length * bytes.first / size - accel_margin;
    const Nanoseconds end = reply.started + length * bytes.end / size + accel_margin;
    Nanoseconds taken = 0;
    Nanoseconds before = 0;
    Nanoseconds newer = 0;
    std::uint32_t edge = 0;
    if (!accel_edges_.find(first, taken, edge) ||
        (accel_edges_.next(edge, newer) && newer <= end) ||
        !accel_edges_.find(taken - 1, before, edge))
        return;
    const Nanoseconds period = taken - before;
    const Nanoseconds off = period - accel_period_;
    const Nanoseconds tolerance = accel_period_ / accel_tolerance;
    if (off > tolerance || -off > tolerance || end >= taken + period) return;
    const Nanoseconds age = (sample.time_ns - taken) / accel_age_step;
    const auto sent = static_cast<std::int16_t>(age);
    if (sent != age) return;
    sample.accel_age = sent;
    sample.flags |= wire::imu_accel_stamped;
}

void SpiImu::collect(Nanoseconds now) {
    if (job_state_ != Job::armed || !bus_.take_reply(replies_[readings_])) return;
    job_state_ = Job::collected;
    for (unsigned i = 1; i < job_.count; ++i) bus_.take_reply(replies_[readings_ + i]);
    readings_ += job_.count;
    if (state_ == State::set_up) {
        job_state_ = Job::none;
        check_step(now);
    }
}

bool SpiImu::refused() const {
    for (unsigned i = 0; i < readings_; ++i)
        if (replies_[i].refused) return true;
    return false;
}

/// A reading gives no sample; its number will be missing.
bool SpiImu::drop(wire::BoardEventKind kind, Nanoseconds now) {
    readings_ = 0;
    if (!count_error()) fail(kind, now, 0, while_running);
    return false;
}

bool SpiImu::take(Nanoseconds now, wire::ImuSample& sample) {
    job_state_ = Job::none;
    sample = {};
    if (refused()) return drop(wire::BoardEventKind::imu_silent, now);
    if (part_->parse(replies_, readings_, sample) == Verdict::unsure) {
        arm_reading(not_routed, now, 1);
        return false;
    }
    // Of the readings that were compared, the first: an update may precede it.
    const ImuReply& reply = replies_[readings_ - part_->readings()];
    readings_ = 0;
    sample.kind = part_->kind();
    sample.time_ns = reply.started;
    if (paced_by_part() && !stamp(reply, now, sample)) return false;
    stamp_accel(sample);
    if (!finish(sample)) fail(wire::BoardEventKind::imu_failed, now, 0, while_running);
    return true;
}

/// Sets the reading for the next grid point when it is time.
void SpiImu::pace(Nanoseconds now) {
    if (grid_.next() < now) {
        const std::int64_t passed = (now - grid_.next()) / grid_.period() + 1;
        miss(static_cast<std::uint32_t>(passed));
        grid_.advance_by(passed);
    }
    if (grid_.next() - set_ahead > now) return;
    if (job_state_ == Job::none)
        arm_reading(not_routed, grid_.next(), part_->readings());
    else
        miss();
    grid_.advance();
}

bool SpiImu::poll(Nanoseconds now, Nanoseconds settled, wire::ImuSample& sample) {
    bool taken = false;
    if (state_ == State::running && job_state_ == Job::collected &&
        (!paced_by_part() || replies_[readings_ - 1].started < settled))
        taken = take(now, sample);
    if (job_state_ == Job::armed && now >= job_until_)
        fail(wire::BoardEventKind::imu_silent, now, 0, while_running);
    if (state_ == State::set_up && job_state_ == Job::none && now >= resume_) next_step(now);
    if (state_ != State::running) return taken;
    if (!paced_by_part()) {
        pace(now);
    } else if (now >= silent_at_) {
        fail(wire::BoardEventKind::imu_silent, now, 0, while_running);
    } else if (fast_edges_ >= max_fast_edges) {
        // A part that has reset itself continues at another rate.
        fail(wire::BoardEventKind::imu_failed, now, 0, while_running);
    } else if (job_state_ == Job::none) {
        // Neither the newest edge nor its echoes, whether they have come or not, start a reading.
        arm_reading(input_imu_ready, max(began_, ready_edges_.quiet_until()), part_->readings());
    }
    return taken;
}

Nanoseconds SpiImu::next_wake(Nanoseconds lag) const {
    Nanoseconds wake = never;
    const auto sooner = [&wake](Nanoseconds at) { wake = at < wake ? at : wake; };
    if (job_state_ == Job::armed) sooner(job_until_);
    if (job_state_ == Job::collected) sooner(replies_[readings_ - 1].started + 1 + lag);
    if (state_ == State::set_up && job_state_ == Job::none) sooner(resume_);
    if (state_ == State::running) sooner(paced_by_part() ? silent_at_ : grid_.next() - set_ahead);
    return wake;
}

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
#include "world.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include "wire/messages.hpp"

namespace versavis::test {

namespace {

using pairing::Arrival;
using pairing::Exposure;
using pairing::Instant;
using pairing::Shortfall;
using pairing::Start;

constexpr HostTime begin{1'000'000'000};
constexpr Duration tick_of_service = milliseconds(50);
constexpr Duration command_delay = milliseconds(2);
constexpr Duration missing_packets_timeout = milliseconds(110);
constexpr Duration shortest_start_patience = milliseconds(2);  // of the firmware
constexpr Duration longest_start_patience = milliseconds(50);
constexpr double board_drift = 20e-6;
constexpr double camera_drift = 100e-6;
constexpr int frames_in_camera = 3;
constexpr std::uint64_t frames_of_grace = 5;
constexpr std::int64_t frames_of_pattern = 20;

class World final : private pairing::Outcome {
 public:
    explicit World(const WorldSettings& settings)
        : settings_(settings),
          period_{std::llround(1e9 / settings.rate_hz)},
          exposure_{settings.exposure.ns != 0 ? settings.exposure
                                              : std::min(milliseconds(2), period_ / 3)},
          random_(settings.seed),
          filter_(record_limits()),
          pairing_(limits(), *this),
          next_id_(settings.first_id) {
        for (const auto& [pulse, kind] : settings_.faults) {
            swapped_ = swapped_ || kind == FaultKind::cameras_swapped;
            stale_first_ = stale_first_ || kind == FaultKind::stale_frame;
        }
    }

    Verdict run() {
        now_ = begin;
        at(begin, [this] { tick(); });
        at(begin, [this] { serve(); });
        at(begin, [this] { start_anew(); });
        while (!events_.empty() && now_ < end_) {
            const Event event = events_.top();
            events_.pop();
            now_ = event.at;
            event.happen();
        }
        verdict_.final_state = pairing_.state();
        verdict_.stamped = pairing_.stamped();
        verdict_.unproved_at_end = last_arrival_ - last_published_;
        judge_withheld();
        return verdict_;
    }

 private:
    struct Event {
        HostTime at;
        std::uint64_t order;
        std::function<void()> happen;
        bool operator<(const Event& other) const {
            return other.at < at || (other.at == at && other.order < order);
        }
    };
    struct Truth {
        std::uint64_t life = 0;
        std::uint64_t trigger = 0;
        std::uint64_t pulse = 0;
        bool recorded = false;
        BoardTime stamped;
    };

    pairing::Limits limits() const {
        pairing::Limits limits;
        limits.period = period_;
        limits.camera_clock =
            settings_.clock != WorldClock::absent || !settings_.clock_known_absent;
        limits.stamped = settings_.told_stamped;
        limits.pattern_duration = period_ * (wire::start_pattern_length + 2);
        limits.frames_held = 6 + static_cast<std::uint32_t>(std::ceil(settings_.rate_hz * 0.12));
        return limits;
    }

    pairing::RecordLimits record_limits() const {
        pairing::RecordLimits limits;
        limits.period = period_;
        limits.exposure = exposure_;
        limits.max_exposure = period_;
        limits.wired = settings_.strobe;
        limits.fixed_grid = settings_.compensated;
        return limits;
    }

    void at(HostTime time, std::function<void()> happen) {
        events_.push({std::max(time, now_), ++order_, std::move(happen)});
    }
    double uniform(double from, double to) {
        return std::uniform_real_distribution<>(from, to)(random_);
    }
    bool chance(double probability) { return uniform(0, 1) < probability; }
    Duration between(Duration from, Duration to) {
        return {std::llround(uniform(static_cast<double>(from.ns), static_cast<double>(to.ns)))};
    }

    // --- the service
    void serve() {
        at(now_ + tick_of_service, [this] { serve(); });
        pairing_.advance(now_);
        if (!camera_dead_ && board_alive_)
            if (const auto start = pairing_.wanted_start(now_)) {
                ++verdict_.starts;
                request(*start);
            }
    }

    void request(Start start) {
        filter_.forget_grid();
        pairing_.start_requested(start, now_);
        at(now_ + command_delay, [this, start, life = life_] {
            if (life != life_) return;
            mode_ = start;
            first_tick_ = ticks_;
            running_ = true;
        });
    }

    /// Camera or board is there (again): everything begins from the start.
    void start_anew() {
        if (camera_dead_ || !board_alive_) return;
        filter_.forget();
        pairing_.reset();
        if (stale_first_ || chance(0.2)) send_stale_frames();
        started_ = now_;
        request(pairing_.first_start());
    }

    // --- the board
    bool wanted(unsigned output) const {
        const std::uint64_t since = ticks_ - first_tick_;
        if (mode_ == Start::slow)
            return since % wire::slow_start_ticks(std::llround(settings_.rate_hz * 1e6), output) ==
                   0;
        if (mode_ == Start::steady || since >= wire::start_pattern_length) return true;
        return (wire::start_pattern_bits[output] >> since & 1U) != 0;
    }

    void tick() {
        if (pulses_ >= settings_.pulses) {
            end_ = now_ + seconds(4);
            return;
        }
        at(now_ + board_period() + std::exchange(grid_waits_, {}), [this] { tick(); });
        if (++idle_ticks_ > 100'000) end_ = now_;
        if (!board_alive_ || !running_) return;
        if (wanted(0)) pulse();
        if (swapped_ && wanted(1)) expose(now_, {life_, 0, 0, false, {}}, false);
        ++ticks_;
    }

    Duration longest_exposure() const {
        const Duration longest = settings_.exposure.ns != 0 ? settings_.exposure : period_ / 3;
        return std::max(longest, settings_.other_exposure);
    }

    /// A fixed grid goes by the board's clock.
    Duration board_period() const {
        if (!settings_.compensated) return period_;
        return {std::llround(static_cast<double>(period_.ns) / (1 + board_drift))};
    }

    void pulse() {
        ++trigger_;
        ++pulses_;
        idle_ticks_ = 0;
        const auto fault = settings_.faults.find(pulses_);
        fault_ = fault == settings_.faults.end() ? std::nullopt : std::optional(fault->second);
        if (fault_) disturb(*fault_);
        if (!board_alive_) return;
        const bool crowded =
            link_busy_ - now_ > frame_on_link() * (frames_in_camera - 1) && settings_.link_load > 0;
        const bool takes = !camera_dead_ && fault_ != FaultKind::trigger_ignored && !crowded &&
                           !busy() && !(settings_.ignored > 0 && chance(settings_.ignored));
        const bool lost = fault_ == FaultKind::record_lost;
        // The middle of an exposure as long as the one before is on the grid.
        const HostTime triggered_at =
            settings_.compensated ? now_ + (longest_exposure() - expected_) / 2 : now_;
        const HostTime start = triggered_at + microseconds(20);
        const Truth truth{life_, trigger_, pulses_, !lost,
                          to_board(stamped(start, start + exposure_))};
        Exposure exposure;
        exposure.trigger = trigger_;
        exposure.tick = life_ << 32U | ticks_;
        exposure.start = to_board(start);
        exposure.end = to_board(start + exposure_);
        if (!settings_.strobe) exposure.kind = StampKind::trigger_edge;
        exposure.exposed =
            takes || !settings_.strobe || swapped_ || (crowded && settings_.drops_after_exposure);
        if (exposure.exposed) expected_ = exposure_;
        const HostTime sent = start + (exposure.exposed ? exposure_ : start_patience());
        BoardTime triggered = to_board(triggered_at);
        if (fault_ == FaultKind::lying_record) lie(exposure, triggered);
        if (!lost) send_record(exposure, triggered, sent);
        if (!swapped_) expose(start, truth, takes);
        if (settings_.switched_every != 0 && pulses_ % settings_.switched_every == 0)
            exposure_ = pulses_ / settings_.switched_every % 2 != 0 ? settings_.other_exposure
                                                                    : settings_.exposure;
        // It follows the light.
        if (settings_.exposure.ns != 0) return;
        exposure_ = std::clamp(exposure_ + between(-exposure_ / 10, exposure_ / 10), period_ / 50,
                               period_ / 3);
    }

    /// How long the board waits for an exposure line that stays silent.
    Duration start_patience() const {
        return std::clamp(period_, shortest_start_patience, longest_start_patience);
    }

    BoardTime to_board(HostTime host) const {
        return {board_offset_ + std::llround(static_cast<double>(host.ns) * (1 + board_drift))};
    }

    /// As the board writes it.
    wire::Exposure written(const Exposure& exposure, BoardTime triggered) const {
        wire::Exposure record{};
        record.trigger = exposure.trigger;
        record.tick = exposure.tick;
        record.trigger_ns = triggered.ns;
        record.start_ns = exposure.exposed ? exposure.start.ns : wire::no_time;
        record.end_ns = exposure.exposed ? exposure.end.ns : wire::no_time;
        record.flags = !settings_.strobe  ? wire::exposure_predicted
                       : exposure.exposed ? wire::exposure_measured
                                          : wire::exposure_no_start;
        if (mode_ == Start::pattern) record.flags |= wire::exposure_pattern;
        if (mode_ == Start::slow) record.flags |= wire::exposure_slow;
        return record;
    }

    /// By the filter of records, as the service asks it.
    bool believed(const wire::Exposure& record) {
        constexpr Duration exchange_period = milliseconds(100);
        constexpr Duration ahead_slack = milliseconds(1);
        constexpr Duration estimate_sigma = microseconds(10);
        pairing::ReceivedRecord received;
        received.record = record;
        received.exchanges = static_cast<std::uint64_t>(now_.ns / exchange_period.ns);
        const Duration delay = now_ - to_host(pairing::newest_instant(record));
        if (delay < -ahead_slack) received.arrival = EventReason::not_yet;
        received.promptness = delays_.of(delay, estimate_sigma);
        const pairing::RecordVerdict verdict = filter_.judge(received);
        if (verdict.overturned || verdict.step) pairing_.reset();
        if (verdict.doubt) return false;
        if (record.end_ns != wire::no_time) delays_.learn(delay, now_);
        return true;
    }

    void send_record(Exposure exposure, BoardTime triggered, HostTime sent) {
        if (fault_ == FaultKind::usb_stall) link_free_ = now_ + seconds(2);
        Duration delay = settings_.record_delay;
        if (fault_ == FaultKind::record_late) delay = delay + milliseconds(100);
        if (settings_.held_records > 0 && chance(settings_.held_records))
            delay = delay + between({}, period_ * 2);
        link_free_ = std::max(link_free_, sent + delay);
        const Duration noise = between(-microseconds(30), microseconds(30));
        const wire::Exposure record = written(exposure, triggered);
        at(link_free_, [this, exposure, record, noise, life = life_]() mutable {
            if (life != life_) return;
            // As the service does, before it looks at the record.
            if (std::exchange(clock_anew_, false)) {
                pairing_.reset();
                filter_.forget();
                delays_.forget();
            }
            if (!believed(record)) return;
            exposure.recorded = now_;
            exposure.end_on_host = exposure.earliest_on_host = to_host(exposure.end) + noise;
            pairing_.add(exposure);
        });
    }

    /// By the estimate of the board's clock, which notices a step some time after it.
    HostTime to_host(BoardTime board) const {
        return {
            std::llround(static_cast<double>(board.ns - estimated_offset_) / (1 + board_drift))};
    }

    /// The board's time in all that it says. When its grid goes by that time, it skips the grid
    /// points that have passed, or waits for the next.
    void step_board_time(bool grid_follows) {
        Duration step = clock_step();
        if (grid_follows) {
            const std::int64_t ticks = std::uniform_int_distribution<>(1, 3)(random_);
            const bool forward = chance(0.5);
            step = period_ * (forward ? ticks : -ticks);
            if (forward)
                ticks_ += static_cast<std::uint64_t>(ticks);
            else
                grid_waits_ = -step;
        }
        board_offset_ += step.ns;
        at(now_ + between(milliseconds(300), seconds(3)), [this, life = life_] {
            if (life != life_) return;
            estimated_offset_ = board_offset_;
            clock_anew_ = true;
            recovers();
        });
    }

    /// One number is wrong, as after a torn read or by ill will.
    void lie(Exposure& exposure, BoardTime& triggered) {
        const double size = std::pow(10, uniform(6, 12));
        const Duration shift{std::llround(chance(0.5) ? size : -size)};
        switch (std::uniform_int_distribution<>(0, 5)(random_)) {
            case 0: exposure.start = exposure.start + shift; break;
            case 1: exposure.end = exposure.end + shift; break;
            case 2: exposure.trigger += 1000; break;
            case 3: exposure.tick += random_() % 1000; break;
            case 4: exposure.start.ns += std::int64_t{1} << 32U; [[fallthrough]];
            default:
                triggered = triggered + shift;
                exposure.start = exposure.start + shift;
                exposure.end = exposure.end + shift;
        }
    }

    // --- the camera
    /// It still exposes, or reads out, for a trigger that it took.
    bool busy() {
        if (now_ < free_at_) return true;
        free_at_ = now_ + settings_.shortest_period;
        return false;
    }

    /// `takes`: it exposes; when it does not, its counter may go on.
    void expose(HostTime start, const Truth& truth, bool takes) {
        if (camera_dead_) return;
        if (swapped_) takes = true;
        if (!takes && !settings_.ids_count_ignored) return;
        std::uint64_t id = next_id_++;
        if (!takes) return;
        if (fault_ == FaultKind::duplicate_id) {
            --id;
            if (chance(0.5)) --next_id_;
        }
        const HostTime end = start + exposure_;
        HostTime arrives = end + settings_.readout + between(-settings_.jitter, settings_.jitter);
        if (settings_.link_load > 0)
            arrives = link_busy_ = std::max(link_busy_, end) + frame_on_link();
        if (chance(settings_.late_frames)) arrives = arrives + between({}, milliseconds(40));
        if (fault_ == FaultKind::frame_lost) return;
        if (fault_ == FaultKind::last_packet_lost || fault_ == FaultKind::leader_lost) {
            const bool known = fault_ == FaultKind::last_packet_lost;
            frames_free_ =
                std::max(frames_free_, arrives + missing_packets_timeout);  // later ones wait
            at(frames_free_, [this, id = known ? unwrap(id) : 0] {
                pairing_.add(Shortfall{id, EventReason::frame_incomplete});
            });
            return;
        }
        if (fault_ == FaultKind::frames_reordered)
            arrives = arrives + period_ + settings_.jitter * 2;
        else
            arrives = frames_free_ = std::max(frames_free_, arrives);
        deliver(id, start, arrives, truth);
        if (settings_.doubled > 0 && chance(settings_.doubled))
            deliver(next_id_++, start, frames_free_ = arrives + milliseconds(1), truth);
    }

    /// What the camera stamps of this exposure, in any time.
    template <class Time>
    Time stamped(Time start, Time end) const {
        const Instant instant = settings_.stamped;
        const Time by_exposure = instant == Instant::middle ? middle(start, end)
                                 : instant == Instant::end  ? end
                                                            : start;
        return by_exposure + settings_.readout_start;
    }

    void deliver(std::uint64_t id, HostTime start, HostTime arrives, const Truth& truth) {
        Arrival frame;
        frame.slot = static_cast<std::uint32_t>(truths_.size());
        frame.camera_time = camera_time(stamped(start, start + exposure_));
        if (settings_.chunks) frame.exposure = exposure_;
        truths_.push_back(truth);
        at(arrives, [this, frame, id, power = camera_power_]() mutable {
            if (power != camera_power_) return;  // it was off when it should have sent this
            frame.block_id = unwrap(id);
            frame.arrived = last_arrival_ = now_;
            if (truths_[frame.slot].trigger != 0) ++verdict_.frames;
            ++frames_since_slip_;
            pairing_.add(frame);
        });
    }

    Duration frame_on_link() const {
        return {std::llround(static_cast<double>(period_.ns) * settings_.link_load)};
    }

    std::uint64_t unwrap(std::uint64_t id) {
        return unwrapper_.unwrap(settings_.wide_ids ? id : (id - 1) % 0xFFFF + 1);
    }

    CameraTime camera_time(HostTime start) {
        if (settings_.clock == WorldClock::absent) return {};
        const double rate = settings_.clock == WorldClock::drifting ? camera_drift : -5e-6;
        return {camera_offset_ + std::llround(static_cast<double>(start.ns) * (1 + rate)) +
                std::uniform_int_distribution<std::int64_t>(-2000, 2000)(random_)};
    }

    void send_stale_frames() {
        const int count = std::uniform_int_distribution<>(1, 3)(random_);
        for (int i = count; i > 0; --i) {
            const HostTime start = now_ - period_ * (3 * i + 1) - between({}, period_);
            deliver(4000 - static_cast<std::uint64_t>(i), start, now_ + milliseconds(i), {});
        }
    }

    // --- what fails
    void disturb(FaultKind kind) {
        const std::uint64_t in_flight =
            8 + static_cast<std::uint64_t>((settings_.readout + milliseconds(150)).ns / period_.ns);
        grace_.push_back({pulses_ - std::min(pulses_, in_flight), pulses_ + frames_of_grace});
        switch (kind) {
            case FaultKind::id_restart: next_id_ = 1; break;
            case FaultKind::clock_jump: {
                const Duration step = clock_step();
                camera_offset_ += step.ns;
                // Only the pattern can show that it is the clock: the others could have stepped
                // together.
                if (step.ns % period_.ns == 0)
                    grace_.back().second += std::uint64_t{frames_of_pattern};
                break;
            }
            case FaultKind::camera_reboot: reboot_camera(); break;
            case FaultKind::board_reset: reset_board(); break;
            case FaultKind::board_time_step:
            case FaultKind::board_time_step_grid: {
                step_board_time(kind == FaultKind::board_time_step_grid);
                // Nothing can be proved until its clock is estimated anew.
                const Duration lasts = seconds(3) + period_ * frames_of_pattern;
                grace_.back().second += static_cast<std::uint64_t>(lasts.ns / period_.ns);
                break;
            }
            case FaultKind::usb_stall:
                grace_.back().second += static_cast<std::uint64_t>(seconds(2).ns / period_.ns);
                break;
            case FaultKind::stale_frame:
                camera_dead_ = true;
                reconnect();
                break;
            default: break;
        }
    }

    /// Whole periods are the worst: the camera's clock then still fits, one trigger off.
    Duration clock_step() {
        const std::int64_t sign = chance(0.5) ? 1 : -1;
        switch (std::uniform_int_distribution<>(0, 2)(random_)) {
            case 0: return period_ * (sign * std::uniform_int_distribution<>(1, 3)(random_));
            case 1: return between({}, period_) * sign;
            default: return between(seconds(1), seconds(1000)) * sign;
        }
    }

    void reboot_camera() {
        camera_dead_ = true;
        ++camera_power_;
        at(now_ + between(milliseconds(500), seconds(3)), [this] {
            reconnect();
            camera_offset_ = -now_.ns + between(seconds(1), seconds(9)).ns;
        });
        at(now_ + milliseconds(400), [this, life = life_] {
            if (life == life_ && camera_dead_) running_ = false;
        });
    }

    void reset_board() {
        board_alive_ = running_ = false;
        ++life_;
        trigger_ = 0;
        at(now_ + milliseconds(400), [this] {
            board_alive_ = true;
            board_offset_ = estimated_offset_ = between({}, seconds(100)).ns - now_.ns;
            recovers();
            start_anew();
        });
    }

    /// A new stream of the same camera: its numbers begin anew.
    void reconnect() {
        next_id_ = 1;
        unwrapper_ = {};
        recovers();
        running_ = false;
        ++camera_power_;
        at(now_ + milliseconds(5), [this] {
            camera_dead_ = false;
            start_anew();
        });
    }

    void recovers() {
        recovering_since_ = now_;
        grace_.push_back(
            {pulses_ - std::min<std::uint64_t>(pulses_, 20), pulses_ + 2 * frames_of_grace});
    }

    // --- what pairing decides
    void paired(const Arrival& arrival, const Exposure& exposure) override {
        const Truth& truth = truths_[arrival.slot];
        last_published_ = now_;
        if (verdict_.published++ == 0) verdict_.first_published = now_ - started_;
        if (truth.trigger != exposure.trigger || truth.life != exposure.tick >> 32U)
            ++verdict_.wrong;
        else if (pairing_.stamped() != Instant::unknown &&
                 absolute(stamped(exposure.start, exposure.end) - truth.stamped) > period_ / 20)
            ++verdict_.lies_published;
        if (recovering_since_) verdict_.recoveries.push_back(now_ - *recovering_since_);
        recovering_since_.reset();
        if (slipped_)
            verdict_.longest_relock = std::max(verdict_.longest_relock, frames_since_slip_);
        slipped_ = false;
    }
    void frame_unpaired(const Arrival& arrival, EventReason reason,
                        const Exposure* guess) override {
        const Truth& truth = truths_[arrival.slot];
        ++verdict_.frame_reasons[reason];
        if (guess != nullptr &&
            (truth.trigger != guess->trigger || truth.life != guess->tick >> 32U))
            ++verdict_.suspects_wrong;
        if (truth.trigger == 0 || !truth.recorded) return;
        ++verdict_.withheld;
        withheld_.push_back(truth.pulse);
    }
    void exposure_unpaired(const Exposure& /*exposure*/, EventReason reason) override {
        ++verdict_.exposure_reasons[reason];
    }
    void locked(const Exposure& /*first*/) override { ++verdict_.locks; }
    void slipped(const Arrival& /*at*/) override {
        ++verdict_.slips;
        slipped_ = true;
        frames_since_slip_ = 0;
    }

    void judge_withheld() {
        for (const std::uint64_t pulse : withheld_) {
            const bool excused = std::any_of(grace_.begin(), grace_.end(), [&](const auto& grace) {
                return pulse >= grace.first && pulse <= grace.second;
            });
            if (!excused) ++verdict_.withheld_needlessly;
        }
    }

    WorldSettings settings_;
    Duration period_;
    Duration exposure_;
    Duration expected_ = exposure_;  ///< by the board, of the next
    std::mt19937_64 random_;
    pairing::RecordFilter filter_;
    DelayFloor delays_;
    pairing::Pairing pairing_;
    pairing::BlockIdUnwrapper unwrapper_;
    Verdict verdict_;

    std::priority_queue<Event> events_;
    std::uint64_t order_ = 0;
    HostTime now_;
    HostTime end_{INT64_MAX};
    std::optional<FaultKind> fault_;

    bool board_alive_ = true;
    bool running_ = false;
    bool swapped_ = false;
    bool stale_first_ = false;
    Start mode_ = Start::pattern;
    std::uint64_t life_ = 1;
    std::uint64_t ticks_ = 0;
    std::uint64_t first_tick_ = 0;
    std::uint64_t idle_ticks_ = 0;
    std::uint64_t trigger_ = 0;
    std::uint64_t pulses_ = 0;
    std::int64_t board_offset_ = 77'000'000'000;
    std::int64_t estimated_offset_ = board_offset_;
    bool clock_anew_ = false;  ///< the estimate of the board's
    Duration grid_waits_;
    HostTime link_free_;

    bool camera_dead_ = false;
    std::uint64_t camera_power_ = 0;
    std::uint64_t next_id_;
    std::int64_t camera_offset_ = 5'000'000'000'000;
    HostTime free_at_;
    HostTime frames_free_;
    HostTime link_busy_;

    HostTime started_;
    HostTime last_arrival_;
    HostTime last_published_ = begin;
    std::optional<HostTime> recovering_since_;
    bool slipped_ = false;
    std::uint64_t frames_since_slip_ = 0;
    std::vector<Truth> truths_;  ///< by slot
    std::vector<std::uint64_t> withheld_;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> grace_;  ///< pulses that a fault may cost
};

}  // namespace

const char* to_string(FaultKind kind) {
    switch (kind) {
        case FaultKind::trigger_ignored: return "trigger ignored";
        case FaultKind::frame_lost: return "frame lost";
        case FaultKind::last_packet_lost: return "last packet lost";
        case FaultKind::leader_lost: return "leader lost";
        case FaultKind::frames_reordered: return "frames reordered";
        case FaultKind::duplicate_id: return "duplicate id";
        case FaultKind::id_wrap: return "id wrap";
        case FaultKind::id_restart: return "id restart";
        case FaultKind::clock_jump: return "camera clock jump";
        case FaultKind::camera_reboot: return "camera reboot";
        case FaultKind::board_reset: return "board reset";
        case FaultKind::record_lost: return "exposure record lost";
        case FaultKind::record_late: return "exposure record late";
        case FaultKind::usb_stall: return "USB stall 2 s";
        case FaultKind::stale_frame: return "first frame stale";
        case FaultKind::cameras_swapped: return "two cameras swapped";
        case FaultKind::board_time_step: return "board time step";
        case FaultKind::board_time_step_grid: return "board time step with grid";
        case FaultKind::lying_record: return "lying exposure record";
    }
    return "unknown";
}

const char* to_string(WorldClock clock) {
    switch (clock) {
        case WorldClock::good: return "good";
        case WorldClock::drifting: return "100 ppm";
        case WorldClock::absent: return "absent";
    }
    return "unknown";
}

Verdict run_world(const WorldSettings& settings) { return World(settings).run(); }

}  // namespace versavis::test

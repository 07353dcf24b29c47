// SPDX-License-Identifier: BSD-3-Clause
#include "damage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::liar {

namespace {

/// Messages that a lasting lie covers: more than a majority needs to see that they agree among
/// themselves. At half it ends about when the service believes it, at twice it says no more.
constexpr unsigned lasting_messages = 20;

const std::vector<Field> exposure_instants = instants(Type::exposure);
const std::vector<Field> answer_instants = instants(Type::clock_answer);

const Victim any_exposure{
    Type::exposure,
    {exposure::trigger, exposure::tick, exposure::trigger_time, exposure::start, exposure::end}};
const Victim any_sample{Type::imu_sample, {imu_sample::number, imu_sample::time, imu_sample::age}};
const Victim any_answer{Type::clock_answer, answer_instants};
const Victim any_follow_up{Type::clock_follow_up, {clock_follow_up::sent}};
const Victim any_event{Type::event, {event::detail, event::sequence, event::time, event::value}};
const std::vector<Victim> all{any_exposure, any_sample, any_answer, any_follow_up, any_event};
const std::vector<Victim> all_and_reports{any_exposure,   any_sample, any_answer,
                                          any_follow_up,  any_event,  {Type::health, {}},
                                          {Type::log, {}}};

std::int64_t camera_of(const Packet& packet) {
    return packet.type == Type::exposure ? get(packet, exposure::camera) : 0;
}

/// The serial number in a sample's magnetic field must outlive damage to its other bits.
bool is_mark(Type type, std::size_t byte) {
    return type == Type::imu_sample && byte >= imu_sample::magnetic_x.offset &&
           byte < imu_sample::magnetic_y.offset + imu_sample::magnetic_y.size;
}

const char* to_text(Type type) {
    switch (type) {
        case Type::exposure: return "exposure";
        case Type::imu_sample: return "imu_sample";
        case Type::event: return "event";
        case Type::clock_answer: return "clock_answer";
        case Type::clock_follow_up: return "clock_follow_up";
        case Type::health: return "health";
        case Type::log: return "log";
        default: return "other";
    }
}

std::string names(const std::vector<Field>& fields) {
    std::string text;
    for (const Field& field : fields) text += (text.empty() ? "" : ", ") + std::string(field.name);
    return text;
}

std::string in_ms(std::int64_t ns) { return fmt::format("{:+.6f} ms", ns * 1e-6); }

}  // namespace

const std::vector<Kind>& kinds() {
    static const std::vector<Kind> list{
        {"trigger-time", Way::shift, {{Type::exposure, {exposure::trigger_time}}}},
        {"start", Way::shift, {{Type::exposure, {exposure::start}}}},
        {"end", Way::shift, {{Type::exposure, {exposure::end}}}},
        {"edges", Way::shift, {{Type::exposure, {exposure::start, exposure::end}}}},
        {"end-second",
         Way::regular,
         {{Type::exposure, {exposure::end}}},
         2,
         microseconds(300),
         milliseconds(1)},
        {"end-third",
         Way::regular,
         {{Type::exposure, {exposure::end}}},
         3,
         microseconds(300),
         milliseconds(1)},
        {"end-all",
         Way::regular,
         {{Type::exposure, {exposure::end}}},
         1,
         microseconds(300),
         milliseconds(1)},
        {"slow-end",
         Way::regular,
         {{Type::exposure, {exposure::end}}},
         1,
         microseconds(400),
         microseconds(400)},
        {"record", Way::shift, {{Type::exposure, exposure_instants}}},
        {"record-periods", Way::shift_periods, {{Type::exposure, exposure_instants}}},
        {"camera", Way::jump, {{Type::exposure, {exposure::camera}}}},
        {"trigger-number", Way::jump, {{Type::exposure, {exposure::trigger}}}},
        {"tick", Way::jump, {{Type::exposure, {exposure::tick}}}},
        {"exposure-flags", Way::flip_flag, {{Type::exposure, {exposure::flags}}}},
        {"imu-time", Way::shift, {{Type::imu_sample, {imu_sample::time}}}},
        {"imu-age", Way::shift, {{Type::imu_sample, {imu_sample::age}}}},
        {"imu-accel-age", Way::jump, {{Type::imu_sample, {imu_sample::accel_age}}}},
        {"imu-number", Way::jump, {{Type::imu_sample, {imu_sample::number}}}},
        {"imu-flags", Way::flip_flag, {{Type::imu_sample, {imu_sample::flags}}}},
        {"answer-received", Way::shift, {{Type::clock_answer, {clock_answer::received}}}},
        {"answer-sent", Way::shift, {{Type::clock_answer, {clock_answer::sent}}}},
        {"answer", Way::shift, {any_answer}},
        {"answer-id", Way::jump, {{Type::clock_answer, {clock_answer::id}}}},
        {"follow-up", Way::shift, {any_follow_up}},
        {"event-time", Way::shift, {{Type::event, {event::time}}}},
        {"event-numbers",
         Way::jump,
         {{Type::event, {event::detail, event::sequence, event::value}}}},
        {"swap-messages", Way::swap_messages, all},
        {"swap-fields", Way::swap_fields, {any_exposure, any_sample, any_answer, any_event}},
        {"repeat", Way::repeat, all_and_reports},
        {"drop", Way::drop, all_and_reports},
        {"freeze", Way::freeze, all},
        {"bits", Way::flip_bits, all_and_reports},
        {"late-start", Way::late, {{Type::exposure, {exposure::start}}}},
        {"late-edges", Way::late, {{Type::exposure, {exposure::start, exposure::end}}}},
        {"late-record", Way::late, {{Type::exposure, exposure_instants}}},
        {"late-imu", Way::late, {{Type::imu_sample, {imu_sample::time}}}},
        {"late-exchange", Way::late, {any_answer}},
        {"clock-step", Way::step, all},
    };
    return list;
}

const Kind* find_kind(std::string_view name) {
    const auto found = std::find_if(kinds().begin(), kinds().end(),
                                    [&](const Kind& kind) { return kind.name == name; });
    return found == kinds().end() ? nullptr : &*found;
}

std::string to_text(const Damage& damage) {
    return fmt::format("{} {} {}{}: {}", damage.kind->name, to_text(damage.type), damage.number,
                       damage.type == Type::exposure ? fmt::format(" of cam{}", damage.camera) : "",
                       damage.what);
}

Liar::Liar(std::uint64_t seed, Duration period) : period_(period), random_(seed) {}

void Liar::obey(Orders orders) {
    const std::lock_guard lock(mutex_);
    orders_ = std::move(orders);
    lies_ = 0;
    lasting_.clear();
    steady_.reset();
}

void Liar::begin(const SteadyLie& lie) {
    obey(Orders{});
    const std::lock_guard lock(mutex_);
    steady_.emplace(lie, period_);
}

void Liar::forget() {
    const std::lock_guard lock(mutex_);
    step_ns_ = 0;
    held_.reset();
    follow_ups_.clear();
    lasting_.clear();
}

std::uint64_t Liar::damaged() const {
    const std::lock_guard lock(mutex_);
    return damaged_;
}

HostTime Liar::last_lie() const {
    const std::lock_guard lock(mutex_);
    return last_lie_;
}

std::vector<Damage> Liar::damages_since(std::size_t begin) const {
    const std::lock_guard lock(mutex_);
    return {damages_.begin() + static_cast<long>(std::min(begin, damages_.size())), damages_.end()};
}

std::optional<std::uint64_t> Liar::true_tick(unsigned camera, std::uint64_t trigger) const {
    const std::lock_guard lock(mutex_);
    const auto found = ticks_.find({camera, trigger});
    if (found == ticks_.end()) return {};
    return found->second;
}

std::vector<Packet> Liar::pass(Packet packet, HostTime now) {
    const std::lock_guard lock(mutex_);
    if (packet.nonce != nonce_) {
        nonce_ = packet.nonce;
        sequence_.reset();
        step_ns_ = 0;
    }
    if (!sequence_) sequence_ = packet.sequence;
    observe(packet);
    if (steady_ && steady_->alter(packet, now)) damage_counted(now);
    if (step_ns_ != 0) shift_fields(instants(packet.type), step_ns_, packet);

    std::vector<Packet> out;
    const bool waited_for =
        held_ && held_->packet.type == packet.type && camera_of(held_->packet) == camera_of(packet);
    if (held_ && !waited_for && orders_.kinds.empty()) {
        out.push_back(std::move(held_->packet));  // the one it waited for may never come
        held_.reset();
    }
    if (waited_for) {
        Packet first = std::move(held_->packet);
        const Kind& kind = *held_->kind;
        held_.reset();
        if (kind.way == Way::swap_messages) {
            std::swap(first, packet);
            note(kind, packet, now, "changed places with the one before");
        } else {
            const auto victim =
                std::find_if(kind.victims.begin(), kind.victims.end(),
                             [&](const Victim& v) { return v.type == packet.type; });
            const Field field = victim->fields[below(victim->fields.size())];
            const std::int64_t value = get(packet, field);
            set(packet, field, get(first, field));
            set(first, field, value);
            note(kind, packet, now, fmt::format("{} changed places with that before", field.name));
        }
        damage_counted(now);
        damage_counted(now);
        out.push_back(std::move(first));
        out.push_back(std::move(packet));
    } else {
        // One lie to a message: two may forge another that agrees with itself.
        const Kind* kind = continue_lies(packet, now) ? nullptr : choose(packet);
        if (kind == nullptr) {
            out.push_back(std::move(packet));
        } else {
            const auto victim =
                std::find_if(kind->victims.begin(), kind->victims.end(),
                             [&](const Victim& v) { return v.type == packet.type; });
            for (Packet& damaged : lie(*kind, *victim, std::move(packet), now))
                out.push_back(std::move(damaged));
        }
    }
    for (Packet& passed : out) passed.sequence = (*sequence_)++;
    return out;
}

/// Notes what is true, before any lie.
void Liar::observe(const Packet& packet) {
    const std::uint64_t seen = ++seen_[packet.type];
    present_ = {static_cast<std::uint64_t>(camera_of(packet)), seen};
    if (packet.type == Type::exposure) {
        present_.number = static_cast<std::uint64_t>(get(packet, exposure::trigger));
        ticks_[{static_cast<unsigned>(present_.camera), present_.number}] =
            static_cast<std::uint64_t>(get(packet, exposure::tick));
    } else if (packet.type == Type::imu_sample) {
        present_.number = serial_in(packet);
    }
}

const Kind* Liar::choose(const Packet& packet) {
    if (lies_ >= orders_.most || held_) return nullptr;
    const bool resting = std::any_of(lasting_.begin(), lasting_.end(), [&](const Lasting& l) {
        return l.type == packet.type && l.camera == camera_of(packet);
    });
    std::vector<const Kind*> fitting;
    for (const Kind* kind : orders_.kinds) {
        if (resting && (kind->way == Way::late || kind->way == Way::freeze)) continue;
        for (const Victim& victim : kind->victims)
            if (victim.type == packet.type) fitting.push_back(kind);
    }
    if (fitting.empty() || uniform() >= orders_.rate) return nullptr;
    return fitting[below(fitting.size())];
}

/// True when the packet is damaged now.
bool Liar::continue_lies(Packet& packet, HostTime now) {
    bool lied_on = false;
    if (packet.type == Type::clock_follow_up) {
        const auto lied =
            follow_ups_.find(static_cast<std::uint32_t>(get(packet, clock_follow_up::id)));
        if (lied != follow_ups_.end()) {
            shift_fields({clock_follow_up::sent}, lied->second, packet);
            follow_ups_.erase(lied);
            damage_counted(now);
            lied_on = true;
        }
    }
    for (Lasting& lasting : lasting_) {
        if (lasting.type != packet.type || lasting.camera != camera_of(packet)) continue;
        if (lasting.left == 0) {
            --lasting.rest;
            continue;
        }
        if (lasting.kind->way == Way::freeze)
            set(packet, lasting.fields[0], lasting.amount_ns);
        else
            shift_fields(lasting.fields, lasting.amount_ns, packet);
        if (packet.type == Type::clock_answer && lasting.kind->way == Way::late)
            follow_ups_[static_cast<std::uint32_t>(get(packet, clock_answer::id))] =
                lasting.amount_ns;
        damage_counted(now);
        --lasting.left;
        lied_on = true;
    }
    std::erase_if(lasting_, [](const Lasting& lasting) { return lasting.rest == 0; });
    return lied_on;
}

std::vector<Packet> Liar::lie(const Kind& kind, const Victim& victim, Packet packet, HostTime now) {
    if (kind.way == Way::swap_messages || kind.way == Way::swap_fields) {
        ++lies_;
        held_ = Held{&kind, std::move(packet)};
        return {};
    }
    if (kind.way == Way::drop) {
        ++lies_;
        note(kind, packet, now, "dropped");
        damage_counted(now);
        return {};
    }
    if (kind.way == Way::repeat) {
        ++lies_;
        note(kind, packet, now, "sent twice");
        damage_counted(now);
        return {packet, packet};
    }
    if (alter(kind, victim, packet, now)) {
        ++lies_;
        damage_counted(now);
    }
    return {packet};
}

/// False: there is nothing here to lie about.
bool Liar::alter(const Kind& kind, const Victim& victim, Packet& packet, HostTime now) {
    const auto one_field = [&] { return victim.fields[below(victim.fields.size())]; };
    switch (kind.way) {
        case Way::shift:
        case Way::shift_periods: {
            const std::int64_t by = kind.way == Way::shift ? any_shift_ns() : any_periods_ns();
            if (!shift_fields(victim.fields, by, packet)) return false;
            note(kind, packet, now, names(victim.fields) + " " + in_ms(by));
            return true;
        }
        case Way::jump: {
            const Field field = one_field();
            const std::int64_t before = get(packet, field);
            set(packet, field, other_number(before));
            note(kind, packet, now,
                 fmt::format("{} {} became {}", field.name, before, get(packet, field)));
            return true;
        }
        case Way::flip_flag: {
            constexpr unsigned exposure_flags = 12;
            constexpr unsigned sample_flags = 6;
            const std::uint64_t bit =
                below(packet.type == Type::exposure ? exposure_flags : sample_flags);
            const Field field = one_field();
            set(packet, field, get(packet, field) ^ std::int64_t{1} << bit);
            note(kind, packet, now, fmt::format("flag {} flipped", bit));
            return true;
        }
        case Way::flip_bits: {
            std::string what = "bits flipped:";
            for (std::uint64_t left = 1 + below(8); left > 0; --left) {
                const std::uint64_t bit = below(packet.payload.size() * 8);
                if (is_mark(packet.type, bit / 8)) continue;
                packet.payload[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
                what += fmt::format(" {}.{}", bit / 8, bit % 8);
            }
            note(kind, packet, now, what);
            return true;
        }
        case Way::freeze: {
            const Field field = one_field();
            lasting_.push_back({&kind,
                                packet.type,
                                camera_of(packet),
                                {field},
                                get(packet, field),
                                1 + static_cast<unsigned>(below(lasting_messages)),
                                lasting_messages});
            note(kind, packet, now,
                 fmt::format("{} stays for {} more", field.name, lasting_.back().left));
            return true;
        }
        case Way::late: {
            const std::int64_t by = small_shift_ns();
            if (!shift_fields(victim.fields, by, packet)) return false;
            lasting_.push_back({&kind, packet.type, camera_of(packet), victim.fields, by,
                                lasting_messages - 1, lasting_messages});
            if (packet.type == Type::clock_answer)
                follow_ups_[static_cast<std::uint32_t>(get(packet, clock_answer::id))] = by;
            note(kind, packet, now,
                 fmt::format("{} {} for {} messages", names(victim.fields), in_ms(by),
                             lasting_messages));
            return true;
        }
        case Way::step: {
            const std::int64_t by = any_periods_ns();
            step_ns_ += by;
            shift_fields(instants(packet.type), by, packet);
            note(kind, packet, now, "the clock steps by " + in_ms(by));
            return true;
        }
        case Way::regular: return shift_regularly(kind, victim, packet, now);
        default: return false;
    }
}

/// False: it is not the turn of this one.
bool Liar::shift_regularly(const Kind& kind, const Victim& victim, Packet& packet, HostTime now) {
    if (camera_of(packet) != 0 || ++regular_ % kind.every != 0) return false;
    const auto spread = static_cast<std::uint64_t>((kind.most - kind.least).ns);
    const std::int64_t by = kind.least.ns + static_cast<std::int64_t>(below(spread + 1));
    if (!shift_fields(victim.fields, by, packet)) return false;
    note(kind, packet, now, names(victim.fields) + " " + in_ms(by));
    return true;
}

void Liar::note(const Kind& kind, const Packet& packet, HostTime now, std::string what) {
    damages_.push_back(
        {now, &kind, packet.type, present_.camera, present_.number, std::move(what)});
}

void Liar::damage_counted(HostTime now) {
    ++damaged_;
    last_lie_ = now;
}

std::int64_t Liar::any_shift_ns() {
    const auto size = static_cast<std::int64_t>(std::pow(10.0, 3 + 9 * uniform()));
    return below(2) == 0 ? size : -size;
}

std::int64_t Liar::small_shift_ns() {
    constexpr double least_ns = 5e5;
    constexpr double factor = 40;
    const auto size = static_cast<std::int64_t>(least_ns * std::pow(factor, uniform()));
    return below(2) == 0 ? size : -size;
}

std::int64_t Liar::any_periods_ns() {
    constexpr std::int64_t most[] = {1, 1, 2, 3, 10, 1000};
    const auto periods = 1 + static_cast<std::int64_t>(
                                 below(static_cast<std::uint64_t>(most[below(std::size(most))])));
    return (below(2) == 0 ? periods : -periods) * period_.ns;
}

std::int64_t Liar::other_number(std::int64_t number) {
    constexpr std::int64_t steps[] = {1, -1, 2, 5, -5, 1000, -1000, 1LL << 31U, 1LL << 32U};
    const std::uint64_t choice = below(std::size(steps) + 1);
    const auto by =
        choice < std::size(steps) ? static_cast<std::uint64_t>(steps[choice]) : random_();
    return static_cast<std::int64_t>(static_cast<std::uint64_t>(number) + by);
}

std::uint64_t serial_in(const Packet& sample) {
    const auto word = [&](const Field& field) {
        return static_cast<std::uint16_t>(get(sample, field));
    };
    return word(imu_sample::magnetic_x) | std::uint64_t{word(imu_sample::magnetic_y)} << 16U;
}

}  // namespace versavis::liar

// SPDX-License-Identifier: BSD-3-Clause
#include "imu/vn100.hpp"

#include <cstring>

#include "imu/text_line.hpp"

namespace versavis::firmware {

namespace {

constexpr std::uint32_t slow_baud = 115'200;  // after its power-up
constexpr std::uint32_t fast_baud = 921'600;
constexpr std::uint32_t fastest_at_slow_baud_millihertz = 160'000;
constexpr Nanoseconds answer_patience = 300'000'000;
constexpr Nanoseconds silence_floor = 100'000'000;
constexpr Nanoseconds settle = 20'000'000;  // after a change of baud rate

constexpr std::uint8_t sync = 0xFA;
constexpr std::uint8_t header[] = {sync, 0x01, 0x01,
                                   0x06};  // common group: time, IMU, magnetic and pressure
constexpr std::size_t time_at = 4;
constexpr std::size_t accel_at = 12;
constexpr std::size_t gyro_at = 24;
constexpr std::size_t magnetic_at = 36;
constexpr std::size_t temperature_at = 48;
constexpr std::size_t pressure_at = 52;
constexpr Nanoseconds base_period = 1'250'000;  // of its own samples
constexpr Nanoseconds power_up_time = 300'000'000;

/// Edges closer to the one before are its echoes; the part's are a base period apart. If lower,
/// long reflections count double; if higher, two samples might be one.
constexpr Nanoseconds longest_echo = 300'000;

std::uint32_t word32(const std::uint8_t* bytes) {
    std::uint32_t word;
    std::memcpy(&word, bytes, sizeof word);
    return word;
}

std::uint8_t text_checksum(const char* text, std::size_t size) {
    std::uint8_t sum = 0;
    for (std::size_t i = 0; i < size; ++i)
        sum = static_cast<std::uint8_t>(sum ^ static_cast<std::uint8_t>(text[i]));
    return sum;
}

template <class Narrow>
bool narrow(std::uint32_t float_bits, unsigned fraction_bits, std::int32_t lowest,
            std::int32_t highest, Narrow& out) {
    std::int32_t wide;
    if (!fixed_point(float_bits, fraction_bits, wide)) return false;
    out = static_cast<Narrow>(wide < lowest ? lowest : wide > highest ? highest : wide);
    return true;
}

}  // namespace

/// The steps of eight bits at once, by the structure of the polynomial: x^12 + x^5 + 1.
std::uint16_t vn100_crc(const std::uint8_t* data, std::size_t size) {
    std::uint32_t crc = 0;
    for (std::size_t i = 0; i < size; ++i) {
        crc = (crc >> 8U | crc << 8U) & 0xFFFFU;
        crc ^= data[i];
        crc ^= (crc & 0xFFU) >> 4U;
        crc ^= crc << 12U & 0xFFFFU;
        crc ^= (crc & 0xFFU) << 5U;
    }
    return static_cast<std::uint16_t>(crc);
}

bool fixed_point(std::uint32_t float_bits, unsigned fraction_bits, std::int32_t& out) {
    const bool negative = (float_bits >> 31U) != 0;
    const int exponent = static_cast<int>(float_bits >> 23U & 0xFFU);
    if (exponent == 0xFF) return false;
    const auto mantissa = static_cast<std::int32_t>((float_bits & 0x7FFFFFU) | 0x800000U);
    const int shift = exponent - 127 - 23 + static_cast<int>(fraction_bits);
    std::int32_t value = 0;  // also of what is less than half of a unit: zero is so small
    if (shift > 7)
        value = INT32_MAX;
    else if (shift >= 0)
        value = mantissa << shift;
    else if (shift > -25)
        value = (mantissa + (1 << (-shift - 1))) >> -shift;
    out = negative ? -value : value;
    return true;
}

std::uint32_t Vn100::true_rate(std::uint32_t wanted_millihertz) {
    const std::uint32_t parts =
        vn100::fastest_millihertz / (wanted_millihertz == 0 ? 1 : wanted_millihertz);
    return vn100::fastest_millihertz / (parts == 0 ? 1 : parts);
}

std::uint32_t Vn100::divider() const {
    return vn100::fastest_millihertz / true_rate(configuration_.rate_millihertz);
}

Vn100::Vn100(std::uint8_t port, ImuUart& uart, ChannelReports& reports)
    : ImuPort(port, reports), uart_(uart) {}

void Vn100::configure(const wire::ImuConfiguration& configuration, Nanoseconds now) {
    configuration_ = configuration;
    state_ = State::off;
    wake_ = never;
    if (configuration.kind != wire::ImuKind::vn100) return;
    period_ = 1'000'000'000'000 / true_rate(configuration.rate_millihertz);
    fast_first_ = baud_ == fast_baud;
    begin_setup(now > power_up_time ? now : power_up_time);
}

void Vn100::begin_setup(Nanoseconds at) {
    state_ = State::set_up;
    step_ = Step::quiet;
    waiting_ = false;
    wake_ = at;
}

void Vn100::send_step(Nanoseconds now) {
    if (step_ == Step::quiet) set_baud(fast_first_ ? fast_baud : slow_baud);
    TextLine text;
    switch (step_) {
        case Step::quiet: text << "VNASY,0"; break;
        // No output that another program set up may remain: it could be too much for the line.
        case Step::no_text: text << "VNWRG,06,0"; break;
        case Step::no_binary1: text << "VNWRG,75,0,8,01,0001"; break;
        case Step::no_binary2: text << "VNWRG,76,0,8,01,0001"; break;
        case Step::no_binary3: text << "VNWRG,77,0,8,01,0001"; break;
        case Step::baud: text << "VNWRG,05," << wanted_baud(); break;
        // A pulse at the start of each sample, sent or not, 100 us long, high: skipped pulses would
        // not be those of skipped packets.
        case Step::pulses: text << "VNWRG,32,3,0,0,0,1,1,0,100000,0"; break;
        case Step::packets: text << "VNWRG,75,1," << divider() << ",01,0601"; break;
        case Step::go: text << "VNASY,1"; break;
    }
    TextLine line;
    line << "$" << text << "*";
    line.hex(text_checksum(text.data(), text.size())) << "\r\n";
    uart_.write(reinterpret_cast<const std::uint8_t*>(line.data()), line.size());
    waiting_ = true;
    wake_ = now + answer_patience;
}

std::uint32_t Vn100::wanted_baud() const {
    return configuration_.rate_millihertz > fastest_at_slow_baud_millihertz ? fast_baud : slow_baud;
}

void Vn100::set_baud(std::uint32_t baud) {
    baud_ = baud;
    uart_.set_baud(baud);
}

void Vn100::next_step(Nanoseconds now) {
    waiting_ = false;
    wake_ = now;
    if (step_ == Step::baud) {
        set_baud(wanted_baud());
        wake_ = now + settle;
    }
    if (step_ != Step::go) {
        step_ = static_cast<Step>(static_cast<std::uint8_t>(step_) + 1);
        return;
    }
    state_ = State::running;
    startup_ns_ = 0;
    wake_ = now + silence_floor + 20 * period_;
    report_event(wire::BoardEventKind::imu_ready, now, 100);
}

void Vn100::fail(wire::BoardEventKind kind, Nanoseconds now, std::int64_t value) {
    report_failure(
        kind, now, value,
        state_ == State::running ? std::uint16_t{0xFFFF} : static_cast<std::uint16_t>(step_));
    fast_first_ = !fast_first_;
    begin_setup(now + retry_interval);
}

void Vn100::ready_edge(Nanoseconds at) {
    if (at - edges_[0] < longest_echo) return;
    for (std::size_t i = max_edges - 1; i > 0; --i) edges_[i] = edges_[i - 1];
    edges_[0] = at;
}

void Vn100::drop(std::size_t size) {
    for (std::size_t i = size; i != filled_; ++i) bytes_[i - size] = bytes_[i];
    filled_ -= size;
}

/// Length of the first line, including its end; 0: none ends soon.
std::size_t Vn100::line_length() const {
    for (std::size_t i = 0; i < filled_ && i < max_line; ++i)
        if (bytes_[i] == '\n') return i + 1;
    return 0;
}

/// The answer to the step that was sent, or an error. False: the first bytes are not an intact
/// line.
bool Vn100::take_line(Nanoseconds now) {
    const std::size_t end = line_length() - 1;
    const char* line = reinterpret_cast<const char*>(bytes_);
    std::size_t star = 0;
    while (star != end && line[star] != '*') ++star;
    TextLine sum;
    sum.hex(text_checksum(line + 1, star - 1));
    if (star == end || std::memcmp(line + star + 1, sum.data(), 2) != 0) return false;
    const bool error = std::memcmp(line, "$VNERR,", 7) == 0;
    const std::int64_t code = line[7] * 256 + line[8];
    const bool command = step_ == Step::quiet || step_ == Step::go;
    const bool answer = std::memcmp(line, command ? "$VNASY" : "$VNWRG", 6) == 0;
    drop(end);
    if (!waiting_) return true;
    if (error)
        fail(wire::BoardEventKind::imu_failed, now, code);
    else if (answer)
        next_step(now);
    return true;
}

bool Vn100::take_packet(Nanoseconds now, wire::ImuSample& sample) {
    using namespace vn100;
    // Its own bytes and those behind it crossed the line at the baud rate, ten bits each.
    const Nanoseconds first_byte = received_ - static_cast<Nanoseconds>(filled_) * 10'000'000'000 /
                                                   static_cast<Nanoseconds>(baud_);
    const std::uint8_t* packet = bytes_;
    std::uint64_t startup;
    std::memcpy(&startup, packet + time_at, sizeof startup);
    sample = {};
    sample.kind = wire::ImuKind::vn100;
    bool good = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        good =
            fixed_point(word32(packet + gyro_at + 4 * axis), gyro_bits, sample.gyro[axis]) && good;
        good = fixed_point(word32(packet + accel_at + 4 * axis), accel_bits, sample.accel[axis]) &&
               good;
        good = narrow(word32(packet + magnetic_at + 4 * axis), magnetic_bits, INT16_MIN, INT16_MAX,
                      sample.magnetic[axis]) &&
               good;
    }
    good = narrow(word32(packet + temperature_at), temperature_bits, INT16_MIN, INT16_MAX,
                  sample.temperature) &&
           good;
    good =
        narrow(word32(packet + pressure_at), pressure_bits, 0, UINT16_MAX, sample.pressure) && good;
    drop(packet_size);
    if (state_ != State::running) return false;
    if (!good) sample.flags |= wire::imu_self_test_failed;
    stamp(first_byte, count(startup), sample);
    wake_ = now + silence_floor + 20 * period_;
    finish(sample);
    return true;
}

/// The part's own clock shows how many samples were lost on the way. Returns the time since the
/// previous sample; 0: there was none.
Nanoseconds Vn100::count(std::uint64_t startup_ns) {
    if (startup_ns_ == 0) startup_ns_ = startup_ns;
    const auto since = static_cast<Nanoseconds>(startup_ns - startup_ns_);
    startup_ns_ = startup_ns;
    const Nanoseconds periods = (since + period_ / 2) / period_;
    if (periods > 1) miss(static_cast<std::uint32_t>(periods - 1));
    return since;
}

/// A packet leaves within a base period of its sample: the newest edge before it belongs to that
/// sample, if the part's clock agrees.
void Vn100::stamp(Nanoseconds first_byte, Nanoseconds since_last, wire::ImuSample& sample) {
    sample.time_ns = first_byte;
    if ((configuration_.options & wire::imu_data_ready) == 0) return;
    std::size_t newest = 0;
    while (newest != max_edges && edges_[newest] >= first_byte) ++newest;
    if (newest == max_edges || first_byte - edges_[newest] >= base_period) return;
    const Nanoseconds off = edges_[newest] - stamp_ - since_last;
    const bool agrees = off < base_period / 2 && -off < base_period / 2;
    stamp_ = edges_[newest];
    // A clock that stood still, or restarted, says nothing about the edge.
    if (since_last <= 0 || !agrees) return;
    sample.time_ns = stamp_;
    sample.flags |= wire::imu_stamped;
}

/// Takes the first item from the bytes. True: it was a sample.
bool Vn100::parse(Nanoseconds now, wire::ImuSample& sample) {
    while (filled_ != 0) {
        if (bytes_[0] == sync) {
            const std::size_t head = filled_ < sizeof header ? filled_ : sizeof header;
            if (std::memcmp(bytes_, header, head) == 0) {
                if (filled_ < vn100::packet_size) return false;
                if (vn100_crc(bytes_ + 1, vn100::packet_size - 1) == 0) {
                    if (take_packet(now, sample)) return true;
                    continue;
                }
                if (state_ == State::running) count_error();
            }
        } else if (bytes_[0] == '$') {
            const bool whole = line_length() != 0;
            if (whole && take_line(now)) continue;
            if (!whole && filled_ < max_line) return false;
        }
        drop(1);
    }
    return false;
}

bool Vn100::poll(Nanoseconds now, wire::ImuSample& sample) {
    if (state_ == State::off) return false;
    // Bytes already read are handled before more are read: `received_` belongs to the last one.
    if (parse(now, sample)) return true;
    while (const std::size_t size =
               uart_.read(bytes_ + filled_, sizeof bytes_ - filled_, received_)) {
        filled_ += size;
        if (parse(now, sample)) return true;
    }
    if (now < wake_) return false;
    if (waiting_ && step_ == Step::baud && baud_ != wanted_baud()) {
        set_baud(wanted_baud());  // it may have changed before it answered: ask again
    } else if (state_ == State::running || waiting_) {
        fail(wire::BoardEventKind::imu_silent, now, 0);
        return false;
    }
    send_step(now);
    return false;
}

}  // namespace versavis::firmware

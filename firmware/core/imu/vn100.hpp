// SPDX-License-Identifier: BSD-3-Clause
// VectorNav VN-100 on the UART: set up by text commands, read as binary packets; from the user
// manual UM001 v2.22.
#pragma once

#include "imu/imu_port.hpp"

namespace versavis::firmware {

/// CRC-16 with the polynomial 0x1021, from zero; over a packet with its CRC it is zero.
std::uint16_t vn100_crc(const std::uint8_t* data, std::size_t size);

/// An IEEE float as a multiple of 2^-`fraction_bits`, without floating point; saturates. False: it
/// is not a number.
bool fixed_point(std::uint32_t float_bits, unsigned fraction_bits, std::int32_t& out);

namespace vn100 {
// The raw words of its samples are multiples of these.
inline constexpr unsigned gyro_bits = 24;        ///< 2^-24 rad/s
inline constexpr unsigned accel_bits = 20;       ///< 2^-20 m/s^2
inline constexpr unsigned magnetic_bits = 13;    ///< 2^-13 gauss
inline constexpr unsigned temperature_bits = 7;  ///< 2^-7 degree C
inline constexpr unsigned pressure_bits = 8;     ///< 2^-8 kPa
inline constexpr std::uint32_t fastest_millihertz = 800'000;
inline constexpr std::size_t packet_size = 58;  ///< with time, IMU, magnetic and pressure fields
}  // namespace vn100

/// Sets up a VN-100 on the UART, and checks and stamps the packets that it sends. Part of Board,
/// called from Board::poll() only.
class Vn100 final : public ImuPort {
 public:
    Vn100(std::uint8_t port, ImuUart& uart, ChannelReports& reports);

    void configure(const wire::ImuConfiguration& configuration, Nanoseconds now);

    /// Its sync output rose: it takes a sample.
    void ready_edge(Nanoseconds at);

    /// Does what is due. True: `sample` holds a new sample; call again for more.
    bool poll(Nanoseconds now, wire::ImuSample& sample);

    Nanoseconds next_wake() const { return wake_; }

    static std::uint32_t true_rate(std::uint32_t wanted_millihertz);

 private:
    enum class State : std::uint8_t { off, set_up, running };
    enum class Step : std::uint8_t {
        quiet,
        no_text,
        no_binary1,
        no_binary2,
        no_binary3,
        baud,
        pulses,
        packets,
        go
    };
    static constexpr std::size_t max_line = 64;
    static constexpr std::size_t max_edges = 16;

    std::uint32_t divider() const;
    void begin_setup(Nanoseconds at);
    void send_step(Nanoseconds now);
    void next_step(Nanoseconds now);
    std::size_t line_length() const;
    bool take_line(Nanoseconds now);
    std::uint32_t wanted_baud() const;
    void set_baud(std::uint32_t baud);
    bool take_packet(Nanoseconds now, wire::ImuSample& sample);
    void stamp(Nanoseconds first_byte, Nanoseconds since_last, wire::ImuSample& sample);
    Nanoseconds count(std::uint64_t startup_ns);
    bool parse(Nanoseconds now, wire::ImuSample& sample);
    void drop(std::size_t size);
    void fail(wire::BoardEventKind kind, Nanoseconds now, std::int64_t value);

    ImuUart& uart_;
    wire::ImuConfiguration configuration_{};
    State state_ = State::off;
    std::uint32_t baud_ = 0;
    bool fast_first_;  ///< the part may still use the faster baud rate set earlier
    Step step_;
    bool waiting_;              ///< for the answer to the step
    Nanoseconds wake_ = never;  ///< the next attempt, or the end of patience
    Nanoseconds period_;
    Nanoseconds edges_[max_edges] = {};  ///< of the sync output, the newest first
    Nanoseconds stamp_ = 0;              ///< edge of the newest sample
    std::uint64_t startup_ns_;           ///< the part's clock at the newest sample; 0: none yet
    Nanoseconds received_;               ///< when the last of the bytes had arrived
    std::uint8_t bytes_[2 * vn100::packet_size];
    std::size_t filled_ = 0;
};

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// Jobs of the IMU's buses: they begin at an edge or at a time, and go on by interrupts.
#pragma once

#include "edge_port.hpp"
#include "wake_flag.hpp"

namespace versavis::rp2040 {

/// Runs one job at a time on SPI or I2C. The main loop arms it and takes the reply; from its start
/// to its end it runs in interrupts.
class ImuBusPort final : public firmware::ImuBus {
 public:
    ImuBusPort(BoardClock& clock, EdgePort& edges, WakeFlag& wake_flag)
        : clock_(clock), edges_(edges), wake_flag_(wake_flag) {}

    void set_up();

    bool arm(const firmware::ImuJob& job) override;
    bool take_reply(firmware::ImuReply& reply) override;
    void disarm() override;

    // From interrupts:
    void data_ready();
    void time_reached();
    void transferred();
    void i2c_moved();

 private:
    enum class State : std::uint8_t { idle, waits_for_edge, waits_for_time, transfers, done };
    enum class I2cAsks : std::uint8_t { nothing, begin, end };

    const firmware::ImuTransfer& transfer() const { return job_.transfers[index_]; }
    firmware::ImuReply& reply() { return replies_[index_]; }
    bool is_spi() const { return transfer().bus == firmware::ImuTransfer::Bus::spi; }
    void set_up_spi();
    void copy_job(const firmware::ImuJob& job);
    void choose_edge(unsigned pin);
    bool edge_latched() const;
    void forget_edge();
    void watch_edge(bool watch);
    void begin_when_free();
    void pause_from(Nanoseconds at);
    void begin_no_sooner_than(Nanoseconds at);
    void wait_until(Nanoseconds at);
    void set_alarm(Nanoseconds at);
    void cancel_alarm();
    void prepare();
    void use_shared_pins(Function function);
    void prepare_part();
    void begin();
    void begin_part();
    void begin_i2c();
    void feed_i2c();
    void end_i2c(bool refused);
    void end_transfer();

    BoardClock& clock_;
    EdgePort& edges_;
    WakeFlag& wake_flag_;
    volatile State state_ = State::idle;
    volatile I2cAsks i2c_asks_ = I2cAsks::nothing;  ///< by an interrupt that is more urgent
    volatile bool in_gap_ = false;                  ///< between two words of a transfer
    bool pausing_ = false;                          ///< `free_at_` may not have come yet
    Nanoseconds alarm_at_ = 0;
    bool alarm_is_step_ = false;  ///< on the way to that time
    Nanoseconds free_at_ = 0;     ///< when the next transfer may begin
    std::uint32_t started_us_ = 0;
    unsigned index_ = 0;        ///< of the transfer
    std::size_t position_ = 0;  ///< in its bytes
    std::size_t part_ = 0;      ///< of them, that goes on without a gap
    std::size_t received_ = 0;  ///< by I2C, after the first
    std::uint32_t spi_hz_ = 0;
    Function shared_pins_ = function_none;  ///< of the pins that SPI and I2C share
    unsigned taken_ = 0;
    std::uint32_t select_bit_ = 0;  ///< of the transfer's part; 0: on I2C
    unsigned edge_bank_ = 0;        ///< of the pin that starts the job
    std::uint32_t edge_bit_ = 0;
    firmware::ImuJob job_;
    firmware::ImuReply replies_[firmware::max_transfers];
};

}  // namespace versavis::rp2040

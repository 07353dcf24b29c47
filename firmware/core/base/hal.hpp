// SPDX-License-Identifier: BSD-3-Clause
// What the portable core needs from a board: time, scheduled outputs, stamped edges, routing, buses
// and a byte link. Each call says what it promises, and what happens when it comes late.
#pragma once

#include <cstddef>
#include <cstdint>

#include "wire/messages.hpp"

namespace versavis::firmware {

// For all calls: the core makes them from Board's constructor and from Board::poll(), never from an
// interrupt, and never two at once. None blocks. None takes longer than 20 us, interrupts not
// counted, unless it says so. Time passes while the core works, and hardware and interrupts go on
// between any two calls: what one call says may be old at the next.

/// Board time: since boot, 64 bits, never backwards. Edges, words and transfers are stamped on the
/// same clock.
using Nanoseconds = std::int64_t;

inline constexpr Nanoseconds never = INT64_MAX;
inline constexpr std::size_t camera_count = 4;

struct Clock64 {
    /// Within 1 us of the hardware's stamps.
    virtual Nanoseconds now() = 0;

 protected:
    ~Clock64() = default;
};

/// Bits of an output word. The triggers of cameras 0 to 3 are bits 0 to 3.
enum Output : std::uint8_t {
    output_light_gate = 4,  ///< the light may be on
    output_light_lead = 5,  ///< the light is on without an exposure
    output_sync = 6,
    output_test = 7,
    output_count = 8,
};

/// Output pins, driven by hardware from a queue of at least 48 words {time, levels}. Until the
/// first Routing::route() all of them are inputs: resistors on the board decide.
struct OutputSchedule {
    /// Takes a word that shall leave at `at`. Returns when it leaves, exactly: at `at`, or later if
    /// that is too soon for the hardware. never: the queue is full; Board::poll() is called when a
    /// word has left. `at` is a multiple of PortFacts::output_grain(), and at least output_step
    /// after the instant returned for the word before.
    virtual Nanoseconds push(Nanoseconds at, std::uint32_t levels) = 0;

 protected:
    ~OutputSchedule() = default;
};

/// Inputs whose edges are stamped. The exposure lines of cameras 0 to 3 are 0 to 3.
enum Input : std::uint8_t {
    input_imu_ready = 4,  ///< and 5 for the second IMU
    input_pulse = 6,      ///< + wire::PulseInput
    input_accel_ready = 10,
    input_count = 11,
};

inline constexpr bool is_data_ready(std::uint8_t input) {
    return input == input_imu_ready || input == input_imu_ready + 1 || input == input_accel_ready;
}

struct Edge {
    Nanoseconds at;
    std::uint8_t input;
    bool level;
};

/// Edges of the inputs, stamped by hardware; of data-ready inputs only rising ones. At least 256
/// wait. Board::poll() is called when one of another than a data-ready input has arrived, and when
/// half of the room is taken.
struct EdgeStream {
    /// Edges of inputs outside of the mask cost nothing and are not reported. The first edge of an
    /// input that is enabled again is a real change of its line after this call.
    virtual void listen(std::uint32_t inputs) = 0;
    /// The next edge, in the order of their stamps over all inputs. False: there is none, or edges
    /// between the last one and the next one were lost, which take_lost() then counts.
    virtual bool pop(Edge& edge) = 0;
    /// Once pop() has said false, and take_lost() 0: all edges stamped before this instant were
    /// popped or lost. At most 5 us before now().
    virtual Nanoseconds settled() = 0;
    /// Edges lost after the last one that was popped, and before the next one that will be, because
    /// they were not popped in time.
    virtual std::uint32_t take_lost() = 0;
    /// Result of the port's self-test of its stamps. While it fails, edges are lost.
    virtual wire::StampTest stamp_test() = 0;

 protected:
    ~EdgeStream() = default;
};

inline constexpr std::uint8_t not_routed = 0xFF;

/// What follows input levels directly, without waiting for code.
struct Routes {
    /// Camera whose exposure line drives the trigger of this one: active while it exposes.
    /// not_routed: the schedule drives it.
    std::uint8_t master[camera_count] = {not_routed, not_routed, not_routed, not_routed};
    std::uint8_t inverted_triggers = 0;   ///< bit mask: low is active, routed or not
    std::uint8_t inverted_exposures = 0;  ///< bit mask: low is exposing
    std::uint8_t light_cameras = 0;       ///< the light is gate and (lead or any of these exposes)
    bool light_inverted = false;
    Nanoseconds light_limit =
        0;  ///< after this long it goes off until the gate closes, even if the code hangs
    std::uint8_t test_input = not_routed;  ///< input that drives the test output; else the schedule
};

/// A routed output follows its inputs within this time.
inline constexpr Nanoseconds routing_latency_limit = 200;

struct Routing {
    struct Switched {
        /// From here on the new routes act; never: they do not, since a master of a slave that
        /// would be switched exposes. A master's exposure whose start is stamped from here on is
        /// passed on whole by the new routes, one stamped before by the old ones.
        Nanoseconds at = never;
        /// False: a master began meanwhile. A pulse of its slaves may be cut, or missing.
        bool clean = true;
    };
    /// `force`: even while a master exposes; its pulse is cut, and `clean` says so. The first one
    /// of all makes the outputs drive their pins, triggers at rest and the others low, and may take
    /// 400 us.
    virtual Switched route(const Routes& routes, bool force) = 0;

 protected:
    ~Routing() = default;
};

inline constexpr std::size_t max_transfer = 40;
inline constexpr std::size_t max_transfers = 3;

/// One exchange on a bus of the IMU. SPI: mode 3, in full duplex. I2C: writes the first byte, the
/// register; then writes the others, or reads as many.
struct ImuTransfer {
    enum class Bus : std::uint8_t { spi, i2c_write, i2c_read };
    Bus bus = Bus::spi;
    std::uint8_t chip = 0;          ///< SPI: chip select, 0 or 1; I2C: address
    std::uint8_t size = 0;          ///< bytes, both ways; of I2C the register included
    std::uint32_t clock_hz = 0;     ///< at most
    std::uint32_t word_gap_ns = 0;  ///< if not 0: deselected for this long after each 16-bit word
    std::uint8_t bytes[max_transfer] = {};
};

struct ImuReply {
    Nanoseconds started = 0;  ///< true start of the transfer
    Nanoseconds ended = 0;
    bool refused = false;  ///< I2C: not acknowledged, or the bus was held
    std::uint8_t bytes[max_transfer] = {};
};

/// Transfers that follow each other without code in between.
struct ImuJob {
    /// Data-ready input whose edge starts the job: the first one stamped after `after`, which may
    /// have come already. not_routed: it starts at `after`.
    std::uint8_t input = not_routed;
    Nanoseconds after = 0;
    /// At least, between two transfers, be they of this job or of the one before.
    Nanoseconds pause = 0;
    std::uint8_t count = 0;
    ImuTransfer transfers[max_transfers];
};

/// Buses of the IMU. Board::poll() is called when a job has ended.
struct ImuBus {
    /// Starts no sooner than the job asks for, and within 2 us when that is not in the past. False:
    /// not all replies of the job before were taken.
    virtual bool arm(const ImuJob& job) = 0;
    /// Once a job has ended, the replies to its transfers, one with each call that returns true. An
    /// I2C transfer that hangs ends by itself within 10 ms, an SPI transfer always does.
    virtual bool take_reply(ImuReply& reply) = 0;
    /// Cancels what is armed or under way, and forgets what is complete.
    virtual void disarm() = 0;

 protected:
    ~ImuBus() = default;
};

/// Asynchronous serial line, 8N1: the second IMU, or a GNSS receiver and time outputs. At least 256
/// bytes wait; later ones are lost. Board::poll() is called when bytes have arrived.
struct ImuUart {
    /// Bytes that are under way may be lost, unless the speed is what it was.
    virtual void set_baud(std::uint32_t baud) = 0;
    /// From now on the transmitter's line is low at rest, as RS-232 has it, or high, as at first.
    virtual void invert_transmitter(bool inverted) = 0;
    /// At most 80 bytes; what still waits to be sent is sent first.
    virtual void write(const std::uint8_t* data, std::size_t size) = 0;
    /// `received` is when the last of the bytes had arrived, to four characters. One call never
    /// spans a longer pause on the line.
    virtual std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) = 0;

 protected:
    ~ImuUart() = default;
};

/// What another SPI master reads from the board as if it were an ADIS16448.
struct ImuImage {
    std::uint16_t burst[13] =
        {};  ///< status, gyro, accelerometer, magnetometer, pressure, temperature, CRC
    std::uint16_t product = 0;
};

struct ImuOutput {
    /// A read that is under way ends with the image it began with; then the port pulses its
    /// data-ready line. A read that begins within 9 us after another ended may get the older image.
    virtual void publish(const ImuImage& image) = 0;

 protected:
    ~ImuOutput() = default;
};

/// The most that one packet of the host carries.
inline constexpr std::size_t link_packet_size = 64;

/// Bytes to and from the host. Board::poll() is called when some have arrived, when there is room
/// again after there was none, and when the byte that was asked about has left.
struct ByteLink {
    virtual std::size_t free_space() = 0;
    /// At most free_space() bytes.
    virtual void write(const std::uint8_t* data, std::size_t size) = 0;
    /// The bytes of one packet of the host, or none; `data` has room for link_packet_size.
    /// `received` is when they entered the board.
    virtual std::size_t read(std::uint8_t* data, Nanoseconds& received) = 0;
    /// Asks when the newest byte written leaves, which means acknowledged or, if the link knows no
    /// more, handed over. Only the newest question is answered; a link that does not know never
    /// answers.
    virtual void watch_departure() {}
    /// True, once: the byte asked about left at `at`, no later than the host could receive it. A
    /// port that learns of it by an interrupt subtracts how late that may be.
    virtual bool take_departure(Nanoseconds& /*at*/) { return false; }

 protected:
    ~ByteLink() = default;
};

/// Memory that survives a power cycle.
struct Persist {
    enum class Outcome : std::uint8_t { none, busy, stored, failed };

    /// Size of what was last stored, or 0. Only from Board's constructor; may take a millisecond.
    virtual std::size_t load(std::uint8_t* data, std::size_t capacity) = 0;
    /// Begins to store, which takes up to a second; the port keeps a copy. Without power meanwhile,
    /// what was stored before remains. False: the one before is not done.
    virtual bool store(const std::uint8_t* data, std::size_t size) = 0;
    /// How the newest store() went; `stored` and `failed` once.
    virtual Outcome take_outcome() = 0;

 protected:
    ~Persist() = default;
};

struct Rebooter {
    /// Triggers, light and sync end where they are. Does not return on a chip.
    virtual void reboot(bool to_boot_loader) = 0;

 protected:
    ~Rebooter() = default;
};

/// Resets the board when it has not been fed for a second.
struct Watchdog {
    virtual void feed() = 0;

 protected:
    ~Watchdog() = default;
};

/// What a port has, and how fine it is. They do not change.
struct PortFacts {
    std::uint32_t present = 0;                 ///< bits of wire::Present
    std::uint32_t fastest_imu_millihertz = 0;  ///< samples that it can read and pass on
    std::uint8_t output_grain_bits = 0;        ///< words leave at multiples of 2^this ns
    Nanoseconds output_step = 1;               ///< between two words, at least; on the grain

    Nanoseconds output_grain() const { return Nanoseconds{1} << output_grain_bits; }
};

struct Hal {
    Clock64& clock;
    OutputSchedule& outputs;
    EdgeStream& edges;
    Routing& routing;
    ImuBus& imu_bus;
    ImuUart& imu_uart;
    ImuOutput& imu_output;
    ByteLink& link;
    Persist& persist;
    Rebooter& rebooter;
    Watchdog& watchdog;
    PortFacts facts;
};

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// What the portable core needs from a board: time, scheduled outputs, stamped edges, routing, buses
// and a byte link.
#pragma once

#include <cstddef>
#include <cstdint>

namespace versavis::firmware {

/// Board time: since boot, 64 bits, never backwards.
using Nanoseconds = std::int64_t;

inline constexpr Nanoseconds never = INT64_MAX;
inline constexpr std::size_t camera_count = 4;

struct Clock64 {
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
};

/// Output pins, driven by hardware from a queue of {time, levels}.
struct OutputSchedule {
    /// False when the queue is full. Times must not decrease.
    virtual bool push(Nanoseconds at, std::uint32_t levels) = 0;

    struct Late {
        Nanoseconds asked;
        Nanoseconds left;
    };
    /// A word that left later than requested; each is reported once.
    virtual bool take_late(Late& late) = 0;

 protected:
    ~OutputSchedule() = default;
};

/// Inputs whose edges are stamped. The exposure lines of cameras 0 to 3 are 0 to 3.
enum Input : std::uint8_t {
    input_imu_ready = 4,  ///< and 5 for the second IMU
    input_pulse = 6,      ///< + wire::PulseInput
    input_count = 10,
};

struct Edge {
    Nanoseconds at;
    std::uint8_t input;
    bool level;
};

/// Edges of the inputs, stamped by hardware, in order; of data-ready inputs only rising ones.
struct EdgeStream {
    /// Edges of inputs outside of the mask cost nothing and are not reported.
    virtual void listen(std::uint32_t inputs) = 0;
    virtual bool pop(Edge& edge) = 0;
    /// Edges lost since the last call because they were not popped in time.
    virtual std::uint32_t take_lost() = 0;

 protected:
    ~EdgeStream() = default;
};

inline constexpr std::uint8_t not_routed = 0xFF;

/// What follows input levels directly, without waiting for code.
struct Routes {
    /// Camera whose exposure line drives the trigger of this one: active while it exposes.
    /// not_routed: the schedule drives it.
    std::uint8_t master[camera_count] = {not_routed, not_routed, not_routed, not_routed};
    std::uint8_t inverted_triggers = 0;   ///< bit mask: low is active, of routed triggers
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
    virtual void route(const Routes& routes) = 0;

 protected:
    ~Routing() = default;
};

inline constexpr std::size_t max_transfer = 40;

/// One exchange on the IMU's SPI bus, mode 3, in full duplex.
struct ImuTransfer {
    std::uint8_t chip = 0;          ///< chip select: 0 or 1
    std::uint8_t size = 0;          ///< bytes, both ways
    std::uint32_t clock_hz = 0;     ///< at most
    std::uint32_t word_gap_ns = 0;  ///< if not 0: deselected for this long after each 16-bit word
    std::uint8_t bytes[max_transfer] = {};
};

struct ImuReply {
    Nanoseconds started = 0;  ///< true start of the transfer
    std::uint8_t bytes[max_transfer] = {};
};

/// SPI bus of the IMU: a transfer starts at a time set in hardware, and completes later.
struct ImuBus {
    /// False while a transfer is set or under way.
    virtual bool start(Nanoseconds at, const ImuTransfer& transfer) = 0;
    virtual bool complete(ImuReply& reply) = 0;
    /// Cancels what is set or under way.
    virtual void abort() = 0;

 protected:
    ~ImuBus() = default;
};

/// Asynchronous serial line of the second IMU, 8N1. Never blocks.
struct ImuUart {
    virtual void set_baud(std::uint32_t baud) = 0;
    virtual void write(const std::uint8_t* data, std::size_t size) = 0;
    /// `received` is when the last of the bytes had arrived. One call never spans a pause on the
    /// line.
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
    /// data-ready line.
    virtual void publish(const ImuImage& image) = 0;

 protected:
    ~ImuOutput() = default;
};

/// Bytes to and from the host. Never blocks.
struct ByteLink {
    virtual std::size_t free_space() = 0;
    virtual void write(const std::uint8_t* data, std::size_t size) = 0;
    /// `received` is when the newest of the bytes entered the board.
    virtual std::size_t read(std::uint8_t* data, std::size_t capacity, Nanoseconds& received) = 0;
    /// Asks when the newest byte written leaves, which means acknowledged or, if the link knows no
    /// more, handed over. Only the newest question is answered; a link that cannot tell never
    /// answers.
    virtual void watch_departure() {}
    /// True, once: the byte asked about left at `at`, no later than the host could receive it.
    virtual bool take_departure(Nanoseconds& /*at*/) { return false; }

 protected:
    ~ByteLink() = default;
};

/// Memory that survives a power cycle.
struct Persist {
    /// Size of what was last stored, or 0.
    virtual std::size_t load(std::uint8_t* data, std::size_t capacity) = 0;
    virtual void store(const std::uint8_t* data, std::size_t size) = 0;

 protected:
    ~Persist() = default;
};

struct Rebooter {
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
};

}  // namespace versavis::firmware

// SPDX-License-Identifier: BSD-3-Clause
// Memory of an emulated GenICam camera: its features, what a transport has beside them, and the
// description that names them.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "camera_family.hpp"
#include "scenario.hpp"

namespace versavis::rig {

/// Addresses of features. Numbers are big-endian, unless the family says otherwise; registers of
/// the transport lie below.
enum Register : std::uint32_t {
    reg_width = 0x10000,
    reg_height = 0x10004,
    reg_pixel_format = 0x10008,
    reg_payload_size = 0x1000C,
    reg_acquisition_mode = 0x10010,
    reg_acquisition_start = 0x10014,
    reg_acquisition_stop = 0x10018,
    reg_frame_rate = 0x1001C,  ///< float, like all numbers that are not whole
    reg_trigger_selector = 0x10020,
    reg_trigger_mode = 0x10024,
    reg_trigger_source = 0x10028,
    reg_trigger_activation = 0x1002C,
    reg_trigger_overlap = 0x10030,
    reg_trigger_software = 0x10034,
    reg_exposure_mode = 0x10038,
    reg_exposure_time = 0x1003C,
    reg_exposure_auto = 0x10040,
    reg_gain = 0x10044,
    reg_line_selector = 0x10048,
    reg_line_mode = 0x1004C,
    reg_line_source = 0x10050,
    reg_tl_params_locked = 0x10054,
    reg_offset = 0x10058,
    reg_fire_test_packet = 0x1005C,
    reg_chunk_mode = 0x10060,
    reg_chunk_selector = 0x10064,
    reg_chunk_enable = 0x10068,
    reg_temperature = 0x1006C,
    reg_exposure_limit = 0x10070,
    reg_event_selector = 0x10074,
    reg_event_notification = 0x10078,  ///< one register for each event
    reg_gain_auto = 0x10090,
    reg_ptp_enable = 0x10094,
    reg_ptp_slave_only = 0x10098,
    reg_ptp_latch = 0x1009C,  ///< what follows is of its newest write
    reg_ptp_status = 0x100A0,
    reg_ptp_offset = 0x100A4,
    reg_ptp_grandmaster = 0x100A8,
    reg_clock_latch = 0x100AC,
    reg_action_selector = 0x100B0,

    reg_model = 0x11000,  ///< from here on, what a model has of its own
    reg_xml = 0x20000,
};

constexpr std::uint32_t pixel_format_mono8 = 0x01080001;

/// What a transport adds to the features.
struct TransportMemory {
    std::vector<std::uint8_t> registers;         ///< its own after power-up, from address 0 on
    std::string description;                     ///< as it lies at reg_xml
    std::endian chunk_order = std::endian::big;  ///< of the ids and lengths of chunks
};

/// Thread-safe.
class CameraRegisters {
 public:
    CameraRegisters(const CameraScenario& settings, const CameraFamily& family,
                    TransportMemory transport);

    /// Puts all registers into their state after power-up.
    void reset();

    /// False: no such register.
    bool read(std::uint64_t address, std::span<std::uint8_t> out) const;
    bool write(std::uint64_t address, std::span<const std::uint8_t> in);
    bool write(std::uint32_t address, std::uint32_t value);

    /// Frames have this size from now on.
    void resize(std::uint32_t width, std::uint32_t height);

    std::uint32_t value(std::uint32_t address) const;
    float real(Register address) const;

    /// Registers that the model gives a meaning. None: 0.
    double number(const std::optional<Field>& field) const;
    void set_number(const Field& field, double value);
    bool all(const FieldValues& values) const;  ///< none: false
    bool any(const FieldValues& values) const;  ///< none: false

    /// The model does not let it be written now.
    bool locked(std::uint32_t address, bool acquiring) const;

 private:
    // Under the lock.
    void set(std::uint32_t address, std::uint32_t value);
    std::uint32_t peek(std::uint32_t address) const;
    std::uint64_t raw(const Field& field) const;
    double get(const Field& field) const;
    void put(const Field& field, double value);
    bool holds(const FieldValues& values) const;
    void load_user_set(bool factory);
    void settle();

    CameraScenario settings_;
    CameraFamily family_;
    TransportMemory transport_;
    mutable std::mutex mutex_;
    std::vector<std::uint8_t> memory_;
    std::array<std::uint32_t, 2> line_modes_{};  ///< of the lines that are not selected
};

/// What the registers of the rig's own camera mean.
CameraFamily rig_family();

}  // namespace versavis::rig

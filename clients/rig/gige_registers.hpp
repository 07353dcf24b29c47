// SPDX-License-Identifier: BSD-3-Clause
// Register space of an emulated GigE Vision camera: bootstrap registers, features, and the XML that
// names them.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "camera_family.hpp"
#include "gige_hostile.hpp"

namespace versavis::rig {

/// Addresses of GigE Vision bootstrap registers (GigE Vision specification 1.2, chapter 28) and of
/// our features.
enum Register : std::uint32_t {
    reg_version = 0x0000,
    reg_device_mode = 0x0004,
    reg_mac_high = 0x0008,
    reg_mac_low = 0x000C,
    reg_current_ip = 0x0024,
    reg_current_mask = 0x0034,
    reg_vendor = 0x0048,
    reg_model_name = 0x0068,
    reg_device_version = 0x0088,
    reg_vendor_info = 0x00A8,
    reg_serial = 0x00D8,
    reg_user_name = 0x00E8,
    reg_xml_url = 0x0200,
    reg_interface_count = 0x0600,
    reg_message_count = 0x0900,
    reg_stream_count = 0x0904,
    reg_capabilities = 0x0934,
    reg_heartbeat_ms = 0x0938,
    reg_tick_high = 0x093C,
    reg_tick_low = 0x0940,
    reg_control_privilege = 0x0A00,
    reg_message_port = 0x0B00,
    reg_message_address = 0x0B10,
    reg_stream_port = 0x0D00,
    reg_stream_packet_size = 0x0D04,
    reg_stream_packet_delay = 0x0D08,
    reg_stream_address = 0x0D18,
    reg_stream_source_port = 0x0D1C,

    reg_width = 0x10000,
    reg_height = 0x10004,
    reg_pixel_format = 0x10008,
    reg_payload_size = 0x1000C,
    reg_acquisition_mode = 0x10010,
    reg_acquisition_start = 0x10014,
    reg_acquisition_stop = 0x10018,
    reg_frame_rate = 0x1001C,  ///< float, big-endian, like all floats here
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

    reg_model = 0x11000,  ///< from here on, what a model has of its own
    reg_xml = 0x20000,
};

inline constexpr std::uint32_t gige_default_heartbeat_ms = 3000;

/// Thread-safe.
class GigeRegisters {
 public:
    struct Identity {
        std::string address;
        std::string serial;
        std::string name;
        std::uint32_t width;
        std::uint32_t height;
        double exposure_us;
        bool exposure_auto;
        bool gain_auto = false;
        double temperature_c = 45;
        bool events = true;
        Hostility hostility = Hostility::none;
    };
    GigeRegisters(const Identity& identity, const CameraFamily& family);

    /// Puts all registers into their state after power-up.
    void reset();

    /// False: no such register.
    bool read(std::uint32_t address, std::uint32_t& value) const;
    bool write(std::uint32_t address, std::uint32_t value);
    bool read(std::uint32_t address, std::span<std::uint8_t> out) const;

    /// Frames have this size from now on.
    void resize(std::uint32_t width, std::uint32_t height);

    std::uint32_t value(Register address) const;
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
    double get(const Field& field) const;
    void put(const Field& field, double value);
    bool holds(const FieldValues& values) const;
    void set_text(Register address, const std::string& text, std::size_t capacity);
    void load_user_set(bool factory);
    void settle();

    Identity identity_;
    CameraFamily family_;
    GigeDescription description_;
    mutable std::mutex mutex_;
    std::vector<std::uint8_t> memory_;
    std::array<std::uint32_t, 2> line_modes_{};  ///< of the lines that are not selected
};

/// What the registers of the rig's own camera mean.
CameraFamily rig_family();

/// The GenICam description of these registers.
std::string gige_xml(std::uint32_t width, std::uint32_t height,
                     const CameraFamily& family = rig_family());

}  // namespace versavis::rig

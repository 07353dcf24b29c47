// SPDX-License-Identifier: BSD-3-Clause
// Register space of an emulated USB3 Vision camera: bootstrap registers (little-endian), features
// (big-endian, as the XML says), and the XML that names them.
#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <vector>

namespace versavis::test {

/// Addresses of GenCP's ABRM, of USB3 Vision's SBRM, SIRM and manifest table, and of our features.
enum Register : std::uint32_t {
    abrm_gencp_version = 0x0000,
    abrm_vendor = 0x0004,
    abrm_model = 0x0044,
    abrm_family = 0x0084,
    abrm_device_version = 0x00C4,
    abrm_vendor_info = 0x0104,
    abrm_serial = 0x0144,
    abrm_user_name = 0x0184,
    abrm_capability = 0x01C4,
    abrm_response_ms = 0x01CC,
    abrm_manifest = 0x01D0,
    abrm_sbrm = 0x01D8,
    abrm_timestamp = 0x01F0,
    abrm_timestamp_latch = 0x01F8,
    abrm_timestamp_increment = 0x01FC,

    sbrm_version = 0x1000,
    sbrm_capability = 0x1004,
    sbrm_max_command = 0x1014,
    sbrm_max_acknowledge = 0x1018,
    sbrm_stream_channels = 0x101C,
    sbrm_sirm = 0x1020,
    sbrm_sirm_length = 0x1028,
    sbrm_speed = 0x1040,

    sirm_info = 0x2000,
    sirm_control = 0x2004,
    sirm_required_payload = 0x2008,
    sirm_required_leader = 0x2010,
    sirm_required_trailer = 0x2014,
    sirm_max_leader = 0x2018,
    sirm_payload_size = 0x201C,
    sirm_payload_count = 0x2020,
    sirm_transfer1_size = 0x2024,
    sirm_transfer2_size = 0x2028,
    sirm_max_trailer = 0x202C,

    manifest = 0x3000,

    reg_width = 0x10000,
    reg_height = 0x10004,
    reg_pixel_format = 0x10008,
    reg_payload_size = 0x1000C,
    reg_acquisition_mode = 0x10010,
    reg_acquisition_start = 0x10014,
    reg_acquisition_stop = 0x10018,
    reg_frame_rate = 0x1001C,
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

    reg_xml = 0x20000,
};

/// Thread-safe.
class U3vRegisters {
 public:
    struct Identity {
        std::string vendor;
        std::string model;
        std::string serial;
        std::uint32_t width;
        std::uint32_t height;
        std::uint32_t alignment_log2 = 0;
        std::uint32_t response_ms = 100;
    };
    explicit U3vRegisters(const Identity& identity);

    /// Puts all registers into their state after power-up.
    void reset();

    /// False: no such register.
    bool read(std::uint64_t address, std::span<std::uint8_t> out) const;
    enum class Written { done, read_only, no_such };
    Written write(std::uint64_t address, std::span<const std::uint8_t> in);

    /// A bootstrap register.
    std::uint32_t bootstrap(Register address) const;
    void set_bootstrap(Register address, std::uint64_t value, std::size_t size);
    /// A feature.
    std::uint32_t value(Register address) const;
    float real(Register address) const;

 private:
    void put(Register address, std::uint64_t value, std::size_t size);
    void put_feature(Register address, std::uint32_t value);
    void put_text(Register address, const std::string& text);
    std::uint32_t feature(Register address) const;
    void update_payload();

    Identity identity_;
    mutable std::mutex mutex_;
    std::vector<std::uint8_t> memory_;
};

/// The GenICam description of these registers.
std::string u3v_xml(std::uint32_t width, std::uint32_t height);

}  // namespace versavis::test

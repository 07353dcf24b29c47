// SPDX-License-Identifier: BSD-3-Clause
#include "gige_registers.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <cstring>

#include "bytes.hpp"
#include "camera_transport.hpp"
#include "camera_xml.hpp"
#include "genicam_camera.hpp"
#include "gige_hostile.hpp"

namespace versavis::rig {

namespace {

constexpr std::size_t bootstrap_size = 0x1000;
constexpr std::uint32_t default_heartbeat_ms = 3000;
constexpr std::uint32_t tick_frequency = 1'000'000'000;
constexpr std::uint32_t capability_write_memory = 1U << 1U;
constexpr std::uint32_t capability_resend = 1U << 2U;
constexpr std::uint32_t capability_action = 1U << 6U;
constexpr std::uint32_t capability_scheduled_action = 1U << 17U;
constexpr std::uint32_t capability_ptp = 1U << 19U;

void add_events(XmlWriter& xml) {
    const std::pair<const char*, CameraEventId> events[] = {
        {"ExposureStart", CameraEventId::exposure_start},
        {"ExposureEnd", CameraEventId::exposure_end},
        {"FrameTriggerMissed", CameraEventId::trigger_missed},
        {"PtpSyncLost", CameraEventId::ptp_lost},
        {"PtpSyncLocked", CameraEventId::ptp_locked}};
    XmlWriter::Entries entries;
    for (const auto& [name, id] : events) {
        entries.emplace_back(name, event_index(id));
        xml.event(name, static_cast<std::uint32_t>(id));
    }
    xml.enumeration("EventSelector", reg_event_selector, entries);
    xml.enumeration("EventNotification", reg_event_notification, {{"Off", 0}, {"On", 1}},
                    "EventSelector");
}

void add_ptp_and_actions(XmlWriter& xml) {
    xml.boolean("PtpEnable", reg_ptp_enable);
    xml.boolean("PtpSlaveOnly", reg_ptp_slave_only);
    xml.command("PtpDataSetLatch", reg_ptp_latch);
    xml.enumeration("PtpStatus", reg_ptp_status,
                    {{"Initializing", 0},
                     {"Faulty", 1},
                     {"Disabled", static_cast<std::uint32_t>(PtpPort::disabled)},
                     {"Listening", static_cast<std::uint32_t>(PtpPort::listening)},
                     {"PreMaster", 4},
                     {"Master", static_cast<std::uint32_t>(PtpPort::master)},
                     {"Passive", 6},
                     {"Uncalibrated", static_cast<std::uint32_t>(PtpPort::uncalibrated)},
                     {"Slave", static_cast<std::uint32_t>(PtpPort::slave)}});
    xml.integer("PtpOffsetFromMaster", reg_ptp_offset, "", false);
    xml.integer("PtpGrandmasterClockID", reg_ptp_grandmaster, "", false);
    xml.command("TimestampLatch", reg_clock_latch);
    xml.wide_integer("TimestampLatchValue", reg_clock_latched);
    const std::string any = "<Min>0</Min><Max>4294967295</Max>";
    xml.integer("ActionDeviceKey", reg_action_device_key, any);
    xml.integer("ActionSelector", reg_action_selector, "<Min>0</Min><Max>0</Max>");
    xml.integer("ActionGroupKey", reg_action_group_key, any);
    xml.integer("ActionGroupMask", reg_action_group_mask, any);
    xml.integer("ActionQueueSize", reg_action_queue_size, "", false);
}

}  // namespace

std::string gige_xml(std::uint32_t width, std::uint32_t height, const CameraFamily& family) {
    XmlWriter xml;
    xml.text("DeviceVendorName", reg_vendor, 32);
    xml.text("DeviceModelName", reg_model_name, 32);
    xml.text("DeviceVersion", reg_device_version, 32);
    xml.text("DeviceSerialNumber", reg_serial, 16);
    xml.text("DeviceUserID", reg_user_name, 16);
    xml.features(width, height, family);
    xml.integer("GevSCPSPacketSize", reg_stream_packet_size, "<Min>256</Min><Max>16000</Max>");
    xml.command("GevSCPSFireTestPacket", reg_fire_test_packet);
    xml.integer("GevSCPD", reg_stream_packet_delay, "<Min>0</Min><Max>4294967295</Max>");
    xml.integer("GevTimestampTickFrequency", reg_tick_low, "", false);
    if (family.nodes.empty()) add_events(xml);
    if (family.nodes.empty()) add_ptp_and_actions(xml);
    return xml.document("GEV", family);
}

TransportMemory gige_memory(const CameraScenario& settings, const CameraFamily& family) {
    const GigeDescription description = describe_camera(
        settings.hostility, gige_xml(settings.width, settings.height, family), reg_xml);
    TransportMemory memory{std::vector<std::uint8_t>(bootstrap_size), description.bytes};
    const auto set = [&](GigeRegister address, std::uint32_t value) {
        store_number(std::span(memory.registers).subspan(address, sizeof value), value,
                     std::endian::big);
    };
    const auto set_text = [&](GigeRegister address, const std::string& text, std::size_t capacity) {
        std::memcpy(memory.registers.data() + address, text.data(),
                    std::min(text.size(), capacity - 1));
    };
    const std::uint32_t ip = ntohl(inet_addr(settings.address.c_str()));
    set(reg_version, 0x00010002);
    set(reg_device_mode, 0x80000001);  // big-endian, UTF-8
    set(reg_mac_high, 0x0200);         // locally administered
    set(reg_mac_low, ip);
    set(reg_current_ip, ip);
    set(reg_current_mask, 0xFF000000);
    set_text(reg_vendor, family.vendor, 32);
    set_text(reg_model_name, family.model, 32);
    set_text(reg_device_version, "1.0", 32);
    set_text(reg_serial, settings.serial, 16);
    set_text(reg_user_name, settings.name, 16);
    set_text(reg_xml_url, description.url, 512);
    set(reg_interface_count, 1);
    set(reg_message_count, settings.events ? 1 : 0);
    set(reg_stream_count, 1);
    set(reg_capabilities, capability_write_memory | capability_resend | capability_action |
                              capability_scheduled_action | capability_ptp);
    set(reg_action_queue_size, GenicamCamera::action_queue_size);
    set(reg_heartbeat_ms, default_heartbeat_ms);
    set(reg_tick_low, tick_frequency);
    set(reg_stream_packet_size, 1500);
    return memory;
}

}  // namespace versavis::rig

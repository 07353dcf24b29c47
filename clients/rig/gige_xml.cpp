// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <utility>

#include "event_sender.hpp"
#include "gige_registers.hpp"

namespace versavis::rig {

namespace {

using Entries = std::vector<std::pair<std::string, std::uint32_t>>;

/// Collects feature nodes and the category that lists them.
class XmlWriter {
 public:
    void integer(const std::string& name, Register address, const std::string& range,
                 bool writable = true) {
        list(name);
        nodes_ += fmt::format("<Integer Name=\"{0}\"><pValue>{0}Register</pValue>{1}</Integer>\n",
                              name, range);
        int_register(name, address, writable);
    }

    void real(const std::string& name, Register address, const std::string& unit, double minimum,
              double maximum) {
        list(name);
        nodes_ += fmt::format(
            "<Float "
            "Name=\"{0}\"><pValue>{0}Register</pValue><Min>{1}</Min><Max>{2}</Max><Unit>{3}</"
            "Unit></Float>\n"
            "<FloatReg "
            "Name=\"{0}Register\"><Address>{4:#x}</Address><Length>4</Length><AccessMode>RW</"
            "AccessMode>"
            "<pPort>Device</pPort><Endianess>BigEndian</Endianess></FloatReg>\n",
            name, minimum, maximum, unit, std::uint32_t{address});
    }

    void enumeration(const std::string& name, Register address, const Entries& entries) {
        list(name);
        nodes_ += fmt::format("<Enumeration Name=\"{}\">\n", name);
        for (const auto& [entry, value] : entries)
            nodes_ +=
                fmt::format("<EnumEntry Name=\"{}\"><Value>{}</Value></EnumEntry>\n", entry, value);
        nodes_ += fmt::format("<pValue>{}Register</pValue></Enumeration>\n", name);
        int_register(name, address, true);
    }

    void command(const std::string& name, Register address) {
        list(name);
        nodes_ += fmt::format(
            "<Command "
            "Name=\"{0}\"><pValue>{0}Register</pValue><CommandValue>1</CommandValue></Command>\n",
            name);
        int_register(name, address, true);
    }

    void text(const std::string& name, Register address, unsigned length) {
        list(name);
        nodes_ += fmt::format(
            "<StringReg "
            "Name=\"{}\"><Address>{:#x}</Address><Length>{}</Length><AccessMode>RO</AccessMode>"
            "<pPort>Device</pPort></StringReg>\n",
            name, std::uint32_t{address}, length);
    }

    void boolean(const std::string& name, Register address) {
        list(name);
        nodes_ +=
            fmt::format("<Boolean Name=\"{0}\"><pValue>{0}Register</pValue></Boolean>\n", name);
        int_register(name, address, true);
    }

    /// One register for each value of the selector.
    void selected(const std::string& name, Register address, const std::string& selector,
                  const Entries& entries) {
        list(name);
        nodes_ += fmt::format("<Enumeration Name=\"{}\">\n", name);
        for (const auto& [entry, value] : entries)
            nodes_ +=
                fmt::format("<EnumEntry Name=\"{}\"><Value>{}</Value></EnumEntry>\n", entry, value);
        nodes_ += fmt::format(
            "<pValue>{0}Register</pValue></Enumeration>\n<IntReg Name=\"{0}Register\"><Address>"
            "{1:#x}</Address><pIndex Offset=\"4\">{2}Register</pIndex><Length>4</Length>"
            "<AccessMode>RW</AccessMode><pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>"
            "BigEndian</Endianess></IntReg>\n",
            name, std::uint32_t{address}, selector);
    }

    void event(const std::string& name, CameraEventId id) {
        nodes_ += fmt::format("<Port Name=\"Event{}Port\"><EventID>{:x}</EventID></Port>\n", name,
                              static_cast<std::uint16_t>(id));
    }

    void chunk_real(const std::string& name, std::uint32_t id) {
        list(name);
        nodes_ += fmt::format(
            "<Float Name=\"{0}\"><pValue>{0}Register</pValue></Float>\n<FloatReg "
            "Name=\"{0}Register\"><Address>0</Address><Length>4</Length><AccessMode>RO</AccessMode>"
            "<pPort>{0}Port</pPort><Endianess>BigEndian</Endianess></FloatReg>\n<Port "
            "Name=\"{0}Port\"><ChunkID>{1:x}</ChunkID></Port>\n",
            name, id);
    }

    /// Nodes that are written already, with a category of all that they offer.
    void group(const std::string& category, const std::string& nodes) {
        list(category);
        nodes_ += nodes;
    }

    std::string document(const CameraFamily& family) const {
        return fmt::format(
            "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
            "<RegisterDescription ModelName=\"{}\" VendorName=\"{}\" "
            "ToolTip=\"Emulated "
            "camera\" "
            "StandardNameSpace=\"GEV\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" "
            "SchemaSubMinorVersion=\"0\" "
            "MajorVersion=\"1\" MinorVersion=\"0\" SubMinorVersion=\"0\" "
            "ProductGuid=\"7A1B6F3E-0F5C-4A53-9F5E-1D2B3C4D5E6F\" "
            "VersionGuid=\"8B2C7F4E-1A6D-4B64-8A6F-2E3C4D5E6F70\" "
            "xmlns=\"http://www.genicam.org/GenApi/Version_1_0\" "
            "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
            "xsi:schemaLocation=\"http://www.genicam.org/GenApi/Version_1_0 "
            "GenApiSchema_Version_1_0.xsd\">\n"
            "<Category Name=\"Root\" NameSpace=\"Standard\">\n{}</Category>\n{}"
            "<Port Name=\"Device\" NameSpace=\"Standard\"/>\n</RegisterDescription>\n",
            family.model, family.vendor, root_, nodes_);
    }

 private:
    void list(const std::string& name) { root_ += fmt::format("<pFeature>{}</pFeature>\n", name); }

    void int_register(const std::string& name, Register address, bool writable) {
        nodes_ += fmt::format(
            "<IntReg "
            "Name=\"{}Register\"><Address>{:#x}</Address><Length>4</Length><AccessMode>{}</"
            "AccessMode>"
            "<pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>\n",
            name, std::uint32_t{address}, writable ? "RW" : "RO");
    }

    std::string root_;
    std::string nodes_;
};

std::string fixed(std::uint32_t value) {
    return fmt::format("<Min>{0}</Min><Max>{0}</Max>", value);
}

/// What all models have: names, frames and the stream.
void add_frames_and_stream(XmlWriter& xml, std::uint32_t width, std::uint32_t height) {
    xml.text("DeviceVendorName", reg_vendor, 32);
    xml.text("DeviceModelName", reg_model_name, 32);
    xml.text("DeviceVersion", reg_device_version, 32);
    xml.text("DeviceSerialNumber", reg_serial, 16);
    xml.text("DeviceUserID", reg_user_name, 16);
    xml.integer("SensorWidth", reg_width, "", false);
    xml.integer("SensorHeight", reg_height, "", false);
    xml.integer("Width", reg_width, fixed(width), false);
    xml.integer("Height", reg_height, fixed(height), false);
    xml.integer("OffsetX", reg_offset, fixed(0), false);
    xml.integer("OffsetY", reg_offset, fixed(0), false);
    xml.enumeration("PixelFormat", reg_pixel_format, {{"Mono8", 0x01080001}});
    xml.integer("PayloadSize", reg_payload_size, "", false);
    xml.enumeration("AcquisitionMode", reg_acquisition_mode,
                    {{"SingleFrame", 1}, {"Continuous", 2}});
    xml.command("AcquisitionStart", reg_acquisition_start);
    xml.command("AcquisitionStop", reg_acquisition_stop);
    xml.real("DeviceTemperature", reg_temperature, "C", -100, 200);
    xml.integer("GevSCPSPacketSize", reg_stream_packet_size, "<Min>256</Min><Max>16000</Max>");
    xml.command("GevSCPSFireTestPacket", reg_fire_test_packet);
    xml.integer("GevSCPD", reg_stream_packet_delay, "<Min>0</Min><Max>4294967295</Max>");
    xml.integer("GevTimestampTickFrequency", reg_tick_low, "", false);
}

/// What the rig's own camera has beside it.
void add_rig_camera(XmlWriter& xml, const CameraFamily& family) {
    xml.real("AcquisitionFrameRate", reg_frame_rate, "Hz", 0.1, 1000);
    xml.enumeration("TriggerSelector", reg_trigger_selector, {{"FrameStart", 0}});
    xml.enumeration("TriggerMode", reg_trigger_mode, {{"Off", 0}, {"On", 1}});
    xml.enumeration("TriggerSource", reg_trigger_source, {{"Software", 0}, {"Line0", 1}});
    xml.enumeration("TriggerActivation", reg_trigger_activation,
                    {{"RisingEdge", 0}, {"FallingEdge", 1}});
    xml.enumeration("TriggerOverlap", reg_trigger_overlap, {{"Off", 0}, {"ReadOut", 1}});
    xml.command("TriggerSoftware", reg_trigger_software);
    xml.enumeration("ExposureMode", reg_exposure_mode, {{"Timed", 0}, {"TriggerWidth", 1}});
    xml.real("ExposureTime", reg_exposure_time, "us", 10, 1e7);
    xml.enumeration("ExposureAuto", reg_exposure_auto, {{"Off", 0}, {"Continuous", 2}});
    xml.real("AutoExposureExposureTimeUpperLimit", reg_exposure_limit, "us", 10, 1e7);
    xml.real("Gain", reg_gain, "dB", 0, 48);
    xml.enumeration("GainAuto", reg_gain_auto, {{"Off", 0}, {"Continuous", 2}});
    xml.enumeration("LineSelector", reg_line_selector, {{"Line0", 0}, {"Line1", 1}});
    xml.enumeration("LineMode", reg_line_mode, {{"Input", 0}, {"Output", 1}});
    xml.enumeration("LineSource", reg_line_source, {{"Off", 0}, {"ExposureActive", 1}});
    xml.boolean("ChunkModeActive", reg_chunk_mode);
    xml.enumeration("ChunkSelector", reg_chunk_selector, {{"ExposureTime", 0}, {"Gain", 1}});
    xml.boolean("ChunkEnable", reg_chunk_enable);
    xml.chunk_real("ChunkExposureTime", family.exposure_chunk);
    xml.chunk_real("ChunkGain", family.gain_chunk);
    xml.enumeration("EventSelector", reg_event_selector,
                    {{"ExposureStart", 0},
                     {"ExposureEnd", 1},
                     {"FrameTriggerMissed", 2},
                     {"PtpSyncLost", 3},
                     {"PtpSyncLocked", 4}});
    xml.selected("EventNotification", reg_event_notification, "EventSelector",
                 {{"Off", 0}, {"On", 1}});
    xml.event("ExposureStart", CameraEventId::exposure_start);
    xml.event("ExposureEnd", CameraEventId::exposure_end);
    xml.event("FrameTriggerMissed", CameraEventId::trigger_missed);
    xml.event("PtpSyncLost", CameraEventId::ptp_lost);
    xml.event("PtpSyncLocked", CameraEventId::ptp_locked);
    xml.integer("TLParamsLocked", reg_tl_params_locked, "<Min>0</Min><Max>1</Max>");
}

}  // namespace

std::string gige_xml(std::uint32_t width, std::uint32_t height, const CameraFamily& family) {
    XmlWriter xml;
    add_frames_and_stream(xml, width, height);
    if (family.nodes.empty())
        add_rig_camera(xml, family);
    else
        xml.group("Model", family.nodes);
    return xml.document(family);
}

}  // namespace versavis::rig

// SPDX-License-Identifier: BSD-3-Clause
#include "camera_xml.hpp"

#include <fmt/format.h>

#include "camera_registers.hpp"

namespace versavis::rig {

namespace {

std::string fixed(std::uint32_t value) {
    return fmt::format("<Min>{0}</Min><Max>{0}</Max>", value);
}

std::string at(std::uint32_t address) { return fmt::format("<Address>{:#x}</Address>", address); }

}  // namespace

void XmlWriter::list(const std::string& name) {
    root_ += fmt::format("<pFeature>{}</pFeature>\n", name);
}

/// The one that the feature of this name takes its value from.
void XmlWriter::add_register(const char* kind, const std::string& name, const std::string& address,
                             const char* access, const std::string& port) {
    const bool integer = std::string_view(kind) == "IntReg";
    nodes_ += fmt::format(
        "<{0} Name=\"{1}Register\">{2}<Length>4</Length><AccessMode>{3}</AccessMode>"
        "<pPort>{4}</pPort>{5}<Endianess>BigEndian</Endianess></{0}>\n",
        kind, name, address, access, port, integer ? "<Sign>Unsigned</Sign>" : "");
}

void XmlWriter::feature(const char* kind, const std::string& name, const std::string& before,
                        const std::string& after) {
    list(name);
    nodes_ += fmt::format("<{0} Name=\"{1}\">{2}<pValue>{1}Register</pValue>{3}</{0}>\n", kind,
                          name, before, after);
}

void XmlWriter::text(const std::string& name, std::uint32_t address, unsigned length) {
    list(name);
    nodes_ += fmt::format(
        "<StringReg Name=\"{}\">{}<Length>{}</Length><AccessMode>RO</AccessMode>"
        "<pPort>Device</pPort></StringReg>\n",
        name, at(address), length);
}

void XmlWriter::integer(const std::string& name, std::uint32_t address, const std::string& range,
                        bool writable) {
    feature("Integer", name, "", range);
    add_register("IntReg", name, at(address), writable ? "RW" : "RO");
}

void XmlWriter::real(const std::string& name, std::uint32_t address, const std::string& unit,
                     double minimum, double maximum) {
    feature("Float", name, "",
            fmt::format("<Min>{}</Min><Max>{}</Max><Unit>{}</Unit>", minimum, maximum, unit));
    add_register("FloatReg", name, at(address), "RW");
}

void XmlWriter::enumeration(const std::string& name, std::uint32_t address, const Entries& entries,
                            const std::string& selector) {
    std::string nodes;
    for (const auto& [entry, value] : entries)
        nodes +=
            fmt::format("<EnumEntry Name=\"{}\"><Value>{}</Value></EnumEntry>\n", entry, value);
    feature("Enumeration", name, nodes);
    const std::string index =
        selector.empty() ? "" : fmt::format("<pIndex Offset=\"4\">{}Register</pIndex>", selector);
    add_register("IntReg", name, at(address) + index, "RW");
}

void XmlWriter::command(const std::string& name, std::uint32_t address) {
    feature("Command", name, "", "<CommandValue>1</CommandValue>");
    add_register("IntReg", name, at(address), "RW");
}

void XmlWriter::boolean(const std::string& name, std::uint32_t address) {
    feature("Boolean", name);
    add_register("IntReg", name, at(address), "RW");
}

void XmlWriter::wide_integer(const std::string& name, std::uint32_t address) {
    feature("Integer", name);
    nodes_ += fmt::format(
        "<IntReg Name=\"{}Register\">{}<Length>8</Length><AccessMode>RO</AccessMode>"
        "<pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>\n",
        name, at(address));
}

void XmlWriter::event(const std::string& name, std::uint32_t id) {
    nodes_ += fmt::format("<Port Name=\"Event{}Port\"><EventID>{:x}</EventID></Port>\n", name, id);
}

void XmlWriter::chunk_real(const std::string& name, std::uint32_t id) {
    feature("Float", name);
    add_register("FloatReg", name, at(0), "RO", name + "Port");
    nodes_ += fmt::format("<Port Name=\"{}Port\"><ChunkID>{:x}</ChunkID></Port>\n", name, id);
}

void XmlWriter::frame_features(std::uint32_t width, std::uint32_t height) {
    integer("SensorWidth", reg_width, "", false);
    integer("SensorHeight", reg_height, "", false);
    integer("Width", reg_width, fixed(width), false);
    integer("Height", reg_height, fixed(height), false);
    integer("OffsetX", reg_offset, fixed(0), false);
    integer("OffsetY", reg_offset, fixed(0), false);
    enumeration("PixelFormat", reg_pixel_format, {{"Mono8", pixel_format_mono8}});
    integer("PayloadSize", reg_payload_size, "", false);
    enumeration("AcquisitionMode", reg_acquisition_mode, {{"SingleFrame", 1}, {"Continuous", 2}});
    command("AcquisitionStart", reg_acquisition_start);
    command("AcquisitionStop", reg_acquisition_stop);
    real("DeviceTemperature", reg_temperature, "C", -100, 200);
}

/// What the rig's own camera has beside frames.
void XmlWriter::rig_features(const CameraFamily& family) {
    real("AcquisitionFrameRate", reg_frame_rate, "Hz", 0.1, 1000);
    enumeration("TriggerSelector", reg_trigger_selector, {{"FrameStart", 0}});
    enumeration("TriggerMode", reg_trigger_mode, {{"Off", 0}, {"On", 1}});
    enumeration("TriggerSource", reg_trigger_source,
                {{"Software", 0}, {"Line0", 1}, {"Action0", 2}});
    enumeration("TriggerActivation", reg_trigger_activation,
                {{"RisingEdge", 0}, {"FallingEdge", 1}});
    enumeration("TriggerOverlap", reg_trigger_overlap, {{"Off", 0}, {"ReadOut", 1}});
    command("TriggerSoftware", reg_trigger_software);
    enumeration("ExposureMode", reg_exposure_mode, {{"Timed", 0}, {"TriggerWidth", 1}});
    real("ExposureTime", reg_exposure_time, "us", 10, 1e7);
    enumeration("ExposureAuto", reg_exposure_auto, {{"Off", 0}, {"Continuous", 2}});
    real("AutoExposureExposureTimeUpperLimit", reg_exposure_limit, "us", 10, 1e7);
    real("Gain", reg_gain, "dB", 0, 48);
    enumeration("GainAuto", reg_gain_auto, {{"Off", 0}, {"Continuous", 2}});
    enumeration("LineSelector", reg_line_selector, {{"Line0", 0}, {"Line1", 1}});
    enumeration("LineMode", reg_line_mode, {{"Input", 0}, {"Output", 1}});
    enumeration("LineSource", reg_line_source, {{"Off", 0}, {"ExposureActive", 1}});
    boolean("ChunkModeActive", reg_chunk_mode);
    enumeration("ChunkSelector", reg_chunk_selector, {{"ExposureTime", 0}, {"Gain", 1}});
    boolean("ChunkEnable", reg_chunk_enable);
    chunk_real("ChunkExposureTime", family.exposure_chunk);
    chunk_real("ChunkGain", family.gain_chunk);
    integer("TLParamsLocked", reg_tl_params_locked, "<Min>0</Min><Max>1</Max>");
}

void XmlWriter::features(std::uint32_t width, std::uint32_t height, const CameraFamily& family) {
    frame_features(width, height);
    if (family.nodes.empty()) return rig_features(family);
    list("Model");  // a category, of all that its nodes offer
    nodes_ += family.nodes;
}

std::string XmlWriter::document(const std::string& name_space, const CameraFamily& family) const {
    return fmt::format(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
        "<RegisterDescription ModelName=\"{}\" VendorName=\"{}\" ToolTip=\"Emulated camera\" "
        "StandardNameSpace=\"{}\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" "
        "SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" SubMinorVersion=\"0\" "
        "ProductGuid=\"7A1B6F3E-0F5C-4A53-9F5E-1D2B3C4D5E6F\" "
        "VersionGuid=\"8B2C7F4E-1A6D-4B64-8A6F-2E3C4D5E6F70\" "
        "xmlns=\"http://www.genicam.org/GenApi/Version_1_0\" "
        "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
        "xsi:schemaLocation=\"http://www.genicam.org/GenApi/Version_1_0 "
        "GenApiSchema_Version_1_0.xsd\">\n"
        "<Category Name=\"Root\" NameSpace=\"Standard\">\n{}</Category>\n{}"
        "<Port Name=\"Device\" NameSpace=\"Standard\"/>\n</RegisterDescription>\n",
        family.model, family.vendor, name_space, root_, nodes_);
}

}  // namespace versavis::rig

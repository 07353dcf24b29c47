// SPDX-License-Identifier: BSD-3-Clause
#include <sstream>
#include <utility>

#include "u3v_registers.hpp"

namespace versavis::test {

namespace {

using Entries = std::vector<std::pair<std::string, std::uint32_t>>;

/// Collects feature nodes and the category that lists them.
class XmlWriter {
 public:
    void integer(const std::string& name, Register address, const std::string& range,
                 bool writable = true) {
        list(name);
        nodes_ << "<Integer Name=\"" << name << "\"><pValue>" << name << "Register</pValue>"
               << range << "</Integer>\n";
        int_register(name, address, writable);
    }

    void real(const std::string& name, Register address, const std::string& range) {
        list(name);
        nodes_ << "<Float Name=\"" << name << "\"><pValue>" << name << "Register</pValue>" << range
               << "</Float>\n<FloatReg Name=\"" << name << "Register\"><Address>" << address
               << "</Address><Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort>"
                  "<Endianess>BigEndian</Endianess></FloatReg>\n";
    }

    void enumeration(const std::string& name, Register address, const Entries& entries) {
        list(name);
        nodes_ << "<Enumeration Name=\"" << name << "\">\n";
        for (const auto& [entry, value] : entries)
            nodes_ << "<EnumEntry Name=\"" << entry << "\"><Value>" << value
                   << "</Value></EnumEntry>\n";
        nodes_ << "<pValue>" << name << "Register</pValue></Enumeration>\n";
        int_register(name, address, true);
    }

    void command(const std::string& name, Register address) {
        list(name);
        nodes_ << "<Command Name=\"" << name << "\"><pValue>" << name
               << "Register</pValue><CommandValue>1</CommandValue></Command>\n";
        int_register(name, address, true);
    }

    void text(const std::string& name, Register address) {
        list(name);
        nodes_ << "<StringReg Name=\"" << name << "\"><Address>" << address
               << "</Address><Length>64</Length><AccessMode>RO</AccessMode><pPort>Device</pPort></"
                  "StringReg>\n";
    }

    std::string document() const {
        return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
               "<RegisterDescription ModelName=\"RigCamera\" VendorName=\"VersaVIS\" "
               "ToolTip=\"Emulated "
               "camera\" "
               "StandardNameSpace=\"U3V\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" "
               "SchemaSubMinorVersion=\"0\" MajorVersion=\"1\" MinorVersion=\"0\" "
               "SubMinorVersion=\"0\" "
               "ProductGuid=\"7A1B6F3E-0F5C-4A53-9F5E-1D2B3C4D5E6F\" "
               "VersionGuid=\"8B2C7F4E-1A6D-4B64-8A6F-2E3C4D5E6F70\" "
               "xmlns=\"http://www.genicam.org/GenApi/Version_1_0\">\n"
               "<Category Name=\"Root\" NameSpace=\"Standard\">\n" +
               root_.str() + "</Category>\n" + nodes_.str() +
               "<Port Name=\"Device\" NameSpace=\"Standard\"/>\n</RegisterDescription>\n";
    }

 private:
    void list(const std::string& name) { root_ << "<pFeature>" << name << "</pFeature>\n"; }

    void int_register(const std::string& name, Register address, bool writable) {
        nodes_ << "<IntReg Name=\"" << name << "Register\"><Address>" << address
               << "</Address><Length>4</Length><AccessMode>" << (writable ? "RW" : "RO")
               << "</AccessMode><pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</"
                  "Endianess>"
                  "</IntReg>\n";
    }

    std::ostringstream root_;
    std::ostringstream nodes_;
};

std::string range(std::uint32_t minimum, std::uint32_t maximum) {
    return "<Min>" + std::to_string(minimum) + "</Min><Max>" + std::to_string(maximum) + "</Max>";
}

}  // namespace

std::string u3v_xml(std::uint32_t width, std::uint32_t height) {
    const Entries lines{{"Line0", 1}, {"Line1", 2}};
    XmlWriter xml;
    xml.text("DeviceVendorName", abrm_vendor);
    xml.text("DeviceModelName", abrm_model);
    xml.text("DeviceVersion", abrm_device_version);
    xml.text("DeviceSerialNumber", abrm_serial);
    xml.integer("Width", reg_width, range(16, width) + "<Inc>4</Inc>");
    xml.integer("Height", reg_height, range(1, height));
    xml.enumeration("PixelFormat", reg_pixel_format,
                    {{"Mono8", 0x01080001}, {"Mono16", 0x01100007}});
    xml.integer("PayloadSize", reg_payload_size, "", false);
    xml.enumeration("AcquisitionMode", reg_acquisition_mode,
                    {{"SingleFrame", 0}, {"Continuous", 2}});
    xml.command("AcquisitionStart", reg_acquisition_start);
    xml.command("AcquisitionStop", reg_acquisition_stop);
    xml.real("AcquisitionFrameRate", reg_frame_rate, range(1, 1000));
    xml.enumeration("TriggerSelector", reg_trigger_selector, {{"FrameStart", 0}});
    xml.enumeration("TriggerMode", reg_trigger_mode, {{"Off", 0}, {"On", 1}});
    xml.enumeration("TriggerSource", reg_trigger_source, {{"Software", 0}, {"Line0", 1}});
    xml.enumeration("TriggerActivation", reg_trigger_activation,
                    {{"RisingEdge", 0}, {"FallingEdge", 1}});
    xml.enumeration("TriggerOverlap", reg_trigger_overlap, {{"Off", 0}, {"ReadOut", 1}});
    xml.command("TriggerSoftware", reg_trigger_software);
    xml.enumeration("ExposureMode", reg_exposure_mode, {{"Timed", 0}});
    xml.real("ExposureTime", reg_exposure_time, range(10, 1000000));
    xml.enumeration("ExposureAuto", reg_exposure_auto, {{"Off", 0}, {"Continuous", 2}});
    xml.real("Gain", reg_gain, range(0, 24));
    xml.enumeration("LineSelector", reg_line_selector, lines);
    xml.enumeration("LineMode", reg_line_mode, {{"Input", 0}, {"Output", 1}});
    xml.enumeration("LineSource", reg_line_source, {{"Off", 0}, {"ExposureActive", 1}});
    return xml.document();
}

}  // namespace versavis::test

// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description_check.hpp"

#include <catch2/catch.hpp>

#include "gige_registers.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

std::string verdict(const std::string& text) {
    const auto good = check_description({{text.begin(), text.end()}, false});
    return good ? "good" : good.error().what;
}

std::string description_with(const std::string& nodes) {
    return "<RegisterDescription><Category Name=\"Root\"></Category>" + nodes +
           "</RegisterDescription>";
}

}  // namespace

TEST_CASE("description_check: that of an honest camera is good") {
    CHECK(verdict(rig::gige_xml(640, 480)) == "good");
    CHECK(verdict(rig::gige_xml(640, 480) + "\n\n") == "good");
}

TEST_CASE("description_check: limits that name each other's values are no loop") {
    CHECK(verdict(description_with(
              "<Integer Name=\"Width\"><Value>1</Value><pMax>WidthMax</pMax></Integer>"
              "<Integer Name=\"Offset\"><Value>1</Value><pMax>OffsetMax</pMax></Integer>"
              "<IntSwissKnife Name=\"WidthMax\"><pVariable Name=\"O\">Offset</pVariable>"
              "<Formula>100-O</Formula></IntSwissKnife>"
              "<IntSwissKnife Name=\"OffsetMax\"><pVariable Name=\"W\">Width</pVariable>"
              "<Formula>100-W</Formula></IntSwissKnife>")) == "good");
}

TEST_CASE("description_check: entries of a selector may depend on what is selected") {
    CHECK(verdict(description_with(
              "<Enumeration Name=\"Selector\"><EnumEntry Name=\"A\"><Value>0</Value>"
              "<pIsAvailable>Able</pIsAvailable></EnumEntry><Value>0</Value></Enumeration>"
              "<IntSwissKnife Name=\"Able\"><pVariable Name=\"S\">Selector</pVariable>"
              "<Formula>S=0</Formula></IntSwissKnife>")) == "good");
}

TEST_CASE("description_check: values and limits that lead back to themselves are refused") {
    const auto loop = Catch::Contains("leads back to itself");
    CHECK_THAT(verdict(description_with("<Integer Name=\"A\"><pValue>A</pValue></Integer>")), loop);
    CHECK_THAT(verdict(description_with("<Integer Name=\"A\"><pValue>B</pValue></Integer>"
                                        "<Integer Name=\"B\"><pValue>A</pValue></Integer>")),
               loop);
    CHECK_THAT(verdict(description_with("<IntReg Name=\"A\"><Address>0</Address><Length>4</Length>"
                                        "<pAddress>A</pAddress></IntReg>")),
               loop);
    CHECK_THAT(verdict(description_with("<IntReg Name=\"A\"><Length>4</Length>"
                                        "<pIndex pOffset=\"A\">B</pIndex></IntReg>")),
               loop);
    CHECK_THAT(
        verdict(description_with("<StructReg><Address>0</Address><pAddress>A</pAddress><Length>4"
                                 "</Length><StructEntry Name=\"A\"><Bit>1</Bit></StructEntry>"
                                 "</StructReg>")),
        loop);
}

TEST_CASE("description_check: what takes too long to evaluate is refused") {
    std::string chain;
    for (int i = 0; i < 100; ++i)
        chain += "<Integer Name=\"N" + std::to_string(i) + "\"><pValue>N" + std::to_string(i + 1) +
                 "</pValue></Integer>";
    CHECK_THAT(verdict(description_with(chain)), Catch::Contains("nested too deep"));
}

TEST_CASE("description_check: registers have a bounded length, constant where Aravis reads them") {
    const auto reg = [](const std::string& name, const std::string& length) {
        return description_with(
            "<StringReg Name=\"" + name + "\"><Address>0</Address>" + length +
            "</StringReg><Integer Name=\"L\"><Value>64</Value></Integer>"
            "<IntReg Name=\"V\"><Value>64</Value><Address>4</Address><Length>4</Length>"
            "</IntReg>");
    };
    CHECK(verdict(reg("A", "<Length>64</Length>")) == "good");
    CHECK(verdict(reg("A", "<pLength>L</pLength>")) == "good");
    CHECK(verdict(reg("A", "<pLength>V</pLength>")) == "good");  // refused when it is used
    for (const char* length : {"<Length>0</Length>", "<Length>-1</Length>", "<Length>x</Length>",
                               "<Length>0x7fffffffffffffff</Length>"})
        CHECK_THAT(verdict(reg("A", length)), Catch::Contains("a register of"));
    CHECK(verdict(reg("DeviceVendorName", "<pLength>L</pLength>")) == "good");
    CHECK_THAT(verdict(reg("DeviceVendorName", "<pLength>V</pLength>")),
               Catch::Contains("another register"));
    CHECK_THAT(verdict(description_with(
                   "<IntReg Name=\"B\"><Length>4</Length><pIndex pOffset=\"C\">D</pIndex>"
                   "</IntReg><IntReg Name=\"C\"><Address>0</Address><pLength>D</pLength>"
                   "</IntReg><IntReg Name=\"D\"><Address>4</Address><Length>4</Length>"
                   "</IntReg>")),
               Catch::Contains("another register"));
}

TEST_CASE("description_check: a name with pOffset in it is no offset of an index") {
    const std::string loop =
        "<Integer Name=\"Width\"><pValue>One</pValue></Integer>"
        "<IntSwissKnife Name=\"One\"><pVariable Name=\"X\">One</pVariable>"
        "<Formula>X+1</Formula></IntSwissKnife>";
    CHECK_THAT(verdict(description_with(loop)), Catch::Contains("leads back to itself"));
    CHECK_THAT(verdict(description_with("<Integer Name=\"PtpOffsetFromMaster\"><Value>3</Value>"
                                        "</Integer>" +
                                        loop)),
               Catch::Contains("leads back to itself"));
    for (const char* prose : {"pOffset", "it has pOffset = 3", "it's pOffset = of \"Width",
                              "\"this\" pOffset = \"is not closed"})
        CHECK_THAT(verdict(description_with("<Integer Name=\"A\"><ToolTip> " + std::string(prose) +
                                            "</ToolTip><Value>3</Value></Integer>" + loop)),
                   Catch::Contains("leads back to itself"));
    CHECK_THAT(verdict(description_with(
                   "<IntReg Name=\"Width\"><Length>4</Length><pIndex\n pOffset =\n'Width'>B"
                   "</pIndex></IntReg>")),
               Catch::Contains("leads back to itself"));
}

TEST_CASE("description_check: what is no whole description is refused") {
    const std::string honest = rig::gige_xml(640, 480);
    CHECK(verdict("") == "is cut off");
    CHECK(verdict(honest.substr(0, honest.size() / 2)) == "is cut off");
    CHECK(verdict("<a><b></RegisterDescription>") == "is not valid XML");
    CHECK(verdict("<!ENTITY x \"y\">" + honest) == "defines entities");
    CHECK_FALSE(check_description({{'P', 'K', 1, 2, 3, 4}, true}));
}

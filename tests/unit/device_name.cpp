// SPDX-License-Identifier: BSD-3-Clause
#include "settings/device_name.hpp"

#include <catch2/catch.hpp>

#include "../support/message_table.hpp"

using namespace versavis::daemon;
using versavis::test::accepted;

namespace {

std::string fault_of(const std::string& device) {
    const auto fault = device_fault(device);
    return fault ? fault->what + "; " + fault->cure : "";
}

}  // namespace

TEST_CASE("device_name: a MAC address is one, whichever way it is written") {
    for (const char* text : {"00:11:1c:aa:bb:cc", "00:11:1C:AA:BB:CC", "00-11-1C-AA-BB-CC",
                             "0011.1caa.bbcc", "00111CAABBCC", "00 11 1c aa bb cc"}) {
        INFO(text);
        CHECK(mac_address(text) == "00:11:1c:aa:bb:cc");
    }
    for (const char* text :
         {"", "cam0", "00:11:1c:aa:bb", "00:11:1c:aa:bb:c", "00:11:1c:aa:bb:cg",
          "00:11-1c:aa-bb:cc", "0011:1caa:bbcc:0", "001:11c:aab:bcc", "00:11:1c:aa:bb:cc:dd",
          "0:0111:c:aa:bb:cc", "00/11/1c/aa/bb/cc", "21098765", "192.168.1.20"}) {
        INFO(text);
        CHECK_FALSE(mac_address(text));
    }
}

TEST_CASE("device_name: one device has several spellings") {
    CHECK(same_device("Basler-21", "basler-21"));
    CHECK(same_device("00:11:1c:aa:bb:cc", "0011.1CAA.BBCC"));
    CHECK_FALSE(same_device("00:11:1c:aa:bb:cc", "00:11:1c:aa:bb:cd"));
    CHECK_FALSE(same_device("left", "right"));
}

TEST_CASE("device_name: what no camera can be found by is refused, with what to write") {
    const std::string others =
        "; set the camera's IP address, MAC address, serial number or name; "
        "versavis discover lists them";
    const std::string numbers =
        "is not an IP address; an IP address is four numbers from 0 to 255 "
        "without leading zeros, such as 192.168.1.20";
    const std::string plain = "is more than an IP address; write \"192.168.1.20\"";
    const std::string ipv6 = "is an IPv6 address, which GigE Vision cameras do not have" + others;
    const std::string host = "is a host name, which is not looked up" + others;
    const std::string nobody = "is an address that no camera can have" + others;
    versavis::test::check_messages(
        fault_of, {{"192.168.1.20", accepted},
                   {"21098765", accepted},
                   {"Basler-21.5.3", accepted},
                   {"Allied Vision Technologies-50-0503323000", accepted},
                   {"front.left", accepted},
                   {"local", accepted},
                   {"00-11-1C-AA-BB-CC", accepted},
                   {"192.168.1.20:3956", plain},
                   {"192.168.1.20/24", plain},
                   {"192.168.1.20%eth0", plain},
                   {"gige://192.168.1.20/", plain},
                   {"~/left", "is a path, which no camera has" + others},
                   {"/dev/video0", "is a path, which no camera has" + others},
                   {"gige://left", "is a URL" + others},
                   {" 192.168.1.20", "begins or ends with a blank; remove the blank"},
                   {"21098765\n", "begins or ends with a blank; remove the blank"},
                   {"192.168.001.020", numbers},
                   {"192.168.1.300:3956", numbers},
                   {"192,168,1,20", numbers},
                   {"192.168.1", numbers},
                   {"fe80::1", ipv6},
                   {"fe80::1%eth0", ipv6},
                   {"[fe80::1]:3956", ipv6},
                   {"fe80::1/64", ipv6},
                   {"cam0.local", host},
                   {"LEFT.LAN", host},
                   {"left.local:3956", host},
                   {"localhost", host},
                   {"0.0.0.0", nobody},
                   {"224.0.0.1", nobody},
                   {"255.255.255.255", nobody}});
}

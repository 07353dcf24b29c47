// SPDX-License-Identifier: BSD-3-Clause
// The checks of `versavis doctor` against trees that stand for /proc and /sys, each good, then
// broken. What a namespace can really break is in tests/system/doctor.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "../support/temporary_directory.hpp"
#include "doctor/clock_checks.hpp"
#include "doctor/fixes.hpp"
#include "doctor/host_checks.hpp"
#include "doctor/network_checks.hpp"
#include "doctor/service_checks.hpp"
#include "doctor/usb_checks.hpp"

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;
using nlohmann::json;

namespace {

/// A host whose files are made by the test.
struct MadeHost {
    test::TemporaryDirectory directory;
    Subject subject;

    MadeHost() {
        subject.files = HostFiles(directory.path());
        subject.instance = "doctor-unit-test";
        subject.release = "1.0.0";
    }
    void put(const std::string& path, const std::string& text) {
        const auto place = subject.files.path(path);
        std::filesystem::create_directories(place.parent_path());
        std::ofstream(place) << text << "\n";
    }
    std::string get(const std::string& path) const { return subject.files.text(path).value_or(""); }
};

const Finding* find(const Findings& findings, const std::string& check) {
    const auto found = std::find_if(findings.begin(), findings.end(),
                                    [&](const Finding& it) { return it.check == check; });
    return found == findings.end() ? nullptr : &*found;
}

Finding get(const Findings& findings, const std::string& check) {
    const Finding* found = find(findings, check);
    INFO(check);
    REQUIRE(found != nullptr);
    return *found;
}

/// Every finding that is not good says why, and how it is cured.
void check_complete(const Findings& findings) {
    for (const Finding& finding : findings) {
        INFO(finding.check);
        CHECK_FALSE(finding.value.empty());
        if (finding.verdict == Verdict::bad || finding.verdict == Verdict::warning) {
            CHECK_FALSE(finding.reason.empty());
            CHECK_FALSE(finding.cure.empty());
        } else if (finding.verdict == Verdict::good) {
            CHECK(finding.reason.empty());
        }
    }
}

/// A link with a camera, on a host where all is well.
struct LinkedHost : MadeHost {
    LinkedHost() {
        subject.cameras = {{"cam0", "eth7", 8000}};
        put("/sys/class/net/eth7/mtu", "9000");
        put("/sys/class/net/eth7/speed", "1000");
        put("/sys/class/net/eth7/carrier", "1");
        put("/sys/class/net/eth7/statistics/rx_crc_errors", "3");
        put("/sys/class/net/eth7/statistics/rx_dropped", "12");  // nobody wanted them
        put("/proc/sys/net/core/rmem_max", "33554432");
        set_overflows(5);
    }
    void set_overflows(int count) {
        put("/proc/net/snmp", "Tcp: RcvbufErrors\nTcp: 77\nUdp: InDatagrams RcvbufErrors\nUdp: 9 " +
                                  std::to_string(count));
    }
    Findings check() { return check_network(subject, losses, read_losses(subject)); }
    LossCounters losses;
};

/// Of a service that delivers, with all its proof.
json proved_status() {
    return json::parse(R"({"pid": 1, "release": "1.0.0", "health": "ok",
        "board": {"health": "ok", "state": "running", "stamp_test": "passed", "fault": "",
                  "hint": "", "firmware": "versavis 1.0.0", "firmware_outdated": false},
        "clock": {"health": "ok", "state": "locked", "sigma_ns": 4500, "bound_ns": 90000,
                  "fault": "", "hint": "", "output": "realtime", "pps": "off"},
        "cameras": [{"name": "cam0", "health": "ok", "state": "streaming", "trigger": "board",
                     "pairing": "locked", "fault": "", "hint": "", "frames_published": 1000,
                     "frames_suspect": 0, "frames_received": 1002, "frames_incomplete": 0,
                     "frames_without_trigger": 2, "exposure_ns": 3000000,
                     "camera_exposure_ns": 3000000}],
        "imus": [], "time_outputs": [{"name": "lidar", "state": "sending", "health": "ok",
                                      "fault": "", "hint": ""}]})");
}

}  // namespace

TEST_CASE("doctor: a link that is well") {
    LinkedHost host;
    host.losses = read_losses(host.subject);
    const Findings findings = host.check();
    for (const Finding& finding : findings) {
        INFO(finding.check << ": " << finding.value << ": " << finding.reason);
        CHECK(finding.verdict == Verdict::good);
    }
    CHECK(get(findings, "link_loss").value == "3 lost since boot, 0 of them now");
    CHECK(get(findings, "receive_buffers").value == "5 lost since boot, 0 of them now");
    check_complete(findings);
}

TEST_CASE("doctor: each fault of a link is found, with its cure") {
    LinkedHost host;
    host.losses = read_losses(host.subject);
    host.put("/sys/class/net/eth7/mtu", "1500");
    CHECK(get(host.check(), "mtu").verdict == Verdict::bad);  // of packets of 8000 bytes
    host.subject.cameras.front().packet_size = 1500;
    CHECK(get(host.check(), "mtu").verdict == Verdict::warning);
    CHECK_THAT(get(host.check(), "mtu").cure, Contains("ip link set dev eth7 mtu 9000"));
    host.put("/sys/class/net/eth7/speed", "100");
    CHECK(get(host.check(), "link_speed").verdict == Verdict::bad);
    host.put("/sys/class/net/eth7/carrier", "0");
    CHECK(get(host.check(), "link_speed").value == "no carrier");
    host.put("/sys/class/net/eth7/statistics/rx_missed_errors", "4");
    CHECK(get(host.check(), "link_loss").value == "7 lost since boot, 4 of them now");
    CHECK(get(host.check(), "link_loss").verdict == Verdict::bad);
    host.set_overflows(6);
    CHECK(get(host.check(), "receive_buffers").verdict == Verdict::bad);
    check_complete(host.check());
}

TEST_CASE("doctor: a small rmem_max matters without CAP_NET_ADMIN, and --fix raises it") {
    LinkedHost host;
    const std::string path = "/proc/sys/net/core/rmem_max";
    host.put(path, "212992");
    CHECK(get(host.check(), "rmem_max").verdict == Verdict::bad);
    host.subject.status = json::parse(R"({"pid": 4711})");
    host.put("/proc/4711/status", "Name: versavisd\nCapEff:\t0000000000001000");
    CHECK(get(host.check(), "rmem_max").verdict == Verdict::good);
    host.put("/proc/4711/status", "Name: versavisd\nCapEff:\t0000000000000000");
    Findings findings = host.check();
    CHECK(get(findings, "rmem_max").verdict == Verdict::bad);
    check_complete(findings);
    apply_fixes(host.subject.files, findings);
    CHECK(get(findings, "rmem_max").fixed);
    CHECK(host.get(path) == "33554432");
    CHECK(get(host.check(), "rmem_max").verdict == Verdict::good);
}

TEST_CASE("doctor: packet sockets are offered with their price, where none may be opened") {
    LinkedHost host;
    const auto with = [&](const char* receive, const char* capabilities) {
        host.subject.status = json{{"pid", 4711}, {"cameras", {{{"receive", receive}}}}};
        host.put("/proc/4711/status", std::string("CapEff:\t") + capabilities);
        return host.check();
    };
    CHECK(find(host.check(), "packet_socket") == nullptr);
    CHECK(find(with("", "0"), "packet_socket") == nullptr);  // USB3 Vision
    CHECK(get(with("packet", "2000"), "packet_socket").verdict == Verdict::good);
    CHECK(get(with("socket", "2000"), "packet_socket").verdict == Verdict::good);
    const Finding offered = get(with("socket", "0"), "packet_socket");
    CHECK(offered.verdict == Verdict::unknown);
    CHECK(offered.value == "used for 0 of 1 cameras");
    CHECK_THAT(offered.reason, Contains("a third of the processor") && Contains("1.9 to 2.2"));
    CHECK_THAT(offered.cure, Contains("versavisd.service.d/packet-socket.conf"));
}

TEST_CASE("doctor: a fix that is refused says why") {
    MadeHost host;
    Finding small{"rmem_max", "", "1", Verdict::bad, "too small", "raise it"};
    small.fix = Fix{"/proc/sys/none", "2"};
    Findings findings{small};
    apply_fixes(host.subject.files, findings);
    CHECK_FALSE(findings.front().fixed);
    CHECK_THAT(findings.front().reason, Contains("/proc/sys/none: No such file"));
}

TEST_CASE("doctor: how an interface takes packets in") {
    InterfaceSettings settings;
    CHECK(check_interface_settings("eth7", settings, true).empty());
    settings.ring = 256;
    settings.longest_ring = 4096;
    settings.moderation_us = 3;
    settings.merging = {{"lro", false}, {"rx-gro-list", false}};
    for (const Finding& finding : check_interface_settings("eth7", settings, false))
        CHECK(finding.verdict == Verdict::good);
    const Findings lossy = check_interface_settings("eth7", settings, true);
    CHECK(get(lossy, "rx_ring").cure == "sudo ethtool -G eth7 rx 4096");
    settings.moderation_us = 0;
    settings.merging["lro"] = true;
    const Findings findings = check_interface_settings("eth7", settings, true);
    CHECK(get(findings, "moderation").verdict == Verdict::warning);
    CHECK(get(findings, "offload").verdict == Verdict::warning);
    CHECK(get(findings, "offload").cure == "sudo ethtool -K eth7 lro off");
    check_complete(findings);
    settings.adaptive_moderation = true;
    CHECK(get(check_interface_settings("eth7", settings, true), "moderation").verdict ==
          Verdict::good);
}

TEST_CASE("doctor: frames that were lost are named by camera") {
    LinkedHost host;
    host.subject.status = proved_status();
    CHECK(get(host.check(), "frame_loss").verdict == Verdict::good);
    host.subject.status->at("cameras")[0]["frames_incomplete"] = 100;
    const Finding finding = get(host.check(), "frame_loss");
    CHECK(finding.value == "100 of 1102 frames incomplete (9.074 %)");
    CHECK(finding.verdict == Verdict::warning);
}

TEST_CASE("doctor: USB devices, good and then broken") {
    MadeHost host;
    host.subject.configuration.emplace().board_link = "unix:/run/board";
    CHECK(check_usb(host.subject).empty());
    host.subject.configuration->board_link = "usb";
    CHECK(get(check_usb(host.subject), "udev_rule").verdict == Verdict::bad);
    host.put("/usr/lib/udev/rules.d/60-versavis.rules", "SUBSYSTEM");
    const std::string camera = "/sys/bus/usb/devices/2-1";
    const std::string memory = "/sys/module/usbcore/parameters/usbfs_memory_mb";
    host.put(camera + "/2-1:1.0/bInterfaceClass", "ef");
    host.put(camera + "/2-1:1.0/bInterfaceSubClass", "05");
    host.put(camera + "/speed", "5000");
    host.put(camera + "/busnum", "2");
    host.put(camera + "/devnum", "7");
    host.put(camera + "/power/control", "on");
    host.put(memory, "1000");
    host.put("/dev/bus/usb/002/007", "");
    const auto node = host.subject.files.path("/dev/bus/usb/002/007");
    std::filesystem::permissions(node, std::filesystem::perms(0666));
    for (const Finding& finding : check_usb(host.subject)) {
        INFO(finding.check);
        CHECK(finding.verdict == Verdict::good);
    }
    std::filesystem::permissions(node, std::filesystem::perms(0644));
    host.put(camera + "/speed", "480");
    host.put(camera + "/power/control", "auto");
    host.put(camera + "/power/autosuspend_delay_ms", "2000");
    host.put(memory, "16");
    std::filesystem::create_directories(host.subject.files.path("/etc/udev/rules.d"));
    std::filesystem::create_symlink("/dev/null",
                                    host.subject.files.path("/etc/udev/rules.d/60-versavis.rules"));
    Findings findings = check_usb(host.subject);
    CHECK(get(findings, "usb_permission").verdict == Verdict::bad);
    CHECK(get(findings, "usb_speed").value == "480 Mbit/s");
    CHECK(get(findings, "usb_speed").verdict == Verdict::bad);
    CHECK(get(findings, "autosuspend").value == "on, after 2000 ms");
    CHECK(get(findings, "usbfs_memory_mb").verdict == Verdict::bad);
    CHECK(get(findings, "udev_rule").verdict == Verdict::bad);
    check_complete(findings);
    apply_fixes(host.subject.files, findings);
    CHECK(host.get(camera + "/power/control") == "on");
    CHECK(host.get(memory) == "128");
    CHECK(get(check_usb(host.subject), "autosuspend").verdict == Verdict::good);
    CHECK(get(check_usb(host.subject), "usbfs_memory_mb").verdict == Verdict::good);
}

TEST_CASE("doctor: a board on USB is found by its ids") {
    MadeHost host;
    host.put("/sys/bus/usb/devices/1-4/idVendor", "1209");
    host.put("/sys/bus/usb/devices/1-4/idProduct", "5653");
    host.put("/sys/bus/usb/devices/1-4/power/control", "auto");
    host.put("/sys/bus/usb/devices/1-4/power/autosuspend_delay_ms", "-1000");
    const Finding finding = get(check_usb(host.subject), "autosuspend");
    CHECK(finding.subject == "board");
    CHECK(finding.verdict == Verdict::good);  // a negative delay: never
}

TEST_CASE("doctor: governor") {
    MadeHost host;
    CHECK(find(check_host(host.subject), "governor") == nullptr);
    const std::string cpu = "/sys/devices/system/cpu/cpu";
    for (const char* number : {"0", "1"})
        host.put(cpu + number + "/cpufreq/scaling_governor", "performance");
    CHECK(get(check_host(host.subject), "governor").verdict == Verdict::good);
    host.put(cpu + "1/cpufreq/scaling_governor", "powersave");
    const Findings findings = check_host(host.subject);
    CHECK(get(findings, "governor").value == "performance on 1 CPUs, powersave on 1 CPUs");
    CHECK(get(findings, "governor").verdict == Verdict::warning);
    check_complete(findings);
}

TEST_CASE("doctor: real-time priority of the service") {
    MadeHost host;
    host.subject.status = json::parse(R"({"pid": 4711})");
    const std::string stat = "/proc/4711/task/4712/stat";
    const std::string fields_4_to_39 =
        "1 1 1 0 -1 0 0 0 0 0 1 1 0 0 20 0 5 0 100 1000 100 1 1 1 1 1 1 0 0 0 0 0 0 0 -1 3";
    const std::string limits = "Limit      Soft Limit  Hard Limit  Units\nMax realtime priority  ";
    host.put(stat, "4712 (a ) name) S " + fields_4_to_39 + " 20 1 0 0 0");
    CHECK(get(check_host(host.subject), "realtime").value == "a thread runs at priority 20");
    host.put(stat, "4712 (a ) name) S " + fields_4_to_39 + " 0 0 0 0 0");
    host.put("/proc/4711/limits", limits + "20  20");
    CHECK(get(check_host(host.subject), "realtime").verdict == Verdict::unknown);
    host.put("/proc/4711/limits", limits + "0  0");
    CHECK(get(check_host(host.subject), "realtime").verdict == Verdict::warning);
    CHECK_THAT(get(check_host(host.subject), "realtime").cure, Contains("LimitRTPRIO=20"));
}

TEST_CASE("doctor: what disciplines the host's clock") {
    MadeHost host;
    clock::KernelState kernel;
    kernel.synchronised = true;
    kernel.max_error = milliseconds(12);
    kernel.tai_offset_s = 37;
    host.put("/proc/321/comm", "chronyd");
    CHECK(get(check_clock(host.subject, kernel), "host_clock").value ==
          "synchronised to 0.012000 s, by chronyd");
    host.put("/proc/322/comm", "systemd-timesyn");  // the kernel cuts names
    CHECK(get(check_clock(host.subject, kernel), "host_clock").verdict == Verdict::bad);
    std::filesystem::remove_all(host.subject.files.path("/proc"));
    kernel = {};
    Findings findings = check_clock(host.subject, kernel);
    CHECK(get(findings, "host_clock").verdict == Verdict::warning);
    CHECK(get(findings, "tai_offset").value == "not set, not used");
    check_complete(findings);
    host.subject.configuration.emplace().output = "monotonic_raw";
    CHECK(get(check_clock(host.subject, kernel), "host_clock").verdict == Verdict::good);
    host.subject.configuration->output = "tai";
    findings = check_clock(host.subject, kernel);
    CHECK(get(findings, "tai_offset").verdict == Verdict::bad);
    CHECK_THAT(get(findings, "tai_offset").reason, Contains("off by 37 s"));
    kernel.tai_offset_s = 37;
    CHECK(get(check_clock(host.subject, kernel), "tai_offset").verdict == Verdict::good);
}

namespace {

/// As pmc of linuxptp 3.1.1 prints it, of a host that follows another one.
constexpr auto pmc_output = R"(sending: GET DEFAULT_DATA_SET
sending: GET PORT_DATA_SET
	3e7db7.fffe.99334e-0 seq 0 RESPONSE MANAGEMENT DEFAULT_DATA_SET 
		twoStepFlag             1
		clockClass              248
		clockIdentity           3e7db7.fffe.99334e
		domainNumber            0
sending: GET PARENT_DATA_SET
	3e7db7.fffe.99334e-1 seq 1 RESPONSE MANAGEMENT PORT_DATA_SET 
		portIdentity            3e7db7.fffe.99334e-1
		portState               SLAVE
		peerMeanPathDelay       0
	3e7db7.fffe.99334e-0 seq 2 RESPONSE MANAGEMENT PARENT_DATA_SET 
		parentPortIdentity                    3ac9b9.fffe.a8a9fa-1
		grandmasterPriority1                  100
		gm.ClockClass                         248
		grandmasterIdentity                   3ac9b9.fffe.a8a9fa
	3e7db7.fffe.99334e-0 seq 3 RESPONSE MANAGEMENT TIME_PROPERTIES_DATA_SET 
		currentUtcOffset      37
		currentUtcOffsetValid 0
		ptpTimescale          0
)";

std::string replaced(std::string text, const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    REQUIRE(at != std::string::npos);
    return text.replace(at, what.size(), by);
}

Findings ptp(const std::string& output, const std::map<std::string, std::string>& cameras = {},
             bool phc2sys = true) {
    const Findings findings = check_ptp(parse_pmc(output), cameras, {}, phc2sys);
    check_complete(findings);
    return findings;
}

}  // namespace

TEST_CASE("doctor: the answers of ptp4l are read") {
    const auto answers = parse_pmc(pmc_output);
    REQUIRE(answers.size() == 4);
    CHECK(answers[1].port == "3e7db7.fffe.99334e-1");
    CHECK(answers[1].set == "PORT_DATA_SET");
    CHECK(answers[1].values.at("portState") == "SLAVE");
    CHECK(answers[2].values.at("gm.ClockClass") == "248");
    CHECK(parse_pmc("pmc[1]: failed to open configuration\n").empty());
}

TEST_CASE("doctor: the roles of PTP") {
    CHECK(get(ptp(pmc_output), "ptp_port").value == "SLAVE");
    CHECK(get(ptp(pmc_output), "ptp_port").verdict == Verdict::good);
    CHECK(get(ptp(replaced(pmc_output, "SLAVE", "FAULTY")), "ptp_port").verdict == Verdict::bad);
    CHECK(get(ptp(replaced(pmc_output, "SLAVE", "LISTENING")), "ptp_port").verdict ==
          Verdict::warning);

    // A foreign master, disciplined by nothing; by GNSS; and this host itself.
    CHECK(get(ptp(pmc_output), "ptp_master").verdict == Verdict::warning);
    const std::string gnss =
        replaced(pmc_output, "gm.ClockClass                         248", "gm.ClockClass 6");
    CHECK(get(ptp(gnss), "ptp_master").value == "another clock is the grandmaster, class 6");
    CHECK(get(ptp(gnss), "ptp_master").verdict == Verdict::good);
    const std::string own =
        replaced(pmc_output, "grandmasterIdentity                   3ac9b9.fffe.a8a9fa",
                 "grandmasterIdentity 3e7db7.fffe.99334e");
    CHECK(get(ptp(own), "ptp_master").value == "this host is the grandmaster");

    // The same foreign master, which is a camera.
    CHECK(clock_identity("3A:C9:B9:a8:a9:fa") == "3ac9b9.fffe.a8a9fa");
    CHECK(clock_identity("192.168.1.20").empty());
    const Finding camera = get(ptp(pmc_output, {{"3ac9b9.fffe.a8a9fa", "left"}}), "ptp_master");
    CHECK(camera.value == "camera left is the grandmaster");
    CHECK(camera.verdict == Verdict::bad);
}

TEST_CASE("doctor: the 37 seconds of PTP, and phc2sys") {
    CHECK(get(ptp(pmc_output), "ptp_utc_offset").verdict == Verdict::good);
    const std::string zero = replaced(pmc_output, "currentUtcOffset      37", "currentUtcOffset 0");
    CHECK(get(ptp(zero), "ptp_utc_offset").verdict == Verdict::warning);
    CHECK_THAT(get(ptp(zero), "ptp_utc_offset").reason, Contains("off by 37 s"));
    const std::string claimed =
        replaced(zero, "currentUtcOffsetValid 0", "currentUtcOffsetValid 1");
    CHECK(get(ptp(claimed), "ptp_utc_offset").verdict == Verdict::bad);
    CHECK(get(ptp(pmc_output, {}, true), "phc2sys").verdict == Verdict::good);
    CHECK(get(ptp(pmc_output, {}, false), "phc2sys").verdict == Verdict::warning);
}

TEST_CASE("doctor: service, releases and devices") {
    MadeHost host;
    host.subject.silence = {"instance x", "the service has died or hangs", "restart it"};
    host.subject.configuration_error = {"x.toml", "cannot be read", "check its name"};
    Findings findings = check_service(host.subject);
    CHECK(get(findings, "service").value == "not running");
    CHECK(get(findings, "service").reason == "the service has died or hangs");
    CHECK(get(findings, "service").verdict == Verdict::bad);
    CHECK(get(findings, "configuration").verdict == Verdict::bad);
    host.subject.unit = Error{"versavisd.service", "waiting: no memory", "see its log"};
    CHECK(get(check_service(host.subject), "service").value == "serves nothing yet");
    CHECK(get(check_service(host.subject), "service").reason ==
          "versavisd.service: waiting: no memory");
    host.subject.unit->what = "it has failed";
    CHECK(get(check_service(host.subject), "service").value == "not running");
    host.subject.unit.reset();
    check_complete(findings);
    host.subject.status = proved_status();
    CHECK(get(check_service(host.subject), "firmware").verdict == Verdict::good);
    CHECK(find(check_service(host.subject), "release") == nullptr);
    findings = check_service(host.subject);
    CHECK(std::any_of(findings.begin(), findings.end(), [](const Finding& finding) {
        return finding.subject == "lidar" && finding.value == "sending";  // it has no rate
    }));
    host.subject.release = "1.1.0";
    json& board = host.subject.status->at("board");
    board["firmware_outdated"] = true;
    board["health"] = "degraded";
    board["fault"] = "board_stamps";
    board["hint"] = "as the service says it";
    findings = check_service(host.subject);
    CHECK(get(findings, "firmware").verdict == Verdict::warning);
    CHECK(get(findings, "release").verdict == Verdict::warning);
    CHECK(get(findings, "device").verdict == Verdict::bad);
    CHECK(get(findings, "device").reason == "as the service says it");
}

TEST_CASE("doctor: another program that talks to cameras is found by name or library") {
    MadeHost host;
    host.put("/proc/71/comm", "bash");
    host.put("/proc/71/maps", "7f00-7f01 r-xp 0 0 0 /usr/lib/libc.so.6");
    host.put("/proc/72/comm", "versavisd");
    host.put("/proc/72/maps", "7f00-7f01 r-xp 0 0 0 /usr/lib/libaravis-0.8.so.0");
    CHECK(find(check_service(host.subject), "other_program") == nullptr);
    host.put("/proc/73/comm", "python3");
    host.put("/proc/73/maps", "7f00-7f01 r-xp 0 0 0 /opt/pylon/lib/libpylonbase.so.7");
    CHECK(get(check_service(host.subject), "other_program").subject == "process 73");
    CHECK(get(check_service(host.subject), "other_program").verdict == Verdict::warning);
    std::filesystem::remove_all(host.subject.files.path("/proc/73"));
    host.put("/proc/74/comm", "SpinView_QT");
    CHECK(get(check_service(host.subject), "other_program").cure == "end it: kill 74");
}

TEST_CASE("doctor: the conclusion is right only with proof, and says which") {
    MadeHost host;
    using State = Conclusion::State;
    host.subject.silence = {"", "no such stream", ""};
    CHECK(conclude(host.subject).sentence ==
          "Whether the synchronisation is right is not known: there is no living service: no such "
          "stream.");
    host.subject.status = proved_status();
    CHECK(conclude(host.subject).state == State::right);
    CHECK(conclude(host.subject).sentence ==
          "The synchronisation is right: 1000 frames of 1 camera were published, all of them "
          "proved, 2 were withheld; sigma is 4.5 us, the bound 90.0 us; the exposures of 1 of 1 "
          "camera are measured by their line, 1 report the same; the board's test of its stamps "
          "passes.");

    const auto with = [&](const char* pointer, const json& value) {
        host.subject.status = proved_status();
        (*host.subject.status)[json::json_pointer(pointer)] = value;
        return conclude(host.subject);
    };
    CHECK(with("/cameras/0/health", "degraded").state == State::wrong);
    CHECK(with("/board/health", "starting").state == State::unknown);
    CHECK(with("/clock/sigma_ns", nullptr).state == State::unknown);
    CHECK(with("/clock/state", "holdover").state == State::unknown);
    CHECK(with("/cameras/0/pairing", "searching").state == State::unknown);
    CHECK(with("/cameras/0/state", "stopped").state == State::unknown);
    CHECK(with("/cameras/0/trigger", "free").state == State::unknown);
    CHECK(with("/cameras/0/frames_published", 0).state == State::unknown);
    CHECK(with("/cameras", json::array()).state == State::unknown);

    // Cameras by PTP, with a board and without.
    const json ptp{{"state", "locked"}, {"sigma_ns", 3000}, {"bound_ns", 20000}};
    const auto by_ptp = [&](const json& time, const char* board) {
        host.subject.status = proved_status();
        json& status = *host.subject.status;
        status["ptp"] = time;
        status["board"]["state"] = board;
        if (std::string_view(board) == "unused") status["clock"]["state"] = "init";
        status["cameras"][0]["trigger"] = "ptp";
        status["cameras"][0]["exposure_ns"] = 0;
        return conclude(host.subject);
    };
    CHECK(by_ptp(ptp, "running").state == State::right);
    CHECK(by_ptp(ptp, "unused").state == State::right);
    CHECK_THAT(
        by_ptp(ptp, "unused").sentence,
        Contains("sigma is 3.0 us, the bound 20.0 us; PTP's time makes the stamps of 1 camera"));
    CHECK(by_ptp({{"state", "init"}, {"sigma_ns", nullptr}}, "unused").state == State::unknown);
    CHECK(by_ptp({{"state", "init"}, {"sigma_ns", nullptr}}, "running").state == State::unknown);
    CHECK(by_ptp(nullptr, "unused").state == State::unknown);
}

TEST_CASE("doctor: the report is one line for each finding, and one object as JSON") {
    const Finding mtu{"mtu", "eth7", "1500 bytes", Verdict::warning, "why", "do this"};
    const Finding shm{"shm", "/dev/shm", "9 of 9 MiB free"};
    const Findings findings{mtu, shm};
    const Conclusion conclusion{Conclusion::State::right, "It is right."};
    CHECK(report_text(findings, conclusion) ==
          "warning  mtu              eth7         1500 bytes\n         why\n"
          "         cure: do this\n"
          "ok       shm              /dev/shm     9 of 9 MiB free\n\nIt is right.\n");
    const json report = json::parse(report_json(findings, conclusion));
    CHECK(report["schema"] == 1);
    CHECK(report["findings"][0]["verdict"] == "warning");
    CHECK(report["findings"][0]["cure"] == "do this");
    CHECK(report["synchronisation"]["state"] == "right");
}

// SPDX-License-Identifier: BSD-3-Clause
// `versavis flash` through the real libusb, on a simulated bus with a model of the boot loader. Run
// under umockdev-wrapper.
#include <umockdev.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "../support/process.hpp"
#include "../support/stack.hpp"
#include "../support/temporary_directory.hpp"
#include "../support/uf2_file.hpp"
#include "simulated_pico.hpp"
#include "usb_bridge.hpp"

using namespace versavis;
using namespace versavis::test;
using Catch::Contains;

namespace {

constexpr std::size_t pages = 40;  // two sectors and a half
const std::string old_version = "versavis 0.0.1";
const std::string new_version = "versavis 0.0.2";

/// A bus, a file of the new version, and the tool.
struct FlashBench {
    FlashBench() { write(uf2_file(pico_firmware(new_version, pages))); }

    void write(const std::vector<std::uint8_t>& bytes) {
        file = directory.write("new.uf2", as_text(bytes));
    }
    /// Its exit code; `said` is what it printed.
    int flash(std::vector<std::string> more = {}) {
        std::vector<std::string> command{program("versavis"), "--instance", "no-such-service",
                                         "flash", file};
        command.insert(command.end(), more.begin(), more.end());
        return run(command, directory.path() / "log", &said);
    }

    GObjectPtr<UMockdevTestbed> testbed{umockdev_testbed_new()};
    TemporaryDirectory directory;
    std::string file;
    std::string said;
};

bool holds(const SimulatedPico& pico, const std::string& version) {
    const auto image = pico_firmware(version, pages);
    return pico.flash().read(0, image.size()) == image;
}

}  // namespace

TEST_CASE("flash: a board that runs gets new firmware, and both versions are reported") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {});
    // What lies behind the image are the board's own settings.
    const std::vector<std::uint8_t> settings(256, 0x5A);
    pico.flash().write(3 * client::flash_sector, settings);
    CHECK(bench.flash() == 0);
    CHECK_THAT(bench.said, Contains(old_version) && Contains(new_version) && Contains("PICO0001") &&
                               Contains("usb:1-1"));
    CHECK(holds(pico, new_version));
    CHECK(pico.flash().read(3 * client::flash_sector, settings.size()) == settings);
    CHECK(pico.touches() == 0);
}

TEST_CASE("flash: a board in its boot loader is found, too, and the outcome may be JSON") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {"PICO0007", "1-1", ""});
    CHECK(bench.flash({"--json"}) == 0);
    const auto outcome = nlohmann::json::parse(bench.said);
    CHECK(outcome["before"].is_null());
    CHECK(outcome["after"] == new_version);
    CHECK(outcome["serial"] == "PICO0007");
    CHECK(outcome["port"] == "usb:1-1");
    CHECK(outcome["bytes"] == pages * client::flash_page);
    CHECK(holds(pico, new_version));
}

TEST_CASE("flash: a board whose program hangs is rebooted by 1200 baud") {
    FlashBench bench;
    PicoSettings settings;
    settings.hangs = true;
    SimulatedPico pico(bench.testbed.get(), settings);
    CHECK(bench.flash() == 0);
    CHECK(pico.touches() == 1);
    CHECK(holds(pico, new_version));
}

TEST_CASE("flash: firmware of another protocol is replaced, and info says that it must be") {
    FlashBench bench;
    PicoSettings settings;
    settings.protocol = 2;
    SimulatedPico pico(bench.testbed.get(), settings);
    CHECK(run({program("versavis"), "--instance", "no-such-service", "board", "info"},
              bench.directory.path() / "log", &bench.said) == 0);
    CHECK_THAT(bench.said, Contains("firmware of protocol 2.") && Contains("'versavis flash'"));
    CHECK(bench.flash() == 0);
    CHECK_THAT(bench.said, Contains(new_version + ", before firmware of protocol 2."));
}

TEST_CASE("flash: without a board, it says what to do") {
    FlashBench bench;
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("1209:5653") && Contains("2e8a:0003") && Contains("BOOTSEL"));
}

TEST_CASE("flash: a wrong file is refused before the board is touched") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {});
    auto file = uf2_file(pico_firmware(new_version, pages));
    SECTION("of another chip") {
        put_word(file, 28, 0xE48BFF59);
        bench.write(file);
        CHECK(bench.flash() == 69);
        CHECK_THAT(bench.said, Contains("block 0") && Contains("0xe48bff59"));
    }
    SECTION("no UF2 at all") {
        bench.write({'h', 'e', 'l', 'l', 'o'});
        CHECK(bench.flash() == 69);
        CHECK_THAT(bench.said, Contains("is no UF2 file"));
    }
    SECTION("that overwrites the settings") {
        put_word(file, 512 + 12, wire::settings_begin);
        bench.write(file);
        CHECK(bench.flash() == 69);
        CHECK_THAT(bench.said,
                   Contains("block 1") && Contains("where the board keeps its settings"));
    }
    SECTION("that reaches beyond the flash") {
        put_word(file, 512 + 12, 0x10200000);
        bench.write(file);
        CHECK(bench.flash() == 69);
        CHECK_THAT(bench.said, Contains("0x10200000, outside of the flash, which is 2048 KiB"));
    }
    SECTION("damaged") {
        file[20 * 512 + 100] ^= 1;
        bench.write(file);
        CHECK(bench.flash({"--all"}) == 69);
        CHECK_THAT(bench.said, Contains("is damaged, or is not VersaVIS firmware"));
    }
    SECTION("none") {
        bench.file += "x";
        CHECK(bench.flash() == 69);
        CHECK_THAT(bench.said, Contains("No such file"));
    }
    CHECK(holds(pico, old_version));
    CHECK(pico.boots() == 1);
}

TEST_CASE("flash: unplugged in the middle, the board is flashed again") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {});
    BootLoaderFaults faults;
    faults.gone_at = 20 * client::flash_page;
    pico.set_faults(faults);
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("unplugged") && Contains("run this again"));
    CHECK_FALSE(pico.flash().starts());
    pico.set_faults({});
    pico.plug(false);
    CHECK(bench.flash() == 0);
    CHECK_THAT(bench.said, Contains("in its boot loader"));
    CHECK(holds(pico, new_version));
}

TEST_CASE("flash: what reads back otherwise does not start") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {});
    const std::size_t at = 17 * client::flash_page + 3;
    const std::uint8_t wanted = pico_firmware(new_version, pages)[at];
    REQUIRE(wanted != 0);
    unsigned bit = 0;
    while ((wanted >> bit & 1U) == 0) ++bit;
    pico.flash().wear_out(at, static_cast<std::uint8_t>(bit));
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("0x10001103") && Contains("worn"));
    CHECK_FALSE(pico.flash().starts());
}

TEST_CASE("flash: a boot loader that refuses or does not answer is reported, with the command") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {"PICO0001", "1-1", ""});
    struct Case {
        std::uint8_t id;
        const char* words;
    };
    const Case refused = GENERATE(values<Case>({{0x01, "cannot take the flash"},
                                                {0x06, "cannot stop running"},
                                                {0x03, "cannot erase at 0x10000000"},
                                                {0x05, "cannot write at 0x10001000"},
                                                {0x84, "cannot read at 0x10000000"},
                                                {0x02, "cannot reboot"}}));
    BootLoaderFaults faults;
    faults.refused_command = refused.id;
    pico.set_faults(faults);
    pico.plug(true);
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said,
               Contains(refused.words) && Contains("wrong alignment") && Contains("usb:1-1"));
    CHECK_THAT(bench.said, Contains("run this again"));
}

TEST_CASE("flash: a boot loader that does not answer is reported") {
    FlashBench bench;
    PicoSettings settings;
    settings.faults.held_command = 0x05;
    SimulatedPico pico(bench.testbed.get(), settings);
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("cannot write at 0x10001000: it does not answer") &&
                               Contains("reconnect the board"));
}

TEST_CASE("flash: a board that does not reboot into its boot loader is reported") {
    FlashBench bench;
    PicoSettings settings;
    settings.obeys = false;
    SimulatedPico pico(bench.testbed.get(), settings);
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("does not reboot") && Contains("BOOTSEL"));
    CHECK(pico.touches() == 1);
    CHECK(holds(pico, old_version));
}

TEST_CASE("flash: new firmware that says nothing is reported") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {});
    auto image = pico_firmware(new_version, pages);
    image[client::flash_page] = 0;  // its version: it does not speak
    seal(image);
    bench.write(uf2_file(image));
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("written and verified") && Contains("has not said hello"));
}

TEST_CASE("flash: of two boards one is chosen") {
    FlashBench bench;
    SimulatedPico first(bench.testbed.get(), {"PICO0001", "1-1"});
    SimulatedPico second(bench.testbed.get(), {"PICO0002", "1-2"});
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("2 boards") && Contains("usb:1-1 (serial PICO0001)") &&
                               Contains("usb:1-2 (serial PICO0002)") && Contains("--serial"));
    CHECK(bench.flash({"--serial", "PICO0003"}) == 69);
    CHECK_THAT(bench.said, Contains("no board with serial PICO0003"));
    CHECK(bench.flash({"--serial", "PICO0002"}) == 0);
    CHECK(holds(first, old_version));
    CHECK(holds(second, new_version));

    first.plug(true);
    CHECK(bench.flash() == 69);
    CHECK_THAT(bench.said, Contains("usb:1-1 (boot loader)"));
    CHECK(bench.flash({"--port", "usb:1-1"}) == 0);
    CHECK(holds(first, new_version));
}

TEST_CASE("flash: the firmware that was installed is taken, else the one that was built") {
    FlashBench bench;
    SimulatedPico pico(bench.testbed.get(), {});
    const auto prefix = bench.directory.path();
    const auto tool = prefix / "bin/versavis";
    for (const char* folder : {"bin", "firmware", "share/versavis"})
        std::filesystem::create_directories(prefix / folder);
    std::filesystem::copy_file(program("versavis"), tool);
    const auto flash = [&] {
        return run({tool, "--instance", "no-such-service", "flash"}, prefix / "log", &bench.said);
    };
    CHECK(flash() == 69);
    CHECK_THAT(bench.said, Contains("share/versavis/versavis.uf2: is not there") &&
                               Contains("install gcc-arm-none-eabi") &&
                               Contains("name a UF2 file"));
    CHECK(holds(pico, old_version));
    std::filesystem::copy_file(bench.file, prefix / "firmware/versavis.uf2");
    CHECK(flash() == 0);
    CHECK(holds(pico, new_version));
    bench.directory.write("share/versavis/versavis.uf2",
                          as_text(uf2_file(pico_firmware("versavis 0.0.3", pages))));
    CHECK(flash() == 0);
    CHECK(holds(pico, "versavis 0.0.3"));
}

TEST_CASE("flash: all boards of a fleet, whatever becomes of one of them") {
    FlashBench bench;
    CHECK(bench.flash({"--all"}) == 69);
    CHECK_THAT(bench.said, Contains("no board") && Contains("BOOTSEL"));
    SimulatedPico first(bench.testbed.get(), {"PICO0001", "1-1"});
    SimulatedPico second(bench.testbed.get(), {"PICO0002", "1-2"});
    SimulatedPico third(bench.testbed.get(), {"PICO0003", "1-3", ""});
    BootLoaderFaults faults;
    faults.refused_command = 0x05;
    second.set_faults(faults);
    CHECK(bench.flash({"--all"}) == 69);
    CHECK_THAT(bench.said, Contains("board PICO0001 at usb:1-1: " + new_version) &&
                               Contains("boot loader at usb:1-2: cannot write") &&
                               Contains("board PICO0003 at usb:1-3: " + new_version) &&
                               Contains("2 of 3 boards have the new firmware"));
    CHECK(holds(first, new_version));
    CHECK(holds(third, new_version));

    CHECK(bench.flash({"--all", "--serial", "PICO0001"}) != 0);
    CHECK_THAT(bench.said, Contains("excludes"));
    second.set_faults({});
    second.plug(true);
    CHECK(bench.flash({"--all", "--json"}) == 0);
    const auto boards = nlohmann::json::parse(bench.said)["boards"];
    REQUIRE(boards.size() == 3);
    for (const auto& board : boards) CHECK(board["after"] == new_version);
    CHECK(holds(second, new_version));
}

TEST_CASE("flash: a Pico 2 is refused, and does not stand in the way of a board") {
    FlashBench bench;
    PicoSettings settings{"", "1-2", ""};
    settings.faults.product = 0x000F;
    const SimulatedPico other(bench.testbed.get(), settings);
    for (const std::vector<std::string>& more :
         {std::vector<std::string>{}, {"--port", "usb:1-2"}, {"--all"}}) {
        CHECK(bench.flash(more) == 69);
        CHECK_THAT(bench.said, Contains("board at usb:1-2: is a Pico 2") && Contains("RP2350") &&
                                   Contains("use a board with an RP2040"));
    }
    const SimulatedPico pico(bench.testbed.get(), {});
    CHECK(bench.flash() == 0);
    CHECK(holds(pico, new_version));
    CHECK(bench.flash({"--all", "--json"}) == 69);
    CHECK_THAT(bench.said, Contains(R"("error":"board at usb:1-2: is a Pico 2)"));
    CHECK(other.flash().read(0, 1).front() == 0xFF);
}

TEST_CASE("flash: the firmware of this build may be flashed") {
    const auto bin = std::filesystem::path(program("versavis")).parent_path();
    const auto own = bin.parent_path() / "firmware/versavis.uf2";
    if (!exists(own)) {
        WARN("no compiler for the chip: not built");
        return;
    }
    const auto image = client::read_uf2(own);
    INFO((image ? "" : image.error().message()));
    CHECK(image.has_value());
}

TEST_CASE("flash: interrupted, it says what state the board is in") {
    FlashBench bench;
    BootLoaderFaults faults;
    faults.held_command = 0x03;
    SimulatedPico pico(bench.testbed.get(), {});
    pico.set_faults(faults);
    Process tool({program("versavis"), "--instance", "no-such-service", "flash", bench.file},
                 bench.directory.path() / "log");
    const HostTime deadline = host_now() + seconds(20);
    while (pico.flash().starts() && host_now() < deadline) {
        const timespec pause{0, 1'000'000};
        nanosleep(&pause, nullptr);
    }
    REQUIRE_FALSE(pico.flash().starts());
    tool.signal(SIGINT);
    pico.release();
    CHECK(tool.wait(seconds(20)) == 69);
    CHECK_THAT(tool.output(), Contains("stopped") && Contains("waits in its boot loader") &&
                                  Contains("run this again"));
    pico.set_faults({});
    pico.plug(false);
    CHECK(bench.flash() == 0);
    CHECK(holds(pico, new_version));
}

TEST_CASE("usb: a board that the service has is not flashed") {
    FlashBench bench;
    Stack stack({"flashbusy", 32, 1, 20, "", "", "", 320, 240, "usb"});
    stack.start_rig();
    UsbBridge bridge(bench.testbed.get(), stack.socket_path(), "RIG0001");
    stack.start_service();
    stack.wait_for_status(healthy);
    std::string said;
    CHECK(stack.tool({"flash", bench.file}, &said) == 69);
    CHECK_THAT(said, Contains("the service 'flashbusy'") && Contains("systemctl stop versavisd"));
    CHECK(stack.wait_for_status(healthy)["board"]["connections"] == 1);
    CHECK(stack.service().terminate() == 0);
}

// SPDX-License-Identifier: BSD-3-Clause
#include "board/flash.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "board/board_access.hpp"
#include "board/picoboot.hpp"
#include "board/uf2.hpp"

namespace versavis::client {

namespace {

/// For the boot loader to appear: it takes half a second.
constexpr Duration reboot_patience = seconds(3);

using Sectors = decltype(FlashImage::sectors);

/// A part that failed, or was stopped, with what that means for the board.
Unexpected<> ended(const Error& error, const std::string& state) {
    return failure(error.where, fmt::format("{}; {}", error.what, state),
                   error.cure.empty() ? "run this again" : error.cure + ", then run this again");
}

const char* const unharmed = "the board still has its old firmware";
const char* const half_written =
    "the board has no complete firmware now, and waits in its boot loader";

class Flasher {
 public:
    Flasher(const FlashSettings& settings, const FlashImage& image)
        : settings_(settings), image_(image) {}

    Expected<Flashed> run(const device::UsbBus& bus, const BoardChoice& choice) {
        const HostTime begun = host_now();
        const auto found = find_board(bus, choice);
        if (!found) return Unexpected(found.error());
        flashed_.port = found->device.port();
        flashed_.bytes = image_.pages * flash_page;
        const auto device = boot_loader_of(bus, *found);
        if (!device) return Unexpected(device.error());
        if (auto done = fill(*device, image_.sectors); !done) return Unexpected(done.error());
        if (auto done = meet(bus); !done) return Unexpected(done.error());
        flashed_.took = host_now() - begun;
        return flashed_;
    }

 private:
    /// Of a board that runs, once it has rebooted.
    Expected<device::UsbDevice> boot_loader_of(const device::UsbBus& bus, const FoundBoard& found) {
        if (found.in_boot_loader) return found.device;
        auto conversation = open_board(found, settings_.instance);
        if (!conversation) return Unexpected(conversation.error());
        if (const auto greeting = conversation->greet()) {
            flashed_.before = greeting->firmware();
            flashed_.serial = greeting->serial();
        } else {
            flashed_.before = "firmware that does not answer";
        }
        settings_.progress("rebooting", 0, 1);
        // It may go away before all has arrived; what counts is that it comes back.
        static_cast<void>(conversation->send(wire::Reboot{wire::reboot_magic, 1}));
        auto device = wait_for_board(bus, flashed_.port, true, reboot_patience, settings_.stop);
        if (!device && !settings_.stop()) {
            conversation->touch();
            device = wait_for_board(bus, flashed_.port, true, reboot_patience, settings_.stop);
        }
        if (device) return *device;
        if (settings_.stop()) return ended({"flashing", "stopped", ""}, unharmed);
        return failure("board at " + flashed_.port, "does not reboot into its boot loader",
                       "hold its BOOTSEL button while you plug it in, then run this again");
    }

    Expected<> fill(const device::UsbDevice& device, const Sectors& sectors) {
        auto boot_loader = Picoboot::open(device);
        if (!boot_loader) return ended(boot_loader.error(), "the board waits in its boot loader");
        if (settings_.stop())
            return ended({"flashing", "stopped", ""},
                         "nothing was erased: reconnect the board for its old firmware, if it "
                         "had one");
        if (auto done = erase_and_write(*boot_loader, sectors); !done)
            return ended(done.error(), half_written);
        if (auto done = verify(*boot_loader, sectors); !done) {
            // What cannot be trusted shall not start.
            static_cast<void>(boot_loader->erase(sectors.begin()->first, flash_sector));
            return ended(done.error(), half_written);
        }
        settings_.progress("starting", 0, 1);
        if (auto done = boot_loader->reboot(); !done)
            return ended(done.error(), "the new firmware is complete: reconnect the board");
        return {};
    }

    /// The first sector says that there is firmware, so it is the first to go and the last to come.
    Expected<> erase_and_write(Picoboot& boot_loader, const Sectors& sectors) {
        auto done = each("erasing", sectors, [&](const auto& sector) {
            return boot_loader.erase(sector.first, flash_sector);
        });
        if (!done) return done;
        const Sectors rest(std::next(sectors.begin()), sectors.end());
        const auto write = [&](const auto& sector) {
            return boot_loader.write(sector.first, sector.second);
        };
        if (done = each("writing", rest, write); !done) return done;
        return write(*sectors.begin());
    }

    Expected<> verify(Picoboot& boot_loader, const Sectors& sectors) {
        return each("verifying", sectors, [&](const auto& sector) -> Expected<> {
            std::vector<std::uint8_t> read(sector.second.size());
            if (auto done = boot_loader.read(sector.first, read); !done) return done;
            const auto wrong = std::mismatch(read.begin(), read.end(), sector.second.begin());
            if (wrong.first == read.end()) return {};
            return failure(
                "verifying",
                fmt::format("the flash has {:#04x} at {:#010x}, the file {:#04x}", *wrong.first,
                            sector.first + (wrong.first - read.begin()), *wrong.second),
                "if this stays, the flash of the board is worn or too small");
        });
    }

    template <class Do>
    Expected<> each(const char* what, const Sectors& sectors, const Do& act) {
        std::size_t done = 0;
        for (const auto& sector : sectors) {
            if (settings_.stop()) return failure(what, "stopped");
            if (auto result = act(sector); !result) return result;
            settings_.progress(what, ++done, sectors.size());
        }
        return {};
    }

    Expected<> meet(const device::UsbBus& bus) {
        const auto met =
            wait_for_hello(bus, flashed_.port, settings_.instance, std::nullopt, settings_.stop);
        if (!met)
            return failure(met.error().where,
                           "the new firmware was written and verified; " + met.error().what,
                           met.error().cure);
        flashed_.serial = met->serial;
        flashed_.after = met->firmware;
        return {};
    }

    const FlashSettings& settings_;
    const FlashImage& image_;
    Flashed flashed_;
};

double seconds_of(Duration took) { return static_cast<double>(took.ns) * 1e-9; }

}  // namespace

Expected<Flashed> flash(const FlashSettings& settings) {
    const auto image = read_uf2(settings.file);
    if (!image) return Unexpected(image.error());
    const auto bus = device::UsbBus::open();
    if (!bus) return Unexpected(bus.error());
    return Flasher(settings, *image).run(*bus, settings.board);
}

Expected<std::size_t> flash_all(
    const FlashSettings& settings,
    const std::function<void(const FoundBoard&, const Expected<Flashed>&)>& finished) {
    const auto image = read_uf2(settings.file);
    if (!image) return Unexpected(image.error());
    const auto bus = device::UsbBus::open();
    if (!bus) return Unexpected(bus.error());
    const auto boards = list_boards(*bus);
    if (!boards) return Unexpected(boards.error());
    for (const FoundBoard& board : *boards) {
        const std::string port = board.device.port();
        if (settings.stop()) {
            finished(board, failure("board at " + port, "not begun: stopped", "run this again"));
            continue;
        }
        FlashSettings one = settings;
        one.progress = [&](const std::string& what, std::size_t done, std::size_t all) {
            settings.progress(fmt::format("{}: {}", port, what), done, all);
        };
        finished(board, Flasher(one, *image).run(*bus, {"", port}));
    }
    return boards->size();
}

nlohmann::json to_json(const Flashed& flashed) {
    return {{"port", flashed.port},
            {"serial", flashed.serial},
            {"before",
             flashed.before.empty() ? nlohmann::json(nullptr) : nlohmann::json(flashed.before)},
            {"after", flashed.after},
            {"bytes", flashed.bytes},
            {"took_s", seconds_of(flashed.took)}};
}

std::string to_text(const Flashed& flashed) {
    return fmt::format("board {} at {}: {}, before {}; {} bytes written and verified in {:.1f} s\n",
                       flashed.serial, flashed.port, flashed.after,
                       flashed.before.empty() ? "in its boot loader" : flashed.before,
                       flashed.bytes, seconds_of(flashed.took));
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "discovery/found_devices.hpp"

#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <filesystem>

#include "base/json_text.hpp"
#include "base/shallow_json.hpp"
#include "base/wrapped_line.hpp"
#include "board/board_search.hpp"
#include "discovery/service_program.hpp"
#include "status/status_document.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

constexpr std::size_t indent = 4;

std::vector<json> all_statuses() {
    std::vector<json> statuses;
    std::error_code error;
    const auto directory = instance_directory("default").parent_path();
    std::vector<std::string> instances;
    for (const auto& entry : std::filesystem::directory_iterator(directory, error))
        instances.push_back(entry.path().filename());
    std::sort(instances.begin(), instances.end());
    for (const std::string& instance : instances)
        if (auto status = read_status(instance)) statuses.push_back(std::move(*status));
    return statuses;
}

json board_object(const FoundBoard& board) {
    json object{{"serial", board.serial}, {"port", board.device.port()}, {"state", "running"},
                {"firmware", ""},         {"problem", board.problem},    {"cure", ""}};
    if (board.in_boot_loader) {
        object["state"] = "boot_loader";
        object["problem"] = "it is in its boot loader";
        object["cure"] = "flash it with 'versavis flash'";
    }
    if (board.is_pico_2) {
        object["state"] = "pico_2";
        object["problem"] = "its chip, an RP2350, is not the one that the firmware is made for";
        object["cure"] = "use a board with an RP2040: a Pico, Pico H, Pico W or Pico WH";
    }
    return object;
}

json boards_on_usb() {
    json boards = json::array();
    const auto bus = device::UsbBus::open();
    if (!bus) return boards;  // a host without USB
    if (const auto found = list_boards(*bus))
        for (const FoundBoard& board : *found) boards.push_back(board_object(board));
    return boards;
}

/// Null: nobody does.
json user(const json& status, const std::string& name) {
    return {
        {"instance", text(status, "instance")}, {"pid", status.value("pid", 0)}, {"name", name}};
}

void join_board(json& boards, const json& status) {
    const json board = status.value("board", json::object());
    const std::string port = text(board, "port");
    if (port.empty() || text(board, "state") == "absent") return;
    const std::string serial = text(board, "serial");
    auto known = std::find_if(boards.begin(), boards.end(), [&](const json& other) {
        return text(other, "port") == port &&
               (text(other, "serial").empty() || text(other, "serial") == serial);
    });
    if (known == boards.end()) {
        boards.push_back({{"port", port}, {"problem", ""}, {"cure", ""}});
        known = std::prev(boards.end());
    }
    (*known)["serial"] = serial;
    (*known)["state"] = text(board, "state");
    (*known)["firmware"] = text(board, "firmware");
    (*known)["used_by"] = user(status, "");
    (*known)["problem"] = text(board, "hint");
    (*known)["cure"] = "";
}

/// The service has it, so nothing stands in the way but what the service says.
void join_camera(json& cameras, const json& status, const json& used) {
    const std::string serial = text(used, "serial");
    if (serial.empty()) return;
    for (json& camera : cameras) {
        if (text(camera, "serial") != serial || text(camera, "access") != "busy") continue;
        camera["used_by"] = user(status, text(used, "name"));
        camera["problem"] = text(used, "hint");
        camera["cure"] = "";
    }
}

std::string used_text(const json& device) {
    const json used = device.value("used_by", json());
    if (!used.is_object()) return "";
    const std::string name = text(used, "name");
    return fmt::format("used by service '{}'{}", text(used, "instance"),
                       name.empty() ? "" : " as " + name);
}

std::string problem_line(const json& device) {
    const std::string problem = text(device, "problem");
    if (problem.empty()) return "";
    const std::string cure = text(device, "cure");
    return wrapped(fmt::format("{:{}}{}{}", "", indent, problem, cure.empty() ? "" : "; " + cure),
                   indent);
}

/// Cells of rows, the first of which are titles, in columns.
std::string aligned(const std::vector<std::vector<std::string>>& rows,
                    const std::vector<std::string>& below) {
    std::vector<std::size_t> widths(rows.front().size());
    for (const auto& row : rows)
        for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
    std::string out;
    for (std::size_t r = 0; r < rows.size(); ++r) {
        std::string line;
        for (std::size_t i = 0; i < rows[r].size(); ++i)
            line += fmt::format("  {:<{}}", rows[r][i], widths[i]);
        out += line.substr(0, line.find_last_not_of(' ') + 1) + "\n" + below[r];
    }
    return out;
}

std::string or_dash(const std::string& text) { return text.empty() ? "-" : text; }

std::string boards_text(const json& boards) {
    if (boards.empty())
        return "no board: plug it in; a new one: hold BOOTSEL meanwhile, then versavis flash\n";
    std::vector<std::vector<std::string>> rows{{"board", "port", "firmware", "state"}};
    std::vector<std::string> below{""};
    for (const json& board : boards) {
        const std::string used = used_text(board);
        rows.push_back({or_dash(text(board, "serial")), text(board, "port"),
                        or_dash(text(board, "firmware")),
                        text(board, "state") + (used.empty() ? "" : ", " + used)});
        below.push_back(problem_line(board));
    }
    return aligned(rows, below);
}

std::string cameras_text(const json& cameras) {
    if (cameras.empty())
        return "no camera answers: check cables and power, or ask one with --address\n";
    std::vector<std::vector<std::string>> rows{{"camera", "model", "at", "preset", "state"}};
    std::vector<std::string> below{""};
    for (const json& camera : cameras) {
        const std::string used = used_text(camera);
        rows.push_back({or_dash(text(camera, "serial")), or_dash(text(camera, "model")),
                        place_of(camera), or_dash(text(camera, "preset")),
                        used.empty() ? text(camera, "access") : "in use"});
        below.push_back((used.empty() ? "" : wrapped(std::string(indent, ' ') + used, indent)) +
                        problem_line(camera));
    }
    return aligned(rows, below);
}

}  // namespace

bool goes_by(const json& camera, const std::string& name) {
    for (const char* key : {"serial", "address", "mac", "user_name", "device"})
        if (const std::string own = text(camera, key);
            !own.empty() && strcasecmp(own.c_str(), name.c_str()) == 0)
            return true;
    return false;
}

std::string place_of(const json& camera) {
    const std::string address = text(camera, "address");
    return address.empty() ? text(camera, "port") : address;
}

json join_devices(json boards, json cameras, const std::vector<json>& statuses) {
    for (json* list : {&boards, &cameras})
        for (json& device : *list) device["used_by"] = nullptr;
    json services = json::array();
    for (const json& status : statuses) {
        services.push_back({{"instance", text(status, "instance")},
                            {"pid", status.value("pid", 0)},
                            {"health", text(status, "health")}});
        join_board(boards, status);
        for (const json& used : status.value("cameras", json::array()))
            join_camera(cameras, status, used);
    }
    return {{"services", services}, {"boards", boards}, {"cameras", cameras}};
}

Expected<json> find_devices(const std::vector<std::string>& addresses) {
    std::vector<std::string> arguments{"--list-cameras", "--json"};
    for (const std::string& address : addresses)
        arguments.insert(arguments.end(), {"--address", address});
    const auto listed = run_versavisd(std::move(arguments));
    if (!listed) return Unexpected(listed.error());
    json cameras = parse_shallow_json(listed->output);
    if (listed->exit_code != 0 || !cameras.is_array())
        return failure("cameras", "versavisd cannot list them",
                       "install service and tool of the same release");
    return join_devices(boards_on_usb(), std::move(cameras), all_statuses());
}

bool anything_found(const json& devices) {
    return !devices["boards"].empty() || !devices["cameras"].empty();
}

std::string devices_text(const json& devices) {
    return boards_text(devices["boards"]) + "\n" + cameras_text(devices["cameras"]);
}

}  // namespace versavis::client

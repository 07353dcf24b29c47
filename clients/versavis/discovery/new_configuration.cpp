// SPDX-License-Identifier: BSD-3-Clause
#include "discovery/new_configuration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "base/json_text.hpp"
#include "discovery/found_devices.hpp"
#include "engine/imu/imu_model.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// Of a period, for exposures: the rest is for readout.
constexpr double exposure_of_period = 0.8;

/// As a text of TOML, whose escapes are those of JSON.
std::string quoted(const std::string& value) {
    return json(value).dump(-1, ' ', true, json::error_handler_t::replace);
}

/// In one line, whatever a device calls itself.
std::string comment(std::string words) {
    for (char& letter : words)
        if (static_cast<unsigned char>(letter) < ' ' || letter == '\x7f') letter = '?';
    return "# " + words + "\n";
}

std::pair<std::string, std::string> split(const std::string& word) {
    const std::size_t at = word.find('=');
    if (at == std::string::npos) return {word, ""};
    return {word.substr(0, at), word.substr(at + 1)};
}

Error not_found(const json& found, const std::string& name) {
    std::string others;
    for (const json& camera : found)
        others += (others.empty() ? "" : ", ") + text(camera, "serial") + " at " + place_of(camera);
    return {name, "no camera with this serial number, address or name answers",
            others.empty() ? "see 'versavis discover'" : "there are: " + others};
}

Expected<> check_count(std::size_t count) {
    if (count <= most_cameras) return {};
    return failure("cameras",
                   fmt::format("{} are too many: a board has {} outputs", count, most_cameras),
                   "choose with --camera");
}

/// Lines of one table.
class Table {
 public:
    Table(const json& keys, std::string title) : keys_(keys), title_(std::move(title)) {
        if (!title_.empty()) text_ = title_ + "\n";
    }

    Table& key(const std::string& name, const std::string& value) {
        text_ += meaning(name) + name + " = " + value + "\n";
        return *this;
    }

    /// To be uncommented.
    Table& offer(const std::string& name, const std::string& value) {
        text_ += meaning(name) + "#" + name + " = " + value + "\n";
        return *this;
    }

    const std::string& text() const { return text_; }

 private:
    std::string meaning(const std::string& name) const {
        for (const json& key : keys_)
            if (client::text(key, "table") == title_ && client::text(key, "key") == name)
                return comment(fmt::format("{} ({})", client::text(key, "meaning"),
                                           client::text(key, "range")));
        return "";
    }

    static std::string comment(const std::string& words) { return client::comment(words); }

    const json& keys_;
    std::string title_;
    std::string text_;
};

std::string camera_text(const NewConfiguration& configuration, std::size_t output,
                        const json& keys) {
    const NewCamera& camera = configuration.cameras[output];
    Table table(keys, "[[camera]]");
    table.key("name", quoted(camera.name))
        .key("device", quoted(camera.device))
        .key("output", fmt::format("{}", output))
        .key("rate_hz", fmt::format("{}", configuration.rate_hz))
        .key("max_exposure_us",
             fmt::format("{:.0f}", std::max(1.0, exposure_of_period * 1e6 / configuration.rate_hz)))
        .key("strobe", quoted("active_high"))
        .offer("preset", quoted("generic"))
        .offer("trigger_line", quoted("Line0"))
        .offer("strobe_line", quoted("Line1"));
    return "\n" + comment(camera.description) +
           (camera.problem.empty() ? "" : comment("When this was written: " + camera.problem)) +
           table.text() +
           "# GenICam features of the camera, by name\n#[camera.features]\n#ExposureTime = 3000\n";
}

std::string imu_text(const NewImu& imu, const json& keys) {
    Table table(keys, "[[imu]]");
    table.key("name", quoted(imu.name))
        .key("model", quoted(imu.model))
        .key("rate_hz", "200")
        .offer("bus", quoted("spi"))
        .offer("data_ready", "true")
        .offer("filter", "0");
    return "\n" + table.text();
}

}  // namespace

bool usable(const json& camera, const std::string& instance) {
    const json used = camera.value("used_by", json());
    const bool ours = used.is_object() && text(used, "instance") == instance;
    return !text(camera, "device").empty() && (text(camera, "access") == "free" || ours);
}

NewCamera new_camera(const json& camera, const std::string& instance) {
    NewCamera made;
    made.device = text(camera, "device");
    if (made.device.empty()) made.device = text(camera, "serial");
    made.description =
        fmt::format("{} {}, serial number {}, {} at {}; preset {}", text(camera, "vendor"),
                    text(camera, "model"), text(camera, "serial"), text(camera, "protocol"),
                    place_of(camera), text(camera, "preset"));
    if (usable(camera, instance)) return made;
    const json used = camera.value("used_by", json());
    made.problem = used.is_object()
                       ? fmt::format("the service '{}' uses it", text(used, "instance"))
                       : fmt::format("{}; {}", text(camera, "problem"), text(camera, "cure"));
    return made;
}

void name_cameras(std::vector<NewCamera>& cameras) {
    const auto taken = [&](const std::string& name) {
        return std::any_of(cameras.begin(), cameras.end(),
                           [&](const NewCamera& camera) { return camera.name == name; });
    };
    std::size_t next = 0;
    for (NewCamera& camera : cameras) {
        if (!camera.name.empty()) continue;
        std::string name;
        do name = fmt::format("cam{}", next++);
        while (taken(name));
        camera.name = name;
    }
}

Expected<std::vector<NewCamera>> choose_cameras(const json& found,
                                                const std::vector<std::string>& wanted,
                                                const std::string& instance) {
    std::vector<NewCamera> chosen;
    if (wanted.empty())
        for (const json& camera : found)
            if (usable(camera, instance)) chosen.push_back(new_camera(camera, instance));
    for (const std::string& word : wanted) {
        const auto [which, name] = split(word);
        const auto camera =
            std::find_if(found.begin(), found.end(),
                         [&, &id = which](const json& each) { return goes_by(each, id); });
        if (camera == found.end()) return Unexpected(not_found(found, which));
        NewCamera made = new_camera(*camera, instance);
        const bool twice = std::any_of(chosen.begin(), chosen.end(), [&](const NewCamera& other) {
            return other.device == made.device;
        });
        if (twice) return failure(which, "is chosen twice", "name each camera once");
        made.name = name;
        chosen.push_back(std::move(made));
    }
    if (auto fits = check_count(chosen.size()); !fits) return Unexpected(fits.error());
    name_cameras(chosen);
    return chosen;
}

Expected<NewImu> choose_imu(const std::string& text) {
    const auto [model, name] = split(text);
    if (imu::find_model(model) == nullptr)
        return failure(model, "no such IMU",
                       fmt::format("choose one of {}", fmt::join(imu::model_names(), ", ")));
    return NewImu{name.empty() ? "imu0" : name, model};
}

std::string choose_board(const json& boards, const std::string& instance) {
    if (boards.size() < 2) return "";
    for (const json& board : boards) {
        const json used = board.value("used_by", json());
        const bool free = !used.is_object() || text(used, "instance") == instance;
        if (std::string serial = text(board, "serial"); free && !serial.empty()) return serial;
    }
    return "";
}

std::string to_toml(const NewConfiguration& configuration, const json& keys) {
    std::string all =
        "# Configuration of the VersaVIS service, written by `versavis init`. Every key:\n"
        "# `versavisd --keys` and versavis.toml(5). After a change:\n"
        "#     versavisd --check-config && sudo systemctl restart versavisd\n";
    if (configuration.instance != "default")
        all += Table(keys, "").key("instance", quoted(configuration.instance)).text();
    Table board(keys, "[board]");
    if (configuration.link != "usb") board.key("link", quoted(configuration.link));
    board.key("serial", quoted(configuration.board_serial));
    Table clock(keys, "[clock]");
    clock.key("output", quoted("realtime"));
    all += "\n" + board.text() + "\n" + clock.text();
    for (std::size_t i = 0; i < configuration.cameras.size(); ++i)
        all += camera_text(configuration, i, keys);
    if (configuration.imu) all += imu_text(*configuration.imu, keys);
    return all;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "control/control.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/log.hpp"
#include "control/control_interface.hpp"

namespace versavis::daemon {

using nlohmann::json;

namespace {

/// A camera that is mute holds its thread for seconds.
constexpr Duration camera_patience = seconds(10);

json texts(const TomlProblems& problems) {
    json all = json::array();
    for (const TomlProblem& problem : problems) all.push_back(problem.message());
    return all;
}

/// The value as a file would have it; none: it is nothing that a key or a feature can be.
std::optional<std::string> to_toml(const json& value) {
    if (value.is_null()) return "";
    const bool list =
        value.is_array() && std::all_of(value.begin(), value.end(), [](const json& it) {
            return it.is_primitive() && !it.is_null();
        });
    if (!value.is_primitive() && !list) return std::nullopt;
    return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

/// 31 years: a clock that is further off has no figure.
constexpr std::int64_t furthest_lidar_ns = 1'000'000'000'000'000'000;

/// One that every terminal and log shows as it is; none: it is missing, or another kind of value.
std::optional<std::string> plain_text(const json& object, const char* name, std::size_t longest) {
    const auto found = object.find(name);
    if (found == object.end() || !found->is_string()) return std::nullopt;
    const auto text = found->get<std::string>();
    const auto is_plain = [](unsigned char c) { return c >= ' ' && c < 0x7F; };
    if (text.size() > longest || !std::all_of(text.begin(), text.end(), is_plain))
        return std::nullopt;
    return text;
}

/// None: a member is missing, or of another kind.
std::optional<LidarReport> lidar_of(const json& value) {
    if (!value.is_object()) return std::nullopt;
    constexpr std::size_t longest_name = 64;
    constexpr std::size_t longest_hint = 512;
    const auto source = plain_text(value, "source", longest_name);
    const auto maker = plain_text(value, "maker", longest_name);
    const auto verdict = plain_text(value, "verdict", longest_name);
    const auto hint = plain_text(value, "hint", longest_hint);
    if (!source || !maker || !verdict || !hint) return std::nullopt;
    // An address, which no camera has as its name.
    if (source->find_first_of(".:") == std::string::npos ||
        std::find(std::begin(lidar_verdicts), std::end(lidar_verdicts), *verdict) ==
            std::end(lidar_verdicts))
        return std::nullopt;
    LidarReport report{*source, *maker, *verdict, *hint, std::nullopt, std::nullopt};
    for (const auto& [name, time] :
         {std::pair("behind_ns", &report.behind), std::pair("ahead_ns", &report.ahead)}) {
        const json figure = value.value(name, json());
        if (figure.is_null()) continue;
        if (!figure.is_number_integer()) return std::nullopt;
        const double ns = figure.get<double>();
        if (std::abs(ns) > static_cast<double>(furthest_lidar_ns)) return std::nullopt;
        *time = Duration{figure.get<std::int64_t>()};
    }
    return report;
}

json state_of(const Summary& health) {
    json cameras = json::array();
    for (const DeviceSummary& camera : health.cameras)
        cameras.push_back({{"name", camera.name},
                           {"state", camera.state},
                           {"health", to_string(camera.health)},
                           {"hint", camera.hint}});
    return {{"health", to_string(health.health)}, {"text", health.text}, {"cameras", cameras}};
}

}  // namespace

struct Control::Method {
    const char* name;
    void (Control::*call)(Client, const VarlinkCall&);
};

const Control::Method Control::methods[] = {
    {"org.varlink.service.GetInfo", &Control::get_info},
    {"org.varlink.service.GetInterfaceDescription", &Control::describe_interface},
    {"org.versavis.service.GetState", &Control::get_state},
    {"org.versavis.service.StartCamera", &Control::start_camera},
    {"org.versavis.service.StopCamera", &Control::stop_camera},
    {"org.versavis.service.RestartCamera", &Control::restart_camera},
    {"org.versavis.service.SetCamera", &Control::set_camera},
    {"org.versavis.service.Reload", &Control::reload},
    {"org.versavis.service.ReportLidars", &Control::report_lidars}};

void Control::tick(const Summary& health, HostTime now) {
    now_ = now;
    inform_subscribers(health);
    waiting_.remove_if([&](Waiting& waiting) { return answered(waiting, now); });
    socket_.poll(now, [this](Client client, const std::string& message) { call(client, message); });
}

void Control::call(Client client, const std::string& message) {
    const auto parsed = parse_call(message);
    if (!parsed)
        return fail(client, "org.varlink.service.InvalidParameter",
                    {{"parameter", parsed.error().what}});
    if (parsed->oneway) oneway_.insert(client);
    const Method* method =
        std::find_if(std::begin(methods), std::end(methods),
                     [&](const Method& known) { return known.name == parsed->method; });
    if (method == std::end(methods))
        return fail(client, "org.varlink.service.MethodNotFound", {{"method", parsed->method}});
    (this->*method->call)(client, *parsed);
}

void Control::reply(Client client, const json& parameters) {
    if (oneway_.erase(client) > 0) return socket_.finish(client);
    socket_.send(client, varlink_reply(parameters));
}

void Control::fail(Client client, const char* error, const json& parameters) {
    if (oneway_.erase(client) > 0) return socket_.finish(client);
    socket_.send(client, varlink_error(error, parameters));
}

void Control::get_info(Client client, const VarlinkCall& /*call*/) {
    reply(client, {{"vendor", "VersaVIS"},
                   {"product", "versavisd"},
                   {"version", VERSAVIS_VERSION},
                   {"url", "https://varlink.org"},
                   {"interfaces", {"org.varlink.service", "org.versavis.service"}}});
}

void Control::describe_interface(Client client, const VarlinkCall& call) {
    const std::string name = call.text("interface");
    if (name == "org.versavis.service") return reply(client, {{"description", control_interface}});
    if (name == "org.varlink.service") return reply(client, {{"description", varlink_interface}});
    fail(client, "org.varlink.service.InterfaceNotFound", {{"interface", name}});
}

void Control::get_state(Client client, const VarlinkCall& call) {
    if (!call.more) return reply(client, state_);
    if (call.oneway) return reply(client, {});
    subscribers_[client] = nullptr;  // it gets the state with the next step
}

void Control::inform_subscribers(const Summary& health) {
    state_ = state_of(health);
    for (auto it = subscribers_.begin(); it != subscribers_.end();) {
        auto& [client, known] = *it;
        if (known != state_) socket_.send(client, varlink_reply(state_, true), false);
        known = state_;
        it = socket_.connected(client) ? std::next(it) : subscribers_.erase(it);
    }
}

bool Control::known_camera(Client client, const std::string& name) {
    json names = json::array();
    for (const CameraConfiguration& camera : document_.configuration.cameras) {
        if (camera.name == name) return true;
        names.push_back(camera.name);
    }
    fail(client, "org.versavis.service.UnknownCamera", {{"camera", name}, {"cameras", names}});
    return false;
}

void Control::ask(Client client, const VarlinkCall& call, CameraWish wish) {
    const std::string camera = call.text("camera");
    if (!known_camera(client, camera)) return;
    service_.ask(camera, wish);
    await({client, camera});
}

void Control::start_camera(Client client, const VarlinkCall& call) {
    ask(client, call, CameraWish::start);
}
void Control::stop_camera(Client client, const VarlinkCall& call) {
    ask(client, call, CameraWish::stop);
}
void Control::restart_camera(Client client, const VarlinkCall& call) {
    ask(client, call, CameraWish::restart);
}

void Control::await(Waiting waiting) {
    waiting.number = service_.changes(waiting.camera).asked;
    waiting.until = now_ + camera_patience;
    waiting.revision = revision_;
    waiting_.push_back(std::move(waiting));
}

/// True: the camera did what was asked for, or refused it, or takes too long.
bool Control::answered(Waiting& waiting, HostTime now) {
    const ChangeReport changes = service_.changes(waiting.camera);
    if (changes.done < waiting.number) {
        if (now < waiting.until) return false;
        fail(waiting.client, "org.versavis.service.NoAnswer", {{"camera", waiting.camera}});
        return true;
    }
    if (changes.refused.empty() || changes.done != waiting.number) {
        reply(waiting.client, waiting.reply);
        return true;
    }
    // Unless something else was changed since, what it refused is no longer in force.
    if (waiting.before && waiting.revision == revision_)
        if (auto document = document_.with_live_keys_of(*waiting.before))
            adopt(std::move(*document));
    fail(waiting.client, "org.versavis.service.Refused",
         {{"problems", json::array({changes.refused})}});
    return true;
}

/// Rings keep their size, and a camera what follows from it.
void Control::adopt(ConfigurationDocument document) {
    for (CameraConfiguration& camera : document.configuration.cameras)
        for (const CameraConfiguration& before : document_.configuration.cameras)
            if (before.name == camera.name) camera.slots = before.slots;
    document_ = std::move(document);
    ++revision_;
    service_.reconfigure(document_.configuration);
}

void Control::set_camera(Client client, const VarlinkCall& call) {
    const std::string camera = call.text("camera");
    if (!known_camera(client, camera)) return;
    NewValues values;
    const auto given = call.parameters.find("values");
    if (given == call.parameters.end() || !given->is_object())
        return fail(client, "org.varlink.service.InvalidParameter", {{"parameter", "values"}});
    for (const auto& [key, value] : given->items()) {
        const auto text = to_toml(value);
        if (!text)
            return fail(client, "org.varlink.service.InvalidParameter", {{"parameter", key}});
        values.emplace_back(key, *text);
    }
    auto next = document_.with(camera, values);
    if (!next)
        return fail(client, "org.versavis.service.Refused", {{"problems", texts(next.error())}});
    std::vector<std::string> changed;
    std::vector<std::string> fixed;
    for (const KeyChange& change : changes(document_.root, next->root))
        (change.live() ? changed : fixed).push_back(change.text());
    if (!fixed.empty()) return fail(client, "org.versavis.service.NeedsRestart", {{"keys", fixed}});
    if (changed.empty()) return reply(client, {{"changed", changed}});
    log(LogLevel::info, camera, "changed by request: {}", fmt::join(changed, ", "));
    toml::table before = document_.root;
    adopt(std::move(*next));
    await({client, camera, 0, {}, {{"changed", changed}}, std::move(before)});
}

Expected<Reload, TomlProblems> Control::reload() {
    const auto next = ConfigurationDocument::load(document_.configuration.entry.place.path);
    if (!next) return Unexpected(next.error());
    Reload result;
    for (const KeyChange& change : changes(document_.root, next->root))
        (change.live() ? result.changed : result.need_restart).push_back(change.text());
    if (result.changed.empty()) return result;
    auto live = document_.with_live_keys_of(next->root);
    if (!live) return Unexpected(live.error());
    adopt(std::move(*live));
    return result;
}

void Control::reload(Client client, const VarlinkCall& /*call*/) {
    const auto done = reload();
    if (!done)
        return fail(client, "org.versavis.service.Refused", {{"problems", texts(done.error())}});
    reply(client, {{"changed", done->changed}, {"need_restart", done->need_restart}});
}

void Control::report_lidars(Client client, const VarlinkCall& call) {
    std::vector<LidarReport> reports;
    const auto given = call.parameters.find("lidars");
    bool understood = given != call.parameters.end() && given->is_array();
    if (understood)
        for (const json& value : *given) {
            auto report = lidar_of(value);
            understood = understood && report;
            if (report) reports.push_back(std::move(*report));
        }
    if (!understood)
        return fail(client, "org.varlink.service.InvalidParameter", {{"parameter", "lidars"}});
    if (!service_.report_lidars(reports))
        return fail(client, "org.versavis.service.Refused",
                    {{"problems", {"these are more LiDARs than the service keeps: 32"}}});
    reply(client, json::object());
}

}  // namespace versavis::daemon

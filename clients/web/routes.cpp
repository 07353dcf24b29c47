// SPDX-License-Identifier: BSD-3-Clause
#include "routes.hpp"

#include <charconv>

#include "foxglove.hpp"
#include "page_files.hpp"
#include "wiring/wiring_drawing.hpp"
#include "wiring/wiring_text.hpp"

namespace versavis::web {

namespace {

constexpr std::string_view picture_path = "/api/picture/";

/// None: no number.
std::optional<std::uint64_t> number_of(const Target& target, const std::string& key,
                                       std::uint64_t otherwise) {
    const auto found = target.query.find(key);
    if (found == target.query.end()) return otherwise;
    std::uint64_t number = 0;
    const char* end = found->second.data() + found->second.size();
    const auto [read, error] = std::from_chars(found->second.data(), end, number);
    if (error != std::errc() || read != end) return std::nullopt;
    return number;
}

/// The address that a person opens gives the token once; from then on a cookie does.
Response begin_session(const Request& request, const std::string& token) {
    Response response = answer(request, http::status::see_other, "text/plain", "");
    response.set(http::field::location, "/");
    response.set(http::field::set_cookie,
                 "versavis=" + token + "; HttpOnly; SameSite=Strict; Path=/");
    return response;
}

/// In the address, which only the page and viewers may use: it ends up in histories and logs.
bool names_token(const Target& target, const Settings& settings) {
    const auto given = target.query.find("token");
    return !settings.token.empty() && given != target.query.end() &&
           equal_secrets(given->second, settings.token);
}

/// None: it may go on.
std::optional<Response> refuse(const Request& request, const Target& target,
                               const Settings& settings) {
    if (settings.token.empty()) {
        if (names_loopback(as_view(request[http::field::host]))) return std::nullopt;
        return refusal(request, http::status::misdirected_request,
                       "without a token this server answers to localhost and loopback addresses "
                       "only; give it one: --token-file");
    }
    if (target.path == "/" && names_token(target, settings))
        return begin_session(request, settings.token);
    if (equal_secrets(token_of(request), settings.token)) return std::nullopt;
    Response response =
        refusal(request, http::status::unauthorized,
                "a token is needed: open /?token=TOKEN, or send 'Authorization: Bearer TOKEN'");
    response.set(http::field::www_authenticate, "Bearer");
    return response;
}

Response picture(const Request& request, const Target& target, LiveData& data) {
    const auto after = number_of(target, "after", 0);
    const auto whole = number_of(target, "whole", 0);
    if (!after || !whole || *whole > 1)
        return refusal(request, http::status::bad_request,
                       "'after' is the version of the last picture, and 'whole' 0 or 1");
    const HostTime now = host_now();
    const std::string camera = target.path.substr(picture_path.size());
    const ShownPicture* shown = data.picture(camera, *whole == 1, now);
    if (shown == nullptr)
        return refusal(request, http::status::not_found,
                       "no camera '" + camera + "' publishes; /api/state names those that do");
    if (!shown->problem.empty())
        return refusal(request, http::status::service_unavailable, shown->problem);
    if (shown->version == 0 || shown->version == *after)
        return answer(request, http::status::no_content, "image/jpeg", "");
    Response response = answer(request, http::status::ok, "image/jpeg", shown->jpeg);
    nlohmann::json facts = shown->facts;
    facts["version"] = shown->version;
    facts["age_s"] = static_cast<double>((now - shown->arrival).ns) * 1e-9;
    response.set("X-Versavis-Frame", facts.dump());
    return response;
}

/// Browsers name the origin of each POST; only this server's own page may change anything.
bool from_own_page(const Request& request) {
    const std::string_view origin = as_view(request[http::field::origin]);
    return origin.empty() ||
           origin.substr(origin.find("//") + 2) == as_view(request[http::field::host]);
}

Response recording_facts(const Request& request, RecordingProcess& recording) {
    return answer(request, http::status::ok, "application/json",
                  dumped(recording.facts(host_now())) + "\n");
}

Response record(const Request& request, const Target& target, RecordingProcess& recording) {
    if (!from_own_page(request))
        return refusal(request, http::status::forbidden, "only this server's own page records");
    if (!recording.possible())
        return refusal(request, http::status::forbidden,
                       "this server does not record; --record-to DIRECTORY lets it");
    const auto found = target.query.find("action");
    const std::string action = found == target.query.end() ? "" : found->second;
    if (action != "begin" && action != "end")
        return refusal(request, http::status::bad_request, "'action' is begin or end");
    const auto done =
        action == "begin" ? recording.begin(host_now(), std::time(nullptr)) : recording.end();
    if (!done) return refusal(request, http::status::conflict, done.error().message());
    return recording_facts(request, recording);
}

Response wiring(const Request& request, bool drawn, const LiveData& data) {
    const auto parts = data.wiring();
    if (!parts) return refusal(request, http::status::not_found, parts.error().message());
    if (!drawn)
        return answer(request, http::status::ok, "text/plain; charset=utf-8",
                      client::wiring_text(*parts));
    const auto sheets = client::drawings(*parts);
    if (sheets.empty()) return answer(request, http::status::no_content, "image/svg+xml", "");
    return answer(request, http::status::ok, "image/svg+xml", client::to_svg(sheets));
}

/// None: not a file of the page.
std::optional<Response> page_file(const Request& request, const std::string& path) {
    const auto file = [&](std::string_view type, std::string_view content) {
        return answer(request, http::status::ok, type, std::string(content));
    };
    if (path == "/") return file("text/html; charset=utf-8", page_html);
    if (path == "/page.js") return file("text/javascript; charset=utf-8", page_script);
    if (path == "/style.css") return file("text/css; charset=utf-8", page_style);
    if (path == "/icon.svg") return file("image/svg+xml", page_icon);
    return std::nullopt;
}

Response route(const Request& request, const Settings& settings, LiveData& data,
               RecordingProcess& recording) {
    const auto target = parse_target(as_view(request.target()));
    if (!target) return refusal(request, http::status::bad_request, "no path, or damaged escapes");
    if (auto refused = refuse(request, *target, settings)) return std::move(*refused);
    const bool of_recording = target->path == "/api/record";
    if (of_recording && request.method() == http::verb::post)
        return record(request, *target, recording);
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
        const char* allowed = of_recording ? "GET, HEAD, POST" : "GET, HEAD";
        Response response = refusal(request, http::status::method_not_allowed,
                                    std::string("use one of ") + allowed);
        response.set(http::field::allow, allowed);
        return response;
    }
    if (of_recording) return recording_facts(request, recording);
    if (auto file = page_file(request, target->path)) return std::move(*file);
    if (target->path == "/api/state")
        return answer(request, http::status::ok, "application/json", data.state(host_now()));
    if (target->path == "/metrics")
        return answer(request, http::status::ok,
                      "application/openmetrics-text; version=1.0.0; charset=utf-8",
                      data.metrics(host_now()));
    if (target->path == "/api/wiring.svg" || target->path == "/api/wiring.txt")
        return wiring(request, target->path.ends_with(".svg"), data);
    if (target->path.starts_with(picture_path)) return picture(request, *target, data);
    return refusal(request, http::status::not_found, "there is no " + target->path);
}

}  // namespace

std::optional<Response> refuse_viewer(const Request& request, const Settings& settings) {
    const auto target = parse_target(as_view(request.target()));
    if (!target) return refusal(request, http::status::bad_request, "no path, or damaged escapes");
    if (!names_token(*target, settings))
        if (auto refused = refuse(request, *target, settings)) return refused;
    const std::string origin(as_view(request[http::field::origin]));
    if (!settings.allows(origin))
        return refusal(request, http::status::forbidden,
                       "a page of " + origin + " may not look; --allow-origin lets it");
    if (foxglove_protocol(as_view(request[http::field::sec_websocket_protocol])).empty())
        return refusal(request, http::status::bad_request,
                       "this server speaks foxglove.sdk.v1 and foxglove.websocket.v1");
    return std::nullopt;
}

Response respond(const Request& request, const Settings& settings, LiveData& data,
                 RecordingProcess& recording) {
    try {
        return route(request, settings, data, recording);
    } catch (const nlohmann::json::exception& error) {
        return refusal(request, http::status::internal_server_error,
                       std::string("the service's status is not understood: ") + error.what() +
                           "; install service and clients of the same release");
    }
}

}  // namespace versavis::web

// SPDX-License-Identifier: BSD-3-Clause
#include "http.hpp"

#include <boost/asio/ip/address.hpp>
#include <charconv>

namespace versavis::web {

namespace {

constexpr std::string_view cookie_name = "versavis=";

/// None: a damaged escape.
std::optional<std::string> unescaped(std::string_view text) {
    std::string made;
    for (std::size_t at = 0; at < text.size(); ++at) {
        if (text[at] != '%') {
            made += text[at];
            continue;
        }
        unsigned code = 0;
        const char* digits = text.data() + at + 1;
        if (text.size() - at < 3 || std::from_chars(digits, digits + 2, code, 16).ptr != digits + 2)
            return std::nullopt;
        made += static_cast<char>(code);
        at += 2;
    }
    return made;
}

}  // namespace

std::optional<Target> parse_target(std::string_view target) {
    const std::size_t question = target.find('?');
    auto path = unescaped(target.substr(0, question));
    if (!path || !path->starts_with('/')) return std::nullopt;
    Target made{std::move(*path), {}};
    std::string_view query = question == std::string_view::npos ? "" : target.substr(question + 1);
    while (!query.empty()) {
        const std::string_view part = query.substr(0, query.find('&'));
        query.remove_prefix(std::min(query.size(), part.size() + 1));
        const std::size_t equals = part.find('=');
        auto key = unescaped(part.substr(0, equals));
        auto value = unescaped(equals == std::string_view::npos ? "" : part.substr(equals + 1));
        if (!key || !value) return std::nullopt;
        made.query.emplace(std::move(*key), std::move(*value));
    }
    return made;
}

std::string token_of(const Request& request) {
    constexpr std::string_view bearer = "Bearer ";
    const std::string_view authorization = as_view(request[http::field::authorization]);
    if (authorization.starts_with(bearer)) return std::string(authorization.substr(bearer.size()));
    std::string_view cookies = as_view(request[http::field::cookie]);
    while (!cookies.empty()) {
        std::string_view cookie = cookies.substr(0, cookies.find(';'));
        cookies.remove_prefix(std::min(cookies.size(), cookie.size() + 1));
        cookie.remove_prefix(std::min(cookie.size(), cookie.find_first_not_of(' ')));
        if (cookie.starts_with(cookie_name)) return std::string(cookie.substr(cookie_name.size()));
    }
    return "";
}

bool equal_secrets(std::string_view one, std::string_view other) {
    unsigned difference = one.size() == other.size() ? 0 : 1;
    for (std::size_t i = 0; i < one.size(); ++i)
        difference |= static_cast<unsigned char>(one[i]) ^
                      static_cast<unsigned char>(i < other.size() ? other[i] : 0);
    return difference == 0;
}

bool names_loopback(std::string_view host) {
    const bool bracket = host.starts_with('[');
    const std::size_t end = host.find(bracket ? ']' : ':');
    if (bracket && end == std::string_view::npos) return false;
    const std::string name(bracket ? host.substr(1, end - 1) : host.substr(0, end));
    if (name == "localhost") return true;
    boost::system::error_code error;
    const auto address = boost::asio::ip::make_address(name, error);
    return !error && address.is_loopback();
}

Response answer(const Request& request, http::status status, std::string_view type,
                std::string body) {
    Response response(status, request.version());
    response.set(http::field::content_type, boost::beast::string_view(type.data(), type.size()));
    response.set(http::field::cache_control, "no-store");
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.set("Content-Security-Policy",
                 "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
                 "img-src 'self' blob:; base-uri 'none'; form-action 'none'; "
                 "frame-ancestors 'none'");
    response.keep_alive(request.keep_alive());
    response.body() = std::move(body);
    response.prepare_payload();
    return response;
}

std::string dumped(const nlohmann::json& document) {
    return document.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Response refusal(const Request& request, http::status status, const std::string& why) {
    return answer(request, status, "application/json",
                  dumped(nlohmann::json{{"error", why}}) + "\n");
}

}  // namespace versavis::web

// SPDX-License-Identifier: BSD-3-Clause
// Requests, and who may make them.
#pragma once

#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace versavis::web {

namespace http = boost::beast::http;
using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

inline std::string_view as_view(boost::beast::string_view text) {
    return {text.data(), text.size()};
}

/// A target without its escapes: `/api/picture/cam0?after=3`.
struct Target {
    std::string path;
    std::map<std::string, std::string> query;
};

/// None: damaged escapes, or not a path.
std::optional<Target> parse_target(std::string_view target);

/// The token of a request: of `Authorization: Bearer`, or of the cookie that the page's address
/// sets.
std::string token_of(const Request& request);

/// Takes as long wherever they differ.
bool equal_secrets(std::string_view one, std::string_view other);

/// Whether a Host header names this host by an address or name that only this host resolves so.
/// Others are a page of somebody else, whose name leads here: DNS rebinding.
bool names_loopback(std::string_view host);

Response answer(const Request& request, http::status status, std::string_view type,
                std::string body);

/// Whatever bytes its texts have.
std::string dumped(const nlohmann::json& document);

/// {"error": ...}
Response refusal(const Request& request, http::status status, const std::string& why);

}  // namespace versavis::web

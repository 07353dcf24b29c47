// SPDX-License-Identifier: BSD-3-Clause
#include "control/varlink.hpp"

namespace versavis::daemon {

namespace {

using nlohmann::json;

/// The member, if it is there and of this type; else what it is without.
template <class Type>
Type member(const json& object, const char* name, json::value_t type, Type without) {
    const auto found = object.find(name);
    return found != object.end() && found->type() == type ? found->get<Type>() : without;
}

/// Text of users may be no UTF-8.
std::string message(const json& object) {
    return object.dump(-1, ' ', false, json::error_handler_t::replace) + '\0';
}

}  // namespace

std::string VarlinkCall::text(const char* parameter) const {
    return member(parameters, parameter, json::value_t::string, std::string());
}

Expected<VarlinkCall> parse_call(std::string_view message) {
    const json object = json::parse(message, nullptr, false);
    if (!object.is_object()) return failure("control", "a call must be a JSON object");
    VarlinkCall call;
    call.method = member(object, "method", json::value_t::string, std::string());
    if (call.method.empty()) return failure("control", "a call must name its 'method'");
    call.parameters = member(object, "parameters", json::value_t::object, json::object());
    call.more = member(object, "more", json::value_t::boolean, false);
    call.oneway = member(object, "oneway", json::value_t::boolean, false);
    return call;
}

std::string varlink_reply(const json& parameters, bool continues) {
    json reply{{"parameters", parameters}};
    if (continues) reply["continues"] = true;
    return message(reply);
}

std::string varlink_error(const std::string& error, const json& parameters) {
    return message({{"error", error}, {"parameters", parameters}});
}

}  // namespace versavis::daemon

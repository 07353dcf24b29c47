// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_json.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;
using namespace clock;

json describe(const RecordedExchange& item) {
    return {{"clock", "exchange"},
            {"nonce", item.nonce},
            {"request", item.request},
            {"flags", item.flags},
            {"sent_ns", item.sent.ns},
            {"received_ns", item.received.ns},
            {"answered_ns", item.answered.ns},
            {"arrived_ns", item.arrived.ns}};
}

json describe(const RecordedMessage& item) {
    return {{"clock", "one_way"},
            {"nonce", item.nonce},
            {"departed_ns", item.departed.ns},
            {"arrived_ns", item.arrived.ns}};
}

json describe(const RecordedRestart& item) {
    return {{"clock", "board_restarted"}, {"nonce", item.nonce}};
}

json describe(const RecordedOutput& item) {
    return {{"clock", "output"},
            {"epoch", item.epoch},
            {"host_time_ns", item.host.ns},
            {"output_minus_host_ns", item.minus_host.ns},
            {"uncertainty_ns", item.uncertainty.ns}};
}

}  // namespace

json to_json(const ClockItem& item) {
    return std::visit([](const auto& recorded) { return describe(recorded); }, item);
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "diagnostics.hpp"

#include <cstdint>

#include "recording/cdr_writer.hpp"

namespace versavis::dds {

std::string diagnostics_message(const std::vector<ros_client::DiagnosticStatus>& statuses,
                                OutputTime now) {
    client::CdrWriter message;
    message.header(now, "").number(static_cast<std::uint32_t>(statuses.size()));
    for (const ros_client::DiagnosticStatus& one : statuses) {
        message.number(static_cast<std::uint8_t>(one.level))
            .text(one.name)
            .text(one.message)
            .text(one.hardware_id)
            .number(static_cast<std::uint32_t>(one.values.size()));
        for (const auto& value : one.values) message.text(value.key).text(value.text);
    }
    return message.bytes();
}

}  // namespace versavis::dds

// SPDX-License-Identifier: BSD-3-Clause
#include "export/metadata_csv.hpp"

#include <fmt/format.h>

#include "recording/item_fields.hpp"

namespace versavis::client {

std::string csv_columns(ring::StreamKind kind) {
    const std::string columns = field_columns(kind);
    return columns.empty() ? "" : "time_ns,number,life" + columns;
}

std::string csv_row(const RecordedItem& item) {
    return fmt::format("{},{},{:016x}{}", item.time.ns, item.number, item.life,
                       field_row(item.kind, item.metadata, item.attributes));
}

}  // namespace versavis::client

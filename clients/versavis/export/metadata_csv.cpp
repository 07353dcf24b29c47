// SPDX-License-Identifier: BSD-3-Clause
#include "export/metadata_csv.hpp"

#include <fmt/format.h>

#include "base/byte_cursor.hpp"
#include "recording/item_fields.hpp"

namespace versavis::client {

std::string csv_columns(ring::StreamKind kind) {
    const std::string columns = field_columns(kind);
    if (columns.empty()) return "";
    return "time_ns,number,life" + columns + (kind == ring::StreamKind::nmea ? ",text" : "");
}

std::string csv_row(const RecordedItem& item) {
    std::string row = fmt::format("{},{},{:016x}{}", item.time.ns, item.number, item.life,
                                  field_row(item.kind, item.metadata, item.attributes));
    if (item.kind == ring::StreamKind::nmea)
        row += "," + csv_text(std::string(as_text(item.payload)));
    return row;
}

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
// Reads tables of integers from CSV files, by the names of their columns.
#pragma once

#include <cstdint>
#include <istream>
#include <string>
#include <vector>

#include "versavis/error.hpp"

namespace versavis::client {

/// The requested columns; optional ones come last and are empty if the file does not have them.
struct CsvTable {
    std::vector<std::vector<std::int64_t>> columns;
    std::size_t rows = 0;
};

struct CsvColumns {
    std::vector<std::string> required;
    std::vector<std::string> optional;
};

/// Columns may be in any order, and there may be more. Windows line ends, a byte-order mark, blank
/// lines, spaces and quotes around fields are accepted. Errors name file, line and column.
Expected<CsvTable> read_csv(const std::string& path, const CsvColumns& columns);

/// The same from a stream; `name` is used in errors.
Expected<CsvTable> read_csv(std::istream& in, const std::string& name, const CsvColumns& columns);

}  // namespace versavis::client

// SPDX-License-Identifier: BSD-3-Clause
#include "board/asymmetry_store.hpp"

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/state_directory.hpp"
#include "posix/file.hpp"

namespace versavis::daemon {

namespace {

/// What the asymmetry of a port may change from one day to the next, added to its sigma.
constexpr Duration another_day = microseconds(3);

/// A stored number beyond a second is none.
constexpr std::int64_t largest_ns = 1'000'000'000;

/// An object, empty when there is no file; null when it is not understood.
nlohmann::json read(const std::filesystem::path& path) {
    std::ifstream file(path);
    if (!file) return nlohmann::json::object();
    nlohmann::json document = nlohmann::json::parse(file, nullptr, false);
    return document.is_object() ? document : nlohmann::json(nullptr);
}

bool plausible(const nlohmann::json& entry) {
    const auto number = [&](const char* key) {
        const auto value = entry.find(key);
        return value != entry.end() && value->is_number_integer() &&
               std::abs(value->get<double>()) < static_cast<double>(largest_ns);
    };
    return entry.is_object() && number("offset_ns") && number("sigma_ns");
}

}  // namespace

AsymmetryStore::AsymmetryStore(const std::string& directory)
    : path_(state_directory(directory) / "asymmetry.json") {}

Expected<std::optional<clock::Asymmetry>> AsymmetryStore::load(const std::string& port) const {
    const nlohmann::json document = read(path_);
    const auto entry = document.find(port);
    if (document.is_object() && entry == document.end()) return std::nullopt;
    if (document.is_null() || !plausible(*entry))
        return failure(path_.string(), "is not a valid asymmetry file",
                       "remove it: the asymmetries are measured again by PPS");
    return clock::Asymmetry{{(*entry)["offset_ns"]},
                            Duration{(*entry)["sigma_ns"]} * 2 + another_day};
}

Expected<> AsymmetryStore::save(const std::string& port, const clock::Asymmetry& asymmetry) const {
    nlohmann::json document = read(path_);
    if (document.is_null()) document = nlohmann::json::object();
    document[port] = {{"offset_ns", asymmetry.offset.ns}, {"sigma_ns", asymmetry.sigma.ns}};
    auto written = write_whole_file(path_, document.dump(2) + '\n', 0640);
    if (!written) written.error().cure = "create its directory, or set 'state_directory'";
    return written;
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "engine/toml/service_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>
#include <utility>

#include "engine/toml/table_reader.hpp"

namespace versavis {

namespace {

/// More of them are a mistake.
constexpr std::size_t most_files = 100;

/// An array of tables that are told apart by their names.
struct NamedTables {
    std::string_view key;
    std::string_view usual_name;  ///< of one that has none; empty: each must have one
};
constexpr NamedTables named_tables[]{{"camera", ""}, {"imu", "imu0"}};

TomlProblem folder_problem(const std::string& folder, const std::string& what) {
    return {{folder}, "", "", what, "make it a folder that the service can read, or remove it"};
}

bool is_drop_in(const std::filesystem::path& path) {
    return path.extension() == ".toml" && path.filename().string().front() != '.';
}

std::string name_of(const toml::table& table, const NamedTables& kind) {
    return table["name"].value_or(std::string(kind.usual_name));
}

toml::table* find_named(toml::array& tables, const std::string& name, const NamedTables& kind) {
    for (toml::node& node : tables)
        if (toml::table* table = node.as_table(); table && name_of(*table, kind) == name)
            return table;
    return nullptr;
}

/// A copy would lose its place, so nodes are moved.
void put(toml::table& table, const toml::key& key, toml::node& node) {
    node.visit([&](auto& value) { table.insert_or_assign(key, std::move(value)); });
}

void merge(toml::table& below, toml::table& over) {
    for (auto&& [key, node] : over) {
        toml::table* inner = below[key.str()].as_table();
        if (inner != nullptr && node.is_table())
            merge(*inner, *node.as_table());
        else
            put(below, key, node);
    }
}

/// True for what can be merged by name, whatever else is wrong with it.
bool is_named_tables(const toml::node* node) {
    return node != nullptr && node->is_array_of_tables();
}

void merge_named(toml::array& below, toml::array& over, const NamedTables& kind) {
    for (toml::node& node : over) {
        toml::table& table = *node.as_table();
        const std::string name = name_of(table, kind);
        if (toml::table* same = name.empty() ? nullptr : find_named(below, name, kind))
            merge(*same, table);
        else
            below.push_back(std::move(table));
    }
}

void merge_file(toml::table& below, toml::table& over) {
    for (const NamedTables& kind : named_tables) {
        if (!is_named_tables(below.get(kind.key)) || !is_named_tables(over.get(kind.key))) continue;
        merge_named(*below[kind.key].as_array(), *over[kind.key].as_array(), kind);
        over.erase(kind.key);
    }
    merge(below, over);
}

TomlPlace place_of(const toml::node& node, const std::string& path) {
    return {path, node.source().begin.line, node.source().begin.column};
}

/// Merged with one of an earlier file, the second would replace the first.
void find_repeated(const toml::table& root, const std::string& path, TomlProblems& problems) {
    for (const NamedTables& kind : named_tables) {
        if (!is_named_tables(root.get(kind.key))) continue;
        std::vector<std::string> names;
        for (const toml::node& node : *root[kind.key].as_array()) {
            const std::string name = name_of(*node.as_table(), kind);
            if (!name.empty() && std::find(names.begin(), names.end(), name) != names.end())
                problems.push_back(
                    {place_of(node, path), fmt::format("[[{}]] \"{}\"", kind.key, clipped(name)),
                     "name", fmt::format("this file has two [[{}]] '{}'", kind.key, clipped(name)),
                     "make one of the two tables, or choose another name"});
            names.push_back(name);
        }
    }
}

}  // namespace

Expected<std::vector<std::string>, TomlProblem> service_files(const std::string& path) {
    namespace fs = std::filesystem;
    std::vector<std::string> files{path};
    const std::string folder = path + ".d";
    std::error_code error;
    const fs::file_status status = fs::status(folder, error);
    if (status.type() == fs::file_type::not_found) return files;
    if (!error && !fs::is_directory(status))
        return Unexpected(folder_problem(folder, "is not a folder"));
    fs::directory_iterator entry(folder, error);
    for (; !error && entry != fs::directory_iterator(); entry.increment(error))
        if (is_drop_in(entry->path())) files.push_back(entry->path().string());
    if (error) return Unexpected(folder_problem(folder, "cannot be read: " + error.message()));
    if (files.size() > most_files)
        return Unexpected(folder_problem(
            folder, fmt::format("has more than {} configuration files", most_files - 1)));
    std::sort(files.begin() + 1, files.end());
    return files;
}

Expected<toml::table, TomlProblems> parse_service_file(const std::string& path) {
    const auto files = service_files(path);
    if (!files) return Unexpected(TomlProblems{files.error()});
    toml::table root;
    TomlProblems problems;
    for (const std::string& file : *files) {
        auto parsed = parse_toml(file);
        if (!parsed) {
            problems.push_back(parsed.error());
        } else if (file == path) {
            root = std::move(*parsed);
        } else {
            find_repeated(*parsed, file, problems);
            merge_file(root, *parsed);
        }
    }
    if (!problems.empty()) return Unexpected(std::move(problems));
    return root;
}

Expected<std::string> service_text(const std::string& path) {
    const auto files = service_files(path);
    if (!files) return Unexpected<Error>(files.error());
    std::ostringstream text;
    if (files->size() == 1) {
        std::ifstream file(path, std::ios::binary);
        if (!file) return failure(path, "cannot be read", "");
        text << file.rdbuf();
        return text.str();
    }
    const auto root = parse_service_file(path);
    if (!root) return Unexpected<Error>(root.error().front());
    for (const std::string& file : *files) text << "# " << file << '\n';
    text << *root << '\n';
    return text.str();
}

}  // namespace versavis

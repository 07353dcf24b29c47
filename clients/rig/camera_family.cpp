// SPDX-License-Identifier: BSD-3-Clause
#include "camera_family.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "camera_registers.hpp"
#include "engine/toml/table_reader.hpp"

namespace versavis::rig {

namespace {

using FieldNames = std::map<std::string, Field>;

/// "ADDRESS", "ADDRESS/BITS", "ADDRESS float" or "ADDRESS double", with numbers in hexadecimal.
std::optional<Field> parse_field(const std::string& text) {
    if (text.rfind("0x", 0) != 0) return std::nullopt;  // a name may be a number, too
    std::istringstream in(text);
    Field field;
    std::string rest;
    in >> std::hex >> field.at;
    if (!in || field.at < reg_model || field.at >= reg_xml || field.at % 4 != 0)
        return std::nullopt;
    if (in.peek() == '/') {
        in.get();
        in >> field.bits;
        if (!in || field.bits == 0) return std::nullopt;
    }
    in >> rest;
    if (rest == "float") field.format = NumberFormat::single_float;
    if (rest == "double") field.format = NumberFormat::double_float;
    if (!rest.empty() && field.format == NumberFormat::word) return std::nullopt;
    return field;
}

FieldNames read_names(TomlFile& file, const toml::table* table) {
    FieldNames names;
    if (table == nullptr) return names;
    TableReader reader(file, *table);
    for (const auto& [key, node] : *table) {
        std::string text;
        reader.read(key.str(), text);
        if (const auto field = parse_field(text))
            names.emplace(key.str(), *field);
        else
            reader.fail(key.str(), fmt::format("'{}' is no register", text));
    }
    return names;
}

/// Reads the keys that refer to registers, by name or address.
class RegisterReader {
 public:
    RegisterReader(TomlFile& file, TableReader& reader, const FieldNames& names)
        : file_(file), reader_(reader), names_(names) {}

    void read(std::string_view key, std::optional<Field>& field) {
        std::string name;
        reader_.read(key, name);
        if (!name.empty()) field = named(reader_, key, name);
    }

    void read(std::string_view key, FieldValues& values) {
        const toml::table* table = reader_.table(key);
        if (table == nullptr) return;
        TableReader reader(file_, *table);
        for (const auto& [name, node] : *table) {
            double value = 0;
            reader.read(name.str(), value, 0, UINT32_MAX);
            values.emplace_back(named(reader, name.str(), std::string(name.str())), value);
        }
    }

    void read(std::string_view key, std::vector<Field>& fields) {
        std::vector<std::string> names;
        reader_.read(key, names);
        for (const std::string& name : names) fields.push_back(named(reader_, key, name));
    }

 private:
    Field named(TableReader& reader, std::string_view key, const std::string& name) {
        const auto found = names_.find(name);
        if (found != names_.end()) return found->second;
        if (const auto field = parse_field(name)) return *field;
        reader.fail(key, fmt::format("'{}' is no register, nor in [registers]", name));
        return {};
    }

    TomlFile& file_;
    TableReader& reader_;
    const FieldNames& names_;
};

Expected<std::string> read_text(const std::filesystem::path& path) {
    std::ifstream file(path);
    if (!file) return failure(path.string(), "cannot be read");
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

}  // namespace

Expected<CameraFamily> load_camera_family(const std::string& name) {
    std::error_code error;
    const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
    return load_camera_family(program.parent_path().parent_path() / "share/versavis/models", name);
}

Expected<CameraFamily> load_camera_family(const std::string& directory, const std::string& name) {
    const std::filesystem::path path = std::filesystem::path(directory) / name;
    const auto root = parse_toml(path.string() + ".toml");
    if (!root) return Unexpected(root.error());
    auto nodes = read_text(path.string() + ".xml");
    if (!nodes) return Unexpected(nodes.error());
    TomlFile file{path.string() + ".toml", "clients/rig/camera_family.hpp"};
    TableReader reader(file, *root);
    const FieldNames names = read_names(file, reader.table("registers"));
    RegisterReader registers(file, reader, names);
    CameraFamily family;
    family.nodes = std::move(*nodes);
    reader.read("vendor", family.vendor);
    reader.read("model", family.model);
    reader.read("little_endian", family.little_endian);
    registers.read("defaults", family.defaults);
    registers.read("left_behind", family.left_behind);
    for (const toml::table* table : reader.tables("locks")) {
        TableReader lock_reader(file, *table);
        RegisterReader lock_registers(file, lock_reader, names);
        RegisterLock& lock = family.locks.emplace_back();
        lock_registers.read("registers", lock.fields);
        lock_registers.read("when", lock.when);
        lock_registers.read("shown", lock.shown);
        lock_reader.finish();
    }
    registers.read("user_set_load", family.user_set_load);
    registers.read("user_set", family.user_set);
    registers.read("binning", family.binning);
    registers.read("stalled", family.stalled);
    registers.read("triggered", family.triggered);
    registers.read("listens", family.listens);
    registers.read("falling", family.falling);
    registers.read("trigger_delay", family.trigger_delay);
    registers.read("burst", family.burst);
    std::optional<Field> exposure;
    registers.read("exposure", exposure);
    family.exposure = exposure.value_or(Field{});
    registers.read("exposure_auto", family.exposure_auto);
    registers.read("exposure_limit", family.exposure_limit);
    registers.read("shows_exposure", family.shows_exposure);
    registers.read("line_inverted", family.line_inverted);
    registers.read("line_delay", family.line_delay);
    registers.read("line_lead", family.line_lead);
    registers.read("line_duration", family.line_duration);
    registers.read("chunks", family.chunks);
    reader.read("image_chunk", family.image_chunk, 0, UINT32_MAX);
    reader.read("exposure_chunk", family.exposure_chunk, 0, UINT32_MAX);
    family.chunk_is_integer = true;
    reader.finish();
    if (auto read = file.result(); !read) return Unexpected(read.error());
    return family;
}

}  // namespace versavis::rig

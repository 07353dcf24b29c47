// SPDX-License-Identifier: BSD-3-Clause
// Decodes messages of ROS 2 by the text of their definition, as others do, to JSON. It knows the
// types that recordings have.
#pragma once

#include <catch2/catch.hpp>
#include <cstdint>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

namespace versavis::test {

class RosDecoder {
 public:
    /// `definition`: as in a schema of encoding `ros2msg`.
    explicit RosDecoder(const std::string& definition) {
        std::string name;
        std::istringstream lines(definition);
        for (std::string line; std::getline(lines, line);) {
            if (line.empty() || line[0] == '#' || line[0] == '=') continue;
            if (line.rfind("MSG: ", 0) == 0) {
                name = line.substr(5);
                continue;
            }
            std::istringstream words(line);
            Field field;
            words >> field.type >> field.name;
            types_[name].push_back(field);
        }
    }

    /// Fails unless the message ends where the definition does.
    nlohmann::json decode(const std::string& message) {
        bytes_ = message.substr(4);
        at_ = 0;
        CHECK(message.substr(0, 4) == std::string("\0\1\0\0", 4));
        auto decoded = of_type("");
        CHECK(at_ == bytes_.size());
        return decoded;
    }

 private:
    struct Field {
        std::string type;
        std::string name;
    };

    template <class T>
    T number() {
        at_ = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
        REQUIRE(at_ + sizeof(T) <= bytes_.size());
        T value;
        std::memcpy(&value, &bytes_[at_], sizeof value);
        at_ += sizeof value;
        return value;
    }

    nlohmann::json value(const std::string& type) {
        if (type == "bool") return number<std::uint8_t>() != 0;
        if (type == "uint8") return number<std::uint8_t>();
        if (type == "int32") return number<std::int32_t>();
        if (type == "uint32") return number<std::uint32_t>();
        if (type == "int64") return number<std::int64_t>();
        if (type == "uint64") return number<std::uint64_t>();
        if (type == "float32") return number<float>();
        if (type == "float64") return number<double>();
        if (type != "string") return of_type(type);
        const auto length = number<std::uint32_t>();
        REQUIRE(length > 0);
        REQUIRE(at_ + length <= bytes_.size());
        const std::string text = bytes_.substr(at_, length - 1);
        CHECK(bytes_[at_ + length - 1] == '\0');
        at_ += length;
        return text;
    }

    nlohmann::json of_type(const std::string& name) {
        REQUIRE(types_.count(name) == 1);
        nlohmann::json decoded = nlohmann::json::object();
        for (const Field& field : types_[name]) {
            const auto bracket = field.type.find('[');
            const std::string type = field.type.substr(0, bracket);
            if (bracket == std::string::npos) {
                decoded[field.name] = value(type);
                continue;
            }
            const std::string size = field.type.substr(bracket + 1);
            const bool fixed = size[0] >= '0' && size[0] <= '9';
            const auto count =
                fixed ? static_cast<std::uint32_t>(std::stoul(size)) : number<std::uint32_t>();
            if (size[0] == '<') CHECK(count <= std::stoul(size.substr(2)));
            decoded[field.name] = nlohmann::json::array();
            for (std::uint32_t i = 0; i < count; ++i) decoded[field.name].push_back(value(type));
        }
        return decoded;
    }

    std::map<std::string, std::vector<Field>> types_;
    std::string bytes_;
    std::size_t at_ = 0;
};

}  // namespace versavis::test

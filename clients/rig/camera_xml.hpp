// SPDX-License-Identifier: BSD-3-Clause
// Writes the GenICam description of an emulated camera.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "camera_family.hpp"

namespace versavis::rig {

/// Collects feature nodes and the category that lists them.
class XmlWriter {
 public:
    using Entries = std::vector<std::pair<std::string, std::uint32_t>>;

    void text(const std::string& name, std::uint32_t address, unsigned length);
    void integer(const std::string& name, std::uint32_t address, const std::string& range,
                 bool writable = true);
    void real(const std::string& name, std::uint32_t address, const std::string& unit,
              double minimum, double maximum);
    /// `selector`: there is one register for each of its values.
    void enumeration(const std::string& name, std::uint32_t address, const Entries& entries,
                     const std::string& selector = "");
    void command(const std::string& name, std::uint32_t address);
    void boolean(const std::string& name, std::uint32_t address);
    /// Of 64 bits, that can only be read.
    void wide_integer(const std::string& name, std::uint32_t address);
    void event(const std::string& name, std::uint32_t id);
    void chunk_real(const std::string& name, std::uint32_t id);

    /// What all cameras have, whatever their transport.
    void features(std::uint32_t width, std::uint32_t height, const CameraFamily& family);

    /// `name_space`: of the transport's standard, such as "GEV".
    std::string document(const std::string& name_space, const CameraFamily& family) const;

 private:
    void list(const std::string& name);
    void feature(const char* kind, const std::string& name, const std::string& before = "",
                 const std::string& after = "");
    void add_register(const char* kind, const std::string& name, const std::string& address,
                      const char* access, const std::string& port = "Device");
    void frame_features(std::uint32_t width, std::uint32_t height);
    void rig_features(const CameraFamily& family);

    std::string root_;
    std::string nodes_;
};

}  // namespace versavis::rig

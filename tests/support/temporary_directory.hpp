// SPDX-License-Identifier: BSD-3-Clause
// A directory that is removed with its owner.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

namespace versavis::test {

class TemporaryDirectory {
 public:
    /// Created below `parent`; rings need one in shared memory.
    explicit TemporaryDirectory(const std::string& parent = "/tmp") {
        std::string name = parent + "/versavis-test-XXXXXX";
        if (mkdtemp(name.data()) == nullptr)
            throw std::runtime_error("cannot create a temporary directory below " + parent);
        path_ = name;
    }
    ~TemporaryDirectory() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryDirectory(const TemporaryDirectory&) = delete;
    TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

    const std::filesystem::path& path() const { return path_; }

    /// Writes a file and returns its path.
    std::string write(const std::string& name, const std::string& text) const {
        std::ofstream(path_ / name) << text;
        return (path_ / name).string();
    }

 private:
    std::filesystem::path path_;
};

/// The name of the instance whose streams are in this folder. Instances live in /dev/shm/versavis,
/// which the name passes through, so it has to be there.
inline std::string instance_in(const std::filesystem::path& directory) {
    const std::filesystem::path instances = "/dev/shm/versavis";
    std::filesystem::create_directory(instances);
    return std::filesystem::relative(directory, instances);
}

/// Of a file; empty without one.
inline std::string content_of(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace versavis::test

// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description_check.hpp"

#include <arv.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <signal.h>
#include <strings.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <string_view>
#include <utility>

#include "camera/aravis_node_map.hpp"
#include "camera/description_graph.hpp"

namespace versavis::daemon {

namespace {

/// The unzipped text.
constexpr std::size_t largest_text = 24 << 20;

/// Memory and time of the probe.
constexpr rlim_t probe_memory = 128 << 20;
constexpr rlim_t probe_seconds = 5;

/// The description in a zip. Aravis trusts the sizes in it: that is why this runs apart.
Expected<std::string> unzip(const Description& description) {
    const std::unique_ptr<ArvZip, decltype(&arv_zip_free)> zip(
        arv_zip_new(description.bytes.data(), description.bytes.size()), arv_zip_free);
    const GSList* files = arv_zip_get_file_list(zip.get());
    if (files == nullptr) return failure("description", "is not a zip archive");
    auto* file = static_cast<ArvZipFile*>(files->data);
    if (arv_zip_file_get_uncompressed_size(file) > largest_text)
        return failure("description",
                       fmt::format("unzips to {} bytes", arv_zip_file_get_uncompressed_size(file)));
    std::size_t size = 0;
    const std::unique_ptr<void, decltype(&g_free)> text(
        arv_zip_get_file(zip.get(), arv_zip_file_get_name(file), &size), g_free);
    if (!text) return failure("description", "is not a zip archive");
    return std::string(static_cast<const char*>(text.get()), size);
}

/// False: a directory, or what macOS adds to an archive.
bool is_description(ArvZipFile* file) {
    const std::string_view path = arv_zip_file_get_name(file);
    const std::string_view name = path.substr(path.find_last_of('/') + 1);
    return name.size() > 4 && strcasecmp(name.substr(name.size() - 4).data(), ".xml") == 0 &&
           !name.starts_with("._");
}

/// `used` bytes are taken already: by the program, and by the sanitizer that it may run under.
void limit_memory() {
    rlim_t used_pages = 0;
    std::ifstream("/proc/self/statm") >> used_pages;
    const rlim_t used = used_pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
    const rlimit memory{used + probe_memory, used + probe_memory};
    ::setrlimit(RLIMIT_AS, &memory);
}

}  // namespace

}  // namespace versavis::daemon

/// Replaces Aravis' function of this name, also where Aravis calls it: Aravis parses the first file
/// of the list, which is the last of the archive. Cameras' archives may hold other files.
extern "C" const GSList* arv_zip_get_file_list(ArvZip* zip) {
    using Function = const GSList* (*)(ArvZip*);
    static const auto aravis =
        reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "arv_zip_get_file_list"));
    auto* files = const_cast<GSList*>(aravis(zip));
    for (GSList* file = files; file != nullptr; file = file->next)
        if (versavis::daemon::is_description(static_cast<ArvZipFile*>(file->data))) {
            std::swap(files->data, file->data);
            break;
        }
    return files;
}

namespace versavis::daemon {

Expected<> check_description(const Description& description) {
    std::string text(description.bytes.begin(), description.bytes.end());
    if (description.zipped) {
        auto unzipped = unzip(description);
        if (!unzipped) return Unexpected(unzipped.error());
        text = std::move(*unzipped);
    }
    if (text.size() > largest_text) return failure("description", "is too large");
    constexpr std::string_view last = "</RegisterDescription>";
    const auto end = text.find_last_not_of(std::string_view(" \t\r\n\0", 5));
    if (end == std::string::npos || !std::string_view(text).substr(0, end + 1).ends_with(last))
        return failure("description", "is cut off");
    if (text.find("<!ENTITY") != std::string::npos)
        return failure("description", "defines entities");
    text = expose_index_offsets(text);
    const Object<ArvGc> parsed(arv_gc_new(nullptr, text.data(), text.size()));
    if (!ARV_IS_GC(parsed.get())) return failure("description", "is not valid XML");
    return DescriptionGraph(parsed.get()).check();
}

int run_description_probe(bool zipped) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const rlimit time{probe_seconds, probe_seconds};
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CPU, &time);
    ::setrlimit(RLIMIT_CORE, &none);
    limit_memory();
    Description description;
    description.zipped = zipped;
    std::array<std::uint8_t, 65536> part{};
    for (ssize_t size; (size = ::read(STDIN_FILENO, part.data(), part.size())) > 0;)
        description.bytes.insert(description.bytes.end(), part.begin(), part.begin() + size);
    const auto good = check_description(description);
    if (!good) fmt::print("{}: {}\n", good.error().where, good.error().what);
    return good ? 0 : 1;
}

}  // namespace versavis::daemon

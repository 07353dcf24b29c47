// SPDX-License-Identifier: BSD-3-Clause
#include "camera/description.hpp"

#include <fmt/format.h>
#include <glib.h>
#include <strings.h>

#include <algorithm>
#include <charconv>
#include <memory>

namespace versavis::daemon {

namespace {

constexpr std::size_t url_size = 512;

/// For one block of memory.
constexpr Duration block_patience = seconds(3);

const char* const no_description = "it cannot be used: ask its maker for another firmware";

std::optional<std::uint64_t> hexadecimal(const std::string& text) {
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
    const bool whole = error == std::errc() && end == text.data() + text.size();
    return whole ? std::optional(value) : std::nullopt;
}

std::vector<std::string> split(const std::string& text, char separator) {
    std::vector<std::string> parts;
    for (std::size_t at = 0; at <= text.size();) {
        const std::size_t end = std::min(text.find(separator, at), text.size());
        parts.push_back(text.substr(at, end - at));
        at = end + 1;
    }
    return parts;
}

}  // namespace

Expected<DescriptionPlace> parse_description_url(const std::string& url) {
    constexpr const char* scheme = "local:";
    const auto refused = [&](const std::string& why) {
        return failure(fmt::format("description at '{}'", url), why, no_description);
    };
    // What Aravis would do with "file:" is to open a file of this host.
    if (strncasecmp(url.c_str(), scheme, 6) != 0) return refused("is not in the camera");
    const auto parts = split(url.substr(6, url.find('?') - 6), ';');
    const auto address = parts.size() == 3 ? hexadecimal(parts[1]) : std::nullopt;
    const auto size = parts.size() == 3 ? hexadecimal(parts[2]) : std::nullopt;
    if (!address || !size || *address > UINT32_MAX) return refused("has no valid place");
    if (*size == 0 || *size > largest_description)
        return refused(
            fmt::format("has {} bytes, more than {} or none", *size, largest_description));
    return DescriptionPlace{static_cast<std::uint32_t>(*address), *size,
                            parts[0].size() > 4 && parts[0].ends_with(".zip")};
}

Expected<Description> read_description(GvcpClient& camera, const Cancelled& cancelled) {
    const auto url = camera.read(gvcp_description_url, url_size, block_patience, cancelled);
    if (!url) return Unexpected(url.error());
    const auto place =
        parse_description_url(std::string(url->begin(), std::find(url->begin(), url->end(), 0)));
    if (!place) return Unexpected(place.error());
    auto bytes = camera.read(place->address, place->size, block_patience, cancelled);
    if (!bytes) return Unexpected(bytes.error());
    return Description{std::move(*bytes), place->zipped};
}

std::string hash_of(const Description& description) {
    const std::unique_ptr<gchar, decltype(&g_free)> text(
        g_compute_checksum_for_data(G_CHECKSUM_SHA256, description.bytes.data(),
                                    description.bytes.size()),
        g_free);
    return text.get();
}

}  // namespace versavis::daemon

// SPDX-License-Identifier: BSD-3-Clause
#include "verify/signature.hpp"

#include <fmt/format.h>
#include <sodium.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <system_error>
#include <vector>

#include "posix/file.hpp"
#include "recording/recording.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// What DER puts in front of the 32 bytes of a key (RFC 8410).
constexpr std::array<std::uint8_t, 16> secret_prefix{
    0x30, 0x2e, 0x02, 0x01, 0x00, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x04, 0x22, 0x04, 0x20};
constexpr std::array<std::uint8_t, 12> public_prefix{0x30, 0x2a, 0x30, 0x05, 0x06, 0x03,
                                                     0x2b, 0x65, 0x70, 0x03, 0x21, 0x00};

using Key = std::array<std::uint8_t, 32>;
static_assert(sizeof(Key) == crypto_sign_SEEDBYTES);
static_assert(sizeof(Key) == crypto_sign_PUBLICKEYBYTES);

constexpr std::size_t read_size = 1U << 20U;

Unexpected<> not_read(const std::string& path) {
    return failure(path, "cannot be read: " + std::generic_category().message(errno),
                   "check its name and permissions");
}

Expected<std::string> content_of_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) return not_read(path);
    return std::string(std::istreambuf_iterator<char>(in), {});
}

/// The key in a PEM file; none: it is another, or none at all.
template <std::size_t size>
std::optional<Key> key_in(const std::string& pem, const std::string& name,
                          const std::array<std::uint8_t, size>& prefix) {
    const std::string begin = "-----BEGIN " + name + "-----";
    const auto from = pem.find(begin);
    const auto to = pem.find("-----END " + name + "-----");
    if (from == std::string::npos || to == std::string::npos || to < from) return std::nullopt;
    const std::string body = pem.substr(from + begin.size(), to - from - begin.size());
    std::array<std::uint8_t, size + sizeof(Key)> der{};
    std::size_t length = 0;
    const char* end = nullptr;
    const int bad = sodium_base642bin(der.data(), der.size(), body.data(), body.size(), "\r\n ",
                                      &length, &end, sodium_base64_VARIANT_ORIGINAL);
    if (bad != 0 || length != der.size() || end != body.data() + body.size()) return std::nullopt;
    if (!std::equal(prefix.begin(), prefix.end(), der.begin())) return std::nullopt;
    Key key{};
    std::copy(der.begin() + static_cast<std::ptrdiff_t>(size), der.end(), key.begin());
    return key;
}

Expected<std::string> sha256_of(const std::string& path, const std::function<bool()>& go_on) {
    std::ifstream in(path, std::ios::binary);
    if (!in) return not_read(path);
    crypto_hash_sha256_state state;
    crypto_hash_sha256_init(&state);
    std::vector<char> buffer(read_size);
    while (in) {
        if (!go_on()) return failure(path, "stopped before its end");
        in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
        crypto_hash_sha256_update(&state, reinterpret_cast<const unsigned char*>(buffer.data()),
                                  static_cast<unsigned long long>(in.gcount()));
    }
    if (in.bad()) return not_read(path);
    std::array<unsigned char, crypto_hash_sha256_BYTES> hash{};
    crypto_hash_sha256_final(&state, hash.data());
    std::array<char, 2 * crypto_hash_sha256_BYTES + 1> hex{};
    return std::string(sodium_bin2hex(hex.data(), hex.size(), hash.data(), hash.size()));
}

/// Names, sizes and hashes, in the order of the recording.
Expected<json> files_of(const std::string& path, const std::function<bool()>& go_on) {
    const auto recording = Recording::open(path);
    if (!recording) return Unexpected(recording.error());
    json files = json::array();
    for (const std::string& file : recording->paths()) {
        auto hash = sha256_of(file, go_on);
        if (!hash) return Unexpected(hash.error());
        std::error_code ignored;
        files.push_back({{"name", std::filesystem::path(file).filename().string()},
                         {"bytes", std::filesystem::file_size(file, ignored)},
                         {"sha256", *hash}});
    }
    return files;
}

const unsigned char* bytes_of(const std::string& text) {
    return reinterpret_cast<const unsigned char*>(text.data());
}

/// Error: of the first file that is not what was signed.
Expected<> compare(const json& signed_files, const json& files, const std::string& recording) {
    for (std::size_t i = 0; i < std::max(signed_files.size(), files.size()); ++i) {
        if (i >= files.size() || i >= signed_files.size())
            return failure(recording,
                           fmt::format("{} files were signed, and {} are there",
                                       signed_files.size(), files.size()),
                           "put all files of the recording into one folder");
        if (signed_files[i] != files[i])
            return failure(files[i]["name"],
                           "is not the file that was signed: it was changed since",
                           "do not trust it; find the one with sha256 " +
                               signed_files[i].value("sha256", "?"));
    }
    return {};
}

}  // namespace

std::string verdict_path(const std::string& recording) { return recording + ".verdict.json"; }
std::string signature_path(const std::string& recording) { return recording + ".verdict.sig"; }

Expected<> sign_verdict(const std::string& recording, const Verification& verification,
                        const std::string& key_file, const std::function<bool()>& go_on) {
    if (sodium_init() < 0) return failure("libsodium", "does not start");
    auto pem = content_of_file(key_file);
    if (!pem) return Unexpected(pem.error());
    auto seed = key_in(*pem, "PRIVATE KEY", secret_prefix);
    if (!seed)
        return failure(key_file, "is no Ed25519 key",
                       "make one: openssl genpkey -algorithm ed25519 -out KEY");
    auto files = files_of(recording, go_on);
    if (!files) return Unexpected(files.error());
    const std::string text =
        json{{"files", std::move(*files)}, {"verification", to_json(verification)}}.dump(
            1, ' ', false, json::error_handler_t::replace) +
        "\n";
    Key public_key{};
    std::array<unsigned char, crypto_sign_SECRETKEYBYTES> secret_key{};
    crypto_sign_seed_keypair(public_key.data(), secret_key.data(), seed->data());
    std::string signature(crypto_sign_BYTES, '\0');
    crypto_sign_detached(reinterpret_cast<unsigned char*>(signature.data()), nullptr,
                         bytes_of(text), text.size(), secret_key.data());
    sodium_memzero(secret_key.data(), secret_key.size());
    sodium_memzero(seed->data(), seed->size());
    sodium_memzero(pem->data(), pem->size());
    if (auto written = write_whole_file(verdict_path(recording), text); !written) return written;
    return write_whole_file(signature_path(recording), signature);
}

Expected<SignedVerdict> signed_verdict(const std::string& recording,
                                       const std::string& public_key_file,
                                       const std::function<bool()>& go_on) {
    if (sodium_init() < 0) return failure("libsodium", "does not start");
    const auto pem = content_of_file(public_key_file);
    if (!pem) return Unexpected(pem.error());
    const auto key = key_in(*pem, "PUBLIC KEY", public_prefix);
    if (!key)
        return failure(public_key_file, "is no public Ed25519 key",
                       "write it: openssl pkey -in KEY -pubout -out KEY.pub");
    const auto text = content_of_file(verdict_path(recording));
    if (!text) return Unexpected(text.error());
    const auto signature = content_of_file(signature_path(recording));
    if (!signature) return Unexpected(signature.error());
    if (signature->size() != crypto_sign_BYTES ||
        crypto_sign_verify_detached(bytes_of(*signature), bytes_of(*text), text->size(),
                                    key->data()) != 0)
        return SignedVerdict{
            Error{signature_path(recording), "is no signature of the verdict by this key",
                  "one of them was changed, or another machine signed it: use that machine's key"},
            {}};
    json document = json::parse(*text, nullptr, false);
    if (!document.is_object() || !document["files"].is_array())
        return failure(verdict_path(recording), "is no verdict of 'versavis verify'");
    const auto files = files_of(recording, go_on);
    if (!files) return Unexpected(files.error());
    SignedVerdict verdict{{}, document["verification"]};
    if (auto same = compare(document["files"], *files, recording); !same)
        verdict.forged = same.error();
    return verdict;
}

}  // namespace versavis::client

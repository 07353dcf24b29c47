// SPDX-License-Identifier: BSD-3-Clause
// A verdict that can be shown later: the hashes of a recording's files and what was found about
// them, signed with Ed25519 (RFC 8032). OpenSSL makes the keys, and can check the signature.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "verify/verification.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// Where the verdict on a recording is, and its signature: 64 bytes.
std::string verdict_path(const std::string& recording);
std::string signature_path(const std::string& recording);

/// Writes both. `key_file`: PEM, as 'openssl genpkey -algorithm ed25519' writes it. Errors: a file
/// cannot be read or written, it is no such key, stopped.
Expected<> sign_verdict(const std::string& recording, const Verification& verification,
                        const std::string& key_file, const std::function<bool()>& go_on);

struct SignedVerdict {
    std::optional<Error> forged;  ///< it is not by this key, or a file is not what was signed
    nlohmann::json verification;  ///< as to_json(Verification)
};

/// `public_key_file`: PEM, as 'openssl pkey -pubout' writes it. Errors: a file cannot be read, or
/// is no verdict; stopped.
Expected<SignedVerdict> signed_verdict(const std::string& recording,
                                       const std::string& public_key_file,
                                       const std::function<bool()>& go_on);

}  // namespace versavis::client

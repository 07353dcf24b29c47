// SPDX-License-Identifier: BSD-3-Clause
// What went wrong, where, and what to do about it; and results that are a value or such an error.
#pragma once

#include <string>
#include <type_traits>
#include <utility>
#include <variant>

namespace versavis {

/// What a program may want to distinguish. The numbers are those of the C interface.
enum class ErrorCode : int {
    other = -1,
    invalid = -2,      ///< an argument is out of range, or does not fit the others
    no_memory = -3,    ///< no memory left
    absent = -4,       ///< there is no such stream: not yet, or not any more
    forbidden = -5,    ///< no permission
    not_trusted = -6,  ///< the stream belongs to, or can be changed by, somebody else
    wrong_kind = -7,   ///< a stream of another kind
    unsupported = -8,  ///< a ring of a layout that this library does not know
    damaged = -9,      ///< no ring, or a damaged one
    exhausted = -10,   ///< no descriptor or thread available
};

struct Error {
    std::string where;  ///< the file, stream, device or key concerned
    std::string what;   ///< what happened
    std::string cure;   ///< what the user can do next; empty when there is nothing to do
    ErrorCode code = ErrorCode::other;

    /// "where: what; cure" on one line.
    std::string message() const {
        return (where.empty() ? "" : where + ": ") + what + (cure.empty() ? "" : "; " + cure);
    }
};

/// An error on its way into an Expected.
template <class E = Error>
struct Unexpected {
    explicit Unexpected(E why) : error(std::move(why)) {}

    E error;
};

/// A value, or the error that explains why there is none. Look before you take: `*` and `->` of an
/// error, and error() of a value, are undefined. It has the names of C++23's std::expected.
template <class T = void, class E = Error>
class [[nodiscard]] Expected {
 public:
    template <class U = T, class = std::enable_if_t<std::is_convertible_v<U&&, T> &&
                                                    !std::is_same_v<std::decay_t<U>, Expected>>>
    Expected(U&& value) : content_(std::in_place_index<0>, std::forward<U>(value)) {}
    template <class F>
    Expected(Unexpected<F> failed) : content_(std::in_place_index<1>, std::move(failed.error)) {}

    bool has_value() const { return content_.index() == 0; }
    explicit operator bool() const { return has_value(); }

    T& operator*() & { return *std::get_if<0>(&content_); }
    const T& operator*() const& { return *std::get_if<0>(&content_); }
    T&& operator*() && { return std::move(*std::get_if<0>(&content_)); }
    T* operator->() { return std::get_if<0>(&content_); }
    const T* operator->() const { return std::get_if<0>(&content_); }

    E& error() { return *std::get_if<1>(&content_); }
    const E& error() const { return *std::get_if<1>(&content_); }

    template <class U>
    T value_or(U&& otherwise) const& {
        return has_value() ? **this : static_cast<T>(std::forward<U>(otherwise));
    }

 private:
    std::variant<T, E> content_;
};

/// Nothing, or the error that explains why it was not done.
template <class E>
class [[nodiscard]] Expected<void, E> {
 public:
    Expected() = default;
    template <class F>
    Expected(Unexpected<F> failed) : error_(std::in_place_index<1>, std::move(failed.error)) {}

    bool has_value() const { return error_.index() == 0; }
    explicit operator bool() const { return has_value(); }

    E& error() { return *std::get_if<1>(&error_); }
    const E& error() const { return *std::get_if<1>(&error_); }

 private:
    std::variant<std::monostate, E> error_;
};

inline Unexpected<> failure(std::string where, std::string what, std::string cure = {}) {
    return Unexpected<>(Error{std::move(where), std::move(what), std::move(cure)});
}

/// A template, so that nothing but an ErrorCode is taken for one.
template <class Code, class = std::enable_if_t<std::is_same_v<Code, ErrorCode>>>
Unexpected<> failure(Code code, std::string where, std::string what, std::string cure = {}) {
    return Unexpected<>(Error{std::move(where), std::move(what), std::move(cure), code});
}

}  // namespace versavis

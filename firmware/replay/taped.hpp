// SPDX-License-Identifier: BSD-3-Clause
// An interface whose calls go through a tape: what a call is given and what it returns, cut into
// words by its signature.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace versavis::firmware::replay {

// A tape has
//     void begin(const char* name);              a call begins
//     void argument(std::uint32_t word);         what the core passes
//     void end_arguments();
//     template <class Result, class Real> Result perform(Real real);
//     std::uint32_t result(std::uint32_t word);  what the core gets
// One that records performs the real call, and returns each word of the result as it is. One that
// replays performs nothing, and returns the word that was recorded.
//
// Structs are passed by each_field(T&, visit), which calls visit() with all fields, in an order.

/// Cuts values into words. `exchange` takes each word; what it returns takes the word's place.
template <class Exchange>
class Words {
 public:
    explicit Words(Exchange exchange) : exchange_(exchange) {}

    template <class T>
    void pass(T& value) {
        if constexpr (std::is_array_v<T>) {
            pass_array(value);
        } else if constexpr (std::is_class_v<T>) {
            each_field(value, [this](auto&... fields) { (this->pass(fields), ...); });
        } else if constexpr (sizeof(T) <= sizeof(std::uint32_t) || std::is_same_v<T, std::size_t>) {
            value = static_cast<T>(exchange_(static_cast<std::uint32_t>(value)));
        } else {
            const auto bits = static_cast<std::uint64_t>(value);
            const std::uint64_t low = exchange_(static_cast<std::uint32_t>(bits));
            const std::uint64_t high = exchange_(static_cast<std::uint32_t>(bits >> 32U));
            value = static_cast<T>(high << 32U | low);
        }
    }

    /// Constant bytes stay as they are.
    template <class Byte>
    void pass_bytes(Byte* bytes, std::size_t size) {
        for (std::size_t i = 0; i < size; i += sizeof(std::uint32_t)) {
            std::uint32_t word = 0;
            const std::size_t end = size - i < sizeof word ? size : i + sizeof word;
            for (std::size_t k = i; k < end; ++k)
                word |= std::uint32_t{static_cast<std::uint8_t>(bytes[k])} << 8 * (k - i);
            word = exchange_(word);
            if constexpr (!std::is_const_v<Byte>)
                for (std::size_t k = i; k < end; ++k)
                    bytes[k] = static_cast<Byte>(word >> 8 * (k - i));
        }
    }

 private:
    template <class T, std::size_t size>
    void pass_array(T (&values)[size]) {
        if constexpr (sizeof(T) == 1)
            pass_bytes(values, size);
        else
            for (T& value : values) pass(value);
    }

    Exchange exchange_;
};

template <class Tape, class T>
void pass_argument(Tape& tape, const T& value) {
    std::remove_const_t<T> copy = value;
    Words([&tape](std::uint32_t word) { return tape.argument(word), word; }).pass(copy);
}

template <class Tape, class T>
void pass_results(Tape& tape, T& value) {
    Words([&tape](std::uint32_t word) { return tape.result(word); }).pass(value);
}

/// The signature of a method determines what goes where. Values and references to constants are
/// arguments; so are constant bytes, whose size follows. Other references are filled, and so are
/// bytes: as many as the call returns, and no more than the capacity that may follow them. A call
/// that returns 0 or false fills nothing.
template <class Interface, class Tape>
class Taped : public Interface {
 public:
    Taped(Tape& tape, Interface* device) : tape_(tape), device_(device) {}
    Taped(const Taped&) = delete;
    Taped& operator=(const Taped&) = delete;

 protected:
    ~Taped() = default;

    /// What is passed is converted to what the method declares.
    template <class T>
    struct AsDeclared {
        using Type = T;
    };

    template <class Result, class... P>
    Result call(const char* name, Result (Interface::*method)(P...),
                typename AsDeclared<P>::Type... arguments) {
        tape_.begin(name);
        [[maybe_unused]] Given given{tape_};
        (given.template take<P>(arguments), ...);
        tape_.end_arguments();
        const auto real = [&] { return (device_->*method)(arguments...); };
        if constexpr (std::is_void_v<Result>) {
            tape_.template perform<Result>(real);
        } else {
            auto result = tape_.template perform<Result>(real);
            pass_results(tape_, result);
            if constexpr (!std::is_class_v<Result>) {
                [[maybe_unused]] Filled filled{tape_};
                if (result != Result{}) (filled.template take<P>(arguments), ...);
                filled.pass_bytes(static_cast<std::size_t>(result));
            }
            return result;
        }
    }

 private:
    template <class P>
    static constexpr bool is_filled =
        std::is_lvalue_reference_v<P> && !std::is_const_v<std::remove_reference_t<P>>;

    struct Given {
        Tape& tape;
        const std::uint8_t* bytes = nullptr;

        template <class P>
        void take(const std::remove_reference_t<P>& value) {
            if constexpr (std::is_same_v<P, const std::uint8_t*>)
                bytes = value;
            else if constexpr (!is_filled<P> && !std::is_pointer_v<P>)
                pass_argument(tape, value);
            if constexpr (std::is_same_v<P, std::size_t>)
                if (bytes != nullptr)
                    Words([this](std::uint32_t word) {
                        return tape.argument(word), word;
                    }).pass_bytes(bytes, value);
        }
    };

    struct Filled {
        Tape& tape;
        std::uint8_t* bytes = nullptr;
        std::size_t capacity = ~std::size_t{0};

        template <class P>
        void take(std::remove_reference_t<P>& value) {
            if constexpr (is_filled<P>) pass_results(tape, value);
            if constexpr (std::is_same_v<P, std::uint8_t*>) bytes = value;
            if constexpr (std::is_same_v<P, std::size_t>) capacity = value;
        }
        void pass_bytes(std::size_t count) {
            if (bytes == nullptr) return;
            Words([this](std::uint32_t word) {
                return tape.result(word);
            }).pass_bytes(bytes, count < capacity ? count : capacity);
        }
    };

    Tape& tape_;
    Interface* device_;
};

}  // namespace versavis::firmware::replay

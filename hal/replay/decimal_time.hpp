// Times in text: decimal seconds to int64 nanoseconds, exactly (a double has only 0.2 us left at today's Unix times).
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace stillmesh {

// "1305031229.528748", also "1.305031229528748e+09" as numpy writes it. Digits below a nanosecond are dropped.
// `digits_ns`: of a nanosecond behind the point, 9 where the unit is a second.
// Empty: not a number, negative, or beyond the year 2262.
[[nodiscard]] constexpr std::optional<std::int64_t> parse_time_ns(std::string_view text,
                                                                  std::int64_t digits_ns = 9) noexcept {
    std::size_t i = 0;
    const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
    if (!text.empty() && text[0] == '+') ++i;
    // First where the point ends up: 10^`shift` times the digits, in nanoseconds.
    std::size_t digits = 0;
    std::int64_t shift = digits_ns;
    const std::size_t begin = i;
    bool after_point = false;
    for (; i < text.size() && (is_digit(text[i]) || (text[i] == '.' && !after_point)); ++i) {
        if (text[i] == '.') {
            after_point = true;
        } else {
            ++digits;
            if (after_point) --shift;
        }
    }
    const std::size_t end = i;
    if (digits == 0) return std::nullopt;
    if (i < text.size()) {
        if (text[i] != 'e' && text[i] != 'E') return std::nullopt;
        ++i;
        bool is_negative = false;
        if (i < text.size() && (text[i] == '+' || text[i] == '-')) is_negative = text[i++] == '-';
        if (i == text.size()) return std::nullopt;
        std::int64_t exponent = 0;
        for (; i < text.size(); ++i) {
            if (!is_digit(text[i]) || exponent > 1000) return std::nullopt;
            exponent = exponent * 10 + (text[i] - '0');
        }
        shift += is_negative ? -exponent : exponent;
    }
    constexpr std::int64_t kMax = 0x7fffffffffffffff;
    std::int64_t value = 0;
    auto left = static_cast<std::int64_t>(digits);
    for (std::size_t j = begin; j < end; ++j) {
        if (text[j] == '.') continue;
        // The last -shift digits lie below a nanosecond.
        if (shift < 0 && left <= -shift) break;
        --left;
        const std::int64_t digit = text[j] - '0';
        if (value > (kMax - digit) / 10) return std::nullopt;
        value = value * 10 + digit;
    }
    for (; shift > 0 && value != 0; --shift) {
        if (value > kMax / 10) return std::nullopt;
        value *= 10;
    }
    return value;
}

}  // namespace stillmesh

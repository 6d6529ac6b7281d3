#include "platform/motion/triple_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <span>

#include "hal/replay/decimal_time.hpp"
#include "platform/evaluation/text_lines.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kBytesMax = std::size_t{512} << 20U;  // a gyroscope at 1 kHz for two hours
constexpr std::size_t kColumns = 4;

// The words of a line, up to one more than a line may have.
std::size_t words_of(std::string_view line, std::array<std::string_view, kColumns + 1>& words) {
    std::size_t count = 0;
    std::size_t at = line.find_first_not_of(kTextBlanks);
    while (at != std::string_view::npos && count < words.size()) {
        const std::size_t end = std::min(line.find_first_of(kTextBlanks, at), line.size());
        words[count++] = line.substr(at, end - at);
        at = line.find_first_not_of(kTextBlanks, end);
    }
    return count;
}

bool parse_number(std::string_view word, double& value) {
    if (word.starts_with('+')) word.remove_prefix(1);
    const auto [rest, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return error == std::errc() && rest == word.data() + word.size() && std::isfinite(value);
}

}  // namespace

Status parse_triples(std::string_view text, const std::string& file, const TripleKind& kind,
                     const std::function<void(std::int64_t, const Triple&)>& take, std::string& message) {
    std::string wrong;
    std::size_t lines = 0;
    std::int64_t last_ns = 0;
    for_lines(text, [&](std::size_t number, std::string_view line) {
        std::array<std::string_view, kColumns + 1> words;
        const std::size_t count = words_of(line, words);
        const auto time_ns = parse_time_ns(words[0]);
        Triple value{};
        if (count != kColumns) {
            wrong = fmt::format("{} words", count > kColumns ? "too many" : std::to_string(count));
        } else if (!time_ns) {
            wrong = fmt::format("'{}' is not a time in seconds", words[0].substr(0, 40));
        } else if (lines > 0 && *time_ns <= last_ns) {
            wrong = "its time is not after the one of the line before; sort the file by time";
        }
        for (std::size_t i = 1; i < kColumns && wrong.empty(); ++i) {
            if (!parse_number(words[i], value[i - 1])) {
                wrong = fmt::format("'{}' is not a number", words[i].substr(0, 40));
            } else if (std::abs(value[i - 1]) > kind.most) {
                wrong = fmt::format("{} {}", value[i - 1], kind.too_much);
            }
        }
        if (!wrong.empty()) {
            message = fmt::format("{}, line {}: {}; a line is {}.", file, number, wrong, kind.line);
            return false;
        }
        ++lines;
        last_ns = *time_ns;
        take(*time_ns, value);
        return true;
    });
    if (!wrong.empty()) return Status::kInvalid;
    if (lines >= 2) return Status::kOk;
    message = fmt::format("{}: has {} lines; a motion needs two. A line is {}.", file, lines, kind.line);
    return Status::kInvalid;
}

Status read_triples(const std::string& file, const TripleKind& kind,
                    const std::function<void(std::int64_t, const Triple&)>& take, std::string& message) {
    MemoryBlock block;
    std::span<const std::byte> bytes;
    if (!read_whole_file(file, kBytesMax, block, bytes, message)) return Status::kUnavailable;
    return parse_triples({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, file, kind, take, message);
}

std::string triple_line(std::int64_t time_ns, const Triple& value) {
    return fmt::format("{} {:.9f} {:.9f} {:.9f}\n", time_text(time_ns), value[0], value[1], value[2]);
}

}  // namespace stillmesh

#include "hal/calibration/camera_entries.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "hal/calibration/toml_document.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kLettersMax = 256 * 1024;  // of a file's keys and words: aliases make many of few bytes
constexpr int kDepthMax = 8;
constexpr std::size_t kDocumentsMax = 16;

Status fail(std::string& message, const std::string& file, std::size_t line, const std::string& sentence) {
    message = camera_file_message(file, line, sentence);
    return Status::kInvalid;
}

// yaml-cpp recurses as deep as the file nests (and has run out of stack on such files): refuse before it sees them.
[[nodiscard]] bool nests_deeply(std::string_view text) {
    int depth = 0;
    int marks = 0;  // on this line
    std::size_t line_begin = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (c == '\n') {
            line_begin = i + 1;
            marks = 0;
            continue;
        }
        if (c == '[' || c == '{') ++depth;
        if (c == ']' || c == '}') --depth;
        if (depth > kDepthMax) return true;
        // "- - - -" and "? ? ?" nest by a letter; no camera file has more than two on a line, but JSON many colons.
        const bool is_mark = c == '-' || c == '?' || (c == ':' && depth <= 0);
        if (is_mark && i + 1 < text.size() && (text[i + 1] == ' ' || text[i + 1] == '\t') && ++marks > 8) return true;
        if (i - line_begin > 200 && text.substr(line_begin, 200).find_first_not_of(' ') == std::string_view::npos) {
            return true;
        }
    }
    return false;
}

[[nodiscard]] bool is_key_letter(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '.' ||
           c == '-';
}

// What OpenCV takes for YAML, as YAML of the same lines, a document each: its first line is none, and it wants no blank
// behind a colon.
[[nodiscard]] std::vector<std::string> as_yaml(std::string_view text) {
    // yaml-cpp's own way to read several documents does not end on some broken ones.
    std::vector<std::string> documents(1);
    std::size_t lines = 0;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string_view line = text.substr(begin, end - begin);
        begin = end + 1;
        ++lines;
        std::string& body = documents.back();
        if (line.substr(0, line.find_last_not_of(" \t\r") + 1) == "---" && documents.size() < kDocumentsMax) {
            documents.emplace_back(lines, '\n');  // its lines keep their numbers
            continue;
        }
        const std::size_t first = std::min(line.find_first_not_of(" \t"), line.size());
        std::size_t colon = first;
        while (colon < line.size() && is_key_letter(line[colon])) ++colon;
        const bool is_bare_key = colon > first && colon + 1 < line.size() && line[colon] == ':' &&
                                 (line[first] < '0' || line[first] > '9') && line[colon + 1] != ' ' &&
                                 line[colon + 1] != '\t' && line[colon + 1] != '\r';
        if (line.starts_with("%YAML")) {
        } else if (is_bare_key) {
            body.append(line.substr(0, colon + 1)).append(" ").append(line.substr(colon + 1));
        } else {
            body.append(line);
        }
        body += '\n';
    }
    return documents;
}

// Walks the nodes of a document.
class Flattener {
public:
    Flattener(const std::string& file, std::vector<CameraEntry>& entries, std::string& message)
        : file_(file), entries_(entries), message_(message) {}

    [[nodiscard]] Status map(const YAML::Node& node, const std::string& prefix, int depth) {
        for (const auto& entry : node) {
            const std::size_t line = line_of(entry.first);
            if (!entry.first.IsScalar()) return fail(message_, file_, line, "a key is not a plain name.");
            STILLMESH_TRY(value(entry.second, prefix + entry.first.Scalar(), line, depth));
        }
        return Status::kOk;
    }

private:
    [[nodiscard]] static std::size_t line_of(const YAML::Node& node) {
        return node.Mark().line < 0 ? 0 : static_cast<std::size_t>(node.Mark().line) + 1;
    }
    [[nodiscard]] Status value(const YAML::Node& node, const std::string& key, std::size_t line, int depth) {
        if (depth > kDepthMax || !count(key.size())) return too_much(line);
        if (node.IsMap()) return map(node, key + ".", depth + 1);
        CameraEntry entry{key, {}, line};
        if (node.IsScalar() && !count(node.Scalar().size())) return too_much(line);
        if (node.IsScalar()) entry.words.push_back(node.Scalar());
        if (node.IsSequence()) STILLMESH_TRY(list(node, key, entry, depth + 1));
        entries_.push_back(std::move(entry));
        return Status::kOk;
    }
    [[nodiscard]] Status list(const YAML::Node& node, const std::string& key, CameraEntry& entry, int depth) {
        std::size_t place = 0;
        for (const auto& item : node) {
            if (depth > kDepthMax || !count(item.IsScalar() ? item.Scalar().size() : 0)) return too_much(entry.line);
            if (item.IsScalar()) entry.words.push_back(item.Scalar());
            if (item.IsSequence()) STILLMESH_TRY(list(item, key, entry, depth + 1));
            if (item.IsMap()) STILLMESH_TRY(map(item, key + "." + std::to_string(place) + ".", depth + 1));
            ++place;
        }
        return Status::kOk;
    }
    // What an entry or a word takes, more or less. False: too much.
    [[nodiscard]] bool count(std::size_t letters) { return (letters_ += letters + 64) <= kLettersMax; }
    [[nodiscard]] Status too_much(std::size_t line) {
        return fail(message_, file_, line, "this is no camera file: it nests too deeply, or holds too much.");
    }

    const std::string& file_;
    std::vector<CameraEntry>& entries_;
    std::string& message_;
    std::size_t letters_ = 0;
};

// The words of a file that holds nothing but numbers; empty: it holds something else.
[[nodiscard]] std::vector<std::string> only_numbers(std::string_view text) {
    std::vector<std::string> words;
    constexpr std::string_view kBlanks = " \t\r\n,;";
    for (std::size_t begin = 0; (begin = text.find_first_not_of(kBlanks, begin)) != std::string_view::npos;) {
        if (text[begin] == '#') {
            begin = std::min(text.find('\n', begin), text.size());
            continue;
        }
        const std::size_t end = std::min(text.find_first_of(kBlanks, begin), text.size());
        const std::string_view word = text.substr(begin, end - begin);
        double value = 0;
        const char* const first = word.data() + (word[0] == '+' ? 1 : 0);
        const auto [stop, error] = std::from_chars(first, word.data() + word.size(), value);
        if (error != std::errc() || stop != word.data() + word.size()) return {};
        words.emplace_back(word);
        begin = end;
    }
    return words;
}

// Zeros and a one where a camera's matrix has them, row by row; a skew is left to whoever reads the numbers.
[[nodiscard]] bool is_matrix(const std::vector<std::string>& words) {
    const auto is = [&words](std::size_t i, double expected) {
        double value = NAN;
        static_cast<void>(std::from_chars(words[i].data(), words[i].data() + words[i].size(), value));
        return value == expected;
    };
    return words.size() == 9 && is(3, 0) && is(6, 0) && is(7, 0) && is(8, 1);
}

// fx fy cx cy (ETH3D), with k1 k2 p1 p2 and k3 behind them or not, a 3x3 matrix, or a 4x4 one (ScanNet): then without
// its last row and column.
[[nodiscard]] Status entries_of_numbers(std::vector<std::string> words, const std::string& file,
                                        std::vector<CameraEntry>& entries, std::string& message) {
    if (words.size() == 16) {
        for (const std::size_t i : {std::size_t{15}, std::size_t{14}, std::size_t{13}, std::size_t{12}, std::size_t{11},
                                    std::size_t{7}, std::size_t{3}}) {
            words.erase(words.begin() + static_cast<std::ptrdiff_t>(i));
        }
    }
    if (is_matrix(words)) {
        entries.push_back({"K", std::move(words), 1});
        return Status::kOk;
    }
    if (words.size() != 4 && words.size() != 8 && words.size() != 9) {
        return fail(message, file, 0,
                    "this is no camera file: it holds " + std::to_string(words.size()) +
                        " numbers, and only 4 (fx fy cx cy), 8 or 9 (and k1 k2 p1 p2, k3), 9 or 16 (the camera's "
                        "matrix) say what they are.");
    }
    const auto lens = words.begin() + 4;
    if (words.size() > 4) entries.push_back({"distortion_coefficients", {lens, words.end()}, 1});
    entries.push_back({"intrinsics", {words.begin(), lens}, 1});
    return Status::kOk;
}

}  // namespace

std::string camera_file_message(const std::string& file, std::size_t line, const std::string& sentence) {
    return file + (line == 0 ? std::string() : ", line " + std::to_string(line)) + ": " + sentence;
}

Status read_yaml_entries(std::string_view text, const std::string& file, std::vector<CameraEntry>& entries,
                         std::string& message) {
    entries.clear();
    if (std::vector<std::string> numbers = only_numbers(text); !numbers.empty()) {
        return entries_of_numbers(std::move(numbers), file, entries, message);
    }
    try {
        Flattener flattener(file, entries, message);
        // What `rostopic echo` prints ends with a "---", and keys may have been added behind it: read together.
        for (const std::string& body : as_yaml(text)) {
            if (nests_deeply(body)) return fail(message, file, 0, "this is no camera file: it nests too deeply.");
            const YAML::Node document = YAML::Load(body);
            if (document.IsNull()) continue;
            if (!document.IsMap()) {
                return fail(message, file, 0, "this is no camera file: expected lines like 'Camera.fx: 525'.");
            }
            STILLMESH_TRY(flattener.map(document, "", 0));
        }
    } catch (const YAML::Exception& error) {
        const std::size_t line = error.mark.line < 0 ? 0 : static_cast<std::size_t>(error.mark.line) + 1;
        return fail(message, file, line, "is neither YAML nor JSON: " + error.msg + ".");
    }
    if (entries.empty()) return fail(message, file, 0, "this is no camera file: it says nothing.");
    return Status::kOk;
}

Status read_toml_entries(std::string_view text, const std::string& file, std::vector<CameraEntry>& entries,
                         std::string& message) {
    entries.clear();
    std::vector<TomlEntry> read;
    STILLMESH_TRY(parse_toml_document(text, file, read, message));
    for (const auto& [key, value] : read) {
        std::string word;
        char buffer[64];
        if (const auto* const number = std::get_if<double>(&value)) {
            const auto [end, error] = std::to_chars(buffer, buffer + sizeof(buffer), *number);
            word.assign(buffer, error == std::errc() ? end : buffer);
        } else if (const auto* const whole = std::get_if<std::int64_t>(&value)) {
            word = std::to_string(*whole);
        } else if (const auto* const quoted = std::get_if<std::string>(&value)) {
            // Letters in a TOML string are no number, even if they read like one.
            word = key == "lens" ? *quoted : "'" + *quoted + "'";
        } else {
            word = std::get<bool>(value) ? "true" : "false";
        }
        entries.push_back({key, {word}, 0});
    }
    return Status::kOk;
}

}  // namespace stillmesh

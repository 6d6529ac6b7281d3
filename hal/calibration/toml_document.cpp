#include "hal/calibration/toml_document.hpp"

#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <stdexcept>

namespace {
constexpr void require_toml(bool condition) {
    if (!condition) throw std::runtime_error("unexpected characters");
}
}  // namespace

// toml++ 3.3 asserts on some broken files and, with NDEBUG, takes the condition for granted instead: both would let a
// file crash us. Here its assertions throw.
#undef NDEBUG
#define TOML_ASSERT(condition) require_toml(static_cast<bool>(condition))
#define TOML_EXCEPTIONS 1
#define TOML_HEADER_ONLY 1
#define TOML_ENABLE_WINDOWS_COMPAT 0
#include <toml++/toml.h>

namespace stillmesh {
namespace {

constexpr int kTableDepthMax = 4;

Status flatten(const toml::table& table, const std::string& prefix, const std::string& file, int depth,
               std::vector<TomlEntry>& entries, std::string& message) {
    for (const auto& [name, node] : table) {
        const std::string key = prefix + std::string(name.str());
        if (const toml::table* const inner = node.as_table(); inner != nullptr && depth < kTableDepthMax) {
            STILLMESH_TRY(flatten(*inner, key + ".", file, depth + 1, entries, message));
        } else if (const auto* const flag = node.as_boolean()) {
            entries.push_back({key, flag->get()});
        } else if (const auto* const whole = node.as_integer()) {
            entries.push_back({key, whole->get()});
        } else if (const auto* const number = node.as_floating_point()) {
            entries.push_back({key, number->get()});
        } else if (const auto* const text = node.as_string()) {
            entries.push_back({key, text->get()});
        } else {
            message = file + ", line " + std::to_string(node.source().begin.line) + ": key '" + key.substr(0, 80) +
                      "' must be a single number, text, true or false.";
            return Status::kInvalid;
        }
    }
    return Status::kOk;
}

}  // namespace

Status parse_toml_document(std::string_view text, const std::string& file, std::vector<TomlEntry>& entries,
                           std::string& message) {
    entries.clear();
    try {
        return flatten(toml::parse(text), "", file, 0, entries, message);
    } catch (const toml::parse_error& error) {
        message = file + ", line " + std::to_string(error.source().begin.line) +
                  ": is not TOML: " + std::string(error.description()) + ".";
    } catch (const std::exception& error) {
        message = file + ": is not TOML: " + error.what() + ".";
    }
    return Status::kInvalid;
}

Status read_small_file(const std::string& file, std::size_t bytes_max, std::string& text, std::string& message) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream) {
        message = file + ": cannot be opened: " + std::strerror(errno) + ".";
        return Status::kUnavailable;
    }
    text.assign(bytes_max + 1, '\0');
    stream.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (stream.bad()) {
        message = file + ": cannot be read; is it a folder?";
        return Status::kUnavailable;
    }
    text.resize(static_cast<std::size_t>(stream.gcount()));
    if (text.size() > bytes_max) {
        message = file + ": is longer than " + std::to_string(bytes_max) + " bytes; is it the right file?";
        return Status::kInvalid;
    }
    return Status::kOk;
}

}  // namespace stillmesh

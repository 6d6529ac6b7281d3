#include "platform/cli/destinations.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace stillmesh {
namespace {

[[nodiscard]] std::filesystem::path canonical(const std::string& path) {
    std::error_code error;
    const std::filesystem::path out = std::filesystem::weakly_canonical(path, error);
    return error ? std::filesystem::path(path).lexically_normal() : out;
}

// One file by two names is one file; devices and pipes take lines from many.
[[nodiscard]] bool is_same(const std::string& a, const std::string& b) {
    struct stat here {};
    struct stat there {};
    const bool is_here = ::stat(a.c_str(), &here) == 0, is_there = ::stat(b.c_str(), &there) == 0;
    if (is_here && !S_ISREG(here.st_mode) && !S_ISDIR(here.st_mode)) return false;
    if (is_here && is_there) return here.st_dev == there.st_dev && here.st_ino == there.st_ino;
    return canonical(a) == canonical(b);
}

// The folder that a name is in, or the nearest one above it that is there.
[[nodiscard]] std::string folder_above(const std::string& path, bool may_be_made) {
    std::filesystem::path folder = std::filesystem::path(path).parent_path();
    if (folder.empty()) folder = ".";
    struct stat status {};
    while (may_be_made && ::stat(folder.c_str(), &status) != 0 && errno == ENOENT && folder.has_relative_path()) {
        folder = folder.parent_path();
        if (folder.empty()) folder = ".";
    }
    return folder.string();
}

[[nodiscard]] std::string check(const Destination& to) {
    const bool is_folder = to.kind == DestinationKind::kFolder || to.kind == DestinationKind::kNewFolder;
    const std::string name = std::string(to.option) + " " + to.path + ": ";
    if (to.path.empty()) {
        return std::string(to.option) + ": the name is empty; give a " + (is_folder ? "folder." : "file.");
    }
    if (to.path == "-") {
        if (to.may_be_standard_output) return {};
        return name +
               "only --trajectory or --poses can go to standard output; give a name (a file called '-' is './-').";
    }
    struct stat status {};
    if (::stat(to.path.c_str(), &status) == 0) {
        if (is_folder) {
            if (!S_ISDIR(status.st_mode)) return name + "is no folder; give another name.";
            if (::access(to.path.c_str(), W_OK | X_OK) != 0) {
                return name + "cannot be written: " + std::strerror(errno) + "; give another folder.";
            }
            std::error_code error;
            const bool is_empty = std::filesystem::is_empty(to.path, error);
            if (to.kind == DestinationKind::kNewFolder && !is_empty) {
                return name + "is not empty; give a new folder, nothing was changed.";
            }
            return {};
        }
        if (S_ISDIR(status.st_mode)) return name + "is a folder; give a file in it.";
        if (S_ISSOCK(status.st_mode)) return name + "is a socket, which takes no file; give another name.";
        if (to.kind == DestinationKind::kFile && !S_ISREG(status.st_mode)) {
            return name + "is no regular file; give another name.";
        }
        const bool is_replaced = to.kind == DestinationKind::kWhole && S_ISREG(status.st_mode);
        if (!is_replaced && ::access(to.path.c_str(), W_OK) != 0) {
            return name + "cannot be written: " + std::strerror(errno) + "; give another name.";
        }
        if (!is_replaced && !S_ISREG(status.st_mode)) return {};
    } else if (errno != ENOENT) {
        return name + "cannot be written: " + std::strerror(errno) + "; give another name.";
    } else if (to.path.back() == '/' && !is_folder) {
        return name + "is the name of a folder; give a file in it.";
    }
    const std::string folder = folder_above(to.path, is_folder);
    if (::stat(folder.c_str(), &status) != 0) {
        return name + "the folder " + folder + " cannot be used: " + std::strerror(errno) + "; make it first.";
    }
    if (!S_ISDIR(status.st_mode)) return name + folder + " is no folder.";
    // What is written over in its place needs nothing of its folder.
    const bool is_in_place = to.kind == DestinationKind::kLines && ::access(to.path.c_str(), F_OK) == 0;
    if (!is_in_place && ::access(folder.c_str(), W_OK | X_OK) != 0) {
        return name + "the folder " + folder + " cannot be written: " + std::strerror(errno) + ".";
    }
    return {};
}

}  // namespace

std::string check_destinations(std::span<const Destination> destinations, std::span<const Origin> origins) {
    for (std::size_t i = 0; i < destinations.size(); ++i) {
        const Destination& to = destinations[i];
        if (std::string sentence = check(to); !sentence.empty()) return sentence;
        for (std::size_t k = 0; k < i; ++k) {
            if (!is_same(to.path, destinations[k].path)) continue;
            return std::string(destinations[k].option) + " and " + to.option + " name one place, " + to.path +
                   "; give each its own.";
        }
        for (const Origin& from : origins) {
            if (from.path.empty() || std::strcmp(from.writer, to.option) == 0 || !is_same(to.path, from.path)) continue;
            return std::string(to.option) + " " + to.path + " would write over what " + from.option +
                   " reads; give another name.";
        }
    }
    return {};
}

}  // namespace stillmesh

#include "hal/replay/image_folder.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "hal/replay/frame_list.hpp"

namespace stillmesh {
namespace {

constexpr std::string_view kDigits = "0123456789";

// The last number of a name without its extension, with what stands behind a point: "000017", "1305031229.528748".
[[nodiscard]] std::string_view number_of(std::string_view name) {
    const std::string_view stem = name.substr(0, name.rfind('.'));
    const std::size_t last = stem.find_last_of(kDigits);
    if (last == std::string_view::npos) return {};
    const auto begin_of = [stem](std::size_t end) {  // of the digits that end there
        const std::size_t before = stem.find_last_not_of(kDigits, end);
        return before == std::string_view::npos ? 0 : before + 1;
    };
    std::size_t begin = begin_of(last);
    if (begin >= 2 && stem[begin - 1] == '.' && kDigits.find(stem[begin - 2]) != std::string_view::npos) {
        begin = begin_of(begin - 2);
    }
    return stem.substr(begin, last + 1 - begin);
}

struct NamedImage {
    std::string number, file;

    // In the order of the numbers, of any length.
    [[nodiscard]] auto key() const {
        const std::string_view text =
            std::string_view(number).substr(std::min(number.find_first_not_of('0'), number.size()));
        const std::size_t whole = std::min(text.find('.'), text.size());
        return std::tuple(whole, text, std::string_view(file));
    }
};

}  // namespace

const char* first_folder_in(const std::string& folder, std::span<const char* const> names) {
    std::error_code error;
    const auto at = std::find_if(names.begin(), names.end(), [&](const char* name) {
        return std::filesystem::is_directory(folder + "/" + name, error);
    });
    return at == names.end() ? nullptr : *at;
}

const char* mixed_folder_in(const std::string& folder) {
    const auto at = std::find_if(std::begin(kMixedFolders), std::end(kMixedFolders), [&](const char* name) {
        return !list_of_images(folder, name, false).empty() && !list_of_images(folder, name, true).empty();
    });
    return at == std::end(kMixedFolders) ? nullptr : *at;
}

std::string list_of_images(const std::string& folder, const std::string& name, bool is_depth) {
    const bool is_mixed =
        std::find(std::begin(kMixedFolders), std::end(kMixedFolders), name) != std::end(kMixedFolders);
    std::vector<NamedImage> images;
    std::error_code error;
    for (std::filesystem::directory_iterator at(folder + "/" + name, error), end; !error && at != end;
         at.increment(error)) {
        std::string file = at->path().filename().string();
        const std::string_view number = number_of(file);
        if (number.empty() || !is_image_name(file) || file.find('\n') != std::string::npos) continue;
        if (is_mixed && (file.find("depth") != std::string::npos) != is_depth) continue;
        images.push_back({std::string(number), std::move(file)});
    }
    std::sort(images.begin(), images.end(), [](const NamedImage& a, const NamedImage& b) { return a.key() < b.key(); });
    std::string list;
    for (const NamedImage& image : images) list += image.number + " " + name + "/" + image.file + "\n";
    return list;
}

std::string only_associations_in(const std::string& folder) {
    std::string found;
    std::error_code error;
    for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
        if (at->path().extension() != ".txt" || !at->is_regular_file(error)) continue;
        std::ifstream stream(at->path(), std::ios::binary);
        std::string head(4096, '\0');
        stream.read(head.data(), static_cast<std::streamsize>(head.size()));
        head.resize(static_cast<std::size_t>(stream.gcount()));
        head.resize(std::min(head.find_last_of("\r\n") + 1, head.size()));  // whole lines
        std::vector<ImagePair> pairs;
        std::string message;
        ListTimes times{.frames_per_s = 1};
        if (parse_associations(head, "", pairs, message, times) != Status::kOk || pairs.empty()) continue;
        const auto names_image = [&head](const ListedImage& image) {
            return is_image_name(std::string_view(head).substr(image.name_offset, image.name_size));
        };
        if (!names_image(pairs[0].colour) || !names_image(pairs[0].depth)) continue;
        if (!found.empty()) return {};
        found = at->path().string();
    }
    return found;
}

}  // namespace stillmesh

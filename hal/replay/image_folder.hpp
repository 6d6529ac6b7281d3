// A recording without lists by their usual names: the text file that is a list of both images all the same, or folders
// of images that are called after their times or numbers ("1305031229.528748.png", "frame-000017.color.jpg"). Memory:
// a line per image. Cost: the folder is read once.
#pragma once

#include <span>
#include <string>

namespace stillmesh {

// The first one that there is counts.
inline constexpr const char* kColourFolders[] = {"rgb", "color", "colour", "image", "images"};
inline constexpr const char* kDepthFolders[] = {"depth", "depths"};
// Of both, told by the names: "frame-000017.color.png" beside "frame-000017.depth.png", "frame0017.jpg" beside
// "depth0017.png".
inline constexpr const char* kMixedFolders[] = {".", "results"};
// nullptr: none of them is there.
[[nodiscard]] const char* first_folder_in(const std::string& folder, std::span<const char* const> names);
// nullptr: none of kMixedFolders has images of both.
[[nodiscard]] const char* mixed_folder_in(const std::string& folder);

// A list as rgb.txt is one, of the images in FOLDER/NAME in the order of the last number in each name: "17 NAME/FILE";
// of a mixed folder those of one kind. Images without a number are left out; what cannot be read is empty.
[[nodiscard]] std::string list_of_images(const std::string& folder, const std::string& name, bool is_depth);

// The one text file of the folder whose first line names two images behind a time. Empty: none does, or several do.
[[nodiscard]] std::string only_associations_in(const std::string& folder);

}  // namespace stillmesh

// The lists of a TUM-layout folder (rgb.txt, depth.txt) and which colour image belongs to which depth image.
// Cost: 16 bytes per listed image while opening, 32 per pair afterwards; n log n once.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"

namespace stillmesh {

inline constexpr std::size_t kFileNameMax = 255;  // bytes of a name in a list

// A line of a list. The name is left in the list's file: only its place is kept.
struct ListedImage {
    std::int64_t time_ns = 0;
    std::uint32_t name_offset = 0;
    std::uint32_t name_size = 0;
};

struct ImagePair {
    ListedImage colour;
    ListedImage depth;
};

// Lines are "seconds name", '#' begins a comment, blank lines are nothing; CRLF is fine.
// kInvalid: a line that is not that, a time that repeats or goes backwards; `message` names file, line and remedy.
[[nodiscard]] Status parse_image_list(std::string_view text, const std::string& file, std::vector<ListedImage>& images,
                                      std::string& message);

// The pairs of the TUM tools' associate.py: nearest in time first, each image used once, at most `gap_max_ns` apart;
// and in time order on both sides (a pair that would cross an earlier one is dropped).
[[nodiscard]] std::vector<ImagePair> associate(std::span<const ListedImage> colour, std::span<const ListedImage> depth,
                                               std::int64_t gap_max_ns);

}  // namespace stillmesh

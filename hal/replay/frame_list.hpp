// The lists of a TUM-layout folder (rgb.txt, depth.txt) and which colour image belongs to which depth image.
// Cost: 16 bytes per listed image while opening, 32 per pair afterwards; n log n once.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"
#include "hal/replay/time_unit.hpp"

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

struct ListTimes {
    double frames_per_s = 0;             // of a list that has frame numbers for times; 0: it is refused
    TimeUnit unit = TimeUnit::kSeconds;  // that was found
    double step = 0;                     // in it, from one image to the next
};

// Lines are "time name", parted by blanks, commas or semicolons; '#' begins a comment, blank lines are nothing, nor is
// a heading ("timestamp filename") above all; lines end as on any system, a byte order mark is fine. A name may have
// blanks, or stand in quotes; words behind its ".png" are nothing. Times are seconds, or what TimeUnitGuess says.
// kInvalid: a line that is not that, a time that repeats or goes backwards, UTF-16; `message` names file, line and
// remedy.
[[nodiscard]] Status parse_image_list(std::string_view text, const std::string& file, std::vector<ListedImage>& images,
                                      std::string& message, ListTimes& times);
[[nodiscard]] Status parse_image_list(std::string_view text, const std::string& file, std::vector<ListedImage>& images,
                                      std::string& message);
// Both lists in one, as the TUM tools' associate.py writes it: "time name time name", or "time name name", colour or
// depth first as the first line's names tell, else colour. The pairs are those of the lines.
[[nodiscard]] Status parse_associations(std::string_view text, const std::string& file, std::vector<ImagePair>& pairs,
                                        std::string& message, ListTimes& times);

// The name of an image by its extension, ".png" or another.
[[nodiscard]] bool is_image_name(std::string_view name);
// The pairs of the TUM tools' associate.py: nearest in time first, each image used once, at most `gap_max_ns` apart;
// and in time order on both sides (a pair that would cross an earlier one is dropped).
[[nodiscard]] std::vector<ImagePair> associate(std::span<const ListedImage> colour, std::span<const ListedImage> depth,
                                               std::int64_t gap_max_ns);
// How much later the depth images were taken than their colour images, if that is one time throughout: with it taken
// off, at least half of the shorter list has a partner within `gap_max_ns`. Empty: it is not.
[[nodiscard]] std::optional<std::int64_t> constant_offset_ns(std::span<const ListedImage> colour,
                                                             std::span<const ListedImage> depth,
                                                             std::int64_t gap_max_ns);
// Where none of these could be paired: by how much they miss, and which option takes it.
[[nodiscard]] std::string why_no_pairs(std::span<const ListedImage> colour, std::span<const ListedImage> depth,
                                       std::int64_t gap_max_ns);

}  // namespace stillmesh

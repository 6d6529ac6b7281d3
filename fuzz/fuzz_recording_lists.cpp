// rgb.txt and depth.txt of a recording, one after the other with a byte 0 between them, or both in one list: any bytes
// give a sentence, or lists in time order with names inside the text, and pairs that keep their promises.
#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "fuzz/fuzz.hpp"
#include "hal/replay/decimal_time.hpp"
#include "hal/replay/frame_list.hpp"

namespace {

using namespace stillmesh;

bool parse(std::string_view text, std::vector<ListedImage>& images) {
    std::string message;
    const Status status = parse_image_list(text, "file", images, message);
    if (status != Status::kOk) {
        fuzz::expect(status == Status::kInvalid && !message.empty(), "a bad list is kInvalid with a sentence");
        return false;
    }
    for (std::size_t i = 0; i < images.size(); ++i) {
        const ListedImage& image = images[i];
        fuzz::expect(image.time_ns >= 0, "times are not negative");
        fuzz::expect(i == 0 || images[i - 1].time_ns < image.time_ns, "times rise");
        fuzz::expect(image.name_size > 0 && image.name_size <= kFileNameMax, "names have a length within the limit");
        fuzz::expect(image.name_offset <= text.size() && image.name_size <= text.size() - image.name_offset,
                     "names lie inside the text");
    }
    return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    if (const auto time_ns = parse_time_ns(text.substr(0, text.find(' ')))) {
        fuzz::expect(*time_ns >= 0, "times are not negative");
    }
    std::vector<ImagePair> lines;
    std::string message;
    ListTimes times{.frames_per_s = 30};
    if (parse_associations(text, "file", lines, message, times) == Status::kOk) {
        for (std::size_t i = 0; i < lines.size(); ++i) {
            const ListedImage& depth = lines[i].depth;
            fuzz::expect(i == 0 || lines[i - 1].colour.time_ns < lines[i].colour.time_ns,
                         "times of a pair's list rise");
            fuzz::expect(
                depth.time_ns >= 0 && depth.name_size > 0 && depth.name_offset + depth.name_size <= text.size(),
                "the second name lies inside the text");
        }
    }
    const std::size_t cut = std::min(text.find('\0'), text.size());
    std::vector<ListedImage> colour, depth;
    const bool is_colour_good = parse(text.substr(0, cut), colour);
    const bool is_depth_good = parse(text.substr(std::min(cut + 1, text.size())), depth);
    if (!is_colour_good || !is_depth_good) return 0;

    static_cast<void>(constant_offset_ns(colour, depth, 20'000'000));
    for (const std::int64_t gap_max_ns :
         {std::int64_t{0}, std::int64_t{20'000'000}, std::int64_t{0x7fffffffffffffff}}) {
        const std::vector<ImagePair> pairs = associate(colour, depth, gap_max_ns);
        fuzz::expect(pairs.size() <= std::min(colour.size(), depth.size()), "each image is used once");
        for (std::size_t i = 0; i < pairs.size(); ++i) {
            const std::int64_t gap_ns = pairs[i].colour.time_ns - pairs[i].depth.time_ns;
            fuzz::expect(gap_ns <= gap_max_ns && -gap_ns <= gap_max_ns, "pairs are within the gap");
            fuzz::expect(i == 0 || (pairs[i - 1].colour.time_ns < pairs[i].colour.time_ns &&
                                    pairs[i - 1].depth.time_ns < pairs[i].depth.time_ns),
                         "pairs rise on both sides");
        }
    }
    return 0;
}

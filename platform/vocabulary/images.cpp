#include "platform/vocabulary/images.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <span>
#include <string_view>
#include <system_error>

#include "engine/features/own_extractor.hpp"
#include "hal/replay/frame_list.hpp"
#include "hal/replay/png_reader.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kSideMin = 33;  // px; smaller images have no corner
constexpr std::uint32_t kSideMax = 2047;

class Collector {
public:
    Collector(const ImageSources& sources, TrainingSet& set) : set_(set) {
        limits_.image_width_max = limits_.image_height_max = kSideMax;
        limits_.features_max = std::clamp(sources.features, 50U, 4000U);
        parameters_.count = limits_.features_max;
    }
    [[nodiscard]] bool open() {
        if (!block_.allocate(own_extractor_bytes(limits_))) return false;
        const Result<OwnExtractor> made = create_own_extractor(block_.bytes(), limits_, parameters_, cpu_kernels());
        if (!made.is_ok()) return false;
        own_ = made.value();
        return true;
    }
    [[nodiscard]] bool add(const GreyView& image) {
        if (own_.extractor->extract(image, *own_.features) != Status::kOk) return false;
        for (const Descriptor& descriptor : own_.features->descriptors) {
            set_.descriptors.push_back(descriptor);
            set_.image_of.push_back(set_.images);
        }
        ++set_.images;
        return true;
    }

private:
    TrainingSet& set_;
    Limits limits_;
    FeatureParameters parameters_;
    MemoryBlock block_;
    OwnExtractor own_;
};

// PNGs below a folder by name, or those that a recording lists.
bool list_images(const std::string& folder, std::uint32_t every, std::vector<std::string>& files,
                 std::string& message) {
    std::error_code error;
    if (!fs::is_directory(folder, error)) {
        message = folder + ": is no folder.";
        return false;
    }
    const fs::path list = fs::path(folder) / "rgb.txt";
    if (fs::exists(list, error)) {
        constexpr std::size_t kListBytesMax = std::size_t{256} << 20U;  // as of a recording that is replayed
        MemoryBlock block;
        std::span<const std::byte> bytes;
        if (!read_whole_file(list.string(), kListBytesMax, block, bytes, message)) return false;
        const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        std::vector<ListedImage> images;
        if (parse_image_list(text, list.string(), images, message) != Status::kOk) return false;
        for (std::size_t i = 0; i < images.size(); i += every) {
            files.push_back((fs::path(folder) / text.substr(images[i].name_offset, images[i].name_size)).string());
        }
        return true;
    }
    const std::size_t before = files.size();
    fs::recursive_directory_iterator at(folder, error);
    for (; !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
        if (at->is_regular_file() && at->path().extension() == ".png") files.push_back(at->path().string());
    }
    if (error) {
        message = folder + ": " + error.message() + ".";
        return false;
    }
    if (files.size() == before) {
        message = folder + ": holds neither PNG images nor a recording (rgb.txt).";
        return false;
    }
    std::sort(files.begin() + static_cast<std::ptrdiff_t>(before), files.end());
    return true;
}

bool parse_number(std::string_view text, std::uint64_t& number) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

// "SCENE", "SCENE:SEED" or "SCENE:FIRST-LAST".
bool parse_scene(const std::string& text, std::string& scene, std::uint64_t& first, std::uint64_t& last) {
    const std::size_t colon = text.find(':');
    scene = text.substr(0, colon);
    first = last = 1;
    if (colon == std::string::npos) return true;
    const std::string seeds = text.substr(colon + 1);
    const std::size_t dash = seeds.find('-');
    if (!parse_number(seeds.substr(0, dash), first)) return false;
    last = first;
    if (dash != std::string::npos && !parse_number(seeds.substr(dash + 1), last)) return false;
    return last >= first && last - first < 10'000;
}

}  // namespace

bool collect_descriptors(const ImageSources& sources, TrainingSet& set, std::uint32_t& left_out, std::string& message,
                         const std::function<void(const std::string&)>& say) {
    left_out = 0;
    Collector collector(sources, set);
    if (!collector.open()) {
        message = "the system has no memory left for the feature extractor.";
        return false;
    }
    const auto tell = [&](const std::string& what) {
        if (say)
            say(what + ": " + std::to_string(set.images) + " images, " + std::to_string(set.descriptors.size()) +
                " features");
    };
    std::vector<std::string> files;
    for (const std::string& folder : sources.folders) {
        if (!list_images(folder, std::max(1U, sources.every), files, message)) return false;
    }
    std::vector<std::uint8_t> pixels;
    std::vector<std::uint8_t> grey;
    for (std::size_t i = 0; i < files.size(); ++i) {
        ImageHeader header;
        const Status status = read_png_header(files[i], header, message);
        const bool is_fit = status == Status::kOk && header.kind != ImageKind::kGrey16 && header.width >= kSideMin &&
                            header.height >= kSideMin && header.width <= kSideMax && header.height <= kSideMax;
        if (!is_fit && (status == Status::kOk || status == Status::kInvalid)) {
            ++left_out;
            continue;
        }
        if (status != Status::kOk) return false;
        const std::size_t count = std::size_t{header.width} * header.height;
        pixels.resize(count * bytes_per_pixel(header.kind));
        if (read_png(files[i], header, pixels, message) != Status::kOk) return false;
        grey = pixels;
        if (header.kind == ImageKind::kRgb8) {
            grey.resize(count);
            // Alone on its row: kernels read and write beyond the ends of rows.
            std::vector<std::uint8_t> row(std::size_t{3} * header.width + kKernelSlackBytes);
            std::vector<std::uint8_t> out(header.width + kKernelSlackBytes);
            for (std::size_t y = 0; y < header.height; ++y) {
                std::copy_n(pixels.begin() + static_cast<std::ptrdiff_t>(y * 3 * header.width), 3 * header.width,
                            row.begin());
                cpu_kernels().grey_from_rgb(row.data(), header.width, out.data());
                std::copy_n(out.begin(), header.width, grey.begin() + static_cast<std::ptrdiff_t>(y * header.width));
            }
        }
        if (!collector.add({grey.data(), header.width, header.height, header.width})) ++left_out;
        if (i % 50 == 49) tell("read " + std::to_string(i + 1) + " of " + std::to_string(files.size()));
    }
    for (const std::string& text : sources.scenes) {
        std::string scene;
        std::uint64_t first = 1;
        std::uint64_t last = 1;
        if (!parse_scene(text, scene, first, last)) {
            message = "'" + text + "' is not SCENE:SEED or SCENE:FIRST-LAST.";
            return false;
        }
        for (std::uint64_t seed = first; seed <= last; ++seed) {
            SimulationOptions options;
            options.scene = scene;
            options.seed = seed;
            SimulatedCamera camera(options);
            if (camera.open() != Status::kOk) {
                message = camera.message() + ".";
                return false;
            }
            const std::uint32_t frames = std::clamp(sources.frames, 1U, camera.frame_count());
            for (std::uint32_t i = 0; i < frames; ++i) {
                camera.seek(static_cast<std::uint32_t>(std::uint64_t{i} * camera.frame_count() / frames));
                Frame frame;
                if (camera.poll(frame) != Status::kOk) break;
                if (!collector.add(frame.colour)) ++left_out;
            }
            tell("rendered " + scene + ":" + std::to_string(seed));
        }
    }
    message.clear();
    return true;
}

}  // namespace stillmesh

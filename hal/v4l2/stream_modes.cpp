#include "hal/v4l2/stream_modes.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>

#include "hal/v4l2/pixel_formats.hpp"

namespace stillmesh::v4l2 {
namespace {

constexpr std::uint32_t kFormatsMax = 32, kSizesMax = 64, kIntervalsMax = 32;
constexpr std::uint32_t kSideMin_px = 33, kSideMax_px = 4096;
constexpr double kRateMin = 5, kRateMax = 240;
constexpr std::size_t kPairsMax = 4096;
constexpr V4l2Size kDepthBest{848, 480}, kColourBest{640, 480};

[[nodiscard]] bool is_size(const V4l2Size& size) noexcept {
    return size.width >= kSideMin_px && size.height >= kSideMin_px && size.width <= kSideMax_px &&
           size.height <= kSideMax_px;
}

[[nodiscard]] bool is_rate(const V4l2Interval& interval) noexcept {
    if (interval.numerator == 0) return false;
    const double rate = static_cast<double>(interval.denominator) / interval.numerator;
    return rate >= kRateMin && rate <= kRateMax;
}

// How far a format is from what the engine takes.
[[nodiscard]] double format_cost(std::uint32_t fourcc) noexcept {
    switch (fourcc) {
        case kZ16:
        case kRgb3: return 0;
        case kYuyv: return 1;
        case kUyvy: return 2;
        case kMjpg: return 6;
        case kY16:
        case kGrey: return 30;
        default: return 31;
    }
}

// Twice as many pixels, or half, cost as much as ten images/s less than the best rate; more are hardly worse.
[[nodiscard]] double cost(const Mode& mode, const V4l2Size& best, const V4l2Size& first, double rate_best) {
    const double rate = mode.frames_per_s();
    const double rate_cost = rate < rate_best ? 2 * (rate_best - rate) : (rate - rate_best) / 10;
    const double pixels = static_cast<double>(mode.size.width) * mode.size.height;
    const double size_cost = 20 * std::abs(std::log2(pixels / (static_cast<double>(best.width) * best.height)));
    const bool is_other_size = first.width != 0 && (mode.size.width != first.width || mode.size.height != first.height);
    const bool is_best = mode.size.width == best.width && mode.size.height == best.height;
    return rate_cost + size_cost + format_cost(mode.fourcc) + (is_best ? 0 : 1) + (is_other_size ? 1000 : 0);
}

void list_intervals(V4l2Link& link, int handle, const V4l2Format& format, std::vector<Mode>& modes) {
    for (std::uint32_t i = 0; i < kIntervalsMax && modes.size() < kModesMax; ++i) {
        V4l2Interval interval;
        if (link.interval_at(handle, format, i, interval) != 0) return;
        if (is_rate(interval)) modes.push_back({format.fourcc, {format.width, format.height}, interval});
    }
}

}  // namespace

std::string mode_text(const Mode& mode) {
    char text[48];
    std::snprintf(text, sizeof(text), " %ux%u@%.3g", mode.size.width, mode.size.height, mode.frames_per_s());
    return fourcc_text(mode.fourcc) + text;
}

std::string modes_text(const std::vector<Mode>& modes, bool is_of_depth) {
    std::string text;
    for (const Mode& mode : modes) {
        if (is_depth(mode.fourcc) != is_of_depth || text.size() > 300) continue;
        const std::string one = mode_text(mode).substr(fourcc_text(mode.fourcc).size() + 1);
        if ((" " + text + " ").find(" " + one + " ") == std::string::npos) text += (text.empty() ? "" : " ") + one;
    }
    return text.empty() ? "none" : text;
}

int list_modes(V4l2Link& link, int handle, std::vector<Mode>& modes) {
    modes.clear();
    for (std::uint32_t i = 0; i < kFormatsMax; ++i) {
        V4l2Format format;
        if (const int error = link.format_at(handle, i, format.fourcc); error != 0) {
            return error == EINVAL ? 0 : error;
        }
        if (!is_depth(format.fourcc) && !is_colour(format.fourcc)) continue;
        for (std::uint32_t s = 0; s < kSizesMax; ++s) {
            V4l2Size size;
            if (link.size_at(handle, format.fourcc, s, size) != 0) break;
            if (!is_size(size)) continue;
            format.width = size.width;
            format.height = size.height;
            list_intervals(link, handle, format, modes);
        }
    }
    return 0;
}

double ModePair::bytes_per_s() const noexcept {
    const auto of = [](const Mode& mode) {
        return static_cast<double>(mode.size.width) * mode.size.height *
               std::max<std::uint32_t>(bytes_per_pixel(mode.fourcc), 1) * mode.frames_per_s();
    };
    return of(depth) + of(colour);
}

std::vector<ModePair> rank_modes(const std::vector<Mode>& depth, const std::vector<Mode>& colour,
                                 const ModeWishes& wishes) {
    struct Ranked {
        double cost;
        ModePair pair;
    };
    std::vector<Ranked> ranked;
    for (const Mode& d : depth) {
        if (d.fourcc != kZ16 && (d.fourcc != kY16 || !wishes.has_y16_depth)) continue;
        const double depth_cost = cost(d, kDepthBest, wishes.depth_first, wishes.rate_best);
        for (const Mode& c : colour) {
            const bool is_grey = engine_format(c.fourcc) == PixelFormat::kGrey8;
            if (!is_colour(c.fourcc) || c.size.width > wishes.width_max || c.size.height > wishes.height_max ||
                (c.fourcc == kMjpg && !wishes.has_jpeg) || (is_grey && !wishes.has_infrared_colour) ||
                (!is_grey && wishes.is_one_view)) {
                continue;
            }
            if (wishes.is_one_view && (c.size.width != d.size.width || c.size.height != d.size.height)) continue;
            // Images that find no partner cost the bus and are dropped.
            const double rates_apart = std::abs(d.frames_per_s() - c.frames_per_s()) > 0.5 ? 10 : 0;
            const double colour_cost = cost(c, kColourBest, wishes.colour_first, wishes.rate_best);
            ranked.push_back({depth_cost + colour_cost + rates_apart, {d, c}});
        }
    }
    std::stable_sort(ranked.begin(), ranked.end(), [](const Ranked& a, const Ranked& b) { return a.cost < b.cost; });
    std::vector<ModePair> pairs;
    for (const Ranked& one : ranked) {
        if (pairs.size() == kPairsMax) break;
        pairs.push_back(one.pair);
    }
    return pairs;
}

}  // namespace stillmesh::v4l2

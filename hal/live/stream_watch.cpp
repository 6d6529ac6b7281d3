#include "hal/live/stream_watch.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

// Means of 8x10 samples: noise of 5 grey levels, or of 2 % of the depth, is a tenth of it there.
constexpr std::uint32_t kBlockColumns = 8, kBlockRows = 10;
constexpr float kColourMoved = 2.0F;  // grey levels
constexpr float kDepthMoved = 0.01F;  // of the depth

}  // namespace

void StreamWatch::look(const Frame& frame) noexcept {
    const std::uint32_t channels = channels_of(frame.format);
    const std::uint32_t green = channels == 3 ? 1 : 0;
    Samples colour, depth;
    for (std::uint32_t row = 0; row < kRows; ++row) {
        const std::uint32_t y = (2 * row + 1) * frame.colour.height / (2 * kRows);
        for (std::uint32_t column = 0; column < kColumns; ++column) {
            const std::uint32_t x = (2 * column + 1) * frame.colour.width / (2 * kColumns);
            colour[row * kColumns + column] = frame.colour.row(y)[std::size_t{x} * channels + green];
            depth[row * kColumns + column] = frame.depth.at(x, y);
        }
    }
    const auto empty = static_cast<std::size_t>(std::count(depth.begin(), depth.end(), std::uint16_t{0}));
    has_depth_ = (depth.size() - empty) * 50 > depth.size();
    Channel& c = channels_[kColour];
    Channel& d = channels_[kDepth];
    if (!has_image_) {
        c.now = colour;
        d.now = depth;
        has_image_ = true;
        return;
    }
    const bool did_repeat = c.repeats > 0 || d.repeats > 0;
    compare(c, colour);
    compare(d, depth);
    if (!did_repeat && (c.repeats > 0 || d.repeats > 0)) {
        c.then = c.now;
        d.then = d.now;
    }
    c.now = colour;
    d.now = depth;
    const bool depth_moved = c.repeats > 0 && d.repeats == 0 && has_moved(d, kDepthMoved, true);
    const bool colour_moved = d.repeats > 0 && c.repeats == 0 && has_moved(c, kColourMoved, false);
    c.is_suspect =
        c.repeats > 0 && !c.is_plain && (c.is_suspect || depth_moved || (c.repeats == 1 && !came_to_rest(c)));
    d.is_suspect =
        d.repeats > 0 && !d.is_plain && (d.is_suspect || colour_moved || (d.repeats == 1 && !came_to_rest(d)));
    // A frame that is there twice, as where a source is slower than its times, is right but for the time of an image.
    const bool is_twice = c.repeats == 1 && d.repeats == 1;
    c.is_stuck = c.is_suspect && !is_twice;
    d.is_stuck = d.is_suspect && !is_twice;
}

void StreamWatch::compare(Channel& channel, const Samples& next) noexcept {
    std::uint64_t sum = 0;
    std::uint32_t changed = 0, there = 0;
    bool is_plain = true;
    for (std::size_t i = 0; i < next.size(); ++i) {
        const int difference = next[i] - channel.now[i];
        sum += static_cast<std::uint64_t>(difference < 0 ? -difference : difference);
        changed += difference != 0 ? 1U : 0U;
        there += next[i] != 0 || channel.now[i] != 0 ? 1U : 0U;
        is_plain = is_plain && next[i] == next[0];
    }
    channel.is_plain = is_plain;
    if (changed == 0) {
        ++channel.repeats;
        return;
    }
    channel.repeats = 0;
    std::shift_right(channel.changes.begin(), channel.changes.end(), 1);
    channel.changes[0] = static_cast<float>(sum) / static_cast<float>(next.size());
    channel.changed_share = static_cast<float>(changed) / static_cast<float>(std::max(there, 1U));
    ++channel.changes_seen;
}

// Without noise a camera that comes to rest changes its image less and less, and in the end by nothing: a speed that
// falls evenly leaves a seventh of what it was three images before; or it had hardly moved
// at all. Noise changes most pixels to the last.
bool StreamWatch::came_to_rest(const Channel& channel) noexcept {
    if (channel.changes_seen == 0) return true;  // it never moved
    const float largest = *std::max_element(channel.changes.begin(), channel.changes.end());
    return channel.changed_share < 0.05F || (channel.changed_share < 0.6F && channel.changes[0] < 0.25F * largest);
}

bool StreamWatch::has_moved(const Channel& channel, float threshold, bool is_relative) noexcept {
    float moved = 0;
    std::uint32_t blocks = 0;
    for (std::uint32_t top = 0; top < kRows; top += kBlockRows) {
        for (std::uint32_t left = 0; left < kColumns; left += kBlockColumns) {
            std::uint32_t then = 0, now = 0, both = 0;
            for (std::uint32_t i = 0; i < kBlockRows * kBlockColumns; ++i) {
                const std::size_t at = (top + i / kBlockColumns) * kColumns + left + i % kBlockColumns;
                if (channel.then[at] == 0 || channel.now[at] == 0) continue;
                then += channel.then[at];
                now += channel.now[at];
                ++both;
            }
            if (both < kBlockRows * kBlockColumns / 4) continue;
            ++blocks;
            const auto count = static_cast<float>(is_relative ? then : both);
            moved += std::fabs(static_cast<float>(now) - static_cast<float>(then)) / count;
        }
    }
    return blocks > 0 && moved > threshold * static_cast<float>(blocks);
}

bool StreamWatch::is_frozen() const noexcept {
    const Channel& c = channels_[kColour];
    const Channel& d = channels_[kDepth];
    if (c.repeats > 0 && d.repeats > 0) return true;
    return (c.repeats > 0 && !c.is_plain) || (d.repeats > 0 && !d.is_plain);
}

}  // namespace stillmesh

#include "engine/features/orb_extractor.hpp"

#include <bit>
#include <cstring>

#include "engine/base/numbers.hpp"
#include "engine/features/orb_pattern.hpp"
#include "engine/geometry/trig.hpp"

namespace stillmesh {
namespace {

// Corners, orientation and pattern stay inside the level.
constexpr std::uint32_t kBorder = static_cast<std::uint32_t>(kPatchRadius) + 1;

constexpr std::uint32_t minimum(std::uint32_t a, std::uint32_t b) noexcept {
    return a < b ? a : b;
}

// Spreads the low 11 bits of `v` to the even bits, and back.
constexpr std::uint32_t spread_bits(std::uint32_t v) noexcept {
    v = (v | v << 8) & 0x00ff00ffu;
    v = (v | v << 4) & 0x0f0f0f0fu;
    v = (v | v << 2) & 0x33333333u;
    return (v | v << 1) & 0x55555555u;
}
constexpr std::uint32_t gather_bits(std::uint32_t v) noexcept {
    v &= 0x55555555u;
    v = (v | v >> 1) & 0x33333333u;
    v = (v | v >> 2) & 0x0f0f0f0fu;
    v = (v | v >> 4) & 0x00ff00ffu;
    return (v | v >> 8) & 0x0000ffffu;
}

// How well the patch fixes a corner: det / trace of its gradients' tensor, half the harmonic mean of its eigenvalues
// (Noble 1988), which is in units of squared contrast. On a logarithmic scale of 32 steps to the octave: the exponent
// and first bits of a float are that.
std::uint32_t score_of(const Tensor& tensor) noexcept {
    const std::int64_t determinant = static_cast<std::int64_t>(tensor.xx) * tensor.yy -
                                     static_cast<std::int64_t>(tensor.xy) * tensor.xy;  // below 2^52: exact
    const std::int32_t trace = tensor.xx + tensor.yy;
    constexpr float kLeast = 1024;
    constexpr std::uint32_t kDropped = 18;  // of the 23 bits of a mantissa
    const float ratio = static_cast<float>(static_cast<double>(determinant) / static_cast<double>(trace));
    if (!(ratio > kLeast)) return 0;  // nor where there are no gradients: 0 / 0 is no number
    const std::uint32_t score =
        (std::bit_cast<std::uint32_t>(ratio) - std::bit_cast<std::uint32_t>(kLeast)) >> kDropped;
    return minimum(score, 511);  // 2^26 and more
}

// Where the peak of a parabola through three values lies, from the middle one.
double peak(std::uint32_t before, std::uint32_t here, std::uint32_t after) noexcept {
    const double curvature = static_cast<double>(before) - 2.0 * here + after;
    if (curvature >= 0) return 0;
    const double offset = 0.5 * (static_cast<double>(before) - after) / curvature;
    constexpr double kFarthest = 0.75;
    return offset < -kFarthest ? -kFarthest : offset > kFarthest ? kFarthest : offset;
}

struct Offset {
    double x;
    double y;
};

// A corner's place to a fraction of a pixel: the peak of its FAST strength among the 5x5 around it, smoothed by
// (1 2 1) along and (1 4 6 4 1) across. A quarter of the error falls away against whole pixels (bench/features).
Offset peak_of_strength(const Kernels& kernels, const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    constexpr std::uint32_t kSide = 5;
    constexpr std::uint32_t kWeights[kSide] = {1, 4, 6, 4, 1};
    std::uint8_t strengths[kSide][kSide + kKernelSlackBytes];
    std::uint32_t across[kSide] = {};
    std::uint32_t down[kSide] = {};
    for (std::uint32_t v = 0; v < kSide; ++v) {
        const std::uint8_t* const row = centre + (static_cast<std::ptrdiff_t>(v) - 2) * stride - 2;
        static_cast<void>(kernels.fast_row(row, stride, 0, kSide, 0, strengths[v]));
        for (std::uint32_t u = 0; u < kSide; ++u) {
            across[u] += kWeights[v] * strengths[v][u];
            down[v] += kWeights[u] * strengths[v][u];
        }
    }
    const auto smooth_peak = [](const std::uint32_t line[kSide]) noexcept {
        return peak(line[0] + 2 * line[1] + line[2], line[1] + 2 * line[2] + line[3], line[2] + 2 * line[3] + line[4]);
    };
    return {smooth_peak(across), smooth_peak(down)};
}

// The nearest of the pattern's turns, ties upward; pattern and angle both run from x towards y.
std::uint32_t turn_of(double angle_rad) noexcept {
    constexpr double kTurnsPerRad = kPatternTurns / 6.283185307179586477;
    // In (0.5, kPatternTurns * 1.5 + 0.5].
    const std::int32_t turn = floor_clamped(angle_rad * kTurnsPerRad + (kPatternTurns + 0.5), 0, 2 * kPatternTurns);
    return static_cast<std::uint32_t>(turn) % kPatternTurns;
}

// 256 tests: a bit is set when the first pixel is darker than the second. The first test is the highest bit of word 0.
// The patch is copied to where its rows lie at a fixed distance: one table of offsets serves every image.
template <std::int32_t kSign>
void run_tests(const std::uint8_t* centre, std::ptrdiff_t stride, const std::int16_t* offsets,
               Descriptor& descriptor) noexcept {
    constexpr std::int32_t kRows = 2 * kPatternRadius + 1;
    std::uint8_t patch[kRows * kPatternPatchStride];
    const std::uint8_t* from = centre - kPatternRadius * stride - kPatternRadius;
    for (std::int32_t i = 0; i < kRows; ++i, from += stride) {
        // 33 bytes, as two fixed copies: the compiler makes them a few moves.
        std::memcpy(patch + i * kPatternPatchStride, from, 32);
        patch[i * kPatternPatchStride + 32] = from[32];
    }
    const std::uint8_t* const middle = patch + kPatternRadius * kPatternPatchStride + kPatternRadius;
    for (std::uint64_t& word : descriptor.words) {
        std::uint64_t bits = 0;
        for (std::uint32_t i = 0; i < 64; ++i, offsets += 2)
            bits = bits + bits + (middle[kSign * offsets[0]] < middle[kSign * offsets[1]] ? 1u : 0u);
        word = bits;
    }
}

}  // namespace

void OrbExtractor::create(Arena& arena, const Limits& limits, const OrbOptions& options,
                          const Kernels& kernels) noexcept {
    STILLMESH_CHECK(limits.image_width_max <= kCoordinateMask && limits.image_height_max <= kCoordinateMask);
    STILLMESH_CHECK(options.features_max <= limits.features_max);
    STILLMESH_CHECK(options.scale_factor >= kScalePermilleMin * 1e-3 &&
                    options.scale_factor <= kScalePermilleMax * 1e-3);
    STILLMESH_CHECK(options.even_permille <= 1000);
    STILLMESH_CHECK(options.fast_threshold_low >= 1 && options.fast_threshold_low <= options.fast_threshold);
    options_ = options;
    kernels_ = &kernels;
    const auto permille = static_cast<std::uint32_t>(round_clamped(options.scale_factor * 1000.0));
    pyramid_.create(arena, limits, options.levels, permille, kernels);
    strengths_stride_ = level_stride(limits.image_width_max) + kKernelSlackBytes;
    take_arrays(arena, limits);
}

Status OrbExtractor::extract(const GreyView& image, FeatureSet& features) noexcept {
    features.clear();
    levels_ = 0;
    STILLMESH_TRY(pyramid_.build(image));
    levels_ = pyramid_.levels();
    for (std::uint32_t i = 0; i < levels_; ++i) find_corners(i);
    const std::size_t room = features.keypoints.capacity();
    share_out(room < options_.features_max ? static_cast<std::uint32_t>(room) : options_.features_max);
    for (std::uint32_t i = 0; i < levels_; ++i) {
        if (level_corners_[i].wanted == 0) continue;
        select(i);
        blur(i);
        describe(i, features);
    }
    return Status::kOk;
}

// All corners of a level at the low threshold, without their weaker neighbours, in raster order.
void OrbExtractor::find_corners(std::uint32_t level) noexcept {
    const GreyView image = pyramid_.level(level);
    LevelCorners& found = level_corners_[level];
    found = {};
    if (level > 0) found.begin = level_corners_[level - 1].begin + level_corners_[level - 1].count;
    const std::uint32_t end_max = found.begin + static_cast<std::uint32_t>(corners_max(image.width, image.height));
    STILLMESH_CHECK(end_max <= corners_.size());
    std::uint32_t end = found.begin;
    std::uint32_t score_min = 0;
    const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(image.stride);
    // One pixel more to each side: the neighbours of the outermost corners.
    const std::uint32_t x_begin = kBorder - 1;
    const std::uint32_t x_end = image.width - kBorder + 1;
    std::uint8_t* rows[3];
    bool any[3] = {false, false, false};
    for (std::uint32_t i = 0; i < 3; ++i) rows[i] = strengths_.data() + i * strengths_stride_;
    for (std::uint32_t y = kBorder - 1; y < image.height - kBorder + 1; ++y) {
        std::uint8_t* const newest = rows[y % 3];
        any[y % 3] = kernels_->fast_row(image.row(y), stride, x_begin, x_end, options_.fast_threshold_low, newest);
        const std::uint32_t centre_y = y - 1;  // the row whose neighbours are now known
        if (centre_y < kBorder || !any[centre_y % 3]) continue;
        const std::uint8_t* const centre = rows[centre_y % 3];
        const std::uint32_t count =
            kernels_->local_maxima(rows[(y + 1) % 3], centre, newest, kBorder, image.width - kBorder, maxima_.data());
        for (std::uint32_t i = 0; i < count; ++i) {
            const std::uint32_t x = maxima_[i];
            if (end == end_max) thin_out(found.begin, end, score_min);
            const std::uint32_t score = centre[x];  // until it is rated
            if (score < score_min) continue;
            STILLMESH_CHECK(end < end_max);
            corners_[end++] = score << kScoreShift | (centre[x] > options_.fast_threshold ? kStrongBit : 0) |
                              centre_y << kCoordinateBits | x;
        }
    }
    found.count = end - found.begin;
    put_strong_first(level, image.width);
    put_moving_last(level);
}

// Room is short (noise, or worse): raises the least score until at least half of the level's corners are gone. Where
// more than half share the best score, every second one goes.
void OrbExtractor::thin_out(std::uint32_t begin, std::uint32_t& end, std::uint32_t& score_min) noexcept {
    std::uint32_t histogram[kScores] = {};
    for (std::uint32_t i = begin; i < end; ++i) ++histogram[corners_[i] >> kScoreShift];
    const std::uint32_t total = end - begin;
    std::uint32_t gone = 0;
    score_min = 0;
    while (2 * gone < total && gone + histogram[score_min] < total) gone += histogram[score_min++];
    const std::uint32_t step = 2 * gone < total ? 2 : 1;
    std::uint32_t kept = 0;
    for (std::uint32_t i = begin; i < end; ++i)
        if (corners_[i] >> kScoreShift >= score_min) corners_[begin + kept++ / step] = corners_[i];
    end = begin + (kept + step - 1) / step;
}

// Moves `wanted` of `corners`, evenly spread, to the front and returns their count. A quadtree without the tree: sorted
// along Morton's curve, the corners of every square of every depth lie side by side. The finest depth with no more
// occupied squares than the even share of `wanted` gives each square its best corner; the rest goes to the best of what
// is left, one corner in each square of 4 px. Linear time, no recursion; ties end with the earlier on the
// curve.
std::uint32_t OrbExtractor::spread(std::span<std::uint32_t> corners, std::uint32_t wanted) noexcept {
    const std::uint32_t count = static_cast<std::uint32_t>(corners.size());
    if (count <= wanted || wanted == 0) return minimum(count, wanted);
    // Sorted by place (22 bits, above 10 bits of score and strength), in two passes of 11 bits.
    constexpr std::uint32_t kPlaceShift = 32 - 2 * kCoordinateBits;
    constexpr std::uint32_t kScoreMask = kScores - 1;
    constexpr std::uint32_t kDigit = 2048;
    std::uint32_t starts[2][kDigit] = {};
    for (std::uint32_t& corner : corners) {
        const std::uint32_t place =
            spread_bits(corner & kCoordinateMask) | spread_bits(corner >> kCoordinateBits & kCoordinateMask) << 1;
        corner = place << kPlaceShift | corner >> kScoreShift;
        ++starts[0][place % kDigit];
        ++starts[1][place / kDigit];
    }
    std::uint32_t sum[2] = {0, 0};
    for (std::uint32_t i = 0; i < kDigit; ++i) {
        for (std::uint32_t k = 0; k < 2; ++k) {
            const std::uint32_t here = starts[k][i];
            starts[k][i] = sum[k];
            sum[k] += here;
        }
    }
    for (const std::uint32_t corner : corners) sorted_[starts[0][(corner >> kPlaceShift) % kDigit]++] = corner;
    for (std::uint32_t i = 0; i < count; ++i) corners[starts[1][sorted_[i] >> (kPlaceShift + 11)]++] = sorted_[i];

    // Where a corner and the one before it part: the depth of the first square that holds but one of them.
    const auto parting = [&corners](std::uint32_t i) noexcept {
        const std::uint32_t different = (corners[i] ^ corners[i - 1]) >> kPlaceShift;  // never 0: places are unique
        return static_cast<std::uint32_t>(
            (std::countl_zero(different) - (32 - 2 * static_cast<std::int32_t>(kCoordinateBits))) / 2 + 1);
    };
    std::uint32_t parting_at[kCoordinateBits + 1] = {};
    for (std::uint32_t i = 1; i < count; ++i) ++parting_at[parting(i)];
    std::uint32_t depth = 0;
    std::uint32_t squares = 1;
    while (1000 * (squares + parting_at[depth + 1]) <= options_.even_permille * wanted) squares += parting_at[++depth];
    // Corners that share a square of 4 px say the same.
    std::uint32_t fine = depth < kCoordinateBits - 2 ? kCoordinateBits - 2 : kCoordinateBits;
    std::uint32_t fine_squares = squares;
    for (std::uint32_t i = depth + 1; i <= fine; ++i) fine_squares += parting_at[i];
    while (fine_squares < wanted) fine_squares += parting_at[++fine];

    // The best of every smaller square; the best of each square is certain (the first `squares` of sorted_),
    // the others, behind them, compete.
    std::uint32_t histogram[kScores] = {};
    std::uint32_t certain = 0;
    std::uint32_t others = squares;
    std::uint32_t begin = 0;
    for (std::uint32_t i = 1; i <= count; ++i) {
        if (i < count && parting(i) > fine) continue;
        std::uint32_t best = corners[begin];
        for (std::uint32_t k = begin + 1; k < i; ++k)
            if ((corners[k] & kScoreMask) > (best & kScoreMask)) best = corners[k];
        if (begin == 0 || parting(begin) <= depth) {
            sorted_[certain++] = best;
        } else {
            std::uint32_t& best_of_square = sorted_[certain - 1];
            if ((best & kScoreMask) > (best_of_square & kScoreMask)) {
                const std::uint32_t other = best_of_square;
                best_of_square = best;
                best = other;
            }
            ++histogram[best & kScoreMask];
            sorted_[others++] = best;
        }
        begin = i;
    }
    STILLMESH_CHECK(certain == squares);
    std::uint32_t left = wanted - squares;
    std::uint32_t score = kScoreMask;  // all above it are taken, of it only `left`
    while (score > 0 && left > histogram[score]) left -= histogram[score--];
    std::uint32_t taken = 0;
    for (std::uint32_t i = 0; i < others; ++i) {
        const std::uint32_t corner = sorted_[i];
        bool take = i < squares || (corner & kScoreMask) > score;
        if (!take && (corner & kScoreMask) == score && left > 0) {
            take = true;
            --left;
        }
        if (!take) continue;
        const std::uint32_t place = corner >> kPlaceShift;
        corners[taken++] =
            (corner & kScoreMask) << kScoreShift | gather_bits(place >> 1) << kCoordinateBits | gather_bits(place);
    }
    return taken;
}

// Puts the quality of corners in the place of their FAST strength. Only of those that have a choice before them or are
// given out: where a cell has strong corners its weak ones, most of all, are never asked.
void OrbExtractor::rate(const GreyView& image, std::span<std::uint32_t> corners) noexcept {
    constexpr std::size_t kBatch = 64;
    std::uint32_t places[kBatch];
    Tensor tensors[kBatch];
    for (std::size_t begin = 0; begin < corners.size(); begin += kBatch) {
        const std::size_t count = corners.size() - begin < kBatch ? corners.size() - begin : kBatch;
        for (std::size_t i = 0; i < count; ++i) {
            const std::uint32_t corner = corners[begin + i];
            places[i] = (corner >> kCoordinateBits & kCoordinateMask) << 16 | (corner & kCoordinateMask);
        }
        kernels_->tensors(image.data, static_cast<std::ptrdiff_t>(image.stride), places,
                          static_cast<std::uint32_t>(count), tensors);
        for (std::size_t i = 0; i < count; ++i) {
            std::uint32_t& corner = corners[begin + i];
            corner = score_of(tensors[i]) << kScoreShift | (corner & ((1u << kScoreShift) - 1));
        }
    }
}

void OrbExtractor::blur(std::uint32_t level) noexcept {
    const GreyView image = pyramid_.level(level);
    const std::int32_t last = static_cast<std::int32_t>(image.height) - 1;
    for (std::int32_t y = 0; y <= last; ++y) {
        const std::uint8_t* rows[7];
        for (std::int32_t i = 0; i < 7; ++i) {
            std::int32_t source = y + i - static_cast<std::int32_t>(kBlurRadius);
            if (source < 0) source = -source;  // mirrored, the border row itself once
            if (source > last) source = 2 * last - source;
            rows[i] = image.row(static_cast<std::uint32_t>(source));
        }
        kernels_->blur_row(rows, image.width, blur_scratch_.data() + kKernelSlackBytes,
                           blurred_.data() + static_cast<std::size_t>(y) * image.stride);
    }
}

void OrbExtractor::describe(std::uint32_t level, FeatureSet& features) noexcept {
    const GreyView image = pyramid_.level(level);
    const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(image.stride);
    const TurnedPattern& pattern = turned_pattern();
    const LevelCorners& found = level_corners_[level];
    for (std::uint32_t i = 0; i < found.wanted; ++i) {
        const std::uint32_t corner = corners_[found.begin + i];
        const std::uint32_t x = corner & kCoordinateMask;
        const std::uint32_t y = corner >> kCoordinateBits & kCoordinateMask;
        const Offset offset = peak_of_strength(*kernels_, image.row(y) + x, stride);
        const Moments moments = kernels_->moments(image.row(y) + x, stride);
        const double angle_rad = arc_tan2(moments.y, moments.x);
        Keypoint keypoint;
        keypoint.x = static_cast<float>(pyramid_.full_x(level, x + offset.x));
        keypoint.y = static_cast<float>(pyramid_.full_y(level, y + offset.y));
        keypoint.angle_rad = static_cast<float>(angle_rad);
        keypoint.score = static_cast<std::uint16_t>(corner >> kScoreShift);
        keypoint.level = static_cast<std::uint8_t>(level);
        Descriptor descriptor;
        const std::uint8_t* const centre = blurred_.data() + y * image.stride + x;
        const std::uint32_t turn = turn_of(angle_rad);
        if (turn < kKeptTurns) {
            run_tests<1>(centre, stride, pattern.offsets[turn], descriptor);
        } else {
            run_tests<-1>(centre, stride, pattern.offsets[turn - kKeptTurns], descriptor);
        }
        const bool fits = features.keypoints.push(keypoint) && features.descriptors.push(descriptor);
        STILLMESH_CHECK(fits);
    }
}

}  // namespace stillmesh

// Any picture, one after the other through the same extractor: features lie inside it, no more than asked for, the same
// when asked again, and the same bits from every set of kernels that this processor can run. The extractors live as
// long as the program, but for one that has seen no picture before (struct Others says of how many inputs).
#include <cmath>

#include "engine/base/crc.hpp"

#include "fuzz/fuzz.hpp"
#include "fuzz/pictures.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/rig.hpp"

namespace {

using namespace stillmesh;

// Smaller than Limits::tiny(), for speed; still with three levels.
constexpr Limits kLimits = [] {
    Limits limits = Limits::tiny();
    limits.image_width_max = 96;
    limits.image_height_max = 80;
    return limits;
}();

void expect_same(const FeatureSet& a, const FeatureSet& b, const char* promise) {
    fuzz::expect(a.size() == b.size(), promise);
    for (std::size_t i = 0; i < a.size(); ++i) {
        const Keypoint& p = a.keypoints.span()[i];
        const Keypoint& q = b.keypoints.span()[i];
        fuzz::expect(p.x == q.x && p.y == q.y && p.angle_rad == q.angle_rad && p.score == q.score &&
                         p.level == q.level && a.descriptors.span()[i] == b.descriptors.span()[i],
                     promise);
    }
}

void expect_right(const FeatureSet& features, std::uint32_t width, std::uint32_t height) {
    fuzz::expect(features.size() <= kLimits.features_max, "never more features than asked for");
    for (const Keypoint& keypoint : features.keypoints.span()) {
        fuzz::expect(keypoint.x >= 0 && keypoint.x <= static_cast<float>(width - 1) && keypoint.y >= 0 &&
                         keypoint.y <= static_cast<float>(height - 1),
                     "features lie inside the image");
        fuzz::expect(keypoint.level < kLimits.pyramid_levels_max, "the level exists");
        fuzz::expect(std::abs(keypoint.angle_rad) <= 3.1415928F, "the angle is one");
    }
}

// What is tried of an input beside the extractor that this processor would use.
struct Others {
    bool is_plain = true;  // plain kernels, of one input in eight: they are slow under sanitizers
    bool is_sse2 = true;   // always
    bool is_fresh =
        true;  // an extractor that has seen no picture before, of one in eight, which may have four pictures
};
Others others_of(std::span<const std::uint8_t> input) {
#ifdef STILLMESH_LIBFUZZER
    const std::uint32_t checksum = crc32(std::as_bytes(input));
    return {checksum % 8 == 1, true, checksum % 8 == 0};
#else
    static_cast<void>(input);
    return {};
#endif
}

void try_picture(fuzz::Bytes& bytes, const Others& others) {
    static testing::Rig fast(kLimits, cpu_kernels()), plain(kLimits, plain_kernels());
    static testing::Rig sse2(kLimits, sse2_kernels() != nullptr ? *sse2_kernels() : plain_kernels());
    const std::uint32_t width = bytes.u8() % (kLimits.image_width_max + 8);
    const std::uint32_t height = bytes.u8() % (kLimits.image_height_max + 8);
    const auto picture = fuzz::picture_from<std::uint8_t>(bytes, width, height, 1);
    const Status status = fast.extractor.extract(picture.view, fast.features);
    if (width > kLimits.image_width_max || height > kLimits.image_height_max || width == 0 || height == 0) {
        fuzz::expect(status == Status::kInvalid, "a size that is not possible is kInvalid");
    }
    if (status == Status::kOk) {
        expect_right(fast.features, width, height);
    } else {
        fuzz::expect(status == Status::kInvalid && fast.features.size() == 0, "a refused image has no features");
    }
    const auto compare = [&](testing::Rig& other, const char* promise) {
        fuzz::expect(other.extractor.extract(picture.view, other.features) == status, promise);
        expect_same(fast.features, other.features, promise);
    };
    if (others.is_plain) compare(plain, "plain kernels give the same");
    if (others.is_sse2) compare(sse2, "SSE2 gives the same");
    if (others.is_fresh) {
        // This one has not seen the images before: nothing of them may be left.
        testing::Rig fresh(kLimits, cpu_kernels());
        compare(fresh, "an image's features depend on the image alone");
    }
}

}  // namespace

#ifdef STILLMESH_LIBFUZZER
#include "fuzz/mutator.hpp"

namespace {

std::size_t piece_bytes(std::span<const std::uint8_t> rest, bool) {
    return 7 + (rest.size() > 6 ? 1U + rest[6] % 64 : 0U);
}

fuzz::Piece make_picture(Random& random) {
    const auto any = [&] { return static_cast<std::uint8_t>(random.below(256)); };
    const auto side = [&](std::uint32_t most) {  // seldom too small or too large
        return static_cast<std::uint8_t>(random.below(8) == 0 ? random.below(most + 8) : 33 + random.below(most - 32));
    };
    const std::uint32_t values = random.below(20);
    fuzz::Piece out = {side(kLimits.image_width_max),
                       side(kLimits.image_height_max),
                       any(),
                       static_cast<std::uint8_t>(random.below(2) == 0 ? 0 : random.below(256)),
                       any(),
                       any(),
                       static_cast<std::uint8_t>(values)};
    for (std::uint32_t i = 0; i <= values; ++i) out.push_back(any());
    return out;
}

}  // namespace

STILLMESH_FUZZ_BY((stillmesh::fuzz::Grammar{piece_bytes, make_picture, make_picture}))
#endif

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    fuzz::Bytes bytes({data, size_bytes});
    const Others others = others_of({data, size_bytes});
    const int pictures_max = others.is_fresh ? 4 : 2;
    for (int i = 0; i < pictures_max && !bytes.is_empty(); ++i) try_picture(bytes, others);
    return 0;
}

// Any picture, one after the other through the same extractor: features lie inside it, no more than asked for, the same
// when asked again, and the same bits from every set of kernels that this processor can run.
#include <cmath>

#include "fuzz/fuzz.hpp"
#include "fuzz/pictures.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/rig.hpp"

namespace {

using namespace stillmesh;

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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const Limits limits = Limits::tiny();
    testing::Rig plain(limits, plain_kernels()), fast(limits, cpu_kernels());
    fuzz::Bytes bytes({data, size_bytes});
    for (int i = 0; i < 4 && !bytes.is_empty(); ++i) {
        const std::uint32_t width = bytes.u8() % (limits.image_width_max + 8);
        const std::uint32_t height = bytes.u8() % (limits.image_height_max + 8);
        const auto picture = fuzz::picture_from<std::uint8_t>(bytes, width, height, 1);
        const Status status = plain.extractor.extract(picture.view, plain.features);
        fuzz::expect(fast.extractor.extract(picture.view, fast.features) == status, "all kernels give the same status");
        if (width > limits.image_width_max || height > limits.image_height_max || width == 0 || height == 0) {
            fuzz::expect(status == Status::kInvalid, "a size that is not possible is kInvalid");
        }
        if (status != Status::kOk) {
            fuzz::expect(status == Status::kInvalid && plain.features.size() == 0, "a refused image has no features");
            continue;
        }
        fuzz::expect(plain.features.size() <= limits.features_max, "never more features than asked for");
        for (const Keypoint& keypoint : plain.features.keypoints.span()) {
            fuzz::expect(keypoint.x >= 0 && keypoint.x <= static_cast<float>(width - 1) && keypoint.y >= 0 &&
                             keypoint.y <= static_cast<float>(height - 1),
                         "features lie inside the image");
            fuzz::expect(keypoint.level < limits.pyramid_levels_max, "the level exists");
            fuzz::expect(std::abs(keypoint.angle_rad) <= 3.1415928F, "the angle is one");
        }
        expect_same(plain.features, fast.features, "all kernels give the same bits");
        if (sse2_kernels() != nullptr) {
            testing::Rig sse2(limits, *sse2_kernels());
            fuzz::expect(sse2.extractor.extract(picture.view, sse2.features) == Status::kOk, "also with SSE2");
            expect_same(plain.features, sse2.features, "all kernels give the same bits");
        }
        // This one has not seen the images before: nothing of them may be left.
        testing::Rig again(limits, cpu_kernels());
        fuzz::expect(again.extractor.extract(picture.view, again.features) == Status::kOk, "the same status again");
        expect_same(fast.features, again.features, "an image's features depend on the image alone");
    }
    return 0;
}

// Time of our extraction as a share of cv::ORB(1000, 1.2, 8)'s, on the same frames, in the same run, on one thread.
// Each frame is measured several times by both in turn and the minimum of each is kept, so that what else the machine
// does falls out. Exit 1 when the share exceeds --max.
//   feature_ratio [--kernels auto|avx2|sse2|neon|plain] [--max SHARE] [--repeat N]
#include <chrono>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "bench/features/frames.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/rig.hpp"

namespace {

double now_ms() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

int main(int argc, char** argv) {
    using namespace stillmesh;
    const Kernels* kernels = &cpu_kernels();
    double share_max = 1e9;
    int repeat = 7;
    for (int i = 1; i + 1 < argc; i += 2) {
        const std::string option = argv[i];
        const std::string value = argv[i + 1];
        if (option == "--kernels") {
            // AVX2 only where the processor has it.
            if (value == "avx2") kernels = &cpu_kernels() == avx2_kernels() ? avx2_kernels() : nullptr;
            if (value == "sse2") kernels = sse2_kernels();
            if (value == "neon") kernels = &cpu_kernels() == neon_kernels() ? neon_kernels() : nullptr;
            if (value == "plain") kernels = &plain_kernels();
        }
        if (option == "--max") share_max = std::atof(argv[i + 1]);
        if (option == "--repeat") repeat = std::atoi(argv[i + 1]);
    }
    if (kernels == nullptr) {
        std::printf("these kernels are not in this build, or not for this processor\n");
        return 77;
    }
    cv::setNumThreads(1);
    std::vector<cv::Mat> frames = bench::real_frames(20, 17);
    const char* const source = frames.empty() ? "synthetic frames (STILLMESH_TEST_DATA is not set)" : "real frames";
    if (frames.empty()) frames = bench::synthetic_frames(10);
    testing::Rig rig(Limits::room(), *kernels);
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000, 1.2f, 8);
    double ours_ms = 0;
    double theirs_ms = 0;
    double ours_worst_ms = 0;
    std::size_t ours_count = 0;
    std::size_t theirs_count = 0;
    for (const cv::Mat& frame : frames) {
        double ours_best = 1e9;
        double theirs_best = 1e9;
        for (int i = 0; i < repeat; ++i) {
            const double a = now_ms();
            if (rig.extractor.extract(bench::view_of(frame), rig.features) != Status::kOk) return 1;
            const double b = now_ms();
            std::vector<cv::KeyPoint> keypoints;
            cv::Mat descriptors;
            orb->detectAndCompute(frame, cv::noArray(), keypoints, descriptors);
            const double c = now_ms();
            ours_best = std::min(ours_best, b - a);
            theirs_best = std::min(theirs_best, c - b);
            if (i == 0) ours_count += rig.features.size();
            if (i == 0) theirs_count += keypoints.size();
        }
        ours_ms += ours_best;
        theirs_ms += theirs_best;
        ours_worst_ms = std::max(ours_worst_ms, ours_best);
    }
    const double n = static_cast<double>(frames.size());
    const double share = ours_ms / theirs_ms;
    std::printf("%zu %s, kernels %s\n", frames.size(), source, kernels->name);
    std::printf("stillmesh  %.3f ms (worst %.3f)  %.0f features\n", ours_ms / n, ours_worst_ms,
                static_cast<double>(ours_count) / n);
    std::printf("cv::ORB    %.3f ms                %.0f features\n", theirs_ms / n,
                static_cast<double>(theirs_count) / n);
    std::printf("share      %.3f (at most %.2f)\n", share, share_max);
    return share <= share_max ? 0 : 1;
}

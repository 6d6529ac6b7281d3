// Prints, for every transformation, repeatability, matching score (right matches of what is visible), inlier ratio of
// mutual nearest descriptors, and RMS distance of right matches (in pixels of the image and of the level), of our
// features and of cv::ORB's.
#include <cstdio>
#include <map>

#include "bench/features/frames.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/finders.hpp"

int main() {
    using namespace stillmesh;
    cv::setNumThreads(1);
    std::vector<cv::Mat> frames = bench::real_frames(8, 45);
    if (frames.empty()) frames = bench::synthetic_frames(6);
    const testing::Finder ours = testing::our_finder(cpu_kernels());
    const testing::Finder theirs = testing::their_finder();
    std::vector<std::string> names;
    std::map<std::string, testing::Quality> table[2];
    for (const cv::Mat& frame : frames) {
        const testing::Found originals[2] = {ours(frame), theirs(frame)};
        for (const testing::Transformed& t : testing::transformations(frame)) {
            if (&frame == &frames[0]) names.push_back(t.name);
            for (int i = 0; i < 2; ++i) {
                const testing::Quality q = testing::measure(originals[i], (i == 0 ? ours : theirs)(t.image), t);
                table[i][t.name].add(q);
                table[i]["= " + testing::kind_of(t)].add(q);
                table[i]["= sum"].add(q);
            }
        }
    }
    for (const char* kind : {"rotation", "scale", "blur", "noise", "mixed", "sum"})
        names.push_back(std::string("= ") + kind);
    std::printf("%-20s| repeatability | matching score | inlier ratio  | error px      | in its level\n",
                "ours / cv::ORB");
    for (const std::string& name : names) {
        testing::Quality& a = table[0][name];
        testing::Quality& b = table[1][name];
        std::printf("%-20s| %.3f / %.3f | %.3f / %.3f  | %.3f / %.3f | %.3f / %.3f | %.3f / %.3f\n", name.c_str(),
                    a.repeatability(), b.repeatability(), a.matching_score(), b.matching_score(), a.inlier_ratio(),
                    b.inlier_ratio(), a.error_px(), b.error_px(), a.error_level_px(), b.error_level_px());
    }
    return 0;
}

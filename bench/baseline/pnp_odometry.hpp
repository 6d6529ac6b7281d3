// The plain way to follow an RGB-D camera, as a baseline: cv::ORB (1000 features), brute-force matching with
// cross-check against a keyframe, RANSAC PnP over all matches, a new keyframe when inliers run out. It takes the world
// for static. Simulated scenes with people must defeat it, and static ones must not.
#pragma once

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "hal/depth_camera.hpp"

namespace stillmesh::baseline {

struct OdometryOptions {
    int features = 1000;
    float ransac_pixels = 3.0F;
    int ransac_iterations = 300;
    int inliers_min = 15;                // fewer: the pose is kept, the frame becomes the keyframe
    double keyframe_inlier_share = 0.5;  // of the inliers of the frame after the keyframe; below: new keyframe
};

class PnpOdometry {
public:
    explicit PnpOdometry(const CameraInfo& info, const OdometryOptions& options = {});

    // world_from_camera of this frame; the first is the identity.
    [[nodiscard]] cv::Matx44d track(const Frame& frame);
    [[nodiscard]] int keyframes() const { return keyframes_; }
    [[nodiscard]] int failures() const { return failures_; }

private:
    struct View {
        std::vector<cv::KeyPoint> keypoints;
        cv::Mat descriptors;
        std::vector<cv::Point3f> points;  // camera frame; z = 0: no depth
    };
    void look(const Frame& frame, View& view);

    CameraInfo info_;
    OdometryOptions options_;
    cv::Ptr<cv::ORB> orb_;
    cv::BFMatcher matcher_;
    cv::Matx33d intrinsics_;
    cv::Mat distortion_;
    View keyframe_;
    cv::Matx44d world_from_keyframe_ = cv::Matx44d::eye();
    cv::Matx44d keyframe_from_camera_ = cv::Matx44d::eye();
    int inliers_at_first_ = 0;  // of the first frame tracked against the keyframe
    int keyframes_ = 0;
    int failures_ = 0;
};

}  // namespace stillmesh::baseline

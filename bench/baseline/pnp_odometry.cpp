#include "bench/baseline/pnp_odometry.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh::baseline {

PnpOdometry::PnpOdometry(const CameraInfo& info, const OdometryOptions& options)
    : info_(info),
      options_(options),
      orb_(cv::ORB::create(options.features)),
      matcher_(cv::NORM_HAMMING, true),
      intrinsics_(info.model.fx, 0, info.model.cx, 0, info.model.fy, info.model.cy, 0, 0, 1),
      distortion_(
          (cv::Mat_<double>(1, 5) << info.model.k1, info.model.k2, info.model.p1, info.model.p2, info.model.k3)) {}

void PnpOdometry::look(const Frame& frame, View& view) {
    const auto height = static_cast<int>(frame.colour.height);
    const auto width = static_cast<int>(frame.colour.width);
    cv::Mat grey(height, width, CV_8UC1);
    for (int y = 0; y < height; ++y) {
        const std::uint8_t* const row = frame.colour.row(static_cast<std::uint32_t>(y));
        for (int x = 0; x < width; ++x) {
            // Green stands for grey well enough when a recording is in colour.
            grey.at<std::uint8_t>(y, x) = frame.format == PixelFormat::kGrey8 ? row[x] : row[3 * x + 1];
        }
    }
    orb_->detectAndCompute(grey, cv::noArray(), view.keypoints, view.descriptors);
    view.points.assign(view.keypoints.size(), {0, 0, 0});
    if (view.keypoints.empty()) return;
    std::vector<cv::Point2f> pixels;
    for (const cv::KeyPoint& keypoint : view.keypoints) pixels.push_back(keypoint.pt);
    std::vector<cv::Point2f> rays;
    cv::undistortPoints(pixels, rays, intrinsics_, distortion_);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
        const auto x = static_cast<std::uint32_t>(std::clamp(cvRound(pixels[i].x), 0, width - 1));
        const auto y = static_cast<std::uint32_t>(std::clamp(cvRound(pixels[i].y), 0, height - 1));
        const auto z = static_cast<float>(frame.depth.at(x, y) / frame.depth_units_per_m);
        view.points[i] = {rays[i].x * z, rays[i].y * z, z};
    }
}

cv::Matx44d PnpOdometry::track(const Frame& frame) {
    View view;
    look(frame, view);
    bool is_tracked = false;
    int inlier_count = 0;
    if (keyframes_ > 0 && !view.descriptors.empty() && !keyframe_.descriptors.empty()) {
        std::vector<cv::DMatch> matches;
        matcher_.match(keyframe_.descriptors, view.descriptors, matches);
        std::vector<cv::Point3f> objects;
        std::vector<cv::Point2f> pixels;
        for (const cv::DMatch& match : matches) {
            const cv::Point3f& p = keyframe_.points[static_cast<std::size_t>(match.queryIdx)];
            if (p.z <= 0 || match.distance > 64) continue;
            objects.push_back(p);
            pixels.push_back(view.keypoints[static_cast<std::size_t>(match.trainIdx)].pt);
        }
        if (objects.size() >= static_cast<std::size_t>(options_.inliers_min)) {
            cv::Vec3d rotation;
            cv::Vec3d translation;
            std::vector<int> inliers;
            cv::setRNGSeed(1);
            if (cv::solvePnPRansac(objects, pixels, intrinsics_, distortion_, rotation, translation, false,
                                   options_.ransac_iterations, options_.ransac_pixels, 0.99, inliers,
                                   cv::SOLVEPNP_AP3P) &&
                static_cast<int>(inliers.size()) >= options_.inliers_min) {
                std::vector<cv::Point3f> objects_in;
                std::vector<cv::Point2f> pixels_in;
                for (const int i : inliers) {
                    objects_in.push_back(objects[static_cast<std::size_t>(i)]);
                    pixels_in.push_back(pixels[static_cast<std::size_t>(i)]);
                }
                cv::solvePnPRefineLM(objects_in, pixels_in, intrinsics_, distortion_, rotation, translation);
                cv::Matx33d r;
                cv::Rodrigues(rotation, r);
                cv::Matx44d camera_from_keyframe = cv::Matx44d::eye();
                for (int row = 0; row < 3; ++row) {
                    for (int column = 0; column < 3; ++column) camera_from_keyframe(row, column) = r(row, column);
                    camera_from_keyframe(row, 3) = translation[row];
                }
                keyframe_from_camera_ = camera_from_keyframe.inv();
                is_tracked = true;
                inlier_count = static_cast<int>(inliers.size());
            }
        }
    }
    const cv::Matx44d pose = world_from_keyframe_ * keyframe_from_camera_;
    if (is_tracked) inliers_at_first_ = std::max(inliers_at_first_, inlier_count);
    if (keyframes_ > 0 && !is_tracked) ++failures_;
    if (keyframes_ == 0 || !is_tracked || inlier_count < options_.keyframe_inlier_share * inliers_at_first_) {
        keyframe_ = std::move(view);
        world_from_keyframe_ = pose;
        keyframe_from_camera_ = cv::Matx44d::eye();
        inliers_at_first_ = 0;
        ++keyframes_;
    }
    return pose;
}

}  // namespace stillmesh::baseline

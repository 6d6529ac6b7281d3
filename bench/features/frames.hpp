// Frames to measure on: the grey images of a TUM-layout folder, or dead leaves when there is none.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "tests/features/images.hpp"

namespace stillmesh::bench {

// Every `step`th image of the first set below STILLMESH_TEST_DATA; empty without it.
inline std::vector<cv::Mat> real_frames(std::size_t count_max, std::size_t step, const char* set = "fr1_rpy_a") {
    std::vector<cv::Mat> frames;
    const char* const data = std::getenv("STILLMESH_TEST_DATA");
    if (data == nullptr) return frames;
    std::error_code error;
    std::vector<std::string> paths;
    for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(data) / set / "rgb", error))
        paths.push_back(entry.path().string());
    std::sort(paths.begin(), paths.end());
    for (std::size_t i = 0; i < paths.size() && frames.size() < count_max; i += step) {
        cv::Mat image = cv::imread(paths[i], cv::IMREAD_GRAYSCALE);
        if (!image.empty()) frames.push_back(image);
    }
    return frames;
}

inline std::vector<cv::Mat> synthetic_frames(std::size_t count) {
    std::vector<cv::Mat> frames;
    for (std::size_t i = 0; i < count; ++i) {
        testing::Image image(640, 480);
        testing::fill_leaves(image, i + 1);
        frames.push_back(cv::Mat(480, 640, CV_8UC1, image.pixels.data()).clone());
    }
    return frames;
}

inline GreyView view_of(const cv::Mat& image) {
    return {image.data, static_cast<std::uint32_t>(image.cols), static_cast<std::uint32_t>(image.rows), image.step};
}

}  // namespace stillmesh::bench

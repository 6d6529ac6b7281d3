#include "platform/library/opencv_frame.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace stillmesh::opencv_frame_test {
namespace {

// Promise: what fits is borrowed where it lies, parts of larger images included.
TEST(CvFrame, BorrowsWhatFits) {
    cv::Mat colour(20, 40, CV_8UC3), depth(20, 40, CV_16UC1);
    for (int y = 0; y < 20; ++y)
        for (int x = 0; x < 40; ++x) depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(100 * y + x);
    const cv::Rect part(3, 2, 16, 8);
    CvFrame frames;
    Frame frame;
    ASSERT_EQ(frames.from(colour(part), depth(part), 7, frame), Status::kOk);
    EXPECT_EQ(frame.format, PixelFormat::kBgr8);
    EXPECT_EQ(frame.colour.data, colour.ptr(2, 3));
    EXPECT_EQ(frame.colour.stride, 120U);
    EXPECT_EQ(frame.depth.stride, 40U);  // pixels
    EXPECT_EQ(frame.depth.at(5, 4), 608);
    EXPECT_EQ(frame.depth_units_per_m, 1000);
    EXPECT_EQ(frame.time_ns, 7);
}

// Promise: BGRA and float metres are converted, into memory that lasts until the next frame.
TEST(CvFrame, ConvertsWhatDoesNot) {
    const cv::Mat colour(4, 6, CV_8UC4, cv::Scalar(1, 2, 3, 255)), depth(4, 6, CV_32FC1, cv::Scalar(1.5));
    CvFrame frames;
    Frame frame;
    ASSERT_EQ(frames.from(colour, depth, 7, frame), Status::kOk);
    EXPECT_EQ(frame.format, PixelFormat::kBgr8);
    EXPECT_EQ(frame.colour.row(3)[15], 1);
    EXPECT_EQ(frame.colour.row(3)[17], 3);
    EXPECT_EQ(frame.depth.at(5, 3), 1.5 * frame.depth_units_per_m);
}

// Promise: what is no frame is refused, and the frame stays as it was.
TEST(CvFrame, RefusesWhatIsNone) {
    const cv::Mat grey(4, 6, CV_8UC1), depth(4, 6, CV_16UC1), small(4, 5, CV_16UC1), wide(4, 6, CV_16UC3);
    CvFrame frames;
    Frame frame;
    frame.time_ns = 3;
    EXPECT_EQ(frames.from(grey, small, 7, frame), Status::kInvalid);
    EXPECT_EQ(frames.from(grey, wide, 7, frame), Status::kInvalid);
    EXPECT_EQ(frames.from(wide, depth, 7, frame), Status::kInvalid);
    EXPECT_EQ(frames.from(cv::Mat(), depth, 7, frame), Status::kInvalid);
    EXPECT_EQ(frames.from(grey, cv::Mat(), 7, frame), Status::kInvalid);
    EXPECT_EQ(frame.time_ns, 3);
    EXPECT_EQ(frames.from(grey, depth, 7, frame), Status::kOk);
    EXPECT_EQ(frame.format, PixelFormat::kGrey8);
}

}  // namespace
}  // namespace stillmesh::opencv_frame_test

#include <gtest/gtest.h>

#include "platform/report/jpeg_writer.hpp"

namespace stillmesh::jpeg_absent_test {
namespace {

// Promise: a build without TurboJPEG says so, and leaves nothing that looks like a picture.
TEST(JpegAbsent, SaysSo) {
    const std::vector<std::uint8_t> grey(64 * 48, 7);
    std::vector<std::uint8_t> bytes = {1, 2, 3};
    EXPECT_FALSE(encode_grey_jpeg(grey, 64, 48, bytes));
    EXPECT_TRUE(bytes.empty());
}

}  // namespace
}  // namespace stillmesh::jpeg_absent_test

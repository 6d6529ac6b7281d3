// The headers that the virtual board's D435 puts before its pictures (tests/vm), against what reads them here.
#include "tests/vm/payload_header.hpp"

#include <gtest/gtest.h>

#include "hal/v4l2/realsense_metadata.hpp"

namespace stillmesh::payload_header_test {
namespace {

// What uvcvideo makes of a header for the metadata node: the host's time and the frame number of the bus before it; of
// the standard's format no more than 12 bytes (metafmt-uvc.rst).
[[nodiscard]] vm::Bytes as_handed_out(const vm::Bytes& header, bool is_vendors) {
    vm::Bytes bytes(10, 0xa5);
    bytes.insert(bytes.end(), header.begin(), is_vendors ? header.end() : header.begin() + 12);
    return bytes;
}

// Promise: of each stream, with the projector on and off, the middle of the exposure comes through to the microsecond
// (over the clock's wrap, too), with the exposure and the projector where the blocks are handed out.
TEST(PayloadHeader, IsReadAsItWasMeant) {
    for (const bool is_stereo : {true, false}) {
        for (const bool is_on : {true, false}) {
            for (const std::uint32_t middle_us : {5U, 1'000'000U, 0xffff'ffffU - 100}) {
                vm::PictureFacts facts;
                facts.is_stereo = is_stereo;
                facts.is_emitter_on = is_on;
                facts.middle_us = middle_us;
                facts.exposure_us = is_stereo ? 8'500 : 15'600;
                facts.interval_us = 33'333;
                facts.size = {848, 480};
                const vm::Bytes header = vm::payload_header(vm::HeaderKind::kBlocks, facts);
                ASSERT_EQ(header.size(), vm::header_bytes(vm::HeaderKind::kBlocks, is_stereo));
                ASSERT_EQ(header[0], header.size()) << "bLength is one byte";
                v4l2::ImageFacts read;
                ASSERT_EQ(v4l2::parse_metadata(as_handed_out(header, true), read), Status::kOk);
                EXPECT_EQ(read.device_us, middle_us);
                EXPECT_EQ(read.exposure_us, facts.exposure_us);
                EXPECT_EQ(read.is_laser_on, is_stereo ? std::optional(is_on) : std::nullopt);
                v4l2::ImageFacts plain;
                ASSERT_EQ(v4l2::parse_metadata(as_handed_out(header, false), plain), Status::kOk);
                EXPECT_EQ(plain.device_us, middle_us + facts.exposure_us / 2) << "the header's, without the block";
                EXPECT_FALSE(plain.exposure_us || plain.is_laser_on);
            }
        }
    }
}

// Promise: a header that ends after its clocks is read as the standard's.
TEST(PayloadHeader, OfTheStandardAlone) {
    vm::PictureFacts facts;
    facts.middle_us = 77;
    facts.exposure_us = 100;
    facts.is_second = true;
    const vm::Bytes header = vm::payload_header(vm::HeaderKind::kClock, facts);
    ASSERT_EQ(header.size(), 12U);
    EXPECT_EQ(header[1] & 1U, 1U);
    v4l2::ImageFacts read;
    ASSERT_EQ(v4l2::parse_metadata(as_handed_out(header, true), read), Status::kOk);
    EXPECT_EQ(read.device_us, 127U);
    EXPECT_EQ(vm::payload_header(vm::HeaderKind::kBare, facts).size(), 6U);
}

}  // namespace
}  // namespace stillmesh::payload_header_test

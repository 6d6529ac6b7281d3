// What a camera says about its images, from the metadata node beside their video node: found by the image's number,
// which the driver gives to both. The driver has filled it before it gives the image out, so that nothing is waited
// for. It is no more than help: whatever fails here leaves the images as they are, without it. Memory: kBuffers buffers
// of 1 or 10 kB in the kernel. Cost: three calls of the driver per image.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "hal/v4l2/mapped_buffers.hpp"
#include "hal/v4l2/realsense_metadata.hpp"
#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

class MetadataStream {
public:
    // More than an ImageStream has: each is given back as soon as it is read.
    static constexpr std::uint32_t kBuffers = 8;

    explicit MetadataStream(V4l2Link& link) noexcept : link_(link) {}
    ~MetadataStream() { stop(); }
    MetadataStream(const MetadataStream&) = delete;
    MetadataStream& operator=(const MetadataStream&) = delete;

    // 0, or the errno of what failed. ENOTSUP: no node of metadata, or none that is understood. Opened before the
    // images' buffers are asked for: Linux 6.1 refuses another format of metadata (EBUSY) as long as these are there.
    [[nodiscard]] int open(const std::string& path);
    [[nodiscard]] int start();
    void stop() noexcept;
    [[nodiscard]] bool is_on() const noexcept { return is_on_; }
    // The vendor's blocks, and not the standard header alone: exposures, the projector, the middle of an exposure.
    [[nodiscard]] bool has_blocks() const noexcept { return is_on_ && format_.fourcc == kD4xxMetadata; }

    // Of the image with that number. Empty: none came, or it was damaged.
    [[nodiscard]] ImageFacts find(std::uint32_t sequence) noexcept;

private:
    struct Read {
        std::uint32_t sequence = 0;
        bool is_there = false;
        ImageFacts facts;
    };

    [[nodiscard]] int set_format();
    void read_all() noexcept;

    V4l2Link& link_;
    int handle_ = -1;
    bool is_on_ = false;
    V4l2Format format_;
    MappedBuffers<kBuffers> buffers_;
    std::array<Read, kBuffers> read_{};  // the last, by sequence
};

}  // namespace stillmesh::v4l2

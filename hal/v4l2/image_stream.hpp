// The images of one video node: format and rate set and read back, buffers mapped and queued, and each image handed out
// as something that gives its buffer back when it goes out of use, on whatever thread; the driver is only called by the
// thread that takes, which may hang in it. No pixel is copied. Damaged images and those of a
// wrong length are given back at once and counted. Memory: kBuffers images in the kernel (0.8 MB each for depth of
// 848x480).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <utility>

#include "hal/v4l2/mapped_buffers.hpp"
#include "hal/v4l2/realsense_metadata.hpp"
#include "hal/v4l2/stream_modes.hpp"
#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

class ImageStream;

// An image in its buffer. Empty, or given back when it is destroyed; its stream outlives it.
class Image {
public:
    Image() = default;
    Image(Image&& other) noexcept
        : facts(other.facts), stream_(std::exchange(other.stream_, nullptr)), buffer_(other.buffer_) {}
    Image& operator=(Image&& other) noexcept {
        if (this != &other) {
            release();
            stream_ = std::exchange(other.stream_, nullptr);
            buffer_ = other.buffer_;
            facts = other.facts;
        }
        return *this;
    }
    Image(const Image&) = delete;
    Image& operator=(const Image&) = delete;
    ~Image() { release(); }

    void release() noexcept;
    [[nodiscard]] bool is_held() const noexcept { return stream_ != nullptr; }
    [[nodiscard]] const V4l2Buffer& buffer() const noexcept { return buffer_; }
    // Whole, by is_whole() of the stream's format.
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept;

    ImageFacts facts;  // what the camera says about it, where somebody has asked

private:
    friend class ImageStream;
    ImageStream* stream_ = nullptr;
    V4l2Buffer buffer_;
};

class ImageStream {
public:
    // One waits for its partner, one in the slot, one is given out: three are always the driver's.
    static constexpr std::uint32_t kBuffers = 6;
    static constexpr std::uint32_t kBuffersMin = 4;

    explicit ImageStream(V4l2Link& link) noexcept : link_(link) {}
    ~ImageStream() { stop(); }
    ImageStream(const ImageStream&) = delete;
    ImageStream& operator=(const ImageStream&) = delete;

    // 0, or the errno of what failed, and `step` names it. ERANGE: the driver sets another format than asked for, or
    // gives too few or too small buffers. The handle stays whoever's it is.
    [[nodiscard]] int start(int handle, const Mode& mode);
    // No image of it is held by then (CHECK).
    void stop() noexcept;

    // 0: an image; EAGAIN: none is there; EBADMSG: there was one that cannot be used, or a moment's error; ENODEV:
    // unplugged; EIO: the driver has failed for good.
    [[nodiscard]] int take(Image& image) noexcept;

    [[nodiscard]] const V4l2Format& format() const noexcept { return format_; }
    [[nodiscard]] const Mode& mode() const noexcept { return mode_; }  // with the rate that was set
    [[nodiscard]] int handle() const noexcept { return handle_; }
    [[nodiscard]] const char* step() const noexcept { return step_; }
    // Images that could not be used, and numbers of images that never came.
    [[nodiscard]] std::uint64_t broken() const noexcept { return broken_; }
    [[nodiscard]] std::uint64_t missing() const noexcept { return missing_; }

private:
    friend class Image;
    static constexpr std::uint32_t kErrorsMax = 32;  // in a row, of dequeuing: then it has failed for good

    [[nodiscard]] int set_mode(const Mode& mode);
    void give_back(std::uint32_t index) noexcept;
    void queue_returned() noexcept;

    V4l2Link& link_;
    int handle_ = -1;
    const char* step_ = "";
    Mode mode_;
    V4l2Format format_;
    MappedBuffers<kBuffers> buffers_;
    std::uint32_t held_ = 0;                   // bits of buffers that are out, or returned
    std::atomic<std::uint32_t> returned_ = 0;  // of those that may be queued again
    std::uint32_t errors_ = 0;                 // in a row
    bool is_on_ = false;
    bool has_failed_ = false;  // a buffer could not be given back
    bool has_sequence_ = false;
    std::uint32_t sequence_ = 0;
    std::uint64_t broken_ = 0, missing_ = 0;
};

}  // namespace stillmesh::v4l2

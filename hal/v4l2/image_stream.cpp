#include "hal/v4l2/image_stream.hpp"

#include <cerrno>

#include "engine/base/check.hpp"
#include "hal/v4l2/pixel_formats.hpp"

namespace stillmesh::v4l2 {

void Image::release() noexcept {
    if (stream_ != nullptr) stream_->give_back(buffer_.index);
    stream_ = nullptr;
}

std::span<const std::uint8_t> Image::bytes() const noexcept {
    STILLMESH_CHECK(stream_ != nullptr);
    return stream_->buffers_[buffer_.index].first(buffer_.bytes_used);
}

int ImageStream::set_mode(const Mode& mode) {
    step_ = "its format";
    format_ = {.fourcc = mode.fourcc, .width = mode.size.width, .height = mode.size.height};
    if (const int error = link_.set_format(handle_, format_); error != 0) return error;
    const std::uint32_t bytes = bytes_per_pixel(mode.fourcc);
    const bool is_as_asked = format_.fourcc == mode.fourcc && format_.width == mode.size.width &&
                             format_.height == mode.size.height && format_.bytes > 0;
    const bool has_rows = bytes == 0 || (format_.bytes_per_line >= std::uint64_t{bytes} * format_.width &&
                                         format_.bytes_per_line % (is_depth(mode.fourcc) ? 2 : 1) == 0 &&
                                         is_whole(format_, format_.bytes));
    if (!is_as_asked || !has_rows) return ERANGE;
    step_ = "its rate";
    mode_ = mode;
    if (const int error = link_.set_interval(handle_, mode_.interval); error != 0) return error;
    if (mode_.interval.numerator == 0 || mode_.interval.denominator == 0) mode_.interval = mode.interval;
    return 0;
}

int ImageStream::start(int handle, const Mode& mode) {
    stop();
    handle_ = handle;
    held_ = errors_ = 0;
    returned_ = 0;
    has_failed_ = has_sequence_ = false;
    int error = set_mode(mode);
    if (error == 0) {
        step_ = "its buffers";
        error = buffers_.map(link_, handle_, kBuffersMin, format_.bytes);
    }
    if (error == 0) {
        step_ = "its start";
        error = link_.set_streaming(handle_, true);
        is_on_ = error == 0;
    }
    if (error != 0) stop();
    return error;
}

void ImageStream::stop() noexcept {
    if (handle_ < 0) return;
    STILLMESH_CHECK((held_ & ~returned_) == 0);
    if (is_on_) static_cast<void>(link_.set_streaming(handle_, false));
    is_on_ = false;
    buffers_.unmap(link_, handle_);
    handle_ = -1;
}

void ImageStream::give_back(std::uint32_t index) noexcept {
    returned_ |= 1U << index;
}

void ImageStream::queue_returned() noexcept {
    const std::uint32_t returned = returned_.exchange(0);
    held_ &= ~returned;
    for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
        if ((returned >> i & 1U) != 0 && link_.queue(handle_, i) != 0) has_failed_ = true;
    }
}

int ImageStream::take(Image& image) noexcept {
    if (!is_on_) return EIO;
    queue_returned();
    V4l2Buffer buffer;
    const int error = link_.dequeue(handle_, buffer);
    if (error == ENODEV) return error;
    if (has_failed_) return EIO;
    if (error == EAGAIN) return error;
    if (error != 0 || buffer.index >= buffers_.size() || (held_ >> buffer.index & 1U) != 0) {
        // A buffer whose number is wrong is nobody's: it is lost.
        ++broken_;
        return ++errors_ > kErrorsMax ? EIO : EBADMSG;
    }
    errors_ = 0;
    const std::uint32_t skipped = buffer.sequence - sequence_ - 1;
    if (has_sequence_ && skipped < 1000) missing_ += skipped;
    sequence_ = buffer.sequence;
    has_sequence_ = true;
    held_ |= 1U << buffer.index;
    if (buffer.is_broken || buffer.bytes_used > buffers_[buffer.index].size() ||
        !is_whole(format_, buffer.bytes_used)) {
        ++broken_;
        give_back(buffer.index);
        return EBADMSG;
    }
    image.release();
    image.stream_ = this;
    image.buffer_ = buffer;
    return 0;
}

}  // namespace stillmesh::v4l2

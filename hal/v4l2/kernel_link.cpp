#include "hal/v4l2/kernel_link.hpp"

#include <fcntl.h>
#include <linux/usb/video.h>
#include <linux/uvcvideo.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "hal/v4l2/sysfs_nodes.hpp"

namespace stillmesh {
namespace {

static_assert(kV4l2Capture == V4L2_CAP_VIDEO_CAPTURE && kV4l2Streaming == V4L2_CAP_STREAMING);
static_assert(kV4l2Metadata == V4L2_CAP_META_CAPTURE);

// Tried again where a signal came between.
template <typename Argument>
[[nodiscard]] int call(int handle, unsigned long request, Argument& argument) noexcept {
    int result = 0;
    do {
        result = ::ioctl(handle, request, &argument);
    } while (result != 0 && errno == EINTR);
    return result == 0 ? 0 : errno;
}

[[nodiscard]] int ask_capabilities(int handle, std::uint32_t& capabilities) noexcept {
    v4l2_capability answer{};
    if (const int error = call(handle, VIDIOC_QUERYCAP, answer); error != 0) return error;
    // Of this node, where the driver tells it apart from the whole device.
    capabilities = (answer.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? answer.device_caps : answer.capabilities;
    return 0;
}

// Of a node's buffers. It is asked each time, which waits for nothing, instead of being remembered for each handle.
[[nodiscard]] std::uint32_t type_of(int handle) noexcept {
    std::uint32_t capabilities = 0;
    static_cast<void>(ask_capabilities(handle, capabilities));
    const bool is_metadata = (capabilities & kV4l2Metadata) != 0 && (capabilities & kV4l2Capture) == 0;
    return is_metadata ? V4L2_BUF_TYPE_META_CAPTURE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
}

[[nodiscard]] v4l2_buffer buffer_of(int handle, std::uint32_t index) noexcept {
    v4l2_buffer buffer{};
    buffer.type = type_of(handle);
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
}

}  // namespace

std::vector<V4l2Node> KernelV4l2Link::nodes() {
    return v4l2::nodes_of_sysfs();
}

int KernelV4l2Link::open(const std::string& path, int& handle) {
    handle = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return handle >= 0 ? 0 : errno;
}

void KernelV4l2Link::close(int handle) {
    static_cast<void>(::close(handle));
}

int KernelV4l2Link::query_capability(int handle, std::uint32_t& capabilities) {
    return ask_capabilities(handle, capabilities);
}

int KernelV4l2Link::format_at(int handle, std::uint32_t index, std::uint32_t& fourcc) {
    v4l2_fmtdesc answer{};
    answer.index = index;
    answer.type = type_of(handle);
    const int error = call(handle, VIDIOC_ENUM_FMT, answer);
    fourcc = answer.pixelformat;
    return error;
}

int KernelV4l2Link::size_at(int handle, std::uint32_t fourcc, std::uint32_t index, V4l2Size& size) {
    v4l2_frmsizeenum answer{};
    answer.index = index;
    answer.pixel_format = fourcc;
    if (const int error = call(handle, VIDIOC_ENUM_FRAMESIZES, answer); error != 0) return error;
    // USB video cameras have a list; ranges are for what scales.
    if (answer.type != V4L2_FRMSIZE_TYPE_DISCRETE) return EINVAL;
    size = {answer.discrete.width, answer.discrete.height};
    return 0;
}

int KernelV4l2Link::interval_at(int handle, const V4l2Format& format, std::uint32_t index, V4l2Interval& interval) {
    v4l2_frmivalenum answer{};
    answer.index = index;
    answer.pixel_format = format.fourcc;
    answer.width = format.width;
    answer.height = format.height;
    if (const int error = call(handle, VIDIOC_ENUM_FRAMEINTERVALS, answer); error != 0) return error;
    // Of a range of intervals, the shortest.
    if (answer.type != V4L2_FRMIVAL_TYPE_DISCRETE && index > 0) return EINVAL;
    const v4l2_fract& fraction = answer.type == V4L2_FRMIVAL_TYPE_DISCRETE ? answer.discrete : answer.stepwise.min;
    interval = {fraction.numerator, fraction.denominator};
    return 0;
}

int KernelV4l2Link::set_format(int handle, V4l2Format& format) {
    v4l2_format answer{};
    answer.type = type_of(handle);
    if (answer.type == V4L2_BUF_TYPE_META_CAPTURE) {
        answer.fmt.meta.dataformat = format.fourcc;
        if (const int error = call(handle, VIDIOC_S_FMT, answer); error != 0) return error;
        format = {.fourcc = answer.fmt.meta.dataformat, .bytes = answer.fmt.meta.buffersize};
        return 0;
    }
    answer.fmt.pix.pixelformat = format.fourcc;
    answer.fmt.pix.width = format.width;
    answer.fmt.pix.height = format.height;
    answer.fmt.pix.field = V4L2_FIELD_NONE;
    if (const int error = call(handle, VIDIOC_S_FMT, answer); error != 0) return error;
    const v4l2_pix_format& pix = answer.fmt.pix;
    format = {pix.pixelformat, pix.width, pix.height, pix.bytesperline, pix.sizeimage};
    return 0;
}

int KernelV4l2Link::set_interval(int handle, V4l2Interval& interval) {
    v4l2_streamparm answer{};
    answer.type = type_of(handle);
    answer.parm.capture.timeperframe = {interval.numerator, interval.denominator};
    if (const int error = call(handle, VIDIOC_S_PARM, answer); error != 0) return error;
    interval = {answer.parm.capture.timeperframe.numerator, answer.parm.capture.timeperframe.denominator};
    return 0;
}

int KernelV4l2Link::set_control(int handle, std::uint32_t control, std::int32_t value) {
    v4l2_control answer{};
    answer.id = control;
    answer.value = value;
    return call(handle, VIDIOC_S_CTRL, answer);
}

int KernelV4l2Link::request_buffers(int handle, std::uint32_t& count) {
    v4l2_requestbuffers answer{};
    answer.count = count;
    answer.type = type_of(handle);
    answer.memory = V4L2_MEMORY_MMAP;
    const int error = call(handle, VIDIOC_REQBUFS, answer);
    count = error == 0 ? answer.count : 0;
    return error;
}

int KernelV4l2Link::map(int handle, std::uint32_t index, std::span<const std::uint8_t>& bytes) {
    v4l2_buffer buffer = buffer_of(handle, index);
    if (const int error = call(handle, VIDIOC_QUERYBUF, buffer); error != 0) return error;
    void* const at = ::mmap(nullptr, buffer.length, PROT_READ, MAP_SHARED, handle, static_cast<off_t>(buffer.m.offset));
    if (at == MAP_FAILED) return errno;
    bytes = {static_cast<const std::uint8_t*>(at), buffer.length};
    return 0;
}

void KernelV4l2Link::unmap(std::span<const std::uint8_t> bytes) {
    static_cast<void>(::munmap(const_cast<std::uint8_t*>(bytes.data()), bytes.size()));
}

int KernelV4l2Link::queue(int handle, std::uint32_t index) {
    v4l2_buffer buffer = buffer_of(handle, index);
    return call(handle, VIDIOC_QBUF, buffer);
}

int KernelV4l2Link::dequeue(int handle, V4l2Buffer& buffer) {
    v4l2_buffer answer = buffer_of(handle, 0);
    if (const int error = call(handle, VIDIOC_DQBUF, answer); error != 0) return error;
    buffer.index = answer.index;
    buffer.bytes_used = answer.bytesused;
    buffer.sequence = answer.sequence;
    buffer.stamp_us = std::int64_t{answer.timestamp.tv_sec} * 1'000'000 + answer.timestamp.tv_usec;
    buffer.is_broken = (answer.flags & V4L2_BUF_FLAG_ERROR) != 0;
    buffer.is_monotonic = (answer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    return 0;
}

int KernelV4l2Link::set_streaming(int handle, bool is_on) {
    int type = static_cast<int>(type_of(handle));
    return call(handle, is_on ? VIDIOC_STREAMON : VIDIOC_STREAMOFF, type);
}

int KernelV4l2Link::wait(std::span<const int> handles, std::uint32_t timeout_ms, std::span<V4l2Ready> ready) {
    STILLMESH_CHECK(handles.size() == ready.size() && handles.size() <= kWaitMax);
    std::array<pollfd, kWaitMax> waiting{};
    for (std::size_t i = 0; i < handles.size(); ++i) waiting[i] = {handles[i], POLLIN, 0};
    const int count = ::poll(waiting.data(), handles.size(), static_cast<int>(timeout_ms));
    for (std::size_t i = 0; i < handles.size(); ++i) {
        const int events = count > 0 ? waiting[i].revents : 0;
        ready[i] = {(events & POLLIN) != 0, (events & (POLLERR | POLLHUP | POLLNVAL)) != 0};
    }
    return count >= 0 || errno == EINTR ? 0 : errno;
}

int KernelV4l2Link::extension(int handle, std::uint8_t unit, std::uint8_t control, V4l2Query query,
                              std::span<std::uint8_t> data) {
    uvc_xu_control_query request{};
    request.unit = unit;
    request.selector = control;
    request.query = query == V4l2Query::kSet ? UVC_SET_CUR : UVC_GET_CUR;
    request.size = static_cast<std::uint16_t>(data.size());
    request.data = data.data();
    return call(handle, UVCIOC_CTRL_QUERY, request);
}

std::int64_t KernelV4l2Link::now_ns() {
    timespec now{};
    static_cast<void>(::clock_gettime(CLOCK_MONOTONIC, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

}  // namespace stillmesh

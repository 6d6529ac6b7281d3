// V4L2 as the kernel has it: ioctls on /dev/video*, nodes from sysfs. Nodes are opened without waiting, and closed when
// a program is started from here. No structure of the kernel's crosses this header.
#pragma once

#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh {

class KernelV4l2Link final : public V4l2Link {
public:
    [[nodiscard]] std::vector<V4l2Node> nodes() override;
    [[nodiscard]] int open(const std::string& path, int& handle) override;
    void close(int handle) override;
    [[nodiscard]] int query_capability(int handle, std::uint32_t& capabilities) override;
    [[nodiscard]] int format_at(int handle, std::uint32_t index, std::uint32_t& fourcc) override;
    [[nodiscard]] int size_at(int handle, std::uint32_t fourcc, std::uint32_t index, V4l2Size& size) override;
    [[nodiscard]] int interval_at(int handle, const V4l2Format& format, std::uint32_t index,
                                  V4l2Interval& interval) override;
    [[nodiscard]] int set_format(int handle, V4l2Format& format) override;
    [[nodiscard]] int set_interval(int handle, V4l2Interval& interval) override;
    [[nodiscard]] int set_control(int handle, std::uint32_t control, std::int32_t value) override;
    [[nodiscard]] int request_buffers(int handle, std::uint32_t& count) override;
    [[nodiscard]] int map(int handle, std::uint32_t index, std::span<const std::uint8_t>& bytes) override;
    void unmap(std::span<const std::uint8_t> bytes) override;
    [[nodiscard]] int queue(int handle, std::uint32_t index) override;
    [[nodiscard]] int dequeue(int handle, V4l2Buffer& buffer) override;
    [[nodiscard]] int set_streaming(int handle, bool is_on) override;
    [[nodiscard]] int wait(std::span<const int> handles, std::uint32_t timeout_ms, std::span<V4l2Ready> ready) override;
    [[nodiscard]] int extension(int handle, std::uint8_t unit, std::uint8_t control, V4l2Query query,
                                std::span<std::uint8_t> data) override;
    [[nodiscard]] std::int64_t now_ns() override;
};

}  // namespace stillmesh

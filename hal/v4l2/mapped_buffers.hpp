// A driver's buffers, mapped and queued for as long as a stream is on. Limit: kMost of them. Errors: the errno of what
// failed; what was mapped by then is there until unmap().
#pragma once

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

template <std::uint32_t kMost>
class MappedBuffers {
public:
    // ERANGE: the driver gives fewer than `least`, or smaller ones.
    [[nodiscard]] int map(V4l2Link& link, int handle, std::uint32_t least, std::size_t bytes_min) {
        std::uint32_t count = kMost;
        if (const int error = link.request_buffers(handle, count); error != 0) return error;
        count_ = std::min(count, kMost);
        if (count < least) return ERANGE;
        for (std::uint32_t i = 0; i < count_; ++i) {
            if (const int error = link.map(handle, i, bytes_[i]); error != 0) return error;
            if (bytes_[i].size() < bytes_min) return ERANGE;
            if (const int error = link.queue(handle, i); error != 0) return error;
        }
        return 0;
    }
    // Given back, so that another mode can be set, and another process may stream. The stream is off.
    void unmap(V4l2Link& link, int handle) noexcept {
        for (auto& buffer : bytes_) {
            if (!buffer.empty()) link.unmap(buffer);
            buffer = {};
        }
        std::uint32_t none = 0;
        if (count_ > 0) static_cast<void>(link.request_buffers(handle, none));
        count_ = 0;
    }
    [[nodiscard]] std::uint32_t size() const noexcept { return count_; }
    [[nodiscard]] std::span<const std::uint8_t> operator[](std::uint32_t index) const noexcept { return bytes_[index]; }

private:
    std::array<std::span<const std::uint8_t>, kMost> bytes_{};
    std::uint32_t count_ = 0;
};

}  // namespace stillmesh::v4l2

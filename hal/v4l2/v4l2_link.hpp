// The port to the kernel's video devices (V4L2): which nodes there are, what each offers, its buffers, its stream, and
// the extension units of USB video cameras. What it says is what the driver says: whoever stands above checks it. Every
// call returns 0 or the errno of its failure; ENODEV: unplugged. A node of metadata has the same calls: its format has
// a code and bytes, and no size. Everything above it is tested with an emulated device. Bodies fail a CHECK instead of
// being pure: see docs/decisions.md (ports without __cxa_pure_virtual). Limits: kWaitMax nodes waited for at a time.
// Every call is bounded in time: wait() by its timeout, the others by uvcvideo's own (5 s for a camera that does not
// answer).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/base/check.hpp"

namespace stillmesh {

// A node of a video device and the USB device behind it, as sysfs tells without opening anything.
struct V4l2Node {
    std::string path;      // /dev/video0
    std::string usb_port;  // "2-1": where it is plugged in; empty: no USB device
    std::string serial;    // of the USB device; empty: it has none
    std::string product;
    std::uint16_t vendor_id = 0;
    std::uint16_t product_id = 0;
    std::uint8_t interface = 0;
    std::uint32_t speed_mbit_per_s = 0;  // of the USB connection; 0: unknown
};

struct V4l2Size {
    std::uint32_t width = 0, height = 0;  // px
};
// Time between two images, s.
struct V4l2Interval {
    std::uint32_t numerator = 0, denominator = 0;
};

struct V4l2Format {
    std::uint32_t fourcc = 0;
    std::uint32_t width = 0, height = 0;  // px
    std::uint32_t bytes_per_line = 0;     // 0: compressed
    std::uint32_t bytes = 0;              // of a whole image, or the most of a compressed one
};

struct V4l2Buffer {
    std::uint32_t index = 0;
    std::uint32_t bytes_used = 0;
    std::uint32_t sequence = 0;  // counts images, lost ones too
    std::int64_t stamp_us = 0;
    bool is_broken = false;     // the driver calls the image damaged
    bool is_monotonic = false;  // stamped by the host's monotonic clock
};

struct V4l2Ready {
    bool has_image = false;
    bool is_broken = false;  // gone, or its queue has failed
};

enum class V4l2Query : std::uint8_t { kSet, kGet };

inline constexpr std::uint32_t kV4l2Capture = 0x1;           // of query_capability: images
inline constexpr std::uint32_t kV4l2Metadata = 0x00800000;   // or what the camera says about each
inline constexpr std::uint32_t kV4l2Streaming = 0x04000000;  // and in mapped buffers

class V4l2Link {
public:
    static constexpr std::size_t kWaitMax = 2;

    // Ordered by number. Empty: none, or no sysfs.
    [[nodiscard]] virtual std::vector<V4l2Node> nodes() { not_implemented(); }
    // `handle` names it until it is closed.
    [[nodiscard]] virtual int open(const std::string& path, int& handle) {
        static_cast<void>(path), static_cast<void>(handle);
        not_implemented();
    }
    virtual void close(int handle) {
        static_cast<void>(handle);
        not_implemented();
    }
    [[nodiscard]] virtual int query_capability(int handle, std::uint32_t& capabilities) {
        static_cast<void>(handle), static_cast<void>(capabilities);
        not_implemented();
    }
    // What it offers, one by one: EINVAL behind the last.
    [[nodiscard]] virtual int format_at(int handle, std::uint32_t index, std::uint32_t& fourcc) {
        static_cast<void>(handle), static_cast<void>(index), static_cast<void>(fourcc);
        not_implemented();
    }
    [[nodiscard]] virtual int size_at(int handle, std::uint32_t fourcc, std::uint32_t index, V4l2Size& size) {
        static_cast<void>(handle), static_cast<void>(fourcc), static_cast<void>(index), static_cast<void>(size);
        not_implemented();
    }
    // Of `format`'s fourcc and size.
    [[nodiscard]] virtual int interval_at(int handle, const V4l2Format& format, std::uint32_t index,
                                          V4l2Interval& interval) {
        static_cast<void>(handle), static_cast<void>(format), static_cast<void>(index), static_cast<void>(interval);
        not_implemented();
    }
    // In: fourcc and size; out: what the driver has set, which may be another.
    [[nodiscard]] virtual int set_format(int handle, V4l2Format& format) {
        static_cast<void>(handle), static_cast<void>(format);
        not_implemented();
    }
    [[nodiscard]] virtual int set_interval(int handle, V4l2Interval& interval) {
        static_cast<void>(handle), static_cast<void>(interval);
        not_implemented();
    }
    [[nodiscard]] virtual int set_control(int handle, std::uint32_t control, std::int32_t value) {
        static_cast<void>(handle), static_cast<void>(control), static_cast<void>(value);
        not_implemented();
    }
    // In: how many are wanted, 0 gives them back; out: how many there are. EBUSY: another process streams from it.
    [[nodiscard]] virtual int request_buffers(int handle, std::uint32_t& count) {
        static_cast<void>(handle), static_cast<void>(count);
        not_implemented();
    }
    [[nodiscard]] virtual int map(int handle, std::uint32_t index, std::span<const std::uint8_t>& bytes) {
        static_cast<void>(handle), static_cast<void>(index), static_cast<void>(bytes);
        not_implemented();
    }
    virtual void unmap(std::span<const std::uint8_t> bytes) {
        static_cast<void>(bytes);
        not_implemented();
    }
    [[nodiscard]] virtual int queue(int handle, std::uint32_t index) {
        static_cast<void>(handle), static_cast<void>(index);
        not_implemented();
    }
    // The oldest filled one, without waiting. EAGAIN: none is.
    [[nodiscard]] virtual int dequeue(int handle, V4l2Buffer& buffer) {
        static_cast<void>(handle), static_cast<void>(buffer);
        not_implemented();
    }
    [[nodiscard]] virtual int set_streaming(int handle, bool is_on) {
        static_cast<void>(handle), static_cast<void>(is_on);
        not_implemented();
    }
    // Returns when one of them has something to tell, or after timeout_ms. `ready` is as long as `handles`.
    [[nodiscard]] virtual int wait(std::span<const int> handles, std::uint32_t timeout_ms, std::span<V4l2Ready> ready) {
        static_cast<void>(handles), static_cast<void>(timeout_ms), static_cast<void>(ready);
        not_implemented();
    }
    // Writes to or reads from a control of an extension unit of a USB video camera. EPIPE, EIO: refused.
    [[nodiscard]] virtual int extension(int handle, std::uint8_t unit, std::uint8_t control, V4l2Query query,
                                        std::span<std::uint8_t> data) {
        static_cast<void>(handle), static_cast<void>(unit), static_cast<void>(control), static_cast<void>(query);
        static_cast<void>(data);
        not_implemented();
    }
    // The host's monotonic clock.
    [[nodiscard]] virtual std::int64_t now_ns() { not_implemented(); }

protected:
    ~V4l2Link() = default;

private:
    [[noreturn]] static void not_implemented() noexcept {
        check_failed("V4l2Link not implemented", __FILE__, __LINE__);
    }
};

}  // namespace stillmesh

// A RealSense D435 behind the port to V4L2, as a test writes it: six nodes, modes, buffers, images by the clock, its
// extension unit, and faults when the test says so. Time is simulated: waiting moves it, nothing sleeps; or the host's
// clock, for tests of the thread. What is asked of it in a wrong order is a failure of the test.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "hal/v4l2/pixel_formats.hpp"
#include "hal/v4l2/v4l2_link.hpp"
#include "tests/v4l2/realsense_bytes.hpp"

namespace stillmesh::test {

struct EmulatedMode {
    std::uint32_t fourcc;
    std::uint32_t width, height;
    std::vector<std::uint32_t> rates;
};

// What an image shows: its number and where the pixel is.
[[nodiscard]] std::uint16_t depth_pixel(std::uint32_t number, std::uint32_t x, std::uint32_t y);
// Of the byte at x of row y of a colour image as it is transferred.
// An infrared image with the projector's dots is the negative of one without; depth without them is kUnlit larger.
inline constexpr std::uint16_t kUnlit = 4000;
[[nodiscard]] std::uint8_t colour_byte(std::uint32_t number, std::uint32_t x, std::uint32_t y);

class EmulatedDevice final : public V4l2Link {
public:
    struct Node {
        V4l2Node node;
        std::uint32_t capabilities = 0;
        std::vector<EmulatedMode> modes;
        int open_error = 0;         // EACCES: this user may not
        bool is_held = false;       // another process has its buffers
        bool is_silent = false;     // gives no image
        bool ignores_mode = false;  // sets another size than asked for
        std::uint32_t buffers_max = 32;
        std::uint32_t period_ms = 0;    // instead of the mode's; 0: the mode's
        std::uint32_t delay_us = 0;     // of its images behind the clock's beat
        std::uint32_t way_us = 0;       // none to two times so long they are on their way
        std::uint32_t broken = 0;       // so many next images are damaged: the driver says so
        std::uint32_t cut_off = 0;      // or shorter than they are
        std::uint32_t overlong = 0;     // or longer than their buffer
        std::uint32_t misnumbered = 0;  // or in buffers that do not exist
        bool is_stamped = true;         // by the monotonic clock
        bool has_failed = false;        // the driver's queue is broken
        std::uint32_t spoiled = 0;      // of metadata: so many next ones have a few wrong bits
    };

    EmulatedDevice();
    ~EmulatedDevice();

    // Settings of the test.
    std::vector<Node> devices;               // in the order of their numbers
    std::map<std::uint32_t, Bytes> answers;  // by code, or 256 * parameter + code; without one: refused
    // What each call returns instead of being done, by its name; 0: it is done.
    std::function<int(const char* call)> fault;
    double bytes_per_s_max = 1e12;  // of the bus: else ENOSPC
    double clock_ppm = 0;           // how much faster the camera's clock goes
    std::uint32_t clock_us = 0;     // what it shows at the host's zero
    bool is_real_time = false;
    [[nodiscard]] Node& depth() { return devices[0]; }
    [[nodiscard]] Node& infrared() { return devices[2]; }
    [[nodiscard]] Node& colour() { return devices[4]; }
    // What the camera says of the images of a node.
    [[nodiscard]] Node& metadata_of(Node& node) { return (&node)[1]; }
    void unplug();
    // Back, with nodes that are called otherwise where `first_number` is another.
    void plug(int first_number = 0);
    void advance_ns(std::int64_t ns) { now_ns_ += ns; }

    // What was left behind: nodes open, buffers mapped. Streams are counted while they run.
    [[nodiscard]] int open_now() const {
        const std::lock_guard lock(mutex_);
        return static_cast<int>(handles_.size());
    }
    [[nodiscard]] int mapped_now() const {
        const std::lock_guard lock(mutex_);
        return mapped_;
    }
    std::map<std::uint32_t, std::int32_t> controls;  // that were set
    int emitter = -1;                                // as it was set; -1: not yet
    bool is_alternating = false;                     // the projector is on for images with odd numbers
    bool does_alternate = true;                      // and does as it was told
    // What an image shows, instead of its number; `is_lit`: the projector is on.
    std::function<void(std::size_t node, std::uint32_t number, bool is_lit, Bytes& bytes)> paint;
    std::string misuse;  // the first wrong call; empty: none

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

private:
    struct Open {
        std::size_t node = 0;
        std::uint32_t life = 0;  // of the plug it was opened in
        V4l2Format format;
        V4l2Interval interval{1, 30};
        std::vector<Bytes> buffers;
        std::vector<bool> is_queued;
        std::deque<std::uint32_t> queued;
        std::deque<V4l2Buffer> done;
        bool is_on = false;
        std::int64_t next_number = 0;
        std::uint32_t sequence = 0;
        Bytes asked;
    };

    // 0, or why a call cannot be done; `call` asks `fault`.
    [[nodiscard]] int enter(int handle, const char* call);
    [[nodiscard]] Open& of(int handle) { return handles_.at(handle); }
    [[nodiscard]] Node& node_of(int handle) { return devices[of(handle).node]; }
    [[nodiscard]] std::int64_t time_of(const Open& open, std::int64_t number) const;
    [[nodiscard]] std::int64_t period_ns(const Open& open) const;
    void produce(Open& open);
    [[nodiscard]] bool is_lit(std::int64_t number) const {
        return emitter == 1 && !(is_alternating && does_alternate && number % 2 == 0);
    }
    void describe(std::size_t node, std::int64_t number, const V4l2Buffer& image);
    void give(Open& open, std::int64_t number, std::int64_t time_ns);
    void complain(const char* what) {
        if (misuse.empty()) misuse = what;
    }
    [[nodiscard]] const EmulatedMode* mode_of(const Node& node, const V4l2Format& format) const;
    [[nodiscard]] std::int64_t next_image_ns(std::span<const int> handles);

    std::uint32_t spoils_ = 0;  // until now: each time other bits
    mutable std::recursive_mutex mutex_;
    std::int64_t now_ns_ = 1'000'000'000'000;
    bool is_plugged_ = true;
    std::uint32_t life_ = 1;
    int next_handle_ = 3;
    std::map<int, Open> handles_;
    int mapped_ = 0;
    std::vector<const std::uint8_t*> mappings_;
    std::vector<Bytes> left_;  // buffers of closed nodes that are still mapped
};

}  // namespace stillmesh::test

// The frames of a run as they were given to the engine, in the TUM layout (rgb.txt, depth.txt, PNG files, camera.toml;
// mask/ once a frame has a mask),
// so that a recording of a simulated or live run can be repeated. Frames are copied into a fixed ring by the engine's
// thread, which never waits, and written by a thread of its own; a line is added to a list when its picture is whole.
// A name that ends in .mcap is a bag of ROS 2 (frame_bag.hpp) instead of a folder.
// There are no holes: when the ring is full, or the disk, it ends there, and says so.
// Memory: kSlots frames, 8 x 1.2 MB at 640x480 in colour.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "hal/depth_camera.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/record/frame_bag.hpp"
#include "platform/record/slot_ring.hpp"

namespace stillmesh {

class FrameFolderWriter {
public:
    static constexpr std::size_t kSlots = 8;

    explicit FrameFolderWriter(std::size_t slots = kSlots);
    ~FrameFolderWriter();
    FrameFolderWriter(const FrameFolderWriter&) = delete;
    FrameFolderWriter& operator=(const FrameFolderWriter&) = delete;

    // Makes the folder, which must be new or empty, takes all memory, starts the thread. False: `message` says why.
    [[nodiscard]] bool open(const std::string& folder, const CameraInfo& camera, std::string& message);
    // Copies the frame. Does nothing once the folder has ended.
    void add(const Frame& frame);
    // Whether there is room for the next frame.
    bool wait_for_room(std::chrono::milliseconds timeout) { return ring_.wait_for_room(timeout); }
    // Writes what is left. Empty: all is well; else what was lost, as a sentence.
    [[nodiscard]] std::string close();
    [[nodiscard]] std::uint64_t frames() const { return frames_; }

private:
    struct Slot {
        Frame frame;  // sizes, times and format; its pixels are in these:
        std::vector<std::uint8_t> colour;
        std::vector<std::uint16_t> depth;
        std::vector<std::uint8_t> mask;  // empty: it has none
    };
    [[nodiscard]] bool make_folder(const CameraInfo& camera, std::string& message);
    void write_all();
    // Empty, or why it failed.
    [[nodiscard]] std::string write(const Slot& slot);

    std::string folder_;
    SlotRing<Slot> ring_;
    LineFile colour_list_, depth_list_;
    std::optional<FrameBag> bag_;  // instead of the lists and pictures
    std::jthread thread_;
    std::string error_;  // of the thread, before has_failed_
    std::atomic<bool> has_failed_ = false;
    std::uint64_t frames_ = 0;
    std::uint64_t missed_ = 0;
    bool is_open_ = false;
};

}  // namespace stillmesh

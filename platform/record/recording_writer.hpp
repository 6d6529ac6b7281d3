// Writes a recording (docs/SPEC-recording.md) while the run goes on: records are encoded into a fixed ring by the
// engine's thread, which never waits, and written by a thread of its own, a write(2) each: a kill -9 loses at most what
// was still in the ring. A recording has no holes: when the ring is full, or the disk, it ends there, and says so.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "platform/record/recording_format.hpp"
#include "platform/record/slot_ring.hpp"

namespace stillmesh {

class RecordingWriter {
public:
    static constexpr std::size_t kSlots = 256;  // 8 s at 30 frames/s, 150 KB

    explicit RecordingWriter(std::size_t slots = kSlots);
    ~RecordingWriter();
    RecordingWriter(const RecordingWriter&) = delete;
    RecordingWriter& operator=(const RecordingWriter&) = delete;

    // Opens the file and starts the thread. The first frame replaces what is there. False: `message` says why.
    [[nodiscard]] bool open(const std::string& file, const RecordingHeader& header, std::string& message);
    // Sets the frame's index. Does nothing once the recording has ended.
    void add(RecordedFrame& frame);
    // Until there is room, or the time is over: for runs whose camera can wait.
    void wait_for_room(std::chrono::milliseconds timeout) { ring_.wait_for_room(timeout); }
    // Writes what is left and the end mark, down to the disk. Empty: all is well; else what was lost, as a sentence.
    [[nodiscard]] std::string close();
    // The disk failed, or was too slow: nothing more is recorded.
    [[nodiscard]] bool has_failed() const { return error_ != 0 || missed_ > 0; }
    [[nodiscard]] std::uint64_t frames() const { return frames_; }

private:
    struct Record {
        std::array<std::byte, kRecordingEntryBytesMax> bytes{};
        std::size_t size = 0;
    };
    void write_all();
    [[nodiscard]] bool begin();  // if it has not: what was there goes, the header comes
    [[nodiscard]] bool write(std::span<const std::byte> bytes);

    std::string file_;
    std::vector<std::byte> header_;  // until it is written
    int descriptor_ = -1;
    SlotRing<Record> ring_;
    std::jthread thread_;
    std::atomic<int> error_ = 0;  // errno of the first failed write
    std::uint64_t frames_ = 0;    // recorded
    std::uint64_t missed_ = 0;    // after the end
    bool has_overflown_ = false;
};

}  // namespace stillmesh

// Saves an engine's map to a file, once or again and again while it runs: the copy is made by the engine's thread
// between frames, in slices (engine/record/map_file.hpp); writing it down is a thread's of its own, so that nobody
// waits for a disk. The file is replaced as a whole (platform/linux/atomic_file.hpp). And reads one back.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "engine/engine.hpp"
#include "engine/map_merge.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {

// More than any limits ask for; a larger file would only be read to be refused.
inline constexpr std::size_t kMapFileBytesMax = std::size_t{1} << 30U;

class MapSaver {
public:
    MapSaver() = default;
    ~MapSaver();
    MapSaver(const MapSaver&) = delete;
    MapSaver& operator=(const MapSaver&) = delete;

    // `every_ns`: between the begin of one save and the next; 0: only at the end. Tries whether the file can be
    // written. False: `message` says why.
    [[nodiscard]] bool open(const std::string& file, const Limits& limits, std::uint8_t extractor,
                            std::int64_t every_ns, std::string& message);
    [[nodiscard]] bool is_open() const { return !file_.empty(); }
    [[nodiscard]] bool is_copying() const { return is_copying_; }
    // The next work() begins a save, whether it is time or not.
    void save_soon() { is_asked_ = true; }
    // Between frames: begins a save when it is time, and goes on with it for so many units.
    void work(Engine& engine, std::int64_t now_ns, std::uint32_t units);
    // A save that has failed since this last said so, once a minute at most; else empty.
    [[nodiscard]] std::string take_news(std::int64_t now_ns);
    // The map as it is now, down to the disk. Empty: all saves went well; else a sentence, also for those before.
    [[nodiscard]] std::string finish(Engine& engine);
    [[nodiscard]] bool is_saved() const { return problem_.empty(); }  // by finish()
    // As finish, where there is no memory left: asks for none, and says nothing.
    void rescue(Engine& engine) noexcept;

    [[nodiscard]] std::uint64_t saves() const { return saves_; }
    [[nodiscard]] const MapFileInfo& info() const { return info_; }    // of the last save; after finish()
    [[nodiscard]] double last_save_s() const { return last_save_s_; }  // copy and writing, of finish()

private:
    [[nodiscard]] bool copy(Engine& engine);
    void write();
    void write_file();
    void fail(const std::string& problem);
    void join();

    std::string file_;
    AtomicFile target_;
    std::vector<std::byte> piece_;
    MemoryBlock workspace_;
    std::uint8_t extractor_ = 0;
    std::int64_t every_ns_ = 0;
    std::int64_t next_ns_ = 0;
    std::jthread thread_;
    std::atomic<bool> is_writing_ = false;
    bool is_copying_ = false, is_asked_ = false;
    std::uint64_t saves_ = 0, failures_ = 0;  // these five: the thread's while is_writing_
    MapFileInfo info_;
    std::string problem_, first_problem_;
    bool has_news_ = false;
    std::int64_t said_ns_ = 0;  // 0: never
    double last_save_s_ = 0;
};

// A sentence for what is wrong with a map file.
[[nodiscard]] std::string map_sentence(const std::string& file, const MapFileProblem& problem);
// Why merge_map() found no place that both show for certain.
[[nodiscard]] std::string merge_sentence(const std::string& second, const std::string& first, const MapMerge& merge);
// kOk; else `message` says why, and the engine was not touched. kUnavailable: the file could not be read (this time);
// kInvalid: it could, and is no map to go on in.
[[nodiscard]] Status load_map_file(const std::string& file, Engine& engine, MapUse use, std::uint8_t extractor,
                                   MapFileInfo& info, std::string& message);

}  // namespace stillmesh

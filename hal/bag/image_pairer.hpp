// Colour and depth images in the order in which a bag has them, in pairs: as associate() pairs whole lists (nearest in
// time first, each image once, at most a gap apart), over the images that wait. A colour image is decided once both
// streams are two gaps further, when its depth image has its very time, at the end, or when a stream has no room left.
// Limits: kWaitingMax images of a stream, bytes_max of both; the oldest then goes without a partner. Memory: buffers
// are kept and used again.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/replay/frame_list.hpp"

namespace stillmesh {

struct WaitingImage {
    std::int64_t time_ns = 0;
    std::vector<std::uint8_t> bytes;  // the whole message
};

struct PairerCounts {
    std::uint64_t lonely_colour = 0;
    std::uint64_t times_back = 0;
};

class ImagePairer {
public:
    static constexpr std::size_t kWaitingMax = 32;
    enum Stream : std::uint8_t { kColour = 0, kDepth = 1 };

    ImagePairer(std::int64_t gap_max_ns, std::size_t bytes_max) : gap_max_ns_(gap_max_ns), bytes_max_(bytes_max) {}

    // False: its time repeats or lies behind what was decided; counted, and not taken.
    bool add(Stream stream, std::int64_t time_ns, std::span<const std::uint8_t> bytes);
    void end() noexcept { is_over_ = true; }
    // The next pair, in the order of time; false: none yet, or none any more. Both stay until the next call.
    [[nodiscard]] bool next(const WaitingImage*& colour, const WaitingImage*& depth);
    [[nodiscard]] const PairerCounts& counts() const noexcept { return counts_; }

private:
    using Queue = std::vector<WaitingImage>;  // by time
    [[nodiscard]] bool is_decided() const;
    void drop(Stream stream);

    std::int64_t gap_max_ns_;
    std::size_t bytes_max_;
    std::array<Queue, 2> waiting_;
    std::array<std::int64_t, 2> decided_ns_ = {-1, -1};  // the last that went
    std::array<WaitingImage, 2> given_;
    std::vector<std::vector<std::uint8_t>> spare_;
    std::size_t bytes_ = 0;
    bool is_over_ = false;
    PairerCounts counts_;
};

}  // namespace stillmesh

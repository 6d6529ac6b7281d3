// Pairs colour and depth images by their timestamps: the nearest within half a period, each image in one pair at most.
// A pair is complete as soon as its second image is there. Two images of one stream are a period apart, so at most one
// lies within half a period of an image of the other stream, and it is the nearest. The frame numbers of drivers are
// not used: after a lost image they name other pairs.
// Memory: one waiting image. `Image` is whatever holds the pixels; it is moved, never copied.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

namespace stillmesh {

// Depth later than colour is a positive lag.
struct PairingCounts {
    std::uint64_t pairs = 0;
    std::uint64_t colour_alone = 0;
    std::uint64_t depth_alone = 0;
    std::int64_t lag_sum_us = 0;
    std::int64_t lag_min_us = 0;
    std::int64_t lag_max_us = 0;

    // What another pairer has counted.
    void add(const PairingCounts& other) noexcept {
        if (other.pairs > 0) {
            lag_min_us = pairs == 0 ? other.lag_min_us : std::min(lag_min_us, other.lag_min_us);
            lag_max_us = pairs == 0 ? other.lag_max_us : std::max(lag_max_us, other.lag_max_us);
        }
        pairs += other.pairs;
        colour_alone += other.colour_alone;
        depth_alone += other.depth_alone;
        lag_sum_us += other.lag_sum_us;
    }
    [[nodiscard]] double lag_mean_ms() const noexcept {
        return pairs == 0 ? 0.0 : static_cast<double>(lag_sum_us) * 1e-3 / static_cast<double>(pairs);
    }
};

template <typename Image>
class FramePairer {
public:
    struct Pair {
        Image colour, depth;
        std::int64_t colour_us = 0, depth_us = 0;
    };

    explicit FramePairer(std::int64_t period_us) noexcept : half_period_us_(period_us / 2) {}

    [[nodiscard]] std::optional<Pair> add_colour(Image image, std::int64_t time_us) {
        return add(true, std::move(image), time_us);
    }
    [[nodiscard]] std::optional<Pair> add_depth(Image image, std::int64_t time_us) {
        return add(false, std::move(image), time_us);
    }
    [[nodiscard]] const PairingCounts& counts() const noexcept { return counts_; }

private:
    [[nodiscard]] std::optional<Pair> add(bool is_colour, Image image, std::int64_t time_us) {
        if (waiting_ && is_colour != is_waiting_colour_) {
            const std::int64_t lag_us = is_colour ? waiting_us_ - time_us : time_us - waiting_us_;
            if (lag_us >= -half_period_us_ && lag_us <= half_period_us_) return pair(std::move(image), time_us, lag_us);
            // Both streams only go on: the older one's partner will not come any more.
            if (time_us < waiting_us_) {
                ++(is_colour ? counts_.colour_alone : counts_.depth_alone);
                return std::nullopt;
            }
        }
        if (waiting_) ++(is_waiting_colour_ ? counts_.colour_alone : counts_.depth_alone);
        waiting_ = std::move(image);
        waiting_us_ = time_us;
        is_waiting_colour_ = is_colour;
        return std::nullopt;
    }
    [[nodiscard]] std::optional<Pair> pair(Image image, std::int64_t time_us, std::int64_t lag_us) {
        if (counts_.pairs == 0 || lag_us < counts_.lag_min_us) counts_.lag_min_us = lag_us;
        if (counts_.pairs == 0 || lag_us > counts_.lag_max_us) counts_.lag_max_us = lag_us;
        ++counts_.pairs;
        counts_.lag_sum_us += lag_us;
        Pair made = is_waiting_colour_ ? Pair{std::move(*waiting_), std::move(image), waiting_us_, time_us}
                                       : Pair{std::move(image), std::move(*waiting_), time_us, waiting_us_};
        waiting_.reset();
        return made;
    }

    std::int64_t half_period_us_;
    std::optional<Image> waiting_;
    std::int64_t waiting_us_ = 0;
    bool is_waiting_colour_ = false;
    PairingCounts counts_;
};

}  // namespace stillmesh

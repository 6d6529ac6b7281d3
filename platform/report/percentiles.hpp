// Percentiles of durations in fixed memory: a histogram whose buckets grow by 0.8 %, from 0.1 us to 10 s, so that a run
// of any length costs the same. The largest value is kept exactly. Error of a percentile: at most half a bucket.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace stillmesh {

class Percentiles {
public:
    void add(double ms) noexcept {
        ++counts_[bucket_of(ms)];
        ++count_;
        sum_ += ms;
        if (ms > max_) max_ = ms;
    }
    // `share` in [0, 1]; 0 without values.
    [[nodiscard]] double at(double share) const noexcept {
        if (count_ == 0) return 0.0;
        const auto rank = static_cast<std::uint64_t>(share * static_cast<double>(count_ - 1));
        std::uint64_t seen = 0;
        for (std::size_t i = 0; i < kBuckets; ++i) {
            seen += counts_[i];
            if (seen > rank) return std::fmin(kFirstMs * std::exp((static_cast<double>(i) + 0.5) * kWidth), max_);
        }
        return max_;
    }
    [[nodiscard]] double median() const noexcept { return at(0.5); }
    [[nodiscard]] double p99() const noexcept { return at(0.99); }
    [[nodiscard]] double max() const noexcept { return max_; }
    [[nodiscard]] double mean() const noexcept { return count_ == 0 ? 0.0 : sum_ / static_cast<double>(count_); }
    [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

private:
    static constexpr std::size_t kBuckets = 2304;
    static constexpr double kFirstMs = 1e-4;
    static constexpr double kWidth = 0.008;  // ln of the growth: e^(2304 * 0.008) = 1e8

    [[nodiscard]] static std::size_t bucket_of(double ms) noexcept {
        if (!(ms > kFirstMs)) return 0;
        const double index = std::log(ms / kFirstMs) / kWidth;
        return index >= static_cast<double>(kBuckets) ? kBuckets - 1 : static_cast<std::size_t>(index);
    }

    std::array<std::uint32_t, kBuckets> counts_{};
    std::uint64_t count_ = 0;
    double sum_ = 0;
    double max_ = 0;
};

}  // namespace stillmesh

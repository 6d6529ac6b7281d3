// Regions that anybody can make, and stores of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "engine/base/random.hpp"
#include "platform/store/region_store.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::test {

// What is given to a store, with its own memory.
struct MadeRegion {
    LeavingRegion region;
    std::vector<WordWeight> words;
    std::vector<std::byte> body;

    [[nodiscard]] LeavingRegion given() const {
        LeavingRegion out = region;
        out.words = words;
        out.body = body;
        return out;
    }
};

inline std::vector<WordWeight> made_words(std::uint32_t count, std::uint32_t words_end, Random& random) {
    std::vector<WordWeight> out;
    for (std::uint32_t i = 0; i < count; ++i) {
        out.push_back({1 + random.below(kBagWeightOne / count), static_cast<std::uint16_t>(random.below(words_end))});
    }
    std::sort(out.begin(), out.end(), [](const WordWeight& a, const WordWeight& b) { return a.word < b.word; });
    out.erase(std::unique(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.word == b.word; }),
              out.end());
    return out;
}

inline MadeRegion made_region(std::uint64_t id, std::uint64_t seed, std::uint32_t words_end = 200) {
    Random random(seed);
    MadeRegion out;
    out.region.id = id;
    out.region.time_ns = static_cast<std::int64_t>(1000 * id);
    for (float& v : out.region.position_m) v = static_cast<float>(random.uniform(-50, 50));
    out.region.axis[2] = 1;
    out.words = made_words(4 + random.below(20), words_end, random);
    out.body.resize(1 + random.below(600));
    for (std::byte& b : out.body) b = static_cast<std::byte>(random.below(256));
    return out;
}

inline RegionStoreOptions options_in(const std::string& folder) {
    RegionStoreOptions out;
    out.folder = folder;
    out.origin = {1, 2, 3};
    out.is_durable = false;
    return out;
}

inline std::vector<std::byte> bytes_of_file(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    std::vector<std::byte> out(text.size());
    std::transform(text.begin(), text.end(), out.begin(), [](char c) { return static_cast<std::byte>(c); });
    return out;
}
inline void write_file(const std::string& file, const std::vector<std::byte>& bytes) {
    std::ofstream out(file, std::ios::binary | std::ios::trunc);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

// The answer: id and body. 0: none.
inline std::uint64_t asked(RegionStore& store, const std::vector<WordWeight>& words, std::vector<std::byte>& body,
                           std::uint32_t score_min = 1, std::vector<std::uint64_t> without = {},
                           std::uint64_t older_than = ~std::uint64_t{0}) {
    StoreQuestion question;
    question.number = 7;
    question.words = words;
    question.without = without;
    question.score_min = score_min;
    question.older_than = older_than;
    StoreAnswer answer;
    body.assign(4096, std::byte{0});
    if (!store.find(question, answer, body)) return 0;
    body.resize(answer.size_bytes);
    return answer.id;
}

}  // namespace stillmesh::test

// Mutation that knows where the parts of an input begin: they are taken out, put in, repeated, moved and changed as a
// whole, and new ones are likely right. Bytes changed blindly would nearly always shift all that follows, and most of
// an input would be decoded as something else. One in eight is still changed blindly.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size_bytes, std::size_t size_max_bytes);

namespace stillmesh::fuzz {

using Piece = std::vector<std::uint8_t>;

// What a target says about its inputs.
struct Grammar {
    // Bytes of the piece that `rest` begins with; the head is piece 0. What says more than there is gets all of it.
    std::size_t (*piece_bytes)(std::span<const std::uint8_t> rest, bool is_head);
    Piece (*make_head)(Random& random);
    Piece (*make_piece)(Random& random);  // or several in a row
};

inline std::vector<Piece> cut(const Grammar& grammar, std::span<const std::uint8_t> input) {
    std::vector<Piece> pieces;
    while (!input.empty()) {
        const std::size_t asked = grammar.piece_bytes(input, pieces.empty());
        const std::size_t size = std::clamp<std::size_t>(asked, 1, input.size());
        pieces.emplace_back(input.begin(), input.begin() + static_cast<std::ptrdiff_t>(size));
        input = input.subspan(size);
    }
    if (pieces.empty()) pieces.emplace_back();
    return pieces;
}

// Returns the size. What does not fit is left out.
inline std::size_t join(const std::vector<Piece>& pieces, std::uint8_t* out, std::size_t size_max_bytes) {
    std::size_t size = 0;
    for (const Piece& piece : pieces) {
        if (size + piece.size() > size_max_bytes) break;
        std::copy(piece.begin(), piece.end(), out + size);
        size += piece.size();
    }
    return size;
}

inline void change(const Grammar& grammar, std::vector<Piece>& pieces, Random& random) {
    const auto any = [&] { return random.below(static_cast<std::uint32_t>(pieces.size())); };
    const auto gap = [&] { return pieces.begin() + 1 + random.below(static_cast<std::uint32_t>(pieces.size())); };
    const std::uint32_t at = any(), other = any();
    switch (random.below(8)) {
        case 0:
            if (at > 0) pieces.erase(pieces.begin() + at, pieces.begin() + std::max(at + 1, other));
            break;
        case 1: {
            const std::vector<Piece> run(pieces.begin() + std::min(at, other), pieces.begin() + std::max(at, other));
            pieces.insert(gap(), run.begin(), run.end());
            break;
        }
        case 2:
            if (at > 0 && other > 0) std::swap(pieces[at], pieces[other]);
            break;
        case 3: pieces[0] = grammar.make_head(random); break;
        case 4:
            if (at > 0) pieces[at] = grammar.make_piece(random);
            break;
        case 5:
            if (!pieces[at].empty()) LLVMFuzzerMutate(pieces[at].data(), pieces[at].size(), pieces[at].size());
            break;
        default: pieces.insert(gap(), grammar.make_piece(random)); break;
    }
}

inline std::size_t mutate(const Grammar& grammar, std::uint8_t* data, std::size_t size_bytes,
                          std::size_t size_max_bytes, unsigned seed) {
    Random random(seed);
    if (random.below(8) == 0) return LLVMFuzzerMutate(data, size_bytes, size_max_bytes);
    std::vector<Piece> pieces = cut(grammar, {data, size_bytes});
    for (std::uint32_t changes = 1 + random.below(3); changes > 0; --changes) change(grammar, pieces, random);
    return join(pieces, data, size_max_bytes);
}

// The begin of one and the end of another.
inline std::size_t cross_over(const Grammar& grammar, std::span<const std::uint8_t> one,
                              std::span<const std::uint8_t> other, std::span<std::uint8_t> out, unsigned seed) {
    Random random(seed);
    std::vector<Piece> pieces = cut(grammar, one);
    const std::vector<Piece> more = cut(grammar, other);
    pieces.resize(1 + random.below(static_cast<std::uint32_t>(pieces.size())));
    pieces.insert(pieces.end(), more.begin() + random.below(static_cast<std::uint32_t>(more.size())), more.end());
    return join(pieces, out.data(), out.size());
}

}  // namespace stillmesh::fuzz

// The two functions that libFuzzer asks for, by a grammar.
#define STILLMESH_FUZZ_BY(grammar)                                                                                   \
    extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size_bytes,                       \
                                                   std::size_t size_max_bytes, unsigned int seed) {                  \
        return stillmesh::fuzz::mutate(grammar, data, size_bytes, size_max_bytes, seed);                             \
    }                                                                                                                \
    extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* one, std::size_t one_bytes,                 \
                                                     const std::uint8_t* other, std::size_t other_bytes,             \
                                                     std::uint8_t* out, std::size_t out_bytes, unsigned int seed) {  \
        return stillmesh::fuzz::cross_over(grammar, {one, one_bytes}, {other, other_bytes}, {out, out_bytes}, seed); \
    }

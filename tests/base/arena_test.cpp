#include "engine/base/arena.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <memory>

#include "engine/base/random.hpp"
#include "tests/support/check_message.hpp"

namespace stillmesh::arena_test {
namespace {

struct alignas(kArenaAlignment) Block {
    std::byte bytes[1 << 16];
};

struct Odd {
    char bytes[3];
};

// Promise: what the plan adds up is what the arena uses, to the byte, for every sequence of arrays.
TEST(Arena, PlanEqualsUse) {
    const auto block = std::make_unique<Block>();
    Random random(7);
    for (int round = 0; round < 500; ++round) {
        ArenaPlan plan;
        Arena arena(block->bytes);
        for (int i = 0; i < 12; ++i) {
            const std::size_t count = random.below(300);
            switch (random.below(4)) {
                case 0:
                    plan.array<std::uint8_t>(count);
                    EXPECT_EQ(arena.array<std::uint8_t>(count).size(), count);
                    break;
                case 1:
                    plan.array<double>(count);
                    EXPECT_EQ(arena.array<double>(count).size(), count);
                    break;
                case 2:
                    plan.array<Odd>(count);
                    EXPECT_EQ(arena.array<Odd>(count).size(), count);
                    break;
                default: plan.array<std::uint16_t>(count); EXPECT_EQ(arena.array<std::uint16_t>(count).size(), count);
            }
            ASSERT_EQ(plan.used_bytes(), arena.used_bytes());
        }
    }
}

// Promise: arrays start on cache lines, do not overlap, and their elements are value-initialised.
TEST(Arena, ArraysAreAlignedDisjointAndZero) {
    const auto block = std::make_unique<Block>();
    std::memset(block->bytes, 0xa5, sizeof block->bytes);
    Arena arena(block->bytes);
    const std::uint8_t* end_of_last = nullptr;
    for (std::size_t count = 0; count < 200; ++count) {
        const std::span<std::uint8_t> bytes = arena.array<std::uint8_t>(count);
        EXPECT_EQ(reinterpret_cast<std::uintptr_t>(bytes.data()) % kArenaAlignment, 0U);
        if (end_of_last != nullptr) {
            EXPECT_GE(bytes.data(), end_of_last);
        }
        for (std::uint8_t& byte : bytes) {
            EXPECT_EQ(byte, 0);
            byte = 0xff;
        }
        end_of_last = bytes.data() + bytes.size();
    }
}

// Promise: a block of exactly the planned size is enough, one byte less is a failed CHECK.
TEST(ArenaDeathTest, ExactlyThePlannedSizeIsEnough) {
    const auto block = std::make_unique<Block>();
    ArenaPlan plan;
    plan.array<Odd>(5);
    plan.array<double>(11);
    const auto use = [&](std::size_t bytes) {
        Arena arena(std::span<std::byte>(block->bytes, bytes));
        static_cast<void>(arena.array<Odd>(5));
        static_cast<void>(arena.array<double>(11));
        return arena.used_bytes();
    };
    EXPECT_EQ(use(plan.used_bytes()), plan.used_bytes());
    EXPECT_DEATH(use(plan.used_bytes() - 1), "count <= ");
}

// Promise: a count whose size in bytes overflows is refused like any other that does not fit.
TEST(ArenaDeathTest, HugeCountDoesNotOverflow) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    EXPECT_DEATH(static_cast<void>(arena.array<double>(SIZE_MAX / 4)), "count <= ");
}

// Promise: after seal() no memory is given, not even of size 0.
TEST(ArenaDeathTest, SealedGivesNothing) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    static_cast<void>(arena.array<int>(3));
    EXPECT_FALSE(arena.is_sealed());
    arena.seal();
    EXPECT_TRUE(arena.is_sealed());
    EXPECT_DEATH(static_cast<void>(arena.array<int>(0)), "!sealed_");
}

// Promise: a block that is not aligned is our bug.
TEST(ArenaDeathTest, BlockMustBeAligned) {
    const auto block = std::make_unique<Block>();
    EXPECT_DEATH(Arena(std::span<std::byte>(block->bytes + 8, 100)), "kArenaAlignment");
}

// Promise: the plan is known at compile time.
constexpr std::size_t planned() {
    ArenaPlan plan;
    plan.array<std::uint8_t>(1);
    plan.array<std::uint64_t>(2);
    return plan.used_bytes();
}
static_assert(planned() == 64 + 16);

}  // namespace
}  // namespace stillmesh::arena_test

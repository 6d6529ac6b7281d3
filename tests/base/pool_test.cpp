#include "engine/base/pool.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/support/check_message.hpp"

namespace stillmesh::pool_test {
namespace {

struct alignas(kArenaAlignment) Block {
    std::byte bytes[1 << 14];
};

struct Thing {
    std::uint64_t value = 42;
};

using Name = std::pair<std::uint32_t, std::uint32_t>;
Name name_of(Handle<Thing> handle) {
    return {handle.slot_plus_one, handle.generation};
}

// Promise: whatever is taken, released and reset in whatever order, the pool does what a map of names to values and a
// queue of free slots do; a name is never given twice, and a stale one never finds anything.
TEST(Pool, BehavesLikeAMapAndAQueue) {
    for (const std::size_t capacity : {0U, 1U, 2U, 3U, 17U, 200U}) {
        const auto block = std::make_unique<Block>();
        Arena arena(block->bytes);
        Pool<Thing> pool;
        pool.create(arena, capacity);
        ArenaPlan plan;
        Pool<Thing>::plan(plan, capacity);
        ASSERT_EQ(plan.used_bytes(), arena.used_bytes());
        ASSERT_EQ(pool.capacity(), capacity);

        std::map<Name, std::uint64_t> model;
        std::deque<std::uint32_t> free_slots;
        for (std::uint32_t i = 0; i < capacity; ++i) free_slots.push_back(i);
        std::set<Name> given;
        std::vector<Handle<Thing>> stale;
        std::size_t high_water = 0;
        std::uint64_t refused = 0;

        Random random(capacity + 1);
        for (int step = 0; step < 20000; ++step) {
            // Phases that fill and phases that drain, so that both ends are reached.
            const bool is_filling = (step / 2500) % 2 == 0;
            const std::uint32_t dice = random.below(100);
            if (dice < (is_filling ? 60U : 30U)) {
                const Result<Handle<Thing>> taken = pool.take();
                if (free_slots.empty()) {
                    ASSERT_EQ(taken.status(), Status::kFull);
                    ++refused;
                } else {
                    ASSERT_TRUE(taken.is_ok());
                    const Handle<Thing> handle = taken.value();
                    ASSERT_EQ(handle.slot(), free_slots.front()) << "first released, first reused";
                    free_slots.pop_front();
                    ASSERT_TRUE(given.insert(name_of(handle)).second) << "a name was given twice";
                    ASSERT_EQ(pool.find(handle)->value, 42U) << "a new object is value-initialised";
                    pool.find(handle)->value = random.next();
                    model[name_of(handle)] = pool.find(handle)->value;
                }
            } else if (dice < 95U) {
                if (!model.empty()) {
                    const auto it =
                        std::next(model.begin(),
                                  static_cast<std::ptrdiff_t>(random.below(static_cast<std::uint32_t>(model.size()))));
                    const Handle<Thing> handle{it->first.first, it->first.second};
                    pool.release(handle);
                    free_slots.push_back(handle.slot());
                    stale.push_back(handle);
                    model.erase(it);
                }
            } else if (step % 1000 == 999) {
                pool.reset();
                for (const auto& [name, value] : model) stale.push_back({name.first, name.second});
                model.clear();
                free_slots.clear();
                for (std::uint32_t i = 0; i < capacity; ++i) free_slots.push_back(i);
            }

            high_water = std::max(high_water, model.size());
            ASSERT_EQ(pool.size(), model.size());
            ASSERT_EQ(pool.is_full(), free_slots.empty());
            ASSERT_EQ(pool.high_water(), high_water);
            ASSERT_EQ(pool.refused(), refused);
            if (!stale.empty()) {
                ASSERT_EQ(pool.find(stale[random.below(static_cast<std::uint32_t>(stale.size()))]), nullptr);
            }
            if (step % 37 == 0) {
                for (const auto& [name, value] : model) {
                    const Handle<Thing> handle{name.first, name.second};
                    ASSERT_NE(pool.find(handle), nullptr);
                    ASSERT_EQ(std::as_const(pool).find(handle)->value, value);
                    ASSERT_TRUE(pool.is_taken(handle.slot()));
                    ASSERT_EQ(pool.handle_of(handle.slot()), handle);
                    ASSERT_EQ(&pool.at(handle.slot()), pool.find(handle));
                }
                std::size_t taken_count = 0;
                for (std::uint32_t slot = 0; slot < pool.slots_count(); ++slot) taken_count += pool.is_taken(slot);
                ASSERT_EQ(taken_count, model.size());
            }
        }
        if (capacity > 0) {
            EXPECT_EQ(high_water, capacity) << "the test never filled the pool";
            EXPECT_GT(refused, 0U);
        }
    }
}

// Promise: a full pool says kFull and changes nothing but its count of refusals.
TEST(Pool, FullChangesNothing) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    Pool<Thing> pool;
    pool.create(arena, 5);
    std::vector<Handle<Thing>> handles;
    for (std::uint64_t i = 0; i < 5; ++i) {
        handles.push_back(pool.take().value());
        pool.find(handles.back())->value = i;
    }
    for (std::uint64_t attempt = 1; attempt <= 3; ++attempt) {
        EXPECT_EQ(pool.take().status(), Status::kFull);
        EXPECT_EQ(pool.refused(), attempt);
        EXPECT_EQ(pool.size(), 5U);
        for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(pool.find(handles[i])->value, i);
    }
    pool.release(handles[2]);
    EXPECT_EQ(pool.take().value().slot(), 2U);
    EXPECT_EQ(pool.find(handles[2]), nullptr);
}

// Promise: handles that were never given find nothing: zeroed, beyond the end, of another generation.
TEST(Pool, StrangeHandlesFindNothing) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    Pool<Thing> pool;
    pool.create(arena, 3);
    const Handle<Thing> handle = pool.take().value();
    EXPECT_TRUE(Handle<Thing>{}.is_null());
    EXPECT_EQ(pool.find(Handle<Thing>{}), nullptr);
    EXPECT_EQ(pool.find({4, 1}), nullptr);
    EXPECT_EQ(pool.find({0xffffffffU, 1}), nullptr);
    EXPECT_EQ(pool.find({handle.slot_plus_one, handle.generation + 1}), nullptr);
    EXPECT_EQ(pool.find({handle.slot_plus_one, 0}), nullptr);
    EXPECT_EQ(pool.find({2, 1}), nullptr) << "a free slot";
    EXPECT_FALSE(pool.is_taken(3));
}

// Promise: releasing what is not there, and reaching into a free slot, are our bugs.
TEST(PoolDeathTest, MisuseIsChecked) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    Pool<Thing> pool;
    pool.create(arena, 3);
    const Handle<Thing> handle = pool.take().value();
    pool.release(handle);
    EXPECT_DEATH(pool.release(handle), "find\\(handle\\)");
    EXPECT_DEATH(pool.release({}), "find\\(handle\\)");
    EXPECT_DEATH(static_cast<void>(pool.at(handle.slot())), "is_taken");
    EXPECT_DEATH(static_cast<void>(pool.handle_of(7)), "is_taken");
}

}  // namespace
}  // namespace stillmesh::pool_test

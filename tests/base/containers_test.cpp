#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/random.hpp"
#include "engine/base/ring.hpp"
#include "engine/base/sort.hpp"
#include "engine/base/status.hpp"
#include "tests/support/check_message.hpp"

namespace stillmesh::containers_test {
namespace {

struct alignas(kArenaAlignment) Block {
    std::byte bytes[1 << 12];
};

// Promise: of any sequence the best are kept in order, equal ones in the order they came, as a stable sort would.
TEST(KeepBest, KeepsWhatAStableSortPutsFirst) {
    Random random(4);
    struct Item {
        std::uint32_t key = 0, number = 0;
    };
    const auto is_before = [](const Item& a, const Item& b) { return a.key < b.key; };
    for (int round = 0; round < 500; ++round) {
        std::vector<Item> items(random.below(20));
        for (std::uint32_t i = 0; i < items.size(); ++i) items[i] = {random.below(8), i};
        std::vector<Item> best(random.below(8));
        std::uint32_t count = 0;
        for (const Item& item : items) keep_best(std::span(best), count, item, is_before);
        std::stable_sort(items.begin(), items.end(), is_before);
        ASSERT_EQ(count, std::min(items.size(), best.size()));
        for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ(best[i].number, items[i].number) << round;
    }
}

// Promise: sorts what std::sort sorts, every order of up to seven elements and random ones, ascending or by any order.
TEST(Sort, EqualsTheLibrarys) {
    for (int n = 0; n <= 7; ++n) {
        std::vector<int> order;
        for (int i = 0; i < n; ++i) order.push_back(i);
        do {
            std::vector<int> sorted = order;
            sort(std::span(sorted));
            ASSERT_TRUE(std::is_sorted(sorted.begin(), sorted.end()));
            ASSERT_TRUE(std::is_permutation(sorted.begin(), sorted.end(), order.begin()));
        } while (std::next_permutation(order.begin(), order.end()));
    }
    Random random(7);
    for (int round = 0; round < 200; ++round) {
        std::vector<std::uint32_t> ours(random.below(500));
        for (std::uint32_t& value : ours) value = random.below(100);
        std::vector<std::uint32_t> theirs = ours;
        const auto is_before = [](std::uint32_t a, std::uint32_t b) { return a > b; };
        sort(std::span(ours), is_before);
        std::sort(theirs.begin(), theirs.end(), is_before);
        ASSERT_EQ(ours, theirs);
    }
}

// Promise: a fixed vector is a std::vector that stops at its capacity; a refused push changes nothing.
TEST(FixedVector, BehavesLikeAVectorWithAnEnd) {
    for (const std::size_t capacity : {0U, 1U, 5U, 64U}) {
        const auto block = std::make_unique<Block>();
        Arena arena(block->bytes);
        FixedVector<std::uint32_t> vector;
        vector.create(arena, capacity);
        ArenaPlan plan;
        FixedVector<std::uint32_t>::plan(plan, capacity);
        ASSERT_EQ(plan.used_bytes(), arena.used_bytes());

        std::vector<std::uint32_t> model;
        Random random(capacity);
        for (int step = 0; step < 5000; ++step) {
            const std::uint32_t dice = random.below(100);
            if (dice < 60) {
                const auto value = static_cast<std::uint32_t>(random.next());
                ASSERT_EQ(vector.push(value), model.size() < capacity);
                if (model.size() < capacity) model.push_back(value);
            } else if (dice < 98) {
                if (!model.empty()) {
                    vector.set_size(vector.size() - 1);
                    model.pop_back();
                }
            } else {
                vector.clear();
                model.clear();
            }
            ASSERT_EQ(vector.size(), model.size());
            ASSERT_EQ(vector.is_empty(), model.empty());
            ASSERT_EQ(vector.is_full(), model.size() == capacity);
            ASSERT_TRUE(std::equal(vector.begin(), vector.end(), model.begin(), model.end()));
            ASSERT_TRUE(std::equal(vector.span().begin(), vector.span().end(), model.begin(), model.end()));
            if (!model.empty()) {
                const std::size_t i = random.below(static_cast<std::uint32_t>(model.size()));
                ASSERT_EQ(std::as_const(vector)[i], model[i]);
            }
        }
    }
}

// Promise: reading beyond the end and growing beyond the capacity are our bugs.
TEST(FixedVectorDeathTest, MisuseIsChecked) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    FixedVector<int> vector;
    vector.create(arena, 4);
    ASSERT_TRUE(vector.push(1));
    EXPECT_DEATH(static_cast<void>(vector[1]), "i < size_");
    EXPECT_DEATH(vector.set_size(5), "storage_.size");
}

// Promise: an inline vector stops at its capacity and checks its indices.
TEST(InlineVectorDeathTest, StopsAtItsCapacity) {
    InlineVector<int, 3> vector;
    EXPECT_TRUE(vector.push(1));
    EXPECT_TRUE(vector.push(2));
    EXPECT_TRUE(vector.push(3));
    EXPECT_FALSE(vector.push(4));
    EXPECT_EQ(vector.size(), 3U);
    EXPECT_EQ(std::vector<int>(vector.begin(), vector.end()), (std::vector<int>{1, 2, 3}));
    EXPECT_EQ(vector.span().size(), 3U);
    EXPECT_DEATH(static_cast<void>(vector[3]), "i < size_");
    vector.clear();
    EXPECT_EQ(vector.size(), 0U);
}

// Promise: a ring is a queue that stops at its capacity, or forgets its oldest when told to.
TEST(Ring, BehavesLikeAQueueWithAnEnd) {
    for (const std::size_t capacity : {1U, 2U, 7U, 32U}) {
        const auto block = std::make_unique<Block>();
        Arena arena(block->bytes);
        Ring<std::uint32_t> ring;
        ring.create(arena, capacity);
        ArenaPlan plan;
        Ring<std::uint32_t>::plan(plan, capacity);
        ASSERT_EQ(plan.used_bytes(), arena.used_bytes());

        std::deque<std::uint32_t> model;
        Random random(capacity);
        bool was_full = false;
        for (int step = 0; step < 5000; ++step) {
            const std::uint32_t dice = random.below(100);
            const auto value = static_cast<std::uint32_t>(random.next());
            if (dice < 40) {
                ASSERT_EQ(ring.push(value), model.size() < capacity);
                if (model.size() < capacity) model.push_back(value);
            } else if (dice < 60) {
                ring.push_over(value);
                if (model.size() == capacity) model.pop_front();
                model.push_back(value);
            } else if (dice < 99) {
                if (!model.empty()) {
                    ring.pop();
                    model.pop_front();
                }
            } else {
                ring.clear();
                model.clear();
            }
            was_full = was_full || model.size() == capacity;
            ASSERT_EQ(ring.size(), model.size());
            ASSERT_EQ(ring.is_empty(), model.empty());
            for (std::size_t i = 0; i < model.size(); ++i) ASSERT_EQ(std::as_const(ring)[i], model[i]);
            if (!model.empty()) {
                ASSERT_EQ(ring.newest(), model.back());
            }
        }
        EXPECT_TRUE(was_full);
        EXPECT_EQ(ring.capacity(), capacity);
    }
}

// Promise: an empty ring gives nothing, and a ring of capacity 0 is our bug.
TEST(RingDeathTest, MisuseIsChecked) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    Ring<int> ring;
    ring.create(arena, 2);
    EXPECT_DEATH(ring.pop(), "size_ > 0");
    EXPECT_DEATH(static_cast<void>(ring[0]), "i < size_");
    EXPECT_DEATH(static_cast<void>(ring.newest()), "i < size_");
    EXPECT_DEATH(ring.create(arena, 0), "count_max > 0");
}

// Promise: a result holds a value or says why not; taking the value of a failure is our bug, and so is kOk without one.
TEST(ResultDeathTest, HoldsAValueOrAReason) {
    const Result<int> good(7);
    EXPECT_TRUE(good.is_ok());
    EXPECT_EQ(good.value(), 7);
    const Result<int> bad(Status::kNotFound);
    EXPECT_FALSE(bad.is_ok());
    EXPECT_EQ(bad.status(), Status::kNotFound);
    EXPECT_DEATH(static_cast<void>(bad.value()), "is_ok");
    EXPECT_DEATH(static_cast<void>(Result<int>(Status::kOk)), "kOk");
}

// Promise: every status has a name of its own.
TEST(Status, NamesAreDistinct) {
    std::vector<std::string> names;
    for (std::uint8_t i = 0; i <= static_cast<std::uint8_t>(Status::kEnd); ++i) {
        names.emplace_back(status_name(static_cast<Status>(i)));
    }
    std::sort(names.begin(), names.end());
    EXPECT_EQ(std::unique(names.begin(), names.end()), names.end());
    EXPECT_EQ(std::count(names.begin(), names.end(), "unknown"), 0);
}

}  // namespace
}  // namespace stillmesh::containers_test

#include "hal/simulated/dirt.hpp"

#include <gtest/gtest.h>

#include <set>

namespace stillmesh::dirt_test {
namespace {

// Promise: strengths are read from left to right, a name alone means 1, "all" means each; what is not said stays the
// scene's.
TEST(Dirt, IsReadFromText) {
    Dirt dirt;
    std::string message;
    ASSERT_TRUE(parse_dirt("shake=.5,rolling", dirt, message)) << message;
    EXPECT_EQ(dirt.shake, 0.5);
    EXPECT_EQ(dirt.rolling, 1.0);
    EXPECT_LT(dirt.aside, 0);
    ASSERT_TRUE(parse_dirt("all=0,aside=2", dirt, message)) << message;
    EXPECT_EQ(dirt.shake, 0.0);
    EXPECT_EQ(dirt.aside, 2.0);
    EXPECT_FALSE(is_clean(dirt));
    EXPECT_TRUE(is_clean(all_dirt(0)));
    EXPECT_TRUE(is_clean(Dirt{}));
    Dirt same;
    ASSERT_TRUE(parse_dirt("", same, message));
    EXPECT_EQ(same, Dirt{});
}

// Promise: what cannot be meant is refused with a sentence that names what there is.
TEST(Dirt, RefusesWithASentence) {
    for (const char* text : {"mud", "mud=1", "shake=", "shake=x", "shake=-1", "shake=11", "shake=nan", "=1"}) {
        Dirt dirt;
        std::string message;
        EXPECT_FALSE(parse_dirt(text, dirt, message)) << text;
        EXPECT_GT(message.size(), 20U) << text;
    }
}

// Promise: text of a dirt reads back as the dirt, for every effect; no two share a name.
TEST(Dirt, WritesWhatItReads) {
    std::set<std::string> names;
    Dirt dirt;
    double next = 0.25;
    visit_dirt(dirt, [&](const char* name, double& strength, const char* text) {
        names.insert(name);
        EXPECT_GT(std::string(text).size(), 10U) << name;
        strength = next;
        next += 0.125;
    });
    EXPECT_EQ(names.size(), kDirtCount);
    Dirt read;
    std::string message;
    ASSERT_TRUE(parse_dirt(dirt_text(dirt), read, message)) << message;
    EXPECT_EQ(read, dirt);
    EXPECT_EQ(dirt_text(Dirt{}), "");
}

// Promise: what is said covers the scene's, and what is not leaves it.
TEST(Dirt, LiesOverTheScenes) {
    Dirt said;
    said.shake = 0;
    const Dirt both = laid_over(all_dirt(1), said);
    EXPECT_EQ(both.shake, 0.0);
    EXPECT_EQ(both.rolling, 1.0);
}

}  // namespace
}  // namespace stillmesh::dirt_test

#include "hal/simulated/person.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "hal/simulated/world.hpp"

namespace stillmesh::simulated::people_test {
namespace {

constexpr Lane kLanes[] = {{0.95, 1.06, -0.36, 0.36}, {1.45, 1.7, -0.42, -0.08}, {2.5, 2.7, -0.42, 0.42}};

std::vector<Person> walkers(std::uint64_t seed, const CameraPath& camera, double scale) {
    std::vector<Person> people(3);
    constexpr Manner kManners[] = {Manner::kComesClose, Manner::kStandsStill, Manner::kSitsFirst};
    for (std::size_t i = 0; i < 3; ++i) {
        people[i].manner = scale > 0 ? kManners[i] : Manner::kNone;
        people[i].manner_scale = scale;
    }
    plan_walks(people, kLanes, camera, {{0.75, 0.2, 0.75, 0.4}}, 12, seed);
    return people;
}

double apart(const BodyState& a, const BodyState& b) {
    return std::sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y));
}

// The longest time in which somebody goes less than 2 cm.
double longest_rest_s(const Person& person) {
    double longest = 0;
    for (double from = 0; from < 10; from += 0.1) {
        double until = from;
        while (until < 10 && apart(person.at(from), person.at(until)) < 0.02) until += 0.1;
        longest = std::max(longest, until - from);
    }
    return longest;
}

// Promise: one sits perfectly still for 5 s, rises, and walks away; one stands still for some 5 s; one comes and stands
// 65 cm before the camera for 2 s.
TEST(People, HaveManners) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        const CameraPath camera(CameraMotion::kXyz, 1, seed);
        const std::vector<Person> people = walkers(seed, camera, 1);
        const Person& sits = people[2];
        for (double t = 0; t < 5; t += 0.25) {
            EXPECT_EQ(apart(sits.at(0), sits.at(t)), 0.0) << seed;
            EXPECT_EQ(sits.at(t).change, 1.0);
            EXPECT_EQ(sits.at(t).heading_rad, sits.at(0).heading_rad);
            EXPECT_EQ(sits.at(t).gesture_left, 0.0);
        }
        EXPECT_EQ(sits.at(6.5).change, 0.0);
        EXPECT_GT(apart(sits.at(0), sits.at(8.5)), 0.3) << seed;
        EXPECT_GT(longest_rest_s(people[1]), 4.5) << seed;
        double close_s = 0;
        for (double t = 0; t < 8; t += 0.1) {
            const BodyState b = people[0].at(t);
            const Rigid eye = camera.at(t);
            const double dx = b.x - eye.translation.x;
            const double dy = b.y - eye.translation.y;
            const double distance = std::sqrt(dx * dx + dy * dy);
            EXPECT_GT(distance, 0.4) << seed;
            close_s += distance < 0.75 ? 0.1 : 0.0;
        }
        EXPECT_GT(close_s, 1.5) << seed;
        EXPECT_LT(close_s, 4) << seed;
        EXPECT_LT(longest_rest_s(walkers(seed, camera, 0)[1]), 4) << seed;
    }
}

// Promise: whatever people do, the camera goes through nobody: where it walks round the room, too.
TEST(People, KeepOutOfTheCamera) {
    for (const CameraMotion motion : {CameraMotion::kLoop, CameraMotion::kHalfsphere, CameraMotion::kRpy}) {
        for (std::uint64_t seed = 1; seed <= 6; ++seed) {
            const CameraPath camera(motion, 1, seed);
            for (const Person& person : walkers(seed, camera, 1)) {
                for (double t = 0; t < 11; t += 0.05) {
                    const Vec3 eye = camera.at(t).translation;
                    const double dx = person.at(t).x - eye.x;
                    const double dy = person.at(t).y - eye.y;
                    EXPECT_GT(std::sqrt(dx * dx + dy * dy), 0.35) << seed << " at " << t;
                }
            }
        }
    }
}

// Promise: someone at the desk is still for 5 s, then talks, then stands up for a while, and is down again.
TEST(People, RiseFromTheDesk) {
    Person person;
    person.manner = Manner::kSitsFirst;
    plan_sitting(person, 1, 2, 0.5, 12, 3);
    for (double t = 0; t < 5; t += 0.25) {
        EXPECT_EQ(person.at(t).heading_rad, person.at(0).heading_rad);
        EXPECT_EQ(person.at(t).gesture_phase, person.at(0).gesture_phase);
        EXPECT_EQ(person.at(t).change, 0.0);
    }
    EXPECT_GT(person.at(7.5).gesture_phase, person.at(5).gesture_phase + 1);
    EXPECT_EQ(person.at(9.5).change, 1.0);
    EXPECT_EQ(person.at(11.2).change, 0.0);
}

// Depth of someone who stands 1.5 m before the camera, 0 beside him.
std::vector<float> look_at(const Person& person, double time_s, double folds) {
    Renderer renderer({160, 120, 132, 132, 79.5, 59.5});
    renderer.begin(look_along({0, 0, 1.1}, {1, 0, 0}), 0, 0);
    draw_person(renderer, person, time_s, folds);
    std::vector<float> out;
    for (const float w : renderer.inverse_depth()) out.push_back(w > 0 ? 1 / w : 0);
    return out;
}

// Promise: folds move the surface of clothes by a few millimetres and never by more than 11, and they wander while
// nobody moves.
TEST(People, ClothesFold) {
    const Texture texture = paint(Pattern::kCloth, 1);
    Person person;
    const Material cloth{&texture, Infrared::kGood, true};
    person.shirt = person.trousers = person.skin = person.face = person.shoes = cloth;
    person.states.assign(300, {1.5, 0, kPi, 0, 0, 0, 0, 0, 0});
    const auto mean = [](const std::vector<float>& a, const std::vector<float>& b) {
        double sum = 0;
        double count = 0;
        double most = 0;
        for (std::size_t i = 0; i < a.size(); ++i) {
            const double apart_m = static_cast<double>(std::abs(a[i] - b[i]));
            if (a[i] == 0.0F || b[i] == 0.0F || apart_m > 0.05) continue;  // at the outline
            sum += apart_m;
            most = std::max(most, apart_m);
            ++count;
        }
        EXPECT_GT(count, 1000);
        return sum / count;
    };
    const std::vector<float> plain = look_at(person, 1, 0);
    EXPECT_EQ(plain, look_at(person, 2, 0));
    const double folded = mean(plain, look_at(person, 1, 1));
    EXPECT_GT(folded, 0.0015);
    EXPECT_LT(folded, 0.011);
    EXPECT_GT(mean(look_at(person, 1, 1), look_at(person, 2, 1)), 0.001);
    EXPECT_LT(mean(look_at(person, 1, 1), look_at(person, 1 + 1.0 / 30, 1)), 0.0015);
}

// Promise: posts of shadows stand where people do, lower where one sits.
TEST(World, KnowsWhoCastsAShadow) {
    Scene scene = scenes()[0];
    scene.cast = Cast::kWalking;
    const World world(scene, 1, 1, 10, all_dirt(1));
    std::vector<Post> posts;
    world.find_posts(1, posts);
    ASSERT_EQ(posts.size(), 3U);
    EXPECT_LT(posts[2].height, 1.4);
    world.find_posts(9, posts);
    EXPECT_GT(posts[2].height, 1.5);
}

}  // namespace
}  // namespace stillmesh::simulated::people_test

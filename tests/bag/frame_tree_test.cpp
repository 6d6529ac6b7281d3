// Where frames lie to each other, from messages of transforms.
#include "hal/bag/frame_messages.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace stillmesh::frame_tree_test {
namespace {

using Point = std::array<double, 3>;

// A TFMessage as CDR, little endian.
class Message {
public:
    Message() : bytes_{0, 1, 0, 0, 0, 0, 0, 0} {}
    Message& add(const std::string& parent, const std::string& frame, const RigidTransform& transform) {
        ++bytes_[4];
        put(std::uint32_t{0}), put(std::uint32_t{0});  // a stamp
        text(parent), text(frame);
        for (const double value : transform.translation_m) put(value);
        for (const double value : transform.rotation_xyzw) put(value);
        return *this;
    }
    void to(FrameTree& tree) const {
        take_transforms("/tf_static", kTransformsType, bytes_, MessageLayout::kCdr, tree);
    }

private:
    template <typename T>
    void put(T value) {
        while ((bytes_.size() - 4) % sizeof(T) != 0) bytes_.push_back(0);
        bytes_.resize(bytes_.size() + sizeof(T));
        std::memcpy(bytes_.data() + bytes_.size() - sizeof(T), &value, sizeof(T));
    }
    void text(const std::string& word) {
        put(static_cast<std::uint32_t>(word.size() + 1));
        bytes_.insert(bytes_.end(), word.begin(), word.end());
        bytes_.push_back(0);
    }
    std::vector<std::uint8_t> bytes_;
};

// By the rotation's matrix.
[[nodiscard]] Point moved(const RigidTransform& by, const Point& p) {
    const auto [x, y, z, w] = by.rotation_xyzw;
    const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                            {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                            {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    Point out;
    for (std::size_t i = 0; i < 3; ++i) {
        out[i] = by.translation_m[i];
        for (std::size_t j = 0; j < 3; ++j) out[i] += r[i][j] * p[j];
    }
    return out;
}

// Promise: a point that is carried from a frame up to the common one and down to another lies where the tree says, in
// both directions; what nothing connects, and a circle, are no way.
TEST(FrameTree, CarriesPoints) {
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    const auto any = [&] {
        RigidTransform out;
        double norm = 0;
        for (double& value : out.rotation_xyzw) {
            value = normal(random);
            norm += value * value;
        }
        for (double& value : out.rotation_xyzw) value /= std::sqrt(norm);
        for (double& value : out.translation_m) value = normal(random);
        return out;
    };
    for (int round = 0; round < 50; ++round) {
        const RigidTransform link_base = any(), base_depth = any(), link_colour = any(), colour_optical = any();
        FrameTree tree;
        Message()
            .add("link", "base", link_base)
            .add("/base", "depth", base_depth)
            .add("link", "colour", link_colour)
            .add("colour", "optical", colour_optical)
            .add("colour", "optical", any())  // too late
            .add("island", "shore", any())
            .add("one", "two", any())
            .add("two", "one", any())
            .to(tree);
        const auto optical_depth = tree.between("depth", "/optical");
        const auto depth_optical = tree.between("optical", "depth");
        ASSERT_TRUE(optical_depth && depth_optical);
        const Point p = {normal(random), normal(random), normal(random)};
        const Point in_link = moved(link_base, moved(base_depth, p));
        const Point again = moved(link_colour, moved(colour_optical, moved(*optical_depth, p)));
        const Point back = moved(*depth_optical, moved(*optical_depth, p));
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_NEAR(again[i], in_link[i], 1e-12);
            EXPECT_NEAR(back[i], p[i], 1e-12);
        }
        EXPECT_FALSE(tree.between("depth", "shore"));
        EXPECT_FALSE(tree.between("one", "depth"));
        EXPECT_FALSE(tree.between("nowhere", "depth"));
    }
}

// Promise: what is no rotation, or no number, is passed over.
TEST(FrameTree, PassesOverWhatIsNoTransform) {
    FrameTree tree;
    RigidTransform none, far;
    none.rotation_xyzw[3] = 0;
    far.translation_m[1] = std::nan("");
    Message().add("link", "a", none).add("link", "b", far).add("link", "c", {}).to(tree);
    EXPECT_FALSE(tree.between("a", "c"));
    EXPECT_FALSE(tree.between("b", "c"));
    EXPECT_TRUE(tree.between("link", "c"));
}

}  // namespace
}  // namespace stillmesh::frame_tree_test

#include "platform/grid/grid_files.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/grid/synthetic_room.hpp"

namespace stillmesh::grid_files_test {
namespace {

// Promise: the picture has Nav2's greys, a row of cells each, the highest first, and the text says where it lies.
TEST(GridFiles, PictureAndTextAreNav2s) {
    test::SeenRoom room;
    room.boxes = {{2.0, 2.2, -3, 3, 0, 2}};
    const RigidTransform camera = test::camera_at({0, 0, 1.2}, 0, 0.4);
    const GridOptions options;
    std::vector<std::byte> block(OccupancyGrid::bytes(options));
    OccupancyGrid grid;
    grid.create(block, options);
    const std::vector<std::uint16_t> depth = room.look(camera);
    grid.cover(room.image(depth), camera);
    grid.lay_out();
    for (std::uint64_t frame = 0; frame < 60; frame += 20) grid.add(room.image(depth, frame), camera);
    grid.finish();
    const std::string pgm = grid_pgm(grid);
    const std::string head = "P5\n" + std::to_string(grid.width()) + " " + std::to_string(grid.height()) + "\n255\n";
    ASSERT_EQ(pgm.substr(0, head.size()), head);
    ASSERT_EQ(pgm.size(), head.size() + std::size_t{grid.width()} * grid.height());
    int counts[3] = {};
    for (std::uint32_t y = 0; y < grid.height(); ++y) {
        for (std::uint32_t x = 0; x < grid.width(); ++x) {
            const auto grey =
                static_cast<std::uint8_t>(pgm[head.size() + std::size_t{grid.height() - 1 - y} * grid.width() + x]);
            const GridCell cell = grid.at(x, y);
            ++counts[static_cast<int>(cell)];
            ASSERT_EQ(grey, cell == GridCell::kFree ? 254 : cell == GridCell::kOccupied ? 0 : 205);
        }
    }
    for (const int count : counts) EXPECT_GT(count, 10);
    Floor floor;
    floor.level_from_map = {{0.5, -0.5, 0.5, 0.5}, {1, 2, 3}};
    const std::string yaml = grid_yaml(grid, floor, "office.pgm");
    EXPECT_NE(yaml.find("image: \"office.pgm\"\n"), std::string::npos);
    EXPECT_NE(yaml.find("resolution: 0.05\n"), std::string::npos);
    EXPECT_NE(yaml.find("negate: 0\n"), std::string::npos);
    double x = 0, y = 0;
    ASSERT_EQ(std::sscanf(yaml.c_str() + yaml.find("origin:"), "origin: [%lf, %lf, 0.0]", &x, &y), 2);
    EXPECT_NEAR(x, grid.origin_x(), 1e-4);
    EXPECT_NEAR(y, grid.origin_y(), 1e-4);
    EXPECT_NE(yaml.find("1.000000 2.000000 3.000000 0.500000000 -0.500000000 0.500000000 0.500000000"),
              std::string::npos);
}

}  // namespace
}  // namespace stillmesh::grid_files_test

// The true floor plan of a simulated scene, from the faces that its renderer draws, in squares of a centimetre: what
// stands between two heights, where people go, and what of the rest a camera in the room can reach.
#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "hal/simulated/scene.hpp"
#include "hal/simulated/world.hpp"

namespace stillmesh::test {

class TruePlan {
public:
    static constexpr double kSide_m = 0.01;
    static constexpr int kColumns = 1400, kRows = 1000;  // 14 x 10 m about the middle of the room
    static constexpr double kLeft_m = -7, kBottom_m = -5;

    enum class Square : std::uint8_t { kHidden, kOpen, kObstacle };

    // As it is after `end_s` seconds; people over all of them. The room begins to be filled where the camera is then.
    TruePlan(const simulated::World& world, double end_s, double low_m, double high_m)
        : low_m_(low_m), high_m_(high_m), squares_(kSquares, Square::kHidden), path_(kSquares, 0) {
        Faces standing(*this, false), moving(*this, true);
        world.draw(standing, end_s);
        for (double time_s = 0; time_s <= end_s; time_s += 0.1) world.draw_moving(moving, time_s);
        const simulated::Rigid camera = world.camera().at(end_s);
        open_from(camera.translation.x, camera.translation.y);
    }

    [[nodiscard]] bool has_within(Square what, double x, double y, double radius_m) const {
        return any_within(x, y, radius_m, [&](std::size_t i) { return squares_[i] == what; });
    }
    [[nodiscard]] bool is_on_a_path(double x, double y, double radius_m) const {
        return any_within(x, y, radius_m, [&](std::size_t i) { return path_[i] != 0; });
    }

private:
    static constexpr std::size_t kSquares = std::size_t{kColumns} * kRows;
    [[nodiscard]] static int column_of(double x) { return static_cast<int>(std::floor((x - kLeft_m) / kSide_m)); }
    [[nodiscard]] static int row_of(double y) { return static_cast<int>(std::floor((y - kBottom_m) / kSide_m)); }
    [[nodiscard]] static bool is_inside(int column, int row) {
        return column >= 0 && row >= 0 && column < kColumns && row < kRows;
    }

    class Faces final : public simulated::Canvas {
    public:
        Faces(TruePlan& plan, bool is_moving) : plan_(plan), is_moving_(is_moving) {}
        void draw(const simulated::Vertex* vertices, std::uint32_t count,
                  const simulated::Material& material) override {
            if (material.is_dynamic != is_moving_) return;
            for (std::uint32_t i = 1; i + 1 < count; ++i) triangle(vertices[0].p, vertices[i].p, vertices[i + 1].p);
        }

    private:
        void triangle(const simulated::Vec3& a, const simulated::Vec3& b, const simulated::Vec3& c) {
            constexpr double kStep_m = 0.006;
            const int across = 1 + static_cast<int>(length(b - a) / kStep_m);
            const int along = 1 + static_cast<int>(length(c - a) / kStep_m);
            for (int i = 0; i <= across; ++i) {
                for (int k = 0; k <= along; ++k) {
                    const double u = static_cast<double>(i) / across, v = static_cast<double>(k) / along;
                    if (u + v > 1) break;
                    plan_.mark(a + (b - a) * u + (c - a) * v, is_moving_);
                }
            }
        }
        TruePlan& plan_;
        bool is_moving_;
    };

    void mark(const simulated::Vec3& p, bool is_moving) {
        const int column = column_of(p.x), row = row_of(p.y);
        if (p.z < low_m_ || p.z > high_m_ || !is_inside(column, row)) return;
        const std::size_t i = static_cast<std::size_t>(row) * kColumns + static_cast<std::size_t>(column);
        if (is_moving) {
            path_[i] = 1;
        } else {
            squares_[i] = Square::kObstacle;
        }
    }
    void open_from(double x, double y) {
        std::deque<std::pair<int, int>> todo = {{column_of(x), row_of(y)}};
        while (!todo.empty()) {
            const auto [column, row] = todo.front();
            todo.pop_front();
            if (!is_inside(column, row)) continue;
            Square& square = squares_[static_cast<std::size_t>(row) * kColumns + static_cast<std::size_t>(column)];
            if (square != Square::kHidden) continue;
            square = Square::kOpen;
            todo.insert(todo.end(), {{column + 1, row}, {column - 1, row}, {column, row + 1}, {column, row - 1}});
        }
    }
    template <typename Is>
    [[nodiscard]] bool any_within(double x, double y, double radius_m, Is&& is) const {
        for (int row = row_of(y - radius_m); row <= row_of(y + radius_m); ++row) {
            for (int column = column_of(x - radius_m); column <= column_of(x + radius_m); ++column) {
                const double dx = kLeft_m + (column + 0.5) * kSide_m - x, dy = kBottom_m + (row + 0.5) * kSide_m - y;
                if (!is_inside(column, row) || dx * dx + dy * dy > radius_m * radius_m) continue;
                if (is(static_cast<std::size_t>(row) * kColumns + static_cast<std::size_t>(column))) return true;
            }
        }
        return false;
    }

    double low_m_, high_m_;
    std::vector<Square> squares_;
    std::vector<std::uint8_t> path_;
};

// The world that a SimulatedCamera with these draws.
inline simulated::World world_of(const std::string& name, std::uint64_t seed, std::uint32_t frames) {
    for (const simulated::Scene& scene : simulated::scenes()) {
        if (name == scene.name) return {scene, seed, seed, frames / 30.0, scene.dirt};
    }
    std::abort();
}

}  // namespace stillmesh::test

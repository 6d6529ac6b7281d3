// The simulated office and who is in it: everything that follows from a scene and a seed. Built once; drawn at any
// time.
#pragma once

#include <deque>
#include <vector>

#include "hal/simulated/person.hpp"
#include "hal/simulated/renderer.hpp"
#include "hal/simulated/scene.hpp"
#include "hal/simulated/shadows.hpp"

namespace stillmesh::simulated {

class World {
public:
    // `day` is the seed of all but the room: who is there, and how the camera goes.
    World(const Scene& scene, std::uint64_t seed, std::uint64_t day, double duration_s, const Dirt& dirt);

    // What may move, and what never does, always in the same order; and both.
    void draw_moving(Canvas& canvas, double time_s) const;
    void draw_still(Canvas& canvas) const;
    void draw(Canvas& canvas, double time_s) const;
    // Who casts a shadow at this time.
    void find_posts(double time_s, std::vector<Post>& posts) const;
    [[nodiscard]] const CameraPath& camera() const noexcept { return camera_; }

private:
    struct Quad {
        Vertex corners[4];
        Material material;
    };
    // A texture and how it lies: once over the face, or so many texels a metre.
    struct Coat {
        const Texture* texture = nullptr;
        double texels_per_m = 0;  // 0: once over the face
        Infrared infrared = Infrared::kGood;
    };
    // Furniture that stands still, slides to another place, and stays there.
    struct Movable {
        std::vector<Quad> quads;  // in its own frame
        Vec3 from, to;            // on the floor
        double yaw_rad = 0, turn_rad = 0;
        double begin_s = 0, end_s = 0;
    };
    struct Wall {
        Vec3 corner;  // at the floor, to the left as one looks at the wall
        Vec3 right;   // along the wall
        Vec3 inward;  // into the room
        double width = 0;
    };

    [[nodiscard]] Coat coat(Pattern pattern, double texels_per_m, Infrared infrared = Infrared::kGood);
    // `top_left` as seen from the front; `right` and `down` are its edges.
    void add_quad(std::vector<Quad>& to, const Vec3& top_left, const Vec3& right, const Vec3& down, const Coat& coat,
                  bool is_dynamic = false);
    // Turned about z; `front` faces -y of the box, `rest` the others.
    void add_box(std::vector<Quad>& to, const Vec3& centre, const Vec3& half, double yaw_rad, const Coat& front,
                 const Coat& rest, bool is_dynamic = false);
    void add_on_wall(const Wall& wall, double left, double bottom, double width, double height, double out,
                     const Coat& coat);
    void add_box_at_wall(const Wall& wall, double left, double bottom, double width, double height, double depth,
                         const Coat& front, const Coat& rest);
    void furnish(const Wall& wall, bool is_seen_first);
    void build_corridor();
    void add_shelf(const Wall& wall, double left, double width);
    void add_monitor(double x, double y, double z, double yaw_rad);
    void add_desk(const DeskPlace& place);
    void add_chair(double x, double y, double yaw_rad);
    void add_people(std::uint32_t count);
    void add_trolley();
    void place_trolley();
    void draw_trolley(Canvas& canvas, double time_s) const;
    // A cabin round the camera, open to the room until its doors close, and after that to the room of another floor.
    void add_lift();
    void draw_lift(Canvas& canvas, double time_s) const;
    void add_movables();
    // What goes on in an office beside people: a chair is pushed, a door opens or a mirror shows it all, screens play.
    void add_things();
    void add_door();
    void add_mirror();
    void add_seats();
    void draw_screens(Canvas& canvas, double time_s) const;
    void draw_bodies(Canvas& canvas, double time_s) const;
    static void draw_movable(Canvas& canvas, const Movable& movable, double time_s);
    // The largest share of the picture it holds in the first 10 s, were nothing before it.
    [[nodiscard]] double trolley_peak() const;
    [[nodiscard]] float light_at(const Vec3& at, const Vec3& normal) const noexcept;
    [[nodiscard]] Rigid trolley_at(double time_s) const noexcept;

    Scene scene_;
    std::uint64_t day_;
    Dirt dirt_;
    Random random_;
    double side_;  // -1: mirrored
    double duration_s_;
    CameraPath camera_;
    std::deque<Texture> textures_;  // addresses stay
    std::vector<Quad> quads_;
    std::vector<Quad> trolley_;       // in its own frame
    std::vector<Quad> lift_;          // all that stands still in it
    std::vector<Quad> lift_door_[2];  // the left one and the right one, as they are when shut
    std::vector<Movable> movables_;
    std::vector<Quad> screens_;  // that play
    double bare_left_m_ = 0;     // where the wall before the camera is bare
    bool has_mirror_ = false;
    std::vector<Person> people_;
    double trolley_direction_ = 1;
    double trolley_pace_ = 1;
    double trolley_distance_m_ = 1.12;  // of its lane from the camera's mean place
};

}  // namespace stillmesh::simulated

// The rolling shutter of a colour camera: rows are exposed one after the other, so that a frame has no single pose
// while the camera moves. Kinect, Xtion and most webcams read out in 25 to 30 ms (Ringaby and Forssen, ICCV 2011,
// measured 26 ms on the Kinect's colour camera); at 90 degrees per second that is 2.5 degrees between the first row and
// the last. What a row shows is carried to the time of the middle row with the motion of the frame, taken as constant.
//
// The time of a readout is seldom known. Here it is estimated with the poses: one more unknown beside the six of each
// frame, each frame adds what it knows of it once its own pose is accounted for. A camera that stands still adds next
// to nothing, one that turns a lot. The map was made with a readout too: of two frames that move alike each warps the
// world as the other does, and nothing can be told. So each map point and each pose says how it moves with the readout
// (the derivative is carried through the filters that made them): only the difference counts, and when the readout
// believed changes, the map moves along (Map::express_with_readout). Cost: one pass over the matches a frame; one over
// the map at a change.
#pragma once

#include "engine/geometry/se3.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

class RollingShutter {
public:
    // `readout_s` from the first row to the last; negative: estimated.
    void create(double readout_s, std::uint32_t image_height, const ShutterParameters& parameters = {}) noexcept;
    void reset() noexcept;
    // What a map from before was made with: believed at first, unless the readout is given.
    void start_from(double readout_s) noexcept;

    [[nodiscard]] double readout_s() const noexcept { return readout_s_; }
    [[nodiscard]] bool is_estimated() const noexcept { return is_estimated_; }
    // Seconds from the middle row to the row at y, px.
    [[nodiscard]] double row_time_s(double y_px) const noexcept { return (y_px * inverse_height_ - 0.5) * readout_s_; }

    // How a point measured at y_px moves with the readout, in the camera, m/s; p where it was carried to, `speed` the
    // camera's motion per second, translation m/s and rotation rad/s in its own frame.
    [[nodiscard]] Vector3 by_readout(const Vector3& p, double y_px, const Vector6& speed) const noexcept {
        const Vector3 turning(speed(3), speed(4), speed(5));
        const Vector3 moved = turning.cross(p) + Vector3(speed(0), speed(1), speed(2));
        return moved * (y_px * inverse_height_ - 0.5);
    }

    // What this frame knows of the readout: its static matches one by one, carried to the middle row with `speed`; q is
    // the map's point in the camera, q_by_readout how that moves with the readout, y_px where it was seen.
    void begin_frame() noexcept;
    void add(const Correspondence& c, const Vector3& q, const Vector3& q_by_readout, double y_px, const Vector6& speed,
             double chi2_max) noexcept;
    // How the frame's pose moves with the readout, per second, in the camera. Only what `counts` is learnt from.
    [[nodiscard]] Vector6 end_frame(bool counts) noexcept;
    // What was learnt so far is worth no more than what is known without evidence.
    void doubt() noexcept;
    // Of a trembling camera whose rows said how far it turned (engine/pose/row_turn.hpp): that turn, and the turning
    // from frame to frame, each times the steady turning over the variance of turns. A trembling is in both, but not in
    // step, and its rows alone would tell of a readout too short; in the steady turning it is not.
    void add_turn(double turned, double turning) noexcept;
    // Believes what was learnt, if it is worth it: false, and nothing changed, within step_s.
    bool adopt() noexcept;

private:
    ShutterParameters parameters_;
    double prior_info_ = 0;
    double given_s_ = -1;
    double readout_s_ = 0;   // in use
    double estimate_s_ = 0;  // what readout_s_ should be
    double inverse_height_ = 0;
    bool is_estimated_ = true;
    double info_ = 0;      // of the estimate, 1/s^2
    double weighted_ = 0;  // sum of info * estimate
    // Of the frame at hand: normal equations of pose and readout.
    Matrix6 h_ = Matrix6::Zero();
    Vector6 g_ = Vector6::Zero();
    Vector6 cross_ = Vector6::Zero();
    double h_readout_ = 0;
    double g_readout_ = 0;
    std::uint32_t used_ = 0;
};

}  // namespace stillmesh

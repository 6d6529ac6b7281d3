// The paper to the letter (region.method = 1, `--method paper`): Zhang et al. 2019, so that each of its sentences is
// found in the code, and what we left it for can be measured beside it. Where each of them stands:
//
//   1      a keyframe: pose estimated, fewer than 80 % of the points tracked that the
//          last keyframe tracked, more than 40 new ones                               as_in_paper, KeyframeInserter
//   2.1.1  the mesh over matched features with valid depth at both ends               MeshGroups::triangulate
//   2.1.1  Algorithm 1: an edge is kept below a fixed threshold, tau                  as_in_paper, keeps_distance
//   2.1.2  groups: what the kept edges connect                                        MeshGroups::connect_edges
//   2.1.2  the boundary of each group's own mesh, made anew, and its area             outline_of, twice_area
//   2.1.2  Eq. 1: W1 N / N_all + W2 S / S_all, W1 = 0.5, W2 = 1                       Clusters::choose_best
//   2.1.2  coarse to fine: groups with similar poses and close boundaries are merged  Clusters::merge_two
//   3.1    each group's pose by 3k iterations of RANSAC, k from the last inlier ratio Clusters::fit
//   3.1    similar: below a fifth of the largest error of any pair; close: below 10 px
//          at 640 px width; until no two groups are eligible                          Clusters::merge_two
//   3.1    the pose by 10k iterations, from the members of the best group alone       FrameEstimator::fit_pose
//   2.1.3  the noise of the model                                                     as_in_paper, depth_noise.hpp
//   2.2    Algorithm 2: 0.1 up or down, within [0, 2], words from 1 on                PointJudge, as_in_paper
//
// What stays ours is around the method, not of it: features are matched to the map's points around the prediction,
// which stand for the keyframe's points (the paper matches the latest keyframe by the vocabulary); a sample of RANSAC
// is three points in 3D; the adjustment of the pose with the expected motion; the map and its adjustment. Where the
// text leaves a choice: the error between two poses is metres plus radians; what a frame tracks are the members of its
// best group; the keyframe's points are those that it tracked itself (method.md 13 has what the other reading does).
// The rule of similarity has a known defect, kept: of two groups the only error is the largest, so that two never
// merge.
//
// Limits: the kPosesMax largest groups get a pose, pose.coarse_total_max iterations of RANSAC for all groups of a
// frame. Cost: a merge passes over the pairs of groups, and for those with similar poses over the vertices once for
// each corner of both outlines.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/random.hpp"
#include "engine/static_region/choice.hpp"
#include "engine/static_region/region_input.hpp"

namespace stillmesh {

// The same parameters without our departures in the region's choice, the weights and the keyframe rule: what the
// paper does not have is off, whatever was configured. What it has are our defaults too: tau, p, 3k and 10k, 80 %,
// theta, the static threshold.
[[nodiscard]] Parameters as_in_paper(const Parameters& parameters) noexcept;

// The boundary of the mesh that Delaunay makes of a group's points alone, which is their convex hull: `outline` is its
// corners as indices of groups.mesh().vertices, counter-clockwise (x right, y up). Two corners for points on one line,
// none without points.
void outline_of(const MeshGroups& groups, std::uint16_t group, FixedVector<std::uint16_t>& outline) noexcept;
// Twice that mesh's area, in squared mesh units.
[[nodiscard]] double twice_area(const Mesh& mesh, std::span<const std::uint16_t> outline) noexcept;
// The least distance between two boundary lines; 0 where they cross or touch.
[[nodiscard]] double boundary_distance_px(const Mesh& mesh, std::span<const std::uint16_t> outline,
                                          std::span<const std::uint16_t> other) noexcept;

// Clusters the groups and takes the one with the highest score, ties by the lower number; all its members are `chosen`.
// `groups`, those of the input, are merged: a cluster has the number of its largest group. The score given is Eq. 1
// over W1 + W2, the margin 1: the paper knows no doubt. Not valid, and nothing chosen: no group has a pose.
[[nodiscard]] RegionChoice choose_as_in_paper(const RegionInput& input, MeshGroups& groups,
                                              FixedVector<std::uint16_t>& chosen, Random& random) noexcept;

}  // namespace stillmesh

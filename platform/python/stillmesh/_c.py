"""stillmesh.h for ctypes: constants, structs, functions, and nothing besides. tests/python holds the structs against the
sizes and offsets of the C library."""

import ctypes
import os
from ctypes import (CFUNCTYPE, POINTER, c_char, c_char_p, c_double, c_float, c_int32, c_int64, c_size_t, c_uint8, c_uint16,
                    c_uint32, c_uint64, c_void_p)
from typing import Any, Tuple

OK, FULL, TIMED_OUT, UNAVAILABLE, CORRUPT, INVALID, DEGENERATE, NOT_FOUND, END = range(9)
LENS_BROWN, LENS_FISHEYE = range(2)
GREY8, RGB8, BGR8 = 1, 3, 4
IDLE, WORKING, DONE = range(3)
MAP_CONTINUE, MAP_LOCALISE = range(2)
NO_KEYFRAME = 2**64 - 1
LOOP_LINKS_MAX = 64
LINK_LOOP = 1


class Problem(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("status", c_int32), ("sentence", c_char * 504)]


class Settings(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("is_set", c_uint32), ("inside", c_uint64 * 127)]


class Key(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("kind", c_int32), ("name", c_char_p), ("unit", c_char_p), ("sentence", c_char_p),
                ("value", c_double), ("min", c_double), ("max", c_double)]


class Camera(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("lens", c_int32),
                *[(name, c_double) for name in "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6".split()]]


class Keypoint(ctypes.Structure):
    _fields_ = [("x", c_float), ("y", c_float), ("angle_rad", c_float), ("score", c_uint16), ("level", c_uint8)]


class Descriptor(ctypes.Structure):
    _fields_ = [("words", c_uint64 * 4)]


class Options(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), ("vocabulary", c_void_p), ("vocabulary_bytes", c_size_t),
                ("extractor", c_void_p), ("store", c_void_p)]


class Frame(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("format", c_int32), ("time_ns", c_int64), ("depth_time_ns", c_int64),
                ("width", c_uint32), ("height", c_uint32), ("colour", c_void_p), ("colour_stride_bytes", c_size_t),
                ("depth", c_void_p), ("depth_stride_bytes", c_size_t), ("depth_units_per_m", c_double), ("mask", c_void_p),
                ("mask_stride_bytes", c_size_t)]


class Transform(ctypes.Structure):
    _fields_ = [("rotation_xyzw", c_double * 4), ("translation_m", c_double * 3)]


class MotionHint(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), ("last_from_camera", Transform), ("sigma_m", c_double),
                ("sigma_rad", c_double)]


class Pose(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("state", c_int32), ("time_ns", c_int64), ("odom_from_camera", Transform),
                ("map_from_odom", Transform), ("map_from_camera", Transform), ("covariance", c_double * 36)]


class DepthImage(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), ("columns", c_uint32), ("rows", c_uint32),
                ("depth_mm", c_void_p), ("rays", c_void_p), ("frame", c_uint64), ("map_from_camera", Transform)]


class FrameStatistics(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("unsure", c_int32), ("frame", c_uint64),
                *[(name, c_uint32) for name in "features features_with_depth matches static_matches dynamic_matches "
                  "mesh_edges mesh_edges_kept groups is_keyframe pose_iterations".split()],
                *[(name, c_double) for name in "region_score region_margin chosen_share rival_share".split()],
                ("strayed_since_ns", c_int64)]


_COUNTERS = ("keyframes_evicted keyframes_redundant points_culled points_emptied points_fused points_evicted frames "
             "frames_refused keyframes_made keyframes_forgotten points_forgotten frames_lost recoveries keyframes_refused")
_POOLS = ("keyframes_size keyframes_high_water keyframes_capacity map_points_size map_points_high_water map_points_capacity "
          "keyframe_queue_size keyframe_queue_high_water keyframe_queue_capacity schedule_largest_slice_units "
          "schedule_largest_overdraw_units reserved_too")
_WORK = ("schedule_steps schedule_steps_idle schedule_slices schedule_units_granted schedule_units_spent schedule_units_lost "
         "mapping_keyframes_inserted mapping_adjustments mapping_adjustments_dropped mapping_adjustment_slices "
         "mapping_adjustment_iterations mapping_observations_found mapping_observations_dropped loop_queries "
         "loop_candidates loop_closed loop_confirmed loop_refused_matches loop_refused_pose loop_refused_inliers "
         "loop_refused_spread loop_refused_far loop_refused_unlikely loop_refused_gone loop_dropped loop_points_fused "
         "loop_observations_found loop_graph_iterations loop_adjustments loop_adjustments_dropped "
         "loop_adjustment_iterations")
_LOOPS = ("loop_relocalisations loop_matched_by_words loop_relocalisation_queries loop_relocalisation_candidates store_kept "
          "store_known store_poor store_refused store_asked store_not_found store_late store_damaged store_no_room "
          "store_returned store_useful store_points_made store_points_known store_corrections arena_used_bytes")


class Statistics(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), *[(name, c_uint64) for name in _COUNTERS.split()],
                *[(name, c_uint32) for name in _POOLS.split()], *[(name, c_uint64) for name in _WORK.split()],
                ("loop_largest_correction_m", c_double), ("loop_last_correction_m", c_double),
                *[(name, c_uint64) for name in _LOOPS.split()]]


class TrackedFeature(ctypes.Structure):
    _fields_ = [("x", c_float), ("y", c_float), ("group", c_int32), ("is_matched", c_uint8), ("is_static", c_uint8),
                ("is_dynamic", c_uint8)]


class TrackedEdge(ctypes.Structure):
    _fields_ = [("x0", c_float), ("y0", c_float), ("x1", c_float), ("y1", c_float), ("is_kept", c_uint8)]


class TrackingView(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), ("features", c_void_p), ("features_count", c_size_t),
                ("edges", c_void_p), ("edges_count", c_size_t), ("explained_by", c_void_p)]


class Features(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("reserved", c_uint32), ("keypoints", c_void_p), ("descriptors", c_void_p),
                ("count", c_size_t)]


class Keyframe(ctypes.Structure):
    _fields_ = [("id", c_uint64), ("parent_id", c_uint64), ("map_from_camera", Transform)]


class KeyframeLink(ctypes.Structure):
    _fields_ = [("older_id", c_uint64), ("newer_id", c_uint64), ("shared_points", c_uint32), ("kind", c_uint32)]


class MapInfo(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("extractor", c_uint32), ("size_bytes", c_uint64),
                *[(name, c_uint32) for name in "keyframes points features features_of_keyframe pyramid_levels lens_crc".split()],
                ("scale_factor", c_double), ("time_ns", c_int64), ("frames", c_uint64), ("hash", c_uint64), ("depth_images", c_uint32),
                ("depth_columns", c_uint16), ("depth_rows", c_uint16)]


class MapMerge(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("is_alike", c_uint32),
                *[(name, c_uint32) for name in "keyframes found agreeing points_fused".split()], ("elsewhere_share", c_double),
                ("map_from_second", Transform)]


class MapWriter(ctypes.Structure):
    _fields_ = [("size", c_uint32), ("is_set", c_uint32), ("inside", c_uint64 * 63)]


STAGE_FUNCTION = CFUNCTYPE(None, c_void_p, c_int32, c_int32)

lib = ctypes.CDLL(os.environ.get("STILLMESH_LIBRARY", "libstillmesh_c.so.0"))

_P = POINTER(Problem)
_E = c_void_p
_CALLS: Tuple[Tuple[Any, ...], ...] = (
    ("sm_version", c_char_p), ("sm_status_name", c_char_p, c_int32), ("sm_pose_state_name", c_char_p, c_int32),
    ("sm_unsure_reason_name", c_char_p, c_int32), ("sm_stage_name", c_char_p, c_int32),
    ("sm_settings_init", c_int32, POINTER(Settings), c_char_p, c_char_p, _P),
    ("sm_settings_set", c_int32, POINTER(Settings), c_char_p, c_double, _P),
    ("sm_settings_get", c_int32, POINTER(Settings), c_char_p, POINTER(c_double)),
    ("sm_settings_read", c_int32, POINTER(Settings), c_char_p, c_char_p, _P),
    ("sm_settings_write", c_size_t, POINTER(Settings), c_char_p, c_size_t),
    ("sm_settings_key", c_int32, POINTER(Settings), c_uint32, POINTER(Key)),
    ("sm_settings_check", c_int32, POINTER(Settings), _P),
    ("sm_default_vocabulary", c_void_p, POINTER(c_size_t)), ("sm_engine_bytes", c_size_t, POINTER(Settings)),
    ("sm_engine_create", c_int32, c_void_p, c_size_t, POINTER(Settings), POINTER(Camera), POINTER(Options),
     POINTER(_E), _P),
    ("sm_reset", None, _E), ("sm_start_at", c_int32, _E, POINTER(Transform), _P), ("sm_submit", c_int32, _E, POINTER(Frame), POINTER(MotionHint), _P),
    ("sm_step", c_int32, _E, c_uint32), ("sm_get_pose", c_int32, _E, POINTER(Pose)),
    ("sm_get_frame_statistics", c_int32, _E, POINTER(FrameStatistics)),
    ("sm_get_statistics", c_int32, _E, POINTER(Statistics)),
    ("sm_get_tracking_view", c_int32, _E, POINTER(TrackingView)), ("sm_get_features", c_int32, _E, POINTER(Features)),
    ("sm_keyframe_links", c_uint32, _E, c_void_p, c_uint32, c_uint32),
    ("sm_keyframes", c_uint32, _E, c_void_p, c_uint32), ("sm_reference_keyframe", c_uint64, _E),
    ("sm_get_depth_image", c_int32, _E, c_uint32, POINTER(DepthImage)),
    ("sm_state_hash", c_uint64, _E), ("sm_set_stage_observer", None, _E, STAGE_FUNCTION, c_void_p),
    ("sm_pose_line", c_size_t, POINTER(Pose), c_char_p, c_size_t), ("sm_trajectory_create", c_void_p, _E),
    ("sm_trajectory_destroy", None, c_void_p), ("sm_trajectory_add", c_int32, c_void_p),
    ("sm_trajectory_known", c_size_t, c_void_p, c_void_p, c_void_p, c_size_t),
    ("sm_save_map", c_int32, _E, c_char_p, _P), ("sm_load_map_file", c_int32, _E, c_char_p, c_int32, _P),
    ("sm_load_map", c_int32, _E, c_char_p, c_size_t, c_int32, _P), ("sm_map_copy_bytes", c_size_t, POINTER(Settings)),
    ("sm_set_map_use", c_int32, _E, c_int32, _P),
    ("sm_merge_map", c_int32, _E, c_char_p, c_size_t, POINTER(MapMerge), _P),
    ("sm_merge_map_file", c_int32, _E, c_char_p, POINTER(MapMerge), _P),
    ("sm_fit_map", c_int32, _E, POINTER(Settings), _P),
    ("sm_begin_map_copy", c_int32, _E, c_void_p, c_size_t, _P), ("sm_step_map_copy", c_int32, _E, c_uint32),
    ("sm_map_writer_init", c_int32, POINTER(MapWriter), c_void_p, c_size_t),
    ("sm_map_writer_next", c_size_t, POINTER(MapWriter), c_void_p, c_size_t),
    ("sm_read_map_header", c_int32, c_char_p, c_size_t, POINTER(MapInfo), _P))
for _name, _result, *_arguments in _CALLS:
    _function = getattr(lib, _name)
    _function.restype = _result
    _function.argtypes = _arguments

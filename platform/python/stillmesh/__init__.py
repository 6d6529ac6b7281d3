"""Where an RGB-D camera is while people walk through the picture.

    settings = stillmesh.Settings("room")
    engine = stillmesh.Engine(settings, stillmesh.Camera(640, 480, fx=525, fy=525, cx=319.5, cy=239.5))
    pose = engine.submit(colour, depth, time_ns, depth_units_per_m=1000)     # numpy arrays, not copied
    engine.step()                                                            # background work, until the next frame
    print(pose.state, pose.map_from_camera)                                  # "tracked", 4x4

Only calls of libstillmesh_c (stillmesh.h). An engine is used by one thread. What is refused raises Error with a sentence.
"""

import ctypes
import os
from dataclasses import dataclass, field
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, TypeVar, Union

import numpy as np
import numpy.typing as npt

from . import _c

__all__ = ["Camera", "DEPTH_MOVING", "DepthImage", "Engine", "Error", "Features", "Hint", "Key", "Keyframe", "KeyframeLink", "MapCopy", "MapMerge",
           "Pose", "Settings", "Trajectory", "TrackingView", "read_map_header", "version"]

Matrix = npt.NDArray[np.float64]
# A compound of the engine's own bytes: fields by name.
Records = npt.NDArray[np.void]
Path = Union[str, "os.PathLike[str]"]
_Struct = TypeVar("_Struct", bound=ctypes.Structure)


class Error(Exception):
    """What the library refused: `status` is its name ("invalid"), the text says why and what helps."""

    def __init__(self, status: int, sentence: str) -> None:
        self.status: str = _c.lib.sm_status_name(status).decode()
        super().__init__(sentence or self.status)


def version() -> str:
    return str(_c.lib.sm_version().decode())


def _sized(kind: Callable[[], _Struct]) -> _Struct:
    out = kind()
    out.size = ctypes.sizeof(out)
    return out


def _check(status: int, problem: Optional[_c.Problem] = None) -> None:
    if status != _c.OK:
        raise Error(status, problem.sentence.decode(errors="replace") if problem is not None else "")


def _matrix(transform: _c.Transform) -> Matrix:
    x, y, z, w = transform.rotation_xyzw
    out: Matrix = np.eye(4)
    out[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                   [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                   [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    out[:3, 3] = transform.translation_m
    return out


class Key(NamedTuple):
    """A setting: its value, range, unit and meaning."""
    name: str
    value: float
    min: float
    max: float
    unit: str
    sentence: str


class Settings:
    """Limits, which decide the memory ("room", "pocket", "tiny"), and every key of the configuration, by name."""

    def __init__(self, limits: str = "room", scene: str = "indoor") -> None:
        self._c = _sized(_c.Settings)
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_settings_init(self._c, limits.encode(), scene.encode(), problem), problem)

    def __setitem__(self, key: str, value: float) -> None:
        problem = _sized(_c.Problem)
        status = _c.lib.sm_settings_set(self._c, key.encode(), value, problem)
        if status == _c.NOT_FOUND:
            raise KeyError(problem.sentence.decode())
        _check(status, problem)

    def __getitem__(self, key: str) -> float:
        value = ctypes.c_double()
        if _c.lib.sm_settings_get(self._c, key.encode(), value) != _c.OK:
            raise KeyError(key)
        return value.value

    def __iter__(self) -> Iterator[Key]:
        key = _sized(_c.Key)
        index = 0
        while _c.lib.sm_settings_key(self._c, index, key) == _c.OK:
            yield Key(key.name.decode(), key.value, key.min, key.max, key.unit.decode(), key.sentence.decode())
            index += 1

    def read(self, text: str, name: str = "the text") -> None:
        """The text of a configuration file (TOML): all of it is taken, or nothing."""
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_settings_read(self._c, text.encode(), name.encode(), problem), problem)

    def write(self) -> str:
        """Such a text, with every key."""
        text = ctypes.create_string_buffer(_c.lib.sm_settings_write(self._c, None, 0) + 1)
        _c.lib.sm_settings_write(self._c, text, len(text))
        return text.value.decode()

    def check(self) -> None:
        """Raises what does not go together."""
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_settings_check(self._c, problem), problem)


@dataclass(frozen=True)
class Camera:
    """Pinhole and lens, as OpenCV, ROS and TUM write them; lens "brown" or "fisheye"."""
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0
    k2: float = 0
    p1: float = 0
    p2: float = 0
    k3: float = 0
    k4: float = 0
    k5: float = 0
    k6: float = 0
    lens: str = "brown"

    def _as_c(self) -> _c.Camera:
        out = _sized(_c.Camera)
        for name in self.__dataclass_fields__:
            if name != "lens":
                setattr(out, name, getattr(self, name))
        out.lens = {"brown": _c.LENS_BROWN, "fisheye": _c.LENS_FISHEYE}.get(self.lens, -1)
        return out


@dataclass(frozen=True)
class Hint:
    """What wheels or a gyroscope say of the motion since the last frame: the camera now, seen from the camera then. A negative
    deviation: nothing is said of the translation, or of the rotation."""
    translation_m: Tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation_xyzw: Tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    sigma_m: float = -1.0
    sigma_rad: float = -1.0

    def _as_c(self) -> _c.MotionHint:
        out = _sized(_c.MotionHint)
        out.last_from_camera.translation_m[:] = self.translation_m
        out.last_from_camera.rotation_xyzw[:] = self.rotation_xyzw
        out.sigma_m, out.sigma_rad = self.sigma_m, self.sigma_rad
        return out


@dataclass(frozen=True)
class Pose:
    """state: "none", "predicted", "unsure" or "tracked"; transforms are 4x4, covariance 6x6, translation first."""
    state: str
    time_ns: int
    odom_from_camera: Matrix
    map_from_odom: Matrix
    map_from_camera: Matrix
    covariance: Matrix
    _struct: _c.Pose = field(repr=False, compare=False)

    def line(self) -> str:
        """As TUM's tools write it: time, position, quaternion, camera to map; with its line feed."""
        text = ctypes.create_string_buffer(_c.lib.sm_pose_line(self._struct, None, 0) + 1)
        _c.lib.sm_pose_line(self._struct, text, len(text))
        return text.value.decode()


class Features(NamedTuple):
    """Corners of the last frame and their descriptors (n x 4 words): views of the engine's memory, until the next frame."""
    keypoints: Records
    descriptors: npt.NDArray[np.uint64]


class TrackingView(NamedTuple):
    """What tracking saw in the last frame: views of the engine's memory, until the next frame. explained_by, by feature: 1 by the
    motion chosen, 2 by its rival, 3 by both, 0 by neither."""
    features: Records
    edges: Records
    explained_by: npt.NDArray[np.uint8]


class Keyframe(NamedTuple):
    id: int
    parent_id: Optional[int]
    map_from_camera: Matrix


class KeyframeLink(NamedTuple):
    """Two keyframes that hold each other: by points that both see, or by a loop that was closed or confirmed."""
    older_id: int
    newer_id: int
    shared_points: int
    is_loop: bool


DEPTH_MOVING = 0x8000


class DepthImage(NamedTuple):
    """What was seen at one moment: rows x columns of mm along the camera's axis, 0: none, and x/z, y/z of each cell: views of the
    engine's memory, until the next frame or step. What moved then has DEPTH_MOVING added: it is no part of the room."""
    frame: int
    map_from_camera: Matrix
    depth_mm: npt.NDArray[np.uint16]
    rays: npt.NDArray[np.float32]


class Engine:
    """vocabulary: None for the one of the library, b"" for none (no place is ever recognised), or the bytes of a file."""

    def __init__(self, settings: Settings, camera: Camera, vocabulary: Optional[bytes] = None) -> None:
        settings.check()
        self._memory = np.zeros(_c.lib.sm_engine_bytes(settings._c), np.uint8)
        self._vocabulary = vocabulary  # used where it lies
        self._keyframes_max = int(settings["limits.keyframes_max"])
        self._depth_images_max = int(settings["limits.depth_images_max"])
        self._units = int(settings["schedule.units_per_frame"])
        self._observer: Any = None
        self._map_copy: Optional["MapCopy"] = None
        self._map_copy_bytes = int(_c.lib.sm_map_copy_bytes(settings._c))
        options = _sized(_c.Options)
        if vocabulary:
            options.vocabulary = ctypes.cast(ctypes.c_char_p(vocabulary), ctypes.c_void_p)
            options.vocabulary_bytes = len(vocabulary)
        engine = ctypes.c_void_p()
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_engine_create(self._memory.ctypes.data, self._memory.size, settings._c, camera._as_c(),
                                       options if vocabulary is not None else None, engine, problem), problem)
        self._c = engine

    def start_at(self, translation_m: Sequence[float], rotation_xyzw: Sequence[float] = (0.0, 0.0, 0.0, 1.0)) -> None:
        """Where the camera is at the first frame, in the map that is made from there: before that frame."""
        start, problem = _c.Transform(), _sized(_c.Problem)
        start.translation_m[:], start.rotation_xyzw[:] = translation_m, rotation_xyzw
        _check(_c.lib.sm_start_at(self._c, start, problem), problem)

    def submit(self, colour: npt.NDArray[np.uint8], depth: npt.NDArray[np.uint16], time_ns: int, *,
               depth_units_per_m: float = 1000.0, depth_time_ns: int = 0, hint: Optional[Hint] = None,
               is_bgr: bool = False, mask: Optional[npt.NDArray[np.uint8]] = None) -> Pose:
        """Tracks a frame: grey (h x w) or RGB (h x w x 3; is_bgr: BGR) of uint8, depth of uint16 registered to it, 0 where
        nothing was measured; mask (h x w of uint8): from 128 on, what a detector takes for a body that may move. Rows may
        be apart; nothing is copied."""
        frame = _sized(_c.Frame)
        frame.format = _c.GREY8 if colour.ndim == 2 else _c.BGR8 if is_bgr else _c.RGB8
        _check_image("colour", colour, np.uint8, (1,) if colour.ndim == 2 else (3, 1))
        _check_image("depth", depth, np.uint16, (2,))
        if colour.shape[:2] != depth.shape or (colour.ndim == 3 and colour.shape[2] != 3):
            raise ValueError(f"colour is {colour.shape}, depth {depth.shape}: h x w or h x w x 3, and h x w")
        frame.height, frame.width = depth.shape
        frame.time_ns, frame.depth_time_ns, frame.depth_units_per_m = time_ns, depth_time_ns, depth_units_per_m
        frame.colour, frame.colour_stride_bytes = colour.ctypes.data, colour.strides[0]
        frame.depth, frame.depth_stride_bytes = depth.ctypes.data, depth.strides[0]
        if mask is not None:
            _check_image("mask", mask, np.uint8, (1,))
            if mask.shape != depth.shape:
                raise ValueError(f"mask is {mask.shape}, depth {depth.shape}: h x w, both")
            frame.mask, frame.mask_stride_bytes = mask.ctypes.data, mask.strides[0]
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_submit(self._c, frame, hint._as_c() if hint is not None else None, problem), problem)
        return self.pose

    def step(self, units: Optional[int] = None) -> str:
        """Background work between frames; None: as many units as schedule.units_per_frame. "idle", "working" or "done"."""
        return ("idle", "working", "done")[_c.lib.sm_step(self._c, self._units if units is None else units)]

    def reset(self) -> None:
        """Forgets everything: as a new engine."""
        _c.lib.sm_reset(self._c)

    @property
    def pose(self) -> Pose:
        out = _sized(_c.Pose)
        _check(_c.lib.sm_get_pose(self._c, out))
        return Pose(_c.lib.sm_pose_state_name(out.state).decode(), out.time_ns, _matrix(out.odom_from_camera),
                    _matrix(out.map_from_odom), _matrix(out.map_from_camera),
                    np.array(out.covariance, np.float64).reshape(6, 6), out)

    @property
    def frame_statistics(self) -> Dict[str, Union[int, float, str]]:
        out = _sized(_c.FrameStatistics)
        _check(_c.lib.sm_get_frame_statistics(self._c, out))
        numbers = _numbers(out)
        return {**numbers, "unsure": _c.lib.sm_unsure_reason_name(out.unsure).decode()}

    @property
    def statistics(self) -> Dict[str, Union[int, float]]:
        out = _sized(_c.Statistics)
        _check(_c.lib.sm_get_statistics(self._c, out))
        return _numbers(out)

    @property
    def features(self) -> Features:
        out = _sized(_c.Features)
        _check(_c.lib.sm_get_features(self._c, out))
        descriptors = self._view(out.descriptors, out.count, _c.Descriptor)
        return Features(self._view(out.keypoints, out.count, _c.Keypoint), descriptors["words"])

    @property
    def tracking_view(self) -> TrackingView:
        out = _sized(_c.TrackingView)
        _check(_c.lib.sm_get_tracking_view(self._c, out))
        return TrackingView(self._view(out.features, out.features_count, _c.TrackedFeature),
                            self._view(out.edges, out.edges_count, _c.TrackedEdge),
                            self._view(out.explained_by, out.features_count, ctypes.c_uint8))

    @property
    def keyframes(self) -> List[Keyframe]:
        out = (_c.Keyframe * self._keyframes_max)()
        count = _c.lib.sm_keyframes(self._c, out, len(out))
        return [Keyframe(k.id, None if k.parent_id == _c.NO_KEYFRAME else k.parent_id, _matrix(k.map_from_camera))
                for k in out[:count]]

    def keyframe_links(self, of_each: int = 8) -> List[KeyframeLink]:
        """The graph over the keyframes: loops, the newest first, then each keyframe with the older ones that it shares most points
        with, at most `of_each`."""
        if of_each < 0:
            raise ValueError("of_each is below 0")
        of_each = min(of_each, self._keyframes_max)
        out = (_c.KeyframeLink * (self._keyframes_max * of_each + _c.LOOP_LINKS_MAX))()
        count = _c.lib.sm_keyframe_links(self._c, out, len(out), of_each)
        return [KeyframeLink(k.older_id, k.newer_id, k.shared_points, k.kind == _c.LINK_LOOP) for k in out[:count]]

    @property
    def depth_images(self) -> Iterator[DepthImage]:
        """What keyframes keep of what was seen, at most limits.depth_images_max."""
        for index in range(self._depth_images_max):
            out = _sized(_c.DepthImage)
            _check(_c.lib.sm_get_depth_image(self._c, index, out))
            if out.columns == 0:
                continue
            count = out.rows * out.columns
            yield DepthImage(out.frame, _matrix(out.map_from_camera),
                             self._view(out.depth_mm, count, ctypes.c_uint16).reshape(out.rows, out.columns),
                             self._view(out.rays, 2 * count, ctypes.c_float).reshape(out.rows, out.columns, 2))

    @property
    def reference_keyframe(self) -> Optional[int]:
        """The keyframe that saw most of what the last frame was measured against."""
        number = _c.lib.sm_reference_keyframe(self._c)
        return None if number == _c.NO_KEYFRAME else int(number)

    @property
    def state_hash(self) -> int:
        """Over everything that has been decided so far: equal on every build, frame by frame."""
        return int(_c.lib.sm_state_hash(self._c))

    def observe_stages(self, function: Optional[Callable[[str, bool], None]]) -> None:
        """Calls function(stage, is_begin) around every stage of a frame; None: no more."""
        def call(_: Any, stage: int, is_begin: int) -> None:
            assert function is not None
            function(_c.lib.sm_stage_name(stage).decode(), bool(is_begin))
        self._observer = _c.STAGE_FUNCTION(call) if function is not None else _c.STAGE_FUNCTION(0)
        _c.lib.sm_set_stage_observer(self._c, self._observer, None)

    def save_map(self, file: Path) -> None:
        """Replaces the file as a whole."""
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_save_map(self._c, os.fsencode(file), problem), problem)

    def load_map(self, file: Path, localise: bool = False) -> None:
        """Forgets everything and takes the map of a file; localise: it stays as it is."""
        use = _c.MAP_LOCALISE if localise else _c.MAP_CONTINUE
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_load_map_file(self._c, os.fsencode(file), use, problem), problem)

    def load_map_bytes(self, data: bytes, localise: bool = False) -> None:
        """The same of what a file holds."""
        use = _c.MAP_LOCALISE if localise else _c.MAP_CONTINUE
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_load_map(self._c, data, len(data), use, problem), problem)

    def merge_map(self, file: Path) -> "MapMerge":
        """Joins another map of one place to the one that was just loaded: then step() until "idle", and save_map. Raises Error
        "not found" where no place is the same for certain; the engine has forgotten its map then. Else nothing changes."""
        out, problem = _sized(_c.MapMerge), _sized(_c.Problem)
        _check(_c.lib.sm_merge_map_file(self._c, os.fsencode(file), out, problem), problem)
        return MapMerge._of(out)

    def merge_map_bytes(self, data: bytes) -> "MapMerge":
        """The same of what a file holds."""
        out, problem = _sized(_c.MapMerge), _sized(_c.Problem)
        _check(_c.lib.sm_merge_map(self._c, data, len(data), out, problem), problem)
        return MapMerge._of(out)

    def fit_map(self, settings: Settings) -> None:
        """Forgets, in the order in which full pools do, what the map has above the limits of these settings."""
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_fit_map(self._c, settings._c, problem), problem)

    def set_map_use(self, localise: bool) -> None:
        """localise: from the next frame on the map stays as it is; else it is added to. Until the next load_map or reset."""
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_set_map_use(self._c, _c.MAP_LOCALISE if localise else _c.MAP_CONTINUE, problem), problem)

    def begin_map_copy(self) -> "MapCopy":
        """For a map that is saved while frames come; one at a time."""
        self._map_copy = MapCopy(self, self._map_copy_bytes)  # its memory is the engine's until it is done
        return self._map_copy

    def _view(self, address: Optional[int], count: int, kind: Any) -> Any:
        """Structs that lie in the engine's memory, without a copy; the memory lives as long as the view."""
        if not address or count == 0:
            return np.empty(0, np.dtype(kind))
        begin = address - self._memory.ctypes.data
        view: Any = self._memory[begin:begin + count * ctypes.sizeof(kind)].view(np.dtype(kind))
        view.flags.writeable = False
        return view


class MapMerge(NamedTuple):
    """What came of merge_map: keyframes of the second map, how many of them look like a place of the first, how many of these
    agree on where it lies; points that both had; how much other places look like them, of how much that one does."""
    keyframes: int
    found: int
    agreeing: int
    points_fused: int
    elsewhere_share: float
    map_from_second: Matrix

    @classmethod
    def _of(cls, out: _c.MapMerge) -> "MapMerge":
        return cls(out.keyframes, out.found, out.agreeing, out.points_fused, out.elsewhere_share, _matrix(out.map_from_second))


class MapCopy:
    """The map of one moment: step() between frames until it says True, then blocks() on any thread."""

    def __init__(self, engine: Engine, size: int) -> None:
        self._engine = engine  # lives as long
        memory = np.zeros(size + 63, np.uint8)
        begin = -memory.ctypes.data % 64
        self._memory = memory[begin:begin + size]
        self._is_done = False
        problem = _sized(_c.Problem)
        _check(_c.lib.sm_begin_map_copy(engine._c, self._memory.ctypes.data, size, problem), problem)

    def step(self, units: int = 20000) -> bool:
        """Copies for so many units, as Engine.step; True: all is copied."""
        if not self._is_done:
            self._is_done = _c.lib.sm_step_map_copy(self._engine._c, units) == _c.DONE
        return self._is_done

    def blocks(self) -> Iterator[bytes]:
        """The bytes of the file, piece by piece."""
        writer = _sized(_c.MapWriter)
        if not self._is_done:
            raise Error(_c.INVALID, "the copy is not done: step it until it says True.")
        _check(_c.lib.sm_map_writer_init(writer, self._memory.ctypes.data, self._memory.size))
        piece = ctypes.create_string_buffer(65536)
        while count := _c.lib.sm_map_writer_next(writer, piece, len(piece)):
            yield piece.raw[:count]


class Trajectory:
    """Every frame's pose as it is known at the end, after all corrections: add() after each submit, before step."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine  # lives as long
        self._c = ctypes.c_void_p(_c.lib.sm_trajectory_create(engine._c))
        if not self._c:
            raise MemoryError

    def __del__(self) -> None:
        if getattr(self, "_c", None):
            _c.lib.sm_trajectory_destroy(self._c)

    def add(self) -> None:
        _check(_c.lib.sm_trajectory_add(self._c))

    def known(self) -> Tuple[npt.NDArray[np.int64], Matrix]:
        """Times (ns), and n x 7: position, quaternion x y z w."""
        count = _c.lib.sm_trajectory_known(self._c, None, None, 0)
        times = np.zeros(count, np.int64)
        poses = np.zeros((count, 7), np.float64)
        _c.lib.sm_trajectory_known(self._c, times.ctypes.data, poses.ctypes.data, count)
        return times, poses[:, [4, 5, 6, 0, 1, 2, 3]]


def read_map_header(file: Path) -> Dict[str, Union[int, float]]:
    """What the header of a map file says."""
    with open(file, "rb") as source:
        begin = source.read()
    out = _sized(_c.MapInfo)
    problem = _sized(_c.Problem)
    _check(_c.lib.sm_read_map_header(begin, len(begin), out, problem), problem)
    return _numbers(out)


def _numbers(struct: ctypes.Structure) -> Dict[str, Any]:
    return {str(name): getattr(struct, name) for name, *_ in struct._fields_ if name != "size" and not name.startswith("reserved")}


def _check_image(name: str, image: npt.NDArray[Any], kind: type, strides: Tuple[int, ...]) -> None:
    if image.ndim != len(strides) + 1 or image.dtype != np.dtype(kind):
        raise ValueError(f"{name} is {image.dtype} with {image.ndim} dimensions; {np.dtype(kind)} with {len(strides) + 1} is needed")
    if image.strides[1:] != strides or image.strides[0] < 0:
        raise ValueError(f"the pixels of {name} do not lie side by side: give np.ascontiguousarray({name})")

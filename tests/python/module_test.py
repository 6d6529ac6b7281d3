#!/usr/bin/env python3
"""What the Python module promises, by numpy images of a wall that passes by."""
import ctypes
import gc
import os
import pathlib
import re
import tempfile
import unittest
from xml.etree import ElementTree

import numpy as np

import stillmesh
from stillmesh import _c

SOURCE = pathlib.Path(__file__).resolve().parents[2]
CAMERA = stillmesh.Camera(160, 120, fx=130, fy=130, cx=80, cy=60)


def wall(passed_px):
    row, column = np.mgrid[0:120, 0:160].astype(np.uint32) // np.uint32(1)
    column = (column + np.uint32(passed_px)) // np.uint32(8)
    cell = (column * np.uint32(2654435761)) ^ (row // np.uint32(8) * np.uint32(2246822519))
    return ((cell ^ (cell >> np.uint32(15))) * np.uint32(97)).astype(np.uint8)


DEPTH = np.full((120, 160), 2000, np.uint16)


LARGE_CAMERA = stillmesh.Camera(320, 240, fx=260, fy=260, cx=159.5, cy=119.5)
LARGE_DEPTH = np.full((240, 320), 2000, np.uint16)


def large_wall(passed_px, seed):
    """Cells of 12 px, of many shades, none twice."""
    row, column = np.mgrid[0:240, 0:320]
    cell = ((column + passed_px) // 12 * 40 + row // 12).astype(np.int64)
    shades = np.random.default_rng(seed).integers(0, 256, 4000).astype(np.uint8)
    return shades[cell]


def engine():
    return stillmesh.Engine(stillmesh.Settings("tiny"), CAMERA, b"")


def follow(made, frames=6, begin=0):
    for i in range(begin, begin + frames):
        made.submit(wall(2 * i), DEPTH, i * 33_000_000)
        made.step()
    return made


def layouts_in_c():
    """{struct: (bytes, {field: (offset, bytes)})} of the C library, as abidw describes it."""
    description = ElementTree.parse(SOURCE / "tests/c_api/stillmesh.abi")
    types = {element.get("id"): element for element in description.iter() if element.get("id")}

    def size_of(kind):  # of a typedef: that of what it stands for
        return int(kind.get("size-in-bits")) // 8 if kind.get("size-in-bits") else size_of(types[kind.get("type-id")])
    return {struct.get("name"): (size_of(struct), {
        member[0].get("name"): (int(member.get("layout-offset-in-bits")) // 8, size_of(types[member[0].get("type-id")]))
        for member in struct.findall("data-member")})
            for struct in description.iter("class-decl") if struct.get("size-in-bits")}


class Module(unittest.TestCase):
    def test_structs_are_those_of_the_header(self):
        """Promise: every struct of ctypes has the size and the offsets of the C library's."""
        kinds = {name: kind for name, kind in vars(_c).items()
                 if isinstance(kind, type) and issubclass(kind, ctypes.Structure) and kind is not ctypes.Structure}
        wanted = layouts_in_c()
        self.assertGreater(len(kinds), 15)
        for name, kind in kinds.items():
            c_name = "sm" + re.sub("([A-Z])", lambda m: "_" + m.group(1).lower(), name)
            fields = {field: (getattr(kind, field).offset, getattr(kind, field).size) for field, *_ in kind._fields_}
            self.assertEqual((ctypes.sizeof(kind), fields), wanted[c_name], c_name)

    def test_version(self):
        """Promise: module, library and package have one version."""
        self.assertEqual(stillmesh.version(), os.environ["STILLMESH_VERSION"])
        said = (SOURCE / "platform/python/pyproject.toml").read_text(encoding="utf-8")
        self.assertEqual(re.search(r'^version = "(.*?)"', said, re.M).group(1), stillmesh.version())

    def test_settings(self):
        """Promise: keys are set by name, and what is wrong with one is said."""
        settings = stillmesh.Settings("pocket", "outdoor")
        self.assertEqual(settings["features.count"], 500)
        settings["depth.z_max_m"] = 4.5
        keys = {key.name: key for key in settings}
        self.assertEqual(keys["depth.z_max_m"].value, 4.5)
        self.assertEqual(keys["depth.z_max_m"].unit, "m")
        with self.assertRaisesRegex(KeyError, "depth.zmax"):
            settings["depth.zmax"] = 1
        with self.assertRaisesRegex(stillmesh.Error, "depth.z_max_m.*0.5 to 50 m"):
            settings["depth.z_max_m"] = 500
        other = stillmesh.Settings()
        other.read(settings.write())
        self.assertEqual(list(other), list(settings))
        with self.assertRaisesRegex(stillmesh.Error, "mine.toml.*features.count"):
            other.read("features.cunt = 3\n", "mine.toml")
        other["limits.features_max"] = 400
        with self.assertRaisesRegex(stillmesh.Error, "features.count"):
            stillmesh.Engine(other, CAMERA)
        with self.assertRaisesRegex(stillmesh.Error, "'huge'"):
            stillmesh.Settings("huge")

    def test_follows(self):
        """Promise: the wall is followed, and every output is there."""
        made = follow(engine())
        pose = made.pose
        self.assertIn(pose.state, ("tracked", "unsure"))
        self.assertAlmostEqual(pose.map_from_camera[0, 3], 5 * 4 / 130, delta=0.01)
        np.testing.assert_allclose(pose.map_from_odom @ pose.odom_from_camera, pose.map_from_camera, atol=1e-12)
        self.assertEqual(pose.covariance.shape, (6, 6))
        self.assertTrue(pose.line().startswith("0.165000000 0.15"))
        self.assertEqual(made.statistics["frames"], 6)
        self.assertEqual(made.frame_statistics["frame"], 5)
        features = made.features
        self.assertEqual(len(features.keypoints), made.frame_statistics["features"])
        self.assertEqual(features.descriptors.shape, (len(features.keypoints), 4))
        view = made.tracking_view
        self.assertEqual(len(view.features), len(features.keypoints))
        self.assertEqual(len(view.edges), made.frame_statistics["mesh_edges"])
        self.assertEqual(len(view.explained_by), len(view.features))
        static = view.features["is_static"] != 0
        self.assertGreater((view.explained_by[static] & 1).mean(), 0.9)
        self.assertGreater(made.frame_statistics["chosen_share"], 0.5)
        self.assertEqual(len(made.keyframes), made.statistics["keyframes_size"])
        self.assertIn(made.reference_keyframe, [keyframe.id for keyframe in made.keyframes])
        self.assertIn(made.step(0), ("idle", "working"))

    def test_what_was_seen(self):
        """Promise: a small depth image is what its frame measured, in mm, with the rays of its cells; where the limits have no room
        there is none."""
        self.assertEqual(list(follow(engine()).depth_images), [])
        settings = stillmesh.Settings("tiny")
        settings["limits.depth_images_max"] = 8
        made = follow(stillmesh.Engine(settings, CAMERA, b""), 45)  # they begin after a second
        seen = next(made.depth_images)
        self.assertEqual(seen.depth_mm.shape + (2,), seen.rays.shape)
        self.assertTrue(np.all(np.abs(seen.depth_mm[seen.depth_mm > 0].astype(int) - 2000) <= 1))
        self.assertGreater(int(np.count_nonzero(seen.depth_mm)), seen.depth_mm.size // 2)
        self.assertTrue(np.all(np.diff(seen.rays[0, :, 0]) > 0))
        self.assertEqual(seen.map_from_camera.shape, (4, 4))

    def test_copies_nothing(self):
        """Promise: images are read where they lie, in parts of larger ones too, and results are views that keep their memory."""
        plain, parts = engine(), engine()
        for i in range(4):
            grey = wall(2 * i)
            large, deep = np.zeros((130, 170), np.uint8), np.zeros((130, 170), np.uint16)
            large[5:125, 7:167], deep[3:123, 9:169] = grey, DEPTH
            before = large.copy()
            plain.submit(grey, DEPTH, i)
            parts.submit(large[5:125, 7:167], deep[3:123, 9:169], i)
            np.testing.assert_array_equal(large, before)
            self.assertEqual(plain.state_hash, parts.state_hash)
        view = parts.features.keypoints
        self.assertTrue(np.shares_memory(view, parts._memory))
        self.assertFalse(view.flags.writeable)
        kept = view.copy()
        del parts
        gc.collect()
        np.testing.assert_array_equal(view, kept)

    def test_colour(self):
        """Promise: RGB, BGR and grey of one picture are one picture."""
        hashes = set()
        colour = np.random.default_rng(1).integers(0, 256, (15, 20, 3), np.uint8).repeat(8, 0).repeat(8, 1)
        for image, is_bgr in ((colour, False), (np.ascontiguousarray(colour[:, :, ::-1]), True)):
            made = engine()
            made.submit(image, DEPTH, 1, is_bgr=is_bgr)
            hashes.add(made.state_hash)
        self.assertEqual(len(hashes), 1)

    def test_refuses(self):
        """Promise: what is no frame is refused with words, and the engine goes on."""
        made = follow(engine(), 1)
        good = wall(2)
        for colour, depth, words in ((good.astype(np.int16), DEPTH, "colour is int16"), (good, DEPTH.astype(np.float32), "depth is"),
                                     (good[:, ::-1], DEPTH, "side by side"), (good.T, DEPTH, "side by side"),
                                     (good[:100], DEPTH, "h x w"), (good[::-1], DEPTH, "side by side")):
            with self.assertRaisesRegex(ValueError, words):
                made.submit(colour, depth, 99)
        with self.assertRaisesRegex(stillmesh.Error, "time_ns") as caught:
            made.submit(good, DEPTH, 0)
        self.assertEqual(caught.exception.status, "invalid")
        with self.assertRaisesRegex(stillmesh.Error, "quaternion"):
            made.submit(good, DEPTH, 99, hint=stillmesh.Hint(rotation_xyzw=(0, 0, 0, 2), sigma_rad=1))
        with self.assertRaisesRegex(stillmesh.Error, "camera.width.*160"):
            stillmesh.Engine(stillmesh.Settings("tiny"), stillmesh.Camera(640, 480, 525, 525, 320, 240))
        with self.assertRaisesRegex(stillmesh.Error, "camera.lens"):
            stillmesh.Engine(stillmesh.Settings("tiny"), stillmesh.Camera(160, 120, 130, 130, 80, 60, lens="fish"))
        with self.assertRaisesRegex(stillmesh.Error, "vocabulary"):
            stillmesh.Engine(stillmesh.Settings("tiny"), CAMERA, b"no vocabulary")
        self.assertEqual(made.submit(good, DEPTH, 99, hint=stillmesh.Hint((0.03, 0, 0), sigma_m=0.01)).time_ns, 99)

    def test_reset_and_observer(self):
        """Promise: a reset engine is a new one; stages are told as long as somebody listens."""
        made = engine()
        begin = made.state_hash
        told = []
        made.observe_stages(lambda stage, is_begin: told.append((stage, is_begin)))
        follow(made)
        self.assertEqual(told[0], ("prepare", True))
        self.assertEqual(sum(b for _, b in told) * 2, len(told))
        made.observe_stages(None)
        end, count = made.state_hash, len(told)
        made.reset()
        self.assertEqual(made.state_hash, begin)
        self.assertEqual(follow(made).state_hash, end)
        self.assertEqual(len(told), count)

    def test_maps(self):
        """Promise: a map goes to a file and comes back whole, or not at all."""
        with tempfile.TemporaryDirectory() as folder:
            made, file = follow(engine()), pathlib.Path(folder) / "wall.map"
            made.save_map(file)
            self.assertEqual(stillmesh.read_map_header(file)["keyframes"], len(made.keyframes))
            other = engine()
            other.load_map(file, localise=True)
            self.assertEqual(len(other.keyframes), len(made.keyframes))
            file.write_bytes(file.read_bytes()[:-1])
            with self.assertRaisesRegex(stillmesh.Error, "cut off"):
                other.load_map(file)
            with self.assertRaisesRegex(stillmesh.Error, "none.map"):
                other.load_map(pathlib.Path(folder) / "none.map")

    def test_maps_in_slices(self):
        """Promise: a map that is copied between frames is that of one moment, the bytes of save_map, and comes back from bytes."""
        with tempfile.TemporaryDirectory() as folder:
            made, file = follow(engine()), pathlib.Path(folder) / "wall.map"
            made.save_map(file)
            copy, slices = made.begin_map_copy(), 1
            with self.assertRaisesRegex(stillmesh.Error, "not done"):
                next(copy.blocks())
            while not copy.step(units=1):
                slices += 1
            self.assertGreater(slices, 1)
            follow(made, begin=6)  # does not change what was copied
            data = b"".join(copy.blocks())
            self.assertEqual(data, file.read_bytes())
            other = engine()
            other.load_map_bytes(data, localise=True)
            self.assertGreater(len(other.keyframes), 0)
            with self.assertRaisesRegex(stillmesh.Error, "cut off"):
                other.load_map_bytes(data[:-1])

    def test_maps_in_one(self):
        """Promise: two maps of one wall become one, in the coordinates of the first, with links between keyframes that see the same,
        which is fitted into limits and comes back;
        of another wall, damaged, or without a vocabulary they are refused with a sentence."""
        settings = stillmesh.Settings("pocket")
        settings["limits.keyframes_max"] = 80
        settings["limits.map_points_max"] = 11000

        def mapped(begin, seed, frames=40):
            made = stillmesh.Engine(settings, LARGE_CAMERA)
            for i in range(begin, begin + frames):
                made.submit(large_wall(12 * i, seed), LARGE_DEPTH, (i - begin) * 33_000_000)
                made.step()
            with tempfile.TemporaryDirectory() as folder:
                made.save_map(pathlib.Path(folder) / "wall.map")
                return (pathlib.Path(folder) / "wall.map").read_bytes()
        first, second, other = mapped(0, 1), mapped(10, 1), mapped(0, 2)
        made = stillmesh.Engine(settings, LARGE_CAMERA)
        made.load_map_bytes(first)
        count = len(made.keyframes)
        merge = made.merge_map_bytes(second)
        self.assertGreaterEqual(merge.agreeing, 4)
        self.assertEqual(len(made.keyframes), count + merge.keyframes)
        ids = {keyframe.id for keyframe in made.keyframes}
        links = made.keyframe_links()
        self.assertGreaterEqual(len(links), len(ids) - 1)
        for link in links:
            self.assertTrue({link.older_id, link.newer_id} <= ids and link.older_id < link.newer_id and link.shared_points > 0)
            self.assertIs(link.is_loop, False)
        self.assertLess(len(made.keyframe_links(of_each=1)), len(links))
        self.assertEqual(made.keyframe_links(of_each=0), [])
        with self.assertRaises(ValueError):
            made.keyframe_links(of_each=-1)
        # 120 px to the right at 2 m.
        np.testing.assert_allclose(merge.map_from_second[:3, 3], (120 * 2 / 260, 0, 0), atol=0.02)
        while made.step() != "idle":
            pass
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "second.map"
            file.write_bytes(second)
            made.load_map_bytes(first)
            again = made.merge_map(file)
            self.assertEqual(again[:5], merge[:5])
        settings["limits.keyframes_max"] = 5
        made.fit_map(settings)
        self.assertEqual(len(made.keyframes), 5)
        made.load_map_bytes(first)
        with self.assertRaisesRegex(stillmesh.Error, "damaged"):
            made.merge_map_bytes(second[:-1] + bytes([second[-1] ^ 1]))
        with self.assertRaisesRegex(stillmesh.Error, "cannot be joined"):
            made.merge_map_bytes(other)
        with self.assertRaisesRegex(stillmesh.Error, "just loaded"):
            made.merge_map_bytes(second)


if __name__ == "__main__":
    unittest.main()

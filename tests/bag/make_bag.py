#!/usr/bin/env python3
"""Makes a bag of a recording's frames: ROS 1 by Debian's rosbag, SQLite by Python's sqlite3, MCAP by the writer below
(and by another hand: foreign/write_mcap.mjs, from a dump). The messages of ROS 1 are those of Debian's sensor_msgs; CDR is
written here.

  make_bag.py FRAMES OUT --format ros1|db3|mcap|dump [options]

FRAMES is a folder with frames.json (see bag_maker.hpp) and the images it names; OUT is a file, or a folder with --parts.
"""
import argparse
import json
import os
import sqlite3
import struct
import zlib

import messages
from messages import Messages, grey_to, padded, png

HIGH = {"colour": "/camera/rgb/image_raw", "depth": "/camera/depth/image_raw", "info": "/camera/rgb/camera_info",
        "depth_info": "/camera/depth/camera_info"}
REALSENSE = {"colour": "/device_0/sensor_1/Color_0/image/data", "depth": "/device_0/sensor_0/Depth_0/image/data",
             "info": "/device_0/sensor_1/Color_0/info/camera_info",
             "depth_info": "/device_0/sensor_0/Depth_0/info/camera_info",
             "unit": "/device_0/sensor_0/option/Depth Units/value"}


class Ros1Bag:
    def __init__(self, path, packing, chunk_bytes):
        import rosbag
        import genpy
        self.genpy = genpy
        self.bag = rosbag.Bag(path, "w", compression=packing, chunk_threshold=chunk_bytes)

    def write(self, topic, _kind, time_ns, message):
        self.bag.write(topic, message, self.genpy.Time(time_ns // 10**9, time_ns % 10**9))

    def flush(self):
        self.bag._file.flush()

    def close(self):
        self.bag.close()


class Db3Bag:
    """As rosbag2_storage_sqlite3 makes it."""

    def __init__(self, path, packing, _chunk_bytes):
        self.pack = zstd_pack if packing == "zstd" else lambda data: data
        self.base = sqlite3.connect(path)
        self.base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,"
                          "serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL)")
        self.base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,"
                          "timestamp INTEGER NOT NULL,data BLOB NOT NULL)")
        self.base.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        self.topics = {}

    def write(self, topic, kind, time_ns, message):
        if topic not in self.topics:
            self.topics[topic] = len(self.topics) + 1
            self.base.execute("INSERT INTO topics VALUES(?,?,?,'cdr','')", (self.topics[topic], topic, kind))
        self.base.execute("INSERT INTO messages(topic_id,timestamp,data) VALUES(?,?,?)",
                          (self.topics[topic], time_ns, self.pack(message)))

    def flush(self):
        self.base.commit()

    def close(self):
        self.base.commit()
        self.base.close()


def zstd_pack(data):
    import zstandard
    return zstandard.ZstdCompressor(level=1).compress(data)


def lz4_pack(data):
    import lz4.frame
    return lz4.frame.compress(data)


class McapBag:
    """By mcap.dev/spec: chunks with checksums, then a data end and a footer without a summary."""

    def __init__(self, path, packing, chunk_bytes):
        self.file = open(path, "wb")
        self.packing = "" if packing == "none" else packing
        self.pack = {"": lambda data: data, "lz4": lz4_pack, "zstd": zstd_pack}[self.packing]
        self.chunk_bytes, self.chunk, self.times = chunk_bytes, bytearray(), []
        self.schemas, self.channels, self.count = {}, {}, 0
        self.file.write(b"\x89MCAP0\r\n" + self.record(1, self.text("ros2") + self.text("stillmesh tests")))

    @staticmethod
    def text(value):
        return struct.pack("<I", len(value.encode())) + value.encode()

    @staticmethod
    def record(kind, data):
        return struct.pack("<BQ", kind, len(data)) + data

    def write(self, topic, kind, time_ns, message):
        if kind not in self.schemas:
            self.schemas[kind] = len(self.schemas) + 1
            self.chunk += self.record(3, struct.pack("<H", self.schemas[kind]) + self.text(kind) +
                                      self.text("ros2msg") + self.text("not needed"))
        if topic not in self.channels:
            self.channels[topic] = len(self.channels)
            self.chunk += self.record(4, struct.pack("<HH", self.channels[topic], self.schemas[kind]) +
                                      self.text(topic) + self.text("cdr") + struct.pack("<I", 0))
        self.chunk += self.record(5, struct.pack("<HIQQ", self.channels[topic], self.count, time_ns, time_ns) + message)
        self.count += 1
        self.times.append(time_ns)
        if len(self.chunk) >= self.chunk_bytes:
            self.end_chunk()

    def end_chunk(self):
        data = bytes(self.chunk)
        packed = self.pack(data)
        self.file.write(self.record(6, struct.pack("<QQQI", min(self.times), max(self.times), len(data),
                                                   zlib.crc32(data)) + self.text(self.packing) +
                                    struct.pack("<Q", len(packed)) + packed))
        self.chunk, self.times = bytearray(), []

    def flush(self):
        self.file.flush()

    def close(self):
        if self.times:
            self.end_chunk()
        self.file.write(self.record(15, struct.pack("<I", 0)) + self.record(2, struct.pack("<QQI", 0, 0, 0)) +
                        b"\x89MCAP0\r\n")
        self.file.close()


class Dump:
    """Messages for another writer: lengths of a line of JSON and of the message, then both."""

    def __init__(self, path, _packing, _chunk_bytes):
        self.file = open(path, "wb")

    def write(self, topic, kind, time_ns, message):
        line = json.dumps({"topic": topic, "kind": kind, "time_ns": str(time_ns)}).encode()
        self.file.write(struct.pack("<II", len(line), len(message)) + line + message)

    def close(self):
        self.file.close()


class Maker:
    def __init__(self, options):
        self.options = options
        with open(os.path.join(options.frames, "frames.json"), encoding="utf-8") as file:
            self.recording = json.load(file)
        self.width, self.height = self.recording["width"], self.recording["height"]
        self.depth_camera = self.recording.get("depth_camera")
        of_depth = self.depth_camera or self.recording
        self.depth_width, self.depth_height = of_depth["width"], of_depth["height"]
        self.names = dict(REALSENSE if options.realsense else HIGH)
        self.messages = Messages(options.format == "ros1", options.big_endian)
        self.names.update(json.loads(options.names))

    def kind(self, name, package="sensor_msgs"):
        return f"{package}/{name}" if self.options.format == "ros1" else f"{package}/msg/{name}"

    def read(self, name):
        with open(os.path.join(self.options.frames, name), "rb") as file:
            return file.read()

    def colour(self, frame):
        encoding, stamp = self.options.colour, frame["colour_ns"]
        name, frame_id = self.names["colour"], self.options.frame_id
        if encoding == "file":
            kind = "jpeg" if frame["colour_file"].endswith(".jpg") else "png"
            message = self.messages.compressed(stamp, frame_id, f"rgb8; {kind} compressed bgr8",
                                               self.read(frame["colour_file"]))
            return name + "/compressed", self.kind("CompressedImage"), message
        data, size = grey_to(encoding, self.read(frame["colour"]))
        padding = self.options.padding
        data = padded(data, size * self.width, self.height, padding) if padding else data
        return name, self.kind("Image"), self.messages.image(stamp, frame_id, self.height, self.width, encoding,
                                                             size * self.width + padding, data)

    def depth(self, frame):
        encoding, stamp = self.options.depth, frame["depth_ns"]
        name, frame_id = self.names["depth"], self.options.depth_frame_id or self.options.frame_id
        data, width, height = self.read(frame["depth"]), self.depth_width, self.depth_height
        values = struct.unpack(f"<{width * height}H", data)
        if encoding == "32FC1":
            floats = [v / 5000 if v else float("nan") for v in values]
            data = struct.pack(f"<{len(floats)}f", *floats)
        elif encoding == "16UC1_big":
            data = struct.pack(f">{len(values)}H", *values)
        elif encoding.startswith("compressedDepth"):
            head = struct.pack("<iff", 0, 0, 0)
            kind = "16UC1; compressedDepth png"
            if encoding == "compressedDepth32":
                kind, a, b = "32FC1; compressedDepth png", 100.0 * (100.0 + 1), 1 - 100.0 * (100.0 + 1) / 100.0
                head = struct.pack("<iff", 0, a, b)
                values = [min(65535, int(a / (v / 5000) + b)) if v else 0 for v in values]
            swapped = struct.pack(f">{len(values)}H", *values)
            rows = [swapped[2 * y * width:2 * (y + 1) * width] for y in range(height)]
            message = self.messages.compressed(stamp, frame_id, kind, head + png(width, height, 16, 0, rows))
            return name + "/compressedDepth", self.kind("CompressedImage"), message
        if self.options.small_depth:
            values = [values[2 * y * width + 2 * x] for y in range(height // 2) for x in range(width // 2)]
            data, width, height = struct.pack(f"<{len(values)}H", *values), width // 2, height // 2
        size = 4 if encoding == "32FC1" else 2
        return name, self.kind("Image"), self.messages.image(
            stamp, frame_id, height, width, encoding.replace("_big", ""), size * width, data,
            1 if encoding == "16UC1_big" else 0)

    def camera(self, which):
        camera = {"model": "plumb_bob", "d": [0.0] * 5}
        of = self.depth_camera if which == "depth_info" and self.depth_camera else self.recording
        for key in ("width", "height", "fx", "fy", "cx", "cy"):
            camera[key] = of[key]
        if self.options.realsense:
            camera["model"] = "Inverse Brown Conrady"
        if which == "depth_info" and self.options.other_depth_camera:
            camera["fx"] += 40
        camera.update(json.loads(self.options.camera))
        return camera

    def transforms(self, time_ns):
        """Of two branches of a tree from camera_link; of RealSense what takes a reference into each stream."""
        t, q = self.depth_camera["t"], self.depth_camera["q"]  # colour from depth
        turn = [0.5, -0.5, 0.5, -0.5]  # camera_link from an optical frame
        if self.options.realsense:
            still = ([0, 0, 0], [0, 0, 0, 1])
            for which, transform in (("depth", still), ("colour", (t, q))):
                topic = self.names[which].replace("/image/data", "/tf/0")
                yield time_ns, topic, self.kind("Transform", "geometry_msgs"), self.messages.transform(*transform)
            return
        depth, colour = self.options.depth_frame_id, self.options.frame_id
        back = messages.inverse(t, q)
        links = [("camera_link", "camera_depth_frame", [0.01, 0.02, 0.03], [0, 0, 0, 1]),
                 ("camera_depth_frame", depth, [0, 0, 0], turn),
                 (depth, "a_frame_between", *back), ("a_frame_between", colour, [0, 0, 0], [0, 0, 0, 1])]
        yield time_ns, "/tf_static", self.kind("TFMessage", "tf2_msgs"), self.messages.transforms(time_ns, links)

    def all(self):
        """(time, topic, kind, message) of the whole bag."""
        options = self.options
        for number, frame in enumerate(self.recording["frames"] * options.rounds):
            lap = number // len(self.recording["frames"])
            frame = dict(frame)
            for key in ("colour_ns", "depth_ns"):
                frame[key] += lap * options.lap_ns
            time_ns = max(frame["colour_ns"], frame["depth_ns"])
            if number % options.info_every == 0 and not options.no_info:
                for which in ("info", "depth_info") if options.depth_info else ("info",):
                    frame_id = options.frame_id if which == "info" else options.depth_frame_id or options.frame_id
                    yield (time_ns, self.names[which], self.kind("CameraInfo"),
                           self.messages.info(time_ns, frame_id, self.camera(which)))
                if self.depth_camera and number == 0 and not options.no_tf:
                    yield from self.transforms(time_ns)
                if options.realsense and number == 0:
                    yield (time_ns, self.names["unit"], self.kind("Float32", "std_msgs"),
                           self.messages.number(options.unit_m))
            pair = [self.colour(frame)]
            if options.skip_depth == 0 or number % options.skip_depth != options.skip_depth - 1:
                pair.append(self.depth(frame))
            for topic, kind, message in reversed(pair) if options.depth_first else pair:
                yield time_ns, topic, kind, message

    def ordered(self):
        """Depth may come some messages later than its colour."""
        late = []
        for entry in self.all():
            if "epth" in entry[1] and not entry[2].endswith(("CameraInfo", "Float32", "Transform")) and self.options.late_depth:
                late.append(entry)
                if len(late) > self.options.late_depth:
                    yield late.pop(0)
            else:
                yield entry
        yield from late

    def open(self, path):
        kinds = {"ros1": Ros1Bag, "db3": Db3Bag, "mcap": McapBag, "dump": Dump}
        return kinds[self.options.format](path, self.options.packing, self.options.chunk_bytes)

    def make(self):
        options = self.options
        if options.parts == 0:
            bag = self.open(options.out)
            for time_ns, topic, kind, message in self.ordered():
                bag.write(topic, kind, time_ns, message)
            if options.killed:
                bag.flush()
                os._exit(0)
            bag.close()
            return
        entries, names = list(self.ordered()), []
        os.makedirs(options.out)
        size = -(-len(entries) // options.parts)
        for part in range(options.parts):
            names.append(f"rec_{part}.{options.format}")
            bag = self.open(os.path.join(options.out, names[-1]))
            for time_ns, topic, kind, message in entries[part * size:(part + 1) * size]:
                bag.write(topic, kind, time_ns, message)
            bag.close()
        if not options.no_metadata:
            with open(os.path.join(options.out, "metadata.yaml"), "w", encoding="utf-8") as file:
                file.write("rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n"
                           "  relative_file_paths:\n" + "".join(f"    - {name}\n" for name in names) +
                           "  message_count: 0\n  topics_with_message_count: []\n")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("frames")
    parser.add_argument("out")
    parser.add_argument("--format", choices=("ros1", "db3", "mcap", "dump"), required=True)
    parser.add_argument("--packing", default="none")
    parser.add_argument("--colour", default="mono8")
    parser.add_argument("--depth", default="16UC1")
    parser.add_argument("--chunk-bytes", type=int, default=768 * 1024)
    parser.add_argument("--frame-id", default="camera_rgb_optical_frame")
    parser.add_argument("--depth-frame-id", default="")
    parser.add_argument("--names", default="{}", help="of topics, as JSON")
    parser.add_argument("--camera", default="{}", help="what its CameraInfo has otherwise, as JSON")
    parser.add_argument("--unit-m", type=float, default=0.001)
    for number in ("padding", "parts", "skip-depth", "late-depth", "lap-ns"):
        parser.add_argument("--" + number, type=int, default=0)
    for number in ("rounds", "info-every"):
        parser.add_argument("--" + number, type=int, default=1)
    for switch in ("big-endian", "realsense", "depth-info", "other-depth-camera", "no-info", "no-metadata", "depth-first",
                   "small-depth", "killed", "no-tf"):
        parser.add_argument("--" + switch, action="store_true")
    Maker(parser.parse_args()).make()


if __name__ == "__main__":
    main()

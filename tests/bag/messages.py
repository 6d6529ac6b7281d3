"""Messages of ROS for tests: those of ROS 1 by Debian's sensor_msgs, CDR by hand, and the pixels in them."""
import struct
import zlib


def png(width, height, depth, kind, rows):
    def piece(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    header = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0)
    body = zlib.compress(b"".join(b"\0" + row for row in rows), 1)
    return b"\x89PNG\r\n\x1a\n" + piece(b"IHDR", header) + piece(b"IDAT", body) + piece(b"IEND", b"")


def grey_to(encoding, grey):
    """The bytes of an image whose luma, or each of whose colours, is `grey`; of RGB red is 3 more and blue 5 less."""
    if encoding == "mono8":
        return grey, 1
    red, blue = (grey.translate(bytes((g + more) & 255 for g in range(256))) for more in (3, -5))
    if encoding in ("yuv422", "yuv422_yuy2"):
        out = bytearray(2 * len(grey))
        out[0 if encoding == "yuv422_yuy2" else 1::2] = grey
        out[1 if encoding == "yuv422_yuy2" else 0::2] = bytes([100]) * len(grey)
        return bytes(out), 2
    order = {"rgb8": (red, grey, blue), "bgr8": (blue, grey, red), "rgba8": (red, grey, blue, grey),
             "bgra8": (blue, grey, red, grey)}[encoding]
    out = bytearray(len(order) * len(grey))
    for i, plane in enumerate(order):
        out[i::len(order)] = plane
    return bytes(out), len(order)


def padded(data, row_bytes, height, padding):
    return b"".join(data[y * row_bytes:(y + 1) * row_bytes] + b"\xee" * padding for y in range(height))


class Cdr:
    """XCDR version 1, little or big endian."""

    def __init__(self, is_big):
        self.order = ">" if is_big else "<"
        self.out = bytearray()
        self.is_big = is_big

    def put(self, kind, value):
        size = struct.calcsize("=" + kind)
        self.out += b"\0" * (-len(self.out) % size) + struct.pack(self.order + kind, value)

    def text(self, value):
        data = value.encode() + b"\0"
        self.put("I", len(data))
        self.out += data

    def header(self, stamp_ns, frame):
        self.put("i", stamp_ns // 10**9)
        self.put("I", stamp_ns % 10**9)
        self.text(frame)

    def done(self):
        return bytes([0, 0 if self.is_big else 1, 0, 0]) + bytes(self.out)


def inverse(t, q):
    """Of a rigid transform: translation and unit quaternion (x y z w)."""
    back = [-q[0], -q[1], -q[2], q[3]]

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    once = cross(back[:3], t)
    twice = cross(back[:3], once)
    return [-(t[i] + 2 * (back[3] * once[i] + twice[i])) for i in range(3)], back


class Messages:
    """Serialised messages of both worlds from the same values."""

    def __init__(self, is_ros1, is_big):
        self.is_ros1, self.is_big = is_ros1, is_big
        if is_ros1:
            import sensor_msgs.msg
            import std_msgs.msg
            import genpy
            self.kinds, self.std, self.genpy = sensor_msgs.msg, std_msgs.msg, genpy

    def headed(self, message, stamp_ns, frame):
        message.header.stamp = self.genpy.Time(stamp_ns // 10**9, stamp_ns % 10**9)
        message.header.frame_id = frame
        return message

    def image(self, stamp_ns, frame, height, width, encoding, step, data, is_bigendian=0):
        if self.is_ros1:
            return self.headed(self.kinds.Image(height=height, width=width, encoding=encoding, step=step, data=data,
                                                is_bigendian=is_bigendian), stamp_ns, frame)
        out = Cdr(self.is_big)
        out.header(stamp_ns, frame)
        out.put("I", height)
        out.put("I", width)
        out.text(encoding)
        out.put("B", is_bigendian)
        out.put("I", step)
        out.put("I", len(data))
        out.out += data
        return out.done()

    def compressed(self, stamp_ns, frame, kind, data):
        if self.is_ros1:
            return self.headed(self.kinds.CompressedImage(format=kind, data=data), stamp_ns, frame)
        out = Cdr(self.is_big)
        out.header(stamp_ns, frame)
        out.text(kind)
        out.put("I", len(data))
        out.out += data
        return out.done()

    def info(self, stamp_ns, frame, camera):
        k = [camera["fx"], 0, camera["cx"], 0, camera["fy"], camera["cy"], 0, 0, 1]
        p = camera.get("p", [k[0], 0, k[2], 0, 0, k[4], k[5], 0, 0, 0, 1, 0])
        r = [1, 0, 0, 0, 1, 0, 0, 0, 1]
        if self.is_ros1:
            out = self.kinds.CameraInfo(height=camera["height"], width=camera["width"], D=camera["d"], K=k, R=r, P=p,
                                        distortion_model=camera["model"], binning_x=camera.get("binning", 0))
            return self.headed(out, stamp_ns, frame)
        out = Cdr(self.is_big)
        out.header(stamp_ns, frame)
        out.put("I", camera["height"])
        out.put("I", camera["width"])
        out.text(camera["model"])
        out.put("I", len(camera["d"]))
        for value in list(camera["d"]) + k + r + p:
            out.put("d", value)
        for value in (camera.get("binning", 0), 0, 0, 0, 0, 0):
            out.put("I", value)
        out.put("B", 0)
        return out.done()

    def number(self, value):
        if self.is_ros1:
            return self.std.Float32(value)
        out = Cdr(self.is_big)
        out.put("f", value)
        return out.done()

    def transform(self, t, q):
        if self.is_ros1:
            import geometry_msgs.msg as kinds
            return kinds.Transform(kinds.Vector3(*t), kinds.Quaternion(*q))
        out = Cdr(self.is_big)
        for value in list(t) + list(q):
            out.put("d", value)
        return out.done()

    def transforms(self, stamp_ns, links):
        """Links: parent, child, translation, quaternion."""
        if self.is_ros1:
            import geometry_msgs.msg as kinds
            import tf2_msgs.msg
            out = tf2_msgs.msg.TFMessage()
            for parent, child, t, q in links:
                out.transforms.append(self.headed(kinds.TransformStamped(child_frame_id=child, transform=self.transform(t, q)),
                                                  stamp_ns, parent))
            return out
        out = Cdr(self.is_big)
        out.put("I", len(links))
        for parent, child, t, q in links:
            out.header(stamp_ns, parent)
            out.text(child)
            for value in list(t) + list(q):
                out.put("d", value)
        return out.done()

#!/usr/bin/env python3
"""Compares hal/ros2/messages.idl with the message definitions that Debian has (packages ros-*-msgs): definitions.py IDL SHARE

Those are of ROS 1. ROS 2 has the same fields in the same order and types, but for four rules, which stand here: a header
has no `seq`, a time is of builtin_interfaces (int32 sec, uint32 nanosec), CameraInfo's D, K, R, P are small letters, and a
message without fields has a byte, since a struct of IDL needs one.
Exit 0 when every struct has the same fields.
"""
import pathlib
import re
import sys

PLAIN = {"float64": "double", "float32": "float", "uint8": "octet", "byte": "octet", "int8": "octet", "bool": "boolean",
         "int32": "long", "uint32": "unsigned long", "int16": "short", "uint16": "unsigned short", "string": "string",
         "time": "builtin_interfaces::msg::dds_::Time_"}
HERE_ALONE = {("builtin_interfaces", "Time")}


def idl_structs(text):
    """{(package, name): [(type, name)]}, types written out."""
    text = re.sub(r"//[^\n]*", "", text)
    structs = {}
    for module in re.finditer(r"module (\w+) \{ module msg \{ module dds_ \{(.*?)\n\}; \}; \};", text, re.S):
        package, body = module.groups()
        aliases = {name: (kind, size) for kind, name, size in re.findall(r"typedef (\w+) (\w+)(\[\d+\]);", body)}
        for name, members in re.findall(r"struct (\w+)_ \{(.*?)\}", body, re.S):
            fields = []
            for member in filter(None, (part.strip() for part in members.split(";"))):
                kind, field, size = re.fullmatch(r"(.+?)\s+(\w+)(\[\d+\])?", member).groups()
                if kind in aliases:
                    kind, size = aliases[kind]
                local = re.fullmatch(r"(sequence<)?(\w+_)(>)?", kind)
                if local:
                    kind = f"{local[1] or ''}{package}::msg::dds_::{local[2]}{local[3] or ''}"
                fields.append((kind + (size or ""), field))
            structs[package, name] = fields
    return structs


def ros_fields(package, text):
    fields = []
    for line in text.splitlines():
        line = line.split("#")[0].strip()
        if not line or "=" in line:
            continue
        kind, field = line.split()
        base, many = re.fullmatch(r"([\w/]+)(\[\d*\])?", kind).groups()
        if base == "Header":
            base = "std_msgs/Header"
        if base not in PLAIN and "/" not in base:
            base = f"{package}/{base}"
        kind = PLAIN.get(base) or base.replace("/", "::msg::dds_::") + "_"
        kind = f"sequence<{kind}>" if many == "[]" else kind + (many or "")
        fields.append((kind, field))
    if not fields:
        return [("octet", "structure_needs_at_least_one_member")]
    if (package, fields[0]) == ("std_msgs", ("unsigned long", "seq")):
        fields = fields[1:]
    return fields


def complaints(structs, share):
    for (package, name), fields in structs.items():
        if (package, name) in HERE_ALONE:
            continue
        expected = ros_fields(package, (share / package / "msg" / f"{name}.msg").read_text(encoding="utf-8"))
        if name == "CameraInfo":
            expected = [(kind, field.lower()) for kind, field in expected]
        if fields != expected:
            yield f"{package}/{name}: {fields} instead of {expected}"


def main():
    structs = idl_structs(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    found = list(complaints(structs, pathlib.Path(sys.argv[2])))
    for complaint in found:
        print(complaint)
    # A comparison that never fails is none: with two fields swapped it does.
    structs["geometry_msgs", "PoseWithCovariance"].reverse()
    if not list(complaints(structs, pathlib.Path(sys.argv[2]))):
        print("two swapped fields were not noticed")
        return 1
    print(f"{len(structs)} messages compared")
    return 1 if found or len(structs) < 28 else 0


if __name__ == "__main__":
    sys.exit(main())

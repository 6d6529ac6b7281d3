#!/usr/bin/env python3
"""Each check of the house finds a planted mistake: python3 selftest.py selftest --source DIR ... (as house.py)."""
import pathlib
import subprocess
import sys
import tempfile

import cpp_reader
import house


CODE = """
// a comment with a brace {
#define MACRO(x) { x
namespace stillmesh {
struct Point { int x{0}; std::array<int, 2> both = {1, 2}; };
enum class Kind : unsigned { kOne, kTwo };
class Thing : public Base<int> {
public:
    Thing(int a, int b) noexcept : a_(a), b_{b}, text_("{") {}
    [[nodiscard]] bool operator()(int a) const { return a < a_; }
    virtual int port(int a, std::pair<int, int> b, int c) = 0;
    int only_declared(int a, int b, int c, int d, int e, int f);
private:
    int a_, b_;
};
template <typename T, int N = (1 << 2)>
    requires(N > 0)
Map<int, T> long_one(
    const Map<int, T>& a, int (*f)(int, int),
    int c = g(1, 2)) {
    if (c) { call([&](int x, int y, int z, int u, int v, int w) { return '{'; }); }
    const char* text = "} // {";
    return R"({)";
}
constexpr int kOf = make({1, 2});
int Thing::operator[](int i) const { return 1'000 + i; }
}
"""


def sizes_selftest(expect):
    found = {(f.name, f.lines, f.parameters) for f in cpp_reader.functions_of(CODE)}
    wanted = {("Thing::Thing", 1, 2), ("Thing::operator()", 1, 1), ("Thing::port", 0, 3), ("long_one", 9, 3),
              ("Thing::operator[]", 1, 1)}
    expect("functions", sorted(found ^ wanted), 0)

    def function(name, lines, parameters=0):
        listed = ", ".join(f"int p{i}" for i in range(parameters))
        return f"void {name}({listed}) {{\n" + "    step();\n" * (lines - 2) + "}\n"

    def sizes(text, exceptions=""):
        listed, complaints = house.exceptions_of(exceptions)
        return complaints + house.excepted_complaints(house.sizes_of({"engine/a.cpp": text}), listed,
                                                      ("file", "function", "parameters"))
    expect("sizes", sizes(function("f", 70, 5) + "\n" * 330), 0)
    expect("sizes", sizes(function("f", 71, 6)), 2)
    expect("sizes", sizes("\n" * 401), 1)
    expect("overloads", sizes(function("f", 72) + function("f", 80), "function engine/a.cpp f 80: two of a name"), 0)
    exact = "# heading\n\nfile engine/a.cpp 401: a table\n"
    expect("an exception", sizes("\n" * 401, exact), 0)
    expect("an exception for several", sizes(function("f", 72) + function("g", 75), "function engine/*.cpp [fg] 75: alike"), 0)
    expect("an exception for several", sizes(function("f", 72) + function("h", 75), "function engine/*.cpp [fg] 75: alike"), 2)
    expect("an exception that grew", sizes("\n" * 402, exact), 1)
    expect("an exception that shrank", sizes("\n" * 401, exact.replace("401", "402")), 1)
    expect("an exception that is over", sizes("\n" * 400, exact), 1)
    expect("an exception without a reason", sizes("", "file engine/a.cpp 401:"), 1)
    expect("an exception without a size", sizes("", "file engine/a.cpp: a table"), 1)
    expect("an exception twice", sizes("\n" * 401, exact + exact), 1)
    expect("the number of exceptions", house.count_complaints(2, 2), 0)
    expect("the number of exceptions", house.count_complaints(3, 2), 1)
    expect("the number of exceptions", house.count_complaints(1, 2), 1)

    rooms = ["a"]
    header = {"engine/a/x.hpp": "", "engine/front.hpp": ""}
    expect("tested", house.untested_of({**header, "tests/x.cpp": '#include "engine/a/x.hpp"\n'}, rooms), 0)
    expect("tested", house.untested_of({**header, "tests/x.cpp": '// "engine/a/x.hpp"\n'}, rooms), 1)
    expect("tested", house.untested_of({**header, "engine/b.cpp": '#include "engine/a/x.hpp"\n'}, rooms), 1)


def references_selftest(expect):
    names = ["docs/method.md", "docs/board.md", "engine/a/x.hpp", "README.md", "tests/vm/run", "docs/report.png"]

    def references(text, path="engine/b.cpp"):
        return house.dangling_references({path: text}, names)
    expect("references", references("// method.md 7; docs/method.md, engine/a/x.hpp, engine/a/x, engine/a, tests/vm/run"), 0)
    expect("references", references("[x](board.md#top) ![r](report.png) https://a.org/docs/y.md [y](https://a.org/z)",
                                    "docs/method.md"), 0)
    expect("references", references("build/engine/gone tests/<room>/x tests/*/y.cpp tests/package-${x} $root/docs/z.md"), 0)
    for wrong in ("// gone.md 7", "see docs/gone.md", "engine/gone/x.hpp", "engine/gone/", "`gone.hpp`", "tests/vm/gone."):
        expect(f"reference {wrong}", references(wrong), 1)
    expect("links", references("[x](gone.png)", "docs/method.md"), 1)


HARDENED = ["-fPIE", "-pie", "-Wl,-z,relro", "-Wl,-z,now", "-Wl,-z,noexecstack", "-fstack-protector-strong", "-D_FORTIFY_SOURCE=2",
            "-fcf-protection=full", "-fstack-clash-protection"]
SOFT = ["-fno-pie", "-no-pie", "-Wl,-z,norelro", "-Wl,-z,lazy", "-Wl,-z,execstack", "-fno-stack-protector", "-U_FORTIFY_SOURCE",
        "-fcf-protection=none", "-fno-stack-clash-protection"]
# What each of them is worth when it is gone: -fPIE goes with -pie, and marks and entries are two complaints.
WORTH = {"-pie": 1, "-Wl,-z,relro": 1, "-Wl,-z,now": 1, "-Wl,-z,noexecstack": 1, "-fstack-protector-strong": 1,
         "-D_FORTIFY_SOURCE=2": 1, "-fcf-protection=full": 2, "-fstack-clash-protection": 1}


def hardening_selftest(arguments, folder, expect):
    """Real programs of the compiler at hand: all flags, each of them missing, none."""
    (folder / "main.cpp").write_text("#include <cstring>\nint main(int, char** v) { char page[20000]; std::strcpy(page, v[0]); "
                                     "return page[1] != 0 ? page[0] : 1; }\n")

    def complaints_of(flags):
        for output in ([], ["-c"]):
            subprocess.run([arguments.compiler, "-O2", *flags, *output, "main.cpp", "-o", "o.o" if output else "program"],
                           cwd=folder, check=True, capture_output=True)
        return house.hardening_of(arguments, str(folder / "program"), str(folder / "o.o"))
    expect("hardened", complaints_of(HARDENED), 0)
    # Its frame of five pages, taken page by page in a loop or in a row, counts as a whole, and once.
    disassembly = subprocess.run([arguments.objdump, "-dr", "--no-show-raw-insn", str(folder / "o.o")], capture_output=True,
                                 text=True, check=True).stdout
    frame = house.call_graph(disassembly)["main"][0]
    expect(f"a frame of {frame} bytes", [] if 20_000 <= frame <= 21_000 else [frame], 0)
    expect("not hardened", complaints_of(SOFT), sum(WORTH.values()))
    shows = "    5: 0000000000001139    22 FUNC    GLOBAL DEFAULT   12 "
    needs = ("GNU_RELRO BIND_NOW __stack_chk_fail __memcpy_chk\n  GNU_STACK      0x0 0x0 0x0 0x0 0x0 RW  0x10\n"
             "    1: 0000000000000000     0 FUNC    GLOBAL DEFAULT  UND dds_write\n" + shows + "stillmesh_module\n")
    expect("a module", house.module_complaints(needs), 0)
    expect("a module that shows more", house.module_complaints(needs + shows + "_ZTV3One\n"), 1)
    expect("a module that is not hardened", house.module_complaints(needs.replace("BIND_NOW", "")), 1)
    for at, flag in enumerate(HARDENED):
        if flag in WORTH:
            expect(f"hardened but for {flag}", complaints_of(HARDENED[:at] + [SOFT[at]] + HARDENED[at + 1:]), WORTH[flag])


def check_selftest(arguments):
    complaints = []

    def expect(what, found, count):
        if len(found) != count:
            complaints.append(f"selftest {what}: expected {count} complaints, got {found}")

    expect("symbols", house.symbol_complaints({"memcpy", "malloc", "sin", "_Znwm", "__cxa_pure_virtual"}, []), 4)
    expect("symbols", house.symbol_complaints(set(), [("T", "stillmesh::Engine::submit()"), ("T", "Eigen::x()"),
                                                ("W", "stillmesh::y()"), ("T", "main")]), 3)
    rooms = ["base", "frame", "mesh", "tasks"]
    public = ["engine/base/status.hpp", "engine/engine.hpp", "engine/frame/frame.hpp"]

    def room(path, text):
        return house.room_complaints({path: text}, rooms, public)
    expect("rooms", room("engine/mesh/a.cpp", '#include "engine/frame/f.hpp"\n#include <cstdint>\n'), 0)
    expect("rooms", room("engine/frame/a.cpp", '#include "engine/mesh/f.hpp"\n'), 1)
    expect("rooms", room("engine/frame/a.cpp", '#include <vector>\n#include <thread>\n'), 2)
    expect("rooms", room("engine/frame/a.cpp", '#include "hal/depth_camera.hpp"\n'), 1)
    expect("rooms", room("engine/frame/a.cpp", '#include "engine/engine.hpp"\n'), 1)
    expect("rooms", room("engine/attic/a.cpp", '#include <cstdint>\n'), 1)
    expect("rooms", room("engine/base/status.hpp", '#include "engine/base/pool.hpp"\n#include <Eigen/Core>\n'), 2)
    expect("rooms", room("hal/x/a.cpp", '#include "engine/engine.hpp"\n#include "platform/x.hpp"\n'), 2)
    expect("rooms", room("platform/x/a.cpp", '#include "engine/mesh/inner.hpp"\n#include "engine/engine.hpp"\n'), 1)
    expect("rooms", house.room_complaints({"engine/paging/a.cpp": '#include "engine/tracking/t.hpp"\n#include "engine/paging/p.hpp"\n'},
                                          ["base", "tracking", "paging"], public), 1)
    expect("circles", house.circle_complaints({"engine/a/x.hpp": '#include "engine/a/y.hpp"\n', "engine/a/y.hpp": "",
                                         "engine/a/z.cpp": '#include "engine/a/x.hpp"\n#include "engine/a/y.hpp"\n'}), 0)
    expect("circles", house.circle_complaints({"engine/a/x.hpp": '#include "engine/a/y.hpp"\n',
                                         "engine/a/y.hpp": '#include "engine/a/z.hpp"\n',
                                         "engine/a/z.hpp": '#include "engine/a/x.hpp"\n'}), 1)
    expect("text", house.text_complaints({"a.cpp": "// TO" "DO later\n", "b.md": "see /ho" "me/me/x\nhttps://x.org/home/y\n"}), 2)
    good = "c++ -std=c++20 -Wall -Wextra -Werror -fno-fast-math -fno-math-errno -ffp-contract=off"
    engine = " -fno-exceptions -fno-rtti -fno-threadsafe-statics -fvisibility=hidden -DEIGEN_DONT_VECTORIZE -DEIGEN_NO_MALLOC"

    def flags(command, path="engine/a.cpp"):
        return house.flag_complaints([{"directory": "/s", "file": "/s/engine/e.cpp", "command": good + engine},
                                {"directory": "/s", "file": f"/s/{path}", "command": command}], "/s", True)
    expect("flags", flags(good + engine), 0)
    expect("flags", flags((good + engine).replace("-Werror ", "")), 1)
    expect("flags of a packager", house.flag_complaints([{"directory": "/s", "file": "/s/engine/e.cpp",
                                                          "command": good + engine}], "/s", False), 1)
    presets = [{"name": "base", "hidden": True, "cacheVariables": {"STILLMESH_WERROR": "ON"}},
               {"name": "a", "inherits": "base"}, {"name": "b", "inherits": ["a"]}]
    expect("presets", house.preset_complaints(presets), 0)
    expect("presets", house.preset_complaints(presets + [{"name": "c"}]), 1)
    expect("presets", house.preset_complaints(presets + [{"name": "c", "inherits": "b",
                                                          "cacheVariables": {"STILLMESH_WERROR": "OFF"}}]), 1)
    expect("flags", flags(good), 6)
    expect("flags", flags(good + " -march=native", "hal/a.cpp"), 1)
    expect("flags", flags(good + " -fno-fast-math", "hal/a.cpp"), 1)
    expect("flags", flags(good.replace("-ffp-contract=off", ""), "hal/a.cpp"), 1)
    sizes_selftest(expect)
    references_selftest(expect)
    expect("stack", house.frame_complaints(["a.cpp:1:1:void f()\t64\tstatic", "a.cpp:2:1:void g()\t80\tdynamic",
                                      "a.cpp:3:1:void h()\t99999\tstatic"])[1], 2)
    section = "  0 {} {:08x}  00000000  00000000  00000040  2**0\n                  CONTENTS, ALLOC, LOAD, {}\n"
    code = section.format(".text.a", 600 * 1024, "RELOC, READONLY, CODE")
    expect("size", house.size_complaints(code + section.format(".bss.a", 0, "DATA"))[0], 0)
    expect("size", house.size_complaints(code + section.format(".rodata", 1, "READONLY, DATA"))[0], 1)
    expect("size", house.size_complaints(code + section.format(".bss.a", 1, "DATA"))[0], 1)
    expect("size", house.size_complaints(code + section.format(".data.a", 1, "DATA"))[0], 1)
    expect("size", house.size_complaints(code + section.format(".tbss.a", 1, "THREAD_LOCAL"))[0], 1)
    expect("size", house.size_complaints(section.format(".data.rel.ro.t", 9, "DATA"))[0], 1)
    loop = {"a": (16, {"b"}, False), "b": (8, {"c"}, False), "c": (8, {"b"}, False)}
    expect("recursion", house.graph_complaints(loop)[1], 1)
    expect("depth", house.graph_complaints({"a": (90000, {"b"}, False), "b": (10000, set(), False)})[1], 1)

    # The same with real tools: a library that allocates and exports a weak template, and code that recurses.
    with tempfile.TemporaryDirectory() as directory:
        folder = pathlib.Path(directory)
        (folder / "bad.cpp").write_text("namespace stillmesh { template <class T> T* make(T v) { return new T(v); } "
                                        "template int* make<int>(int); "
                                        "int down(int n) noexcept { return n < 2 ? 1 : down(n - 1) * n + down(n / 3); } }\n")
        (folder / "open.hpp").write_text("struct A { std::uint32_t x; };\n")
        subprocess.run([arguments.compiler, "-std=c++20", "-O1", "-fno-exceptions", "-fno-asynchronous-unwind-tables", "-c",
                        str(folder / "bad.cpp"), "-o", str(folder / "bad.o")], check=True)
        undefined, exported = house.library_symbols(arguments, folder / "bad.o")
        expect("symbols of a library that allocates", house.symbol_complaints(undefined, exported), 2)
        expect("headers", house.header_complaints(arguments, directory, ["open.hpp", "missing.hpp"]), 2)
        machine = subprocess.run([arguments.compiler, "-dumpmachine"], capture_output=True, text=True, check=True).stdout
        if machine.startswith("x86_64"):
            hardening_selftest(arguments, folder, expect)
            disassembly = subprocess.run([arguments.objdump, "-dr", "--no-show-raw-insn", str(folder / "bad.o")],
                                         capture_output=True, text=True, check=True).stdout
            found = house.graph_complaints(house.call_graph(disassembly))[1]
            if not any("recursion" in c for c in found):
                complaints.append(f"selftest recursion: not found in real code: {found}")
    return complaints


if __name__ == "__main__":
    sys.exit(house.main({"selftest": check_selftest}))

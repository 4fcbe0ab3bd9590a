"""Compiles the kernels of the package into a C library: ``python building/compile.py [LEVEL OUT]``.

Without a level it is that of this machine, for the checkout, unless it is there and up to date.

Of each kernel, numba makes LLVM's intermediate representation for the types of its annotations,
behind an entry that reads a table of words (see `lineament.kernels.library`). LLVM makes an object
file of all of them, and a linker a library that needs nothing but the C library's mathematics.
"""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
KERNELS = "src/lineament/kernels"
#: Folders of kernels: of the package, and of the laboratory, which call the former.
FOLDERS = KERNELS, "lab/src/lineament_lab/kernels"
#: What a level is to LLVM; another machine's is whatever all of its kind have.
FEATURES = {
    "x86-64-v2": "+cx16,+sahf,+popcnt,+sse3,+sse4.1,+sse4.2,+ssse3",
    "x86-64-v3": "+avx,+avx2,+bmi,+bmi2,+cx16,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sahf,+sse3,"
    "+sse4.1,+sse4.2,+ssse3,+xsave",
}
#: Kernels that take half of the time.
FIRST_HALF = (
    *("lineament_optimal", "lineament_tracking", "lineament_mapping"),
    *("lineament_hough", "lineament_line_tracking", "lineament_ransac"),
)


def levels(machine: str) -> list[str]:
    """Return the levels that a machine of this kind may be of."""
    machine = machine.lower()
    return list(FEATURES) if machine in ("x86_64", "amd64") else [machine]


def loader() -> Any:
    """Return the module that loads libraries, without the package."""
    spec = importlib.util.spec_from_file_location("library", ROOT / KERNELS / "library.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def ask_numba_for(level: str, cache: str) -> None:
    """Set what numba reads when it is imported."""
    cpu, features = (level, FEATURES[level]) if level in FEATURES else ("generic", "")
    os.environ |= {"NUMBA_CPU_NAME": cpu, "NUMBA_CPU_FEATURES": features}
    # Whatever whoever builds has set for something else.
    os.environ |= {"LINEAMENT_JIT": "1", "NUMBA_DISABLE_JIT": "0", "NUMBA_BOUNDSCHECK": "0"}
    # Nothing is kept of the way from the source to the library.
    os.environ["NUMBA_CACHE_DIR"] = cache
    sys.path[:0] = [str((ROOT / folder).parents[1]) for folder in FOLDERS]


def kernels(folder: str) -> list[Any]:
    """Return the kernels of all modules of a folder, in the order of their names."""
    found = []
    for path in sorted((ROOT / folder).rglob("*.py")):
        parts = path.relative_to((ROOT / folder).parents[1]).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        for value in vars(importlib.import_module(name)).values():
            options = getattr(value, "targetoptions", {"no_cpython_wrapper": True})
            if not options.get("no_cpython_wrapper") and value.__module__ == name:
                found.append(value)
    return found


def compiled(kernel: Any) -> Any:
    """Compile the entry of a kernel, and return what numba has of it."""
    from entries import entry_of
    from numba import njit, types

    kernel.targetoptions["no_cpython_wrapper"] = True
    quiet = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    entry = njit(nogil=True, error_model="numpy", **quiet)(entry_of(kernel))
    entry.compile((types.int64,))
    (result,) = entry.overloads.values()
    return result


#: A function for C, which calls that of numba: that returns a status, its result by address.
ENTRY = """
declare i32 @"{inner}"(ptr, ptr, i64)
define i64 @{name}(i64 %table) {{
  %result = alloca i64
  %error = alloca ptr
  %status = call i32 @"{inner}"(ptr %result, ptr %error, i64 %table)
  %failed = icmp ne i32 %status, 0
  %value = load i64, ptr %result
  %found = select i1 %failed, i64 {refused}, i64 %value
  ret i64 %found
}}
"""

#: How numba counts who uses the memory that an array owns: none does here.
_COUNTS = re.compile(r"^ *(tail )?call void @NRT_(in|de)cref\(.*\n", re.MULTILINE)

#: What numba's code refers to besides the C library: the strides of an array of another shape, of
#: which all is contiguous here.
SUPPORT = """
define i32 @numba_attempt_nocopy_reshape(i64 %nd, ptr %dims, ptr %strides, i64 %count,
    ptr %lengths, ptr %out, i64 %item, i32 %by_columns) {
  %some = icmp sgt i64 %count, 0
  br i1 %some, label %loop, label %end
loop:
  %k = phi i64 [ %count, %0 ], [ %last, %loop ]
  %stride = phi i64 [ %item, %0 ], [ %next, %loop ]
  %last = sub i64 %k, 1
  %place = getelementptr i64, ptr %out, i64 %last
  store i64 %stride, ptr %place
  %at = getelementptr i64, ptr %lengths, i64 %last
  %length = load i64, ptr %at
  %next = mul i64 %stride, %length
  %more = icmp sgt i64 %last, 0
  br i1 %more, label %loop, label %end
end:
  ret i32 1
}
"""


def object_of(name: str, inner: str, code: str) -> bytes:
    """Make an object file of a kernel: of numba's function `inner` and all that it calls.

    Each kernel has a copy of what it calls, as numba's have: a copy that was optimised within
    another kernel may add up in another order.
    """
    import llvmlite.binding as llvm
    from numba import config

    from lineament.kernels.library import REFUSED

    whole = llvm.parse_assembly(_COUNTS.sub("", code))
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=config.CPU_NAME, features=config.CPU_FEATURES, opt=3, reloc="pic", codemodel="default"
    )
    whole.link_in(llvm.parse_assembly(ENTRY.format(inner=inner, name=name, refused=REFUSED)))
    whole.link_in(llvm.parse_assembly(SUPPORT))
    for value in (*whole.functions, *whole.global_variables):
        if not value.is_declaration and value.name != name:
            value.linkage = "internal"
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=1))
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(whole, builder)
    return machine.emit_object(whole)


def linker() -> list[str] | None:
    """Return the command that links: the machine's compiler, or that of the package ziglang."""
    if found := os.environ.get("CC") or shutil.which("cc"):
        return found.split()
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc"]
    return None


def link(objects: list[bytes], out: Path) -> None:
    """Link object files to a library, and seal it."""
    with tempfile.TemporaryDirectory(dir=out.parent) as folder:
        library = Path(folder, out.name)
        files = [Path(folder, f"{k}.o") for k in range(len(objects))]
        for file, code in zip(files, objects, strict=True):
            file.write_bytes(code)
        subprocess.run([*(linker() or ()), "-shared", "-o", library, *files, "-lm"], check=True)
        library.replace(out)
        loader().seal(out).write_text(loader().sealed(out))


def part_of(folder: str, share: int) -> list[bytes]:
    """Compile one of two halves of some kernels, which take the same time, to object files."""
    from lineament.kernels.library import symbol

    objects = []
    for kernel in kernels(folder):
        name = symbol(kernel.__module__, kernel.__name__)
        if name.startswith(FIRST_HALF) == (share == 0):
            result = compiled(kernel)
            inner, code = result.fndesc.llvm_func_name, result.library.get_llvm_str()
            objects.append(object_of(name, inner, code))
            print(f"compiled {name}", flush=True)
    return objects


def main() -> None:
    """Compile for the level and into the file that the command line names."""
    if len(sys.argv) == 3:
        level, outs = sys.argv[1], [Path(sys.argv[2]).absolute()]
    else:
        level = loader().levels()[0]
        outs = [ROOT / folder / f"{level}{loader().SUFFIX}" for folder in FOLDERS]
        outs = [out for out in outs if not loader().is_current(out)]
    if outs and linker() is None:
        raise SystemExit("no linker: neither cc nor the Python package ziglang is installed")
    for out in outs:
        (folder,) = (one for one in FOLDERS if Path(one).parent.name == out.parent.parent.name)
        with tempfile.TemporaryDirectory() as empty:
            ask_numba_for(level, empty)
            with ProcessPoolExecutor(2, get_context("spawn")) as pool:
                link(list(chain(*pool.map(part_of, [folder] * 2, range(2)))), out)
        print(f"{folder}/{out.name}: {out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()

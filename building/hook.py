"""Puts the compiled kernels into the wheel: a library for each level of this kind of machine."""

import os
import platform
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from compile import levels, linker, loader  # noqa: E402


class KernelHook(BuildHookInterface):  # type: ignore[type-arg]
    """Compiles what is not compiled yet. A checkout that is installed as it is has no library."""

    def dependencies(self) -> list[str]:
        """Return the linker that the build needs where the machine has none."""
        return [] if linker() else ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile each level in a process, and make the wheel one of this platform."""
        if self.target_name != "wheel" or version == "editable":
            return
        if linker() is None:
            self.app.display_warning("no linker: the wheel has no kernels, its users need numba")
            return
        (folder,) = Path(self.root, "src").glob("*/kernels")
        # LINEAMENT_LEVELS=native: for this machine alone, in less time.
        native = os.environ.get("LINEAMENT_LEVELS") == "native"
        wanted = loader().levels()[:1] if native else levels(platform.machine())
        outs = {level: folder / f"{level}{loader().SUFFIX}" for level in wanted}
        runs = [
            subprocess.Popen([sys.executable, HERE / "compile.py", level, out])
            for level, out in outs.items()
            if not loader().is_current(out)
        ]
        if sum(run.wait() for run in runs):
            raise SystemExit("the kernels could not be compiled, see above")
        for out in outs.values():
            for file in (out, loader().seal(out)):
                build_data["force_include"][str(file)] = f"{folder.parent.name}/kernels/{file.name}"
        build_data["pure_python"] = False
        tag = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"py3-none-{tag}"

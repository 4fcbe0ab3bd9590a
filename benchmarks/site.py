"""Makes the pages of the site that are not written by hand; MkDocs calls it, see mkdocs.yml.

Files of docs/ that end in .py are notebooks: they are run, and an error in one ends the build.
Below reference/ is a page for each package that the navigation lists, from its docstrings.
Documents at the root of the repository become pages. In all of them names of the package are
links, and nothing may be loaded from elsewhere.
"""

import base64
import inspect
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path, PurePosixPath
from posixpath import relpath
from typing import Any

import griffe
import jupytext
import nbformat
import numpy as np
from click import Context, Group, unstyle
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

from lineament.cli import cli
from lineament.features.records import FIELDS, TABLES

ROOT = Path(__file__).parents[1]
os.environ.setdefault("LINEAMENT_DATA", str(ROOT / ".." / "shared" / "data"))
#: Before the first cell: pictures that read on white and on black.
_SETUP = """%matplotlib inline
import matplotlib
matplotlib.rcParams |= {"figure.facecolor": "none", "axes.facecolor": "none", "figure.dpi": 120}
matplotlib.rcParams |= {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
"""
#: Page and anchor of each documented name; filled while the reference is made.
_PLACES: dict[str, str] = {}
#: What mkdocstrings makes of a package itself: its docstring alone.
_INTRODUCTION = """::: {}
    options:
      members: false
      show_root_heading: false
      show_root_toc_entry: false"""
#: What pandas adds to its tables: the theme has its own style.
_OF_PANDAS = re.compile(r'<style scoped>.*?</style>| border="1" class="dataframe"', re.DOTALL)
_LOADS = re.compile(r"<(?:script|img|link|iframe)\b[^>]*\b(?:src|href)=\"?(https?:)?//[^>]*>")
_NAMES = re.compile(r"<(a|pre|h\d)\b.*?</\1>|<code>([\w.]+)(?:\(\))?</code>", re.DOTALL)


class OwnDefaults(griffe.Extension):
    """Gives parameters that share a line each its own default and type; griffe has the first's."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Go through all functions and classes."""
        waiting: list[Any] = [pkg]
        while waiting:
            one = waiting.pop()
            if one.is_alias or one.name == "kernels":
                continue
            waiting += one.members.values()
            if one.docstring and (one.is_function or one.is_class):
                for section in one.docstring.parsed:
                    if section.kind is griffe.DocstringSectionKind.parameters:
                        self._separate(section.value, one.parameters)

    def _separate(self, documented: list[Any], signature: griffe.Parameters) -> None:
        first = None
        for parameter in documented:
            if first is None or parameter.description is not first.description:
                first = parameter
                shared = vars(first).copy()
            elif {parameter.name, first.name} <= {own.name for own in signature}:
                own, of_first = signature[parameter.name], signature[first.name]
                if shared["value"] is of_first.default:
                    parameter.value = own.default
                if shared["annotation"] is of_first.annotation:
                    parameter.annotation = own.annotation


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made."""
    documents = config.extra["documents"]
    for page, source in documents.items():
        text = re.sub(r"\]\((\.\./)?docs/", "](", (ROOT / source).read_text("utf-8"))
        for other, document in documents.items():
            text = text.replace(f"]({document})", f"]({other})")
        files.append(File.generated(config, page, content=text))
    for name in _listed(config.nav):
        if name.startswith("reference/"):
            module = PurePosixPath(name).stem
            text = _commands() if module == "commands" else _reference(name, module)
            files.append(File.generated(config, name, content=text))
    notebooks = [file for file in files if file.src_uri.endswith(".py")]
    with ThreadPoolExecutor(2) as pool:
        for file, made in zip(notebooks, pool.map(_run, notebooks), strict=True):
            files.remove(file)
            for uri, content in made.items():
                files.append(File.generated(config, uri, content=content))
    return files


def on_page_markdown(text: str, config: Any, **_: Any) -> str:
    """Lead links out of docs/ to the pages of those documents."""
    for page, document in config.extra["documents"].items():
        for target in (document, document.removesuffix("/README.md")):
            text = text.replace(f"](../{target})", f"]({page})")
    return text


def on_page_content(html: str, page: Page, **_: Any) -> str:
    """Make names of the package links to where they are documented."""
    is_reference = page.file.src_uri.startswith("reference/")

    def linked(found: re.Match[str]) -> str:
        name = found[2]
        if name is None or name not in _PLACES or ("." not in name and not is_reference):
            return found[0]
        there, here = _PLACES[name], PurePosixPath(page.file.src_uri)
        return f'<a href="{relpath(there, here.parent)}">{found[0]}</a>'

    return _NAMES.sub(linked, html)


def on_post_build(config: Any) -> None:
    """Write the index of the search as a script, too: pages that are opened from the disk ask."""
    folder = Path(config.site_dir, "search")
    index = (folder / "search_index.json").read_text("utf-8")
    (folder / "search_index.js").write_text(f"var __index = {index}", "utf-8")
    lines = [f"# {config.site_name}", "", f"> {config.site_description}", *_outline(config.nav)]
    Path(config.site_dir, "llms.txt").write_text("\n".join(lines) + "\n", "utf-8")


def _outline(nav: Any) -> Iterator[str]:
    """Yield the navigation as the lines of llms.txt: a section a part, a link a page."""
    for part in nav:
        ((title, inside),) = part.items() if isinstance(part, dict) else (("", part),)
        if isinstance(inside, str):
            yield f"- [{title or inside}]({inside.removesuffix('.md')}.html)"
        else:
            yield from ("", f"## {title}", "", *_outline(inside))


def on_post_page(output: str, page: Page, **_: Any) -> str:
    """Refuse pages that would load something from elsewhere."""
    if found := _LOADS.search(output):
        raise PluginError(f"{page.file.src_uri} loads {found[0]}")
    return output


def _listed(nav: Any) -> list[str]:
    """Return the pages of a navigation, in order."""
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    return [page for part in parts for page in _listed(part)]


def _reference(page: str, module: str) -> str:
    """Write the page of a package: what it is, a table of its names, and each of them."""
    package = import_module(module)
    text, rows = [f"# {module}", _INTRODUCTION.format(module)], ["| name | what it is |\n|---|---|"]
    for name in _public(package):
        value, home = getattr(package, name), f"{module}.{name}"
        if inspect.ismodule(value):
            rows.append(f"| [`{name}`]({home}.md) | {_summary(value)} |")
            continue
        if inspect.isclass(value) or inspect.isfunction(value):
            home = f"{value.__module__}.{value.__qualname__}"
        if home not in _PLACES:  # else it is on an earlier page
            if isinstance(value, np.dtype):
                fields = _fields(value) if value in TABLES.values() else _columns(name, package)
                text.append(f"## `{home}` {{ #{home} }}\n\n{fields}")
            elif inspect.isclass(value) or inspect.isfunction(value):
                text.append(f"::: {module}.{name}")
            else:
                rows.append(f"| `{name}` | {_value(value)} |")
                continue
            _PLACES[home] = f"{page[:-3]}.html#{module}.{name}"
            _PLACES.setdefault(name, _PLACES[home])
            if module == "lineament":
                _PLACES[f"ln.{name}"] = _PLACES[home]
        place = _PLACES[f"{module}.{name}"] = _PLACES[home]
        target = place.rpartition("/")[2].replace(".html#", ".md#")
        rows.append(f"| [`{name}`]({target}) | {_summary(value)} |")
    return "\n\n".join([*text[:2], "\n".join(rows), *text[2:]])


def _public(package: Any) -> list[str]:
    """Return the public names of a module: those that it lists, or what it defines."""
    own = (
        name
        for name, value in vars(package).items()
        if getattr(value, "__module__", "") == package.__name__ and not name.startswith("_")
    )
    return [name for name in getattr(package, "__all__", own) if name != "__version__"]


def _summary(value: Any) -> str:
    """Return the first sentence of a docstring."""
    if isinstance(value, np.dtype):
        return "type of its records"
    first = (inspect.getdoc(value) or "").partition("\n\n")[0]
    return " ".join(first.split()).replace("``", "`").replace("|", "\\|")


def _value(value: Any) -> str:
    """Return a constant as code, or the keys of a mapping."""
    if isinstance(value, Mapping):
        return ", ".join(f"`{key}`" for key in value)
    return f"`{str(value).replace('|', 'or')}`"


def _fields(dtype: np.dtype[Any]) -> str:
    """Return a table of the fields of a record."""
    table = next(name for name, of in TABLES.items() if of is dtype)
    rows = [
        f"| `{field.name}` | `{field.form}` | {field.unit} | {field.about} |"
        for field in FIELDS
        if field.table == table
    ]
    head = f"A record of `{table}`.\n\n| field | type | unit | meaning |\n|---|---|---|---|\n"
    return head + "\n".join(rows)


def _columns(name: str, package: Any) -> str:
    """Return the comment above a record that no table of features has, and its fields."""
    dtype, comments = getattr(package, name), re.compile(rf"((?:^#: .*\n)+){name} = ", re.MULTILINE)
    sources = (path.read_text("utf-8") for path in Path(package.__file__).parent.glob("*.py"))
    about = next(found[1] for source in sources if (found := comments.search(source)))
    rows = [f"| `{field}` | `{dtype[field]}` |" for field in dtype.names]
    return "\n".join([about.replace("#: ", ""), "| field | type |", "|---|---|", *rows])


def _commands() -> str:
    """Write the page of the commands: the help of each."""
    text = ["# Commands", "As `--help` prints it."]
    waiting = [("lineament", cli)]
    while waiting:
        name, command = waiting.pop(0)
        with Context(command, info_name=name, terminal_width=100, max_content_width=100) as context:
            text.append(f"## {name}\n\n``` {{ .text .output }}\n{command.get_help(context)}\n```")
        if isinstance(command, Group):
            parts = command.list_commands(context)
            waiting += [(f"{name} {part}", command.get_command(context, part)) for part in parts]
    return "\n\n".join(text)


def _run(file: File) -> dict[str, str | bytes]:
    """Run a notebook; return its page, its pictures, and itself, by their names."""
    notebook = jupytext.read(file.abs_src_path)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(_SETUP))
    stem = PurePosixPath(file.src_uri).stem
    folder = ROOT / "build" / "tutorials" / stem
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    quiet = ["--IPKernelApp.log_level=40"]
    client = NotebookClient(notebook, timeout=900, kernel_name="python3", extra_arguments=quiet)
    try:
        client.execute(cwd=folder)
    except CellExecutionError as error:
        raise PluginError(f"{file.src_uri}: {unstyle(str(error))}") from None
    del notebook.cells[0]
    made: dict[str, str | bytes] = {}
    text = [part for cell in notebook.cells for part in _cell(cell, stem, made)]
    text.append(f"*This page is a notebook: [{stem}.ipynb]({stem}.ipynb).*")
    made |= {f"{stem}.ipynb": nbformat.writes(notebook), f"{stem}.md": "\n\n".join(text)}
    home = PurePosixPath(file.src_uri).parent
    return {str(home / name): content for name, content in made.items()}


def _cell(cell: Any, stem: str, made: dict[str, str | bytes]) -> Iterator[str]:
    """Write a cell, and what it has shown, as Markdown; its pictures go to `made`."""
    if cell.cell_type == "markdown":
        yield cell.source
        return
    yield f"```python\n{cell.source}\n```"
    for output in cell.outputs:
        if output.output_type == "error":  # while a picture was drawn, after the cell
            raise PluginError(f"{stem}: {unstyle(chr(10).join(output.traceback))}")
        data = output.get("data", {})
        if "image/png" in data:
            picture = f"{stem}_{len(made) + 1}.png"
            made[picture] = base64.b64decode(data["image/png"])
            yield f"![{cell.metadata['alt']}]({picture}){{ .plot }}"
        elif "text/html" in data:
            yield f'<div class="output">{_OF_PANDAS.sub("", data["text/html"])}</div>'
        elif output.get("name") != "stderr":
            written = data.get("text/plain", output.get("text", ""))
            yield f"``` {{ .text .output }}\n{written.rstrip()}\n```"

"""Makes the site of the documents, in build/site: ``python benchmarks/site.py``, see zensical.toml.

First all pages are written to build/pages. Files of docs/ that end in .py are notebooks: they are
run, and an error in one ends the build. Below reference/ is a page for each package that the
navigation lists, from its docstrings. Documents at the root of the repository become pages. Then
Zensical makes the site, in which names of the package become links, and nothing may be missing or
loaded from elsewhere.
"""

import base64
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path, PurePosixPath
from posixpath import normpath, relpath
from typing import Any

import jupytext
import nbformat
from click import unstyle
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from reference import PLACES, commands, reference

ROOT = Path(__file__).parents[1]
DOCS, PAGES, SITE = ROOT / "docs", ROOT / "build" / "pages", ROOT / "build" / "site"
os.environ.setdefault("LINEAMENT_DATA", str(ROOT / ".." / "shared" / "data"))
#: Before the first cell: pictures that read on white and on black.
_SETUP = """%matplotlib inline
import matplotlib
matplotlib.rcParams |= {"figure.facecolor": "none", "axes.facecolor": "none", "figure.dpi": 120}
matplotlib.rcParams |= {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
"""
#: What pandas adds to its tables: the theme has its own style.
_OF_PANDAS = re.compile(r'<style scoped>.*?</style>| border="1" class="dataframe"', re.DOTALL)
_LOADS = re.compile(r"<(?:script|img|link|iframe)\b[^>]*?\b(?:src|href)=[\"']?([^\"' >]+)")
_NAMES = re.compile(r"<(a|pre|h\d)\b.*?</\1>|<code>([\w.]+)(?:\(\))?</code>", re.DOTALL)


def main() -> None:
    """Write the pages, build the site of them, and finish it."""
    project = tomllib.loads((ROOT / "zensical.toml").read_text("utf-8"))["project"]
    shutil.rmtree(PAGES, ignore_errors=True)
    for page, content in pages(project):
        file = PAGES / page
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
    build = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    subprocess.run(build, cwd=ROOT, check=True)
    for file in SITE.rglob("*.html"):
        page = file.relative_to(SITE).as_posix()
        html = linked(page, file.read_text("utf-8"))
        check_loads(page, html)
        file.write_text(html, "utf-8")
    # The index of the search as a script, too: pages that are opened from the disk ask for it.
    index = (SITE / "search.json").read_text("utf-8")
    (SITE / "search.js").write_text(f"var __index = {index}", "utf-8")
    head = [f"# {project['site_name']}", "", f"> {project['site_description']}"]
    text = "\n".join([*head, *_outline(project["nav"])])
    (SITE / "llms.txt").write_text(text + "\n", "utf-8")


def pages(project: Any) -> Iterator[tuple[str, str | bytes]]:
    """Yield the name and the content of each file that the site is built of."""
    documents = project["extra"]["documents"]
    for file in DOCS.rglob("*"):
        if file.suffix not in {".py", ".toml"} and file.is_file():
            name = file.relative_to(DOCS).as_posix()
            yield (
                name,
                _led(file.read_text("utf-8"), documents)
                if file.suffix == ".md"
                else file.read_bytes(),
            )
    for page, source in documents.items():
        text = re.sub(r"\]\((\.\./)?docs/", "](", (ROOT / source).read_text("utf-8"))
        for other, document in documents.items():
            text = text.replace(f"]({document})", f"]({other})")
        yield page, _led(text, documents)
    for name in _listed(project["nav"]):
        if name.startswith("reference/"):
            module = PurePosixPath(name).stem
            yield name, commands() if module == "commands" else reference(name, module)
    with ThreadPoolExecutor(2) as pool:
        for made in pool.map(_run, sorted(DOCS.rglob("*.py"))):
            yield from made.items()


def _led(text: str, documents: dict[str, str]) -> str:
    """Lead links out of docs/ to the pages of those documents."""
    for page, document in documents.items():
        for target in (document, document.removesuffix("/README.md")):
            text = text.replace(f"](../{target})", f"]({page})")
    return text


def linked(page: str, html: str) -> str:
    """Make names of the package links to where they are documented, in what a page says."""
    begin, end, is_reference = (
        html.find("<article"),
        html.find("</article>"),
        page.startswith("reference/"),
    )

    def link(found: re.Match[str]) -> str:
        name = found[2]
        if name is None or name not in PLACES or ("." not in name and not is_reference):
            return found[0]
        return f'<a href="{relpath(PLACES[name], PurePosixPath(page).parent)}">{found[0]}</a>'

    return html[:begin] + _NAMES.sub(link, html[begin:end]) + html[end:]


def check_loads(page: str, html: str) -> None:
    """Refuse a page that loads something from elsewhere, or what is not there."""
    for target in _LOADS.findall(html):
        here = normpath(PurePosixPath(page).parent / target).removeprefix("/")
        if re.match(r"(\w+:)?//", target) or not (
            target.startswith("data:") or (SITE / here).exists()
        ):
            raise SystemExit(f"{page} loads {target}, expected a file of the site")


def _outline(nav: Any) -> Iterator[str]:
    """Yield the navigation as the lines of llms.txt: a section a part, a link a page."""
    for part in nav:
        ((title, inside),) = part.items() if isinstance(part, dict) else (("", part),)
        if isinstance(inside, str):
            yield f"- [{title or inside}]({inside.removesuffix('.md')}.html)"
        else:
            yield from ("", f"## {title}", "", *_outline(inside))


def _listed(nav: Any) -> list[str]:
    """Return the pages of a navigation, in order."""
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    return [page for part in parts for page in _listed(part)]


def _run(file: Path) -> dict[str, str | bytes]:
    """Run a notebook; return its page, its pictures, and itself, by their names."""
    notebook = jupytext.read(file)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(_SETUP))
    stem = file.stem
    folder = ROOT / "build" / "tutorials" / stem
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    quiet = ["--IPKernelApp.log_level=40"]
    client = NotebookClient(notebook, timeout=900, kernel_name="python3", extra_arguments=quiet)
    try:
        client.execute(cwd=folder)
    except CellExecutionError as error:
        raise SystemExit(f"{file.name}: {unstyle(str(error))}") from None
    del notebook.cells[0]
    made: dict[str, str | bytes] = {}
    text = [part for cell in notebook.cells for part in _cell(cell, stem, made)]
    text.append(f"*This page is a notebook: [{stem}.ipynb]({stem}.ipynb).*")
    made |= {f"{stem}.ipynb": nbformat.writes(notebook), f"{stem}.md": "\n\n".join(text)}
    home = PurePosixPath(file.relative_to(DOCS).as_posix()).parent
    return {str(home / name): content for name, content in made.items()}


def _cell(cell: Any, stem: str, made: dict[str, str | bytes]) -> Iterator[str]:
    """Write a cell, and what it has shown, as Markdown; its pictures go to `made`."""
    if cell.cell_type == "markdown":
        yield cell.source
        return
    yield f"```python\n{cell.source}\n```"
    for output in cell.outputs:
        if output.output_type == "error":  # while a picture was drawn, after the cell
            raise SystemExit(f"{stem}: {unstyle(chr(10).join(output.traceback))}")
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


if __name__ == "__main__":
    main()

"""Writes the pages of the reference: of packages from docstrings, of commands from --help."""

import inspect
import re
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import griffe
import numpy as np
from click import Context, Group

import lineament
from lineament.cli import cli
from lineament.features.records import FIELDS, TABLES

#: Page and anchor of each documented name; filled while the reference is made.
PLACES: dict[str, str] = {}
#: What mkdocstrings makes of a package itself: its docstring alone.
_INTRODUCTION = """::: {}
    options:
      members: false
      show_root_heading: false
      show_root_toc_entry: false"""


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


def reference(page: str, module: str) -> str:
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
        if home not in PLACES:  # else it is on an earlier page
            if isinstance(value, np.dtype):
                fields = _fields(value) if value in TABLES.values() else _columns(name, package)
                text.append(f"## `{home}` {{ #{home} }}\n\n{fields}")
            elif inspect.isclass(value) or inspect.isfunction(value):
                text.append(f"::: {module}.{name}")
            else:
                rows.append(f"| `{name}` | {_value(value)} |")
                continue
            PLACES[home] = f"{page[:-3]}.html#{module}.{name}"
            PLACES.setdefault(name, PLACES[home])
            if module == "lineament":
                PLACES[f"ln.{name}"] = PLACES[home]
        place = PLACES[f"{module}.{name}"] = PLACES[home]
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
    # In the package itself, or in the one that it has the record from.
    home, every = Path(package.__file__).parent, Path(lineament.__file__).parent
    files = (*home.glob("*.py"), *every.rglob("*.py"))
    sources = (path.read_text("utf-8") for path in files)
    about = next(found[1] for source in sources if (found := comments.search(source)))
    rows = [f"| `{field}` | `{dtype[field]}` |" for field in dtype.names]
    return "\n".join([about.replace("#: ", ""), "| field | type |", "|---|---|", *rows])


def commands() -> str:
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

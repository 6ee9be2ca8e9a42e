"""The site for a browser: the pages of docs/ as they stand, and pages that are made from the code, by Sphinx.

The order of the site is that of the index, docs/README.md: a section for each of its headings, with the pages that it
links to. Files that a page links to lie beside the pages as in the repository, so that links need no change. Sphinx,
MyST and Furo are the extra `docs`; no network is needed, neither here nor where the site is read.
"""

from __future__ import annotations

import inspect
import io
import json
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from tables import with_tables

import lacmesh
from lacmesh.cli import PROGRAM as LACMESH
from lacmesh.cli.program import Program
from lacsolver.case.schema import json_schema
from lacsolver.cli import PROGRAM as LACSOLVER
from verification.cli import PROGRAM as VERIFICATION

ROOT = Path(__file__).resolve().parents[1]
INDEX, FILMS = ROOT / "docs" / "README.md", ROOT / "build" / "films"
LINK = re.compile(r"(\]\()([^)\s#]*)((?:#[^)\s]*)?\))")
PICTURE = re.compile(r"!\[([^\]]+)\]\(([^)\s]+\.png)\)")
#: pages whose own title would not do in the list of all
TITLES = {"README.md": "Install and first commands <README>"}
#: pages made from the code, by the section of the index that they are added to
MADE = {
    "Start here": ("gallery",),
    "Reference": (
        "reference/lacsolver", "reference/lacmesh", "reference/verification", "reference/python_lacsolver",
        "reference/python_lacmesh",
    ),
}  # fmt: skip
OPTIONS = {
    "project": "lacmesh",
    "version": lacmesh.__version__,
    "release": lacmesh.__version__,
    "extensions": ["myst_parser"],
    "root_doc": "index",
    "html_theme": "furo",
    "html_title": "lacmesh and lacsolver",
    "html_static_path": ["style.css"],
    "html_css_files": ["style.css"],
    "html_show_sphinx": False,
    "html_show_copyright": False,
    "html_show_search_summary": False,  # they are fetched, which browsers forbid for files
    "html_copy_source": False,
    "html_show_sourcelink": False,
    "html_domain_indices": False,
    "html_use_index": False,
    "html_permalinks_icon": "#",
    "html_theme_options": {"top_of_page_buttons": []},
    "myst_heading_anchors": 4,
    "myst_links_external_new_tab": False,
    "suppress_warnings": ["misc.highlighting_failure", "myst.header"],
    "language": "en",
}
#: of a terminal, in warnings
_COLOUR = re.compile(r"\x1b\[[\d;]*m")


def make_site(target: Path) -> list[str]:
    """Make the site in `target`, and return the warnings of Sphinx."""
    from sphinx.application import Sphinx

    target = target.resolve()
    sources = target.with_name(f"{target.name}-sources")
    stage(sources)
    shutil.rmtree(target, ignore_errors=True)
    warnings = io.StringIO()
    doctrees = target.with_name(f"{target.name}-doctrees")
    shutil.rmtree(doctrees, ignore_errors=True)
    app = Sphinx(str(sources), None, str(target), str(doctrees), "html", OPTIONS, status=None, warning=warnings)
    app.build()
    return [_COLOUR.sub("", line) for line in warnings.getvalue().splitlines() if line.strip()]


def stage(folder: Path) -> None:
    """Write all sources into a folder, which is emptied first."""
    shutil.rmtree(folder, ignore_errors=True)
    pages = {page for _, names in sections() for page in names}
    for name in sorted(pages):
        _copy(name, folder, pages)
    made = made_pages()
    for name, text in made.items():
        path = folder / f"{name}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        _copy_linked(text, Path(), folder, pages)
    schema = json.dumps(json_schema(), ensure_ascii=False, indent=2)
    (folder / "reference" / "case.schema.json").write_text(schema, encoding="utf-8")
    shutil.copy(Path(__file__).with_name("style.css"), folder)


def sections() -> list[tuple[str, list[str]]]:
    """(heading, pages) of the index, in its order; a page is where it is named first. Paths from the root."""
    text = INDEX.read_text(encoding="utf-8")
    known: set[str] = set()
    result = []
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        names = [
            _inside(INDEX.parent / link[1]) for link in LINK.findall(body) if link[1].endswith(".md") and link[2] == ")"
        ]
        fresh = [name for name in dict.fromkeys(names) if name not in known]
        known |= set(fresh)
        result.append((heading, fresh))
    return result


def made_pages() -> dict[str, str]:
    """Name -> text of the pages that are made from the code, and of the first page."""
    return {
        "index": first_page(),
        "gallery": gallery(),
        "reference/lacmesh": commands_page(LACMESH, "lacmesh"),
        "reference/lacsolver": commands_page(LACSOLVER, "lacsolver"),
        "reference/verification": commands_page(VERIFICATION, "python -m verification"),
        "reference/python_lacmesh": library_page("lacmesh"),
        "reference/python_lacsolver": library_page("lacsolver"),
    }


def first_page() -> str:
    """The landing page: what the README says first, a picture, a command, and the sections with their pages."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    about = readme.partition("\n![")[0]
    command = re.findall(r"^(\$ lacsolver run .*)$", readme, re.MULTILINE)[-1]
    lines = [about, "", "![Ironing: a die is pressed into rubber and moved](docs/sliding/ironing_3d.png)", ""]
    lines += ["```console", command, "```", ""]
    lines += ["[Install, and the commands before it](README.md). [All pictures](gallery.md).", ""]
    for heading, pages in sections():
        names = [TITLES.get(name, name.removesuffix(".md")) for name in pages] + list(MADE.get(heading, ()))
        if names:
            lines += ["```{toctree}", ":hidden:", f":caption: {heading}", "", *names, "```", ""]
    return "\n".join([*lines, *_directory()])


def gallery() -> str:
    """The gallery: the films that `make docs` made, then every picture of the pages, with the page that shows it."""
    lines, known = ["# Gallery", ""], set()
    for film in sorted(FILMS.glob("*.gif")):
        lines += [f"![{film.stem}]({os.path.relpath(film, ROOT)})", ""]
    for name in (page for _, names in sections() for page in names):
        for title, picture in PICTURE.findall((ROOT / name).read_text(encoding="utf-8")):
            path = _inside(ROOT / Path(name).parent / picture)
            if path not in known:
                known.add(path)
                lines += [f"[![{title}]({path})]({name})", "", f"{title} ([page]({name}))", ""]
    return "\n".join(lines)


def _directory() -> Iterator[str]:
    """The tables of the index, as they stand, but for their links."""
    text = INDEX.read_text(encoding="utf-8")
    body = "\n## " + text.partition("\n## ")[2].partition("\n## How these pages")[0]
    yield LINK.sub(lambda m: m[1] + (_inside(INDEX.parent / m[2]) if m[2] and ":" not in m[2] else m[2]) + m[3], body)


def _copy(name: str, folder: Path, pages: set[str]) -> None:
    """Copy a page with its long tables, and the files that it links to; mend links to what is no page of the site."""
    text = with_tables(Path(name).name, (ROOT / name).read_text(encoding="utf-8"), built=True)
    here = Path(name).parent

    def mended(match: re.Match[str]) -> str:
        target = _inside(ROOT / here / match[2]) if match[2] and ":" not in match[2] else ""
        other = "index.md" if target == _inside(INDEX) else ""
        return f"{match[1]}{os.path.relpath(other, here)})" if other else match[0]

    text = LINK.sub(mended, text)
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")
    _copy_linked(text, here, folder, pages)


def _copy_linked(text: str, here: Path, folder: Path, pages: set[str]) -> None:
    """Copy the files that a page links to and that are no pages of the site."""
    for _, target, _ in LINK.findall(text):
        if not target or ":" in target:
            continue
        path = ROOT / here / target
        if path.is_file() and _inside(path) not in pages:
            (folder / _inside(path)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, folder / _inside(path))


def _inside(path: Path) -> str:
    """The path from the root of the repository."""
    return path.resolve().relative_to(ROOT).as_posix()


# ---- reference of the commands, from their declarations


def commands_page(program: Program, start: str) -> str:
    """The page of a program that is started as `start`: each command with its examples, arguments and options."""
    group = program.group
    lines = [f"# Command {start}", "", escaped(group.help or ""), ""]
    rows = [
        (f"[{name}](#{f'{start} {name}'.replace(' ', '-').lower()})", escaped(one.short_help or ""))
        for name, one in group.commands.items()
    ]
    lines += table(("command", "does"), rows)
    for name, command in group.commands.items():
        lines += _command(f"{start} {name}", command)
    lines += ["## After the options", "", "```text", (group.epilog or "").lstrip("\b\n"), "```", ""]
    return "\n".join(lines)


def _command(title: str, command: Any) -> Iterator[str]:
    about, _, examples = command.help.partition("\b\n")
    yield from (f"## {title}", "", escaped(about.strip()), "")
    yield from ("```console", re.sub(r"^\$ \w+ \S+", f"$ {title}", examples, flags=re.MULTILINE), "```", "")
    context = command.context_class(command, info_name=title)
    rows = []
    for param in command.get_params(context):
        name, text = param.get_help_record(context)
        name = param.metavar if param.param_type_name == "argument" else name
        rows.append((f"`{name}`".replace("|", r"\|"), escaped(text)))
    yield from table(("argument", "meaning"), rows)


# ---- reference of the Python library, from docstrings


#: pages of the library, and the modules that each describes
MODULES = {
    "lacmesh": ("lacmesh", "lacmesh.errors", "lacmesh.surface", "lacmesh.quality", "lacmesh.gmsh", "lacmesh.exchange"),
    "lacsolver": ("lacsolver", "lacsolver.errors", "lacsolver.contact.laws", "lacsolver.contact.friction"),
}


def library_page(package: str) -> str:
    """The page of a package."""
    lines = [f"# Python library: {package}", ""]
    for name in MODULES[package]:
        lines += _module(import_module(name))
    return "\n".join(lines)


def public(module: ModuleType) -> dict[str, Any]:
    """The functions and classes that a module offers, by name: those it lists, or else those it defines."""
    listed = getattr(module, "__all__", None) or [n for n in dir(module) if not n.startswith("_")]
    values = {name: getattr(module, name) for name in listed}
    ours = {n: v for n, v in values.items() if inspect.isclass(v) or inspect.isfunction(v)}
    package = module.__name__.split(".")[0]
    return {n: v for n, v in ours.items() if v.__module__.split(".")[0] == package}


def _module(module: ModuleType) -> Iterator[str]:
    yield from (f"## {module.__name__}", "", *of_docstring(module.__doc__ or ""))
    for name, value in public(module).items():
        yield from _described(f"### {module.__name__}.{name}", name, value)
        if inspect.isclass(value) and not issubclass(value, BaseException):
            yield from _members(value)


def _described(heading: str, name: str, value: Any) -> Iterator[str]:
    yield from (heading, "")
    if not (inspect.isclass(value) and issubclass(value, BaseException)):
        yield from ("```python", name + _signature(value), "```", "")
    yield from of_docstring(inspect.getdoc(value) or "")


def _signature(value: Any) -> str:
    """Arguments and what is returned; a line for each argument where there are many."""
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):
        return ""
    line = _unquoted(signature)
    if len(line) < 90:
        return line
    _, _, answer = line.partition(") -> ")
    arguments = [_unquoted(p) for p in signature.parameters.values()]
    keywords = [k for k, p in enumerate(signature.parameters.values()) if p.kind is p.KEYWORD_ONLY]
    if keywords:
        arguments.insert(keywords[0], "*")
    end = f") -> {answer}" if answer else ")"
    return "(\n" + "".join(f"    {argument},\n" for argument in arguments) + end


def _unquoted(part: inspect.Signature | inspect.Parameter) -> str:
    """The text of a signature whose annotations are not evaluated: they are strings, whose quotes go."""
    return re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(part))


def _members(value: type) -> Iterator[str]:
    """Methods and properties that the class defines itself, with their docstrings."""
    for name, member in vars(value).items():
        function = getattr(member, "__func__", getattr(member, "fget", getattr(member, "func", member)))
        written = inspect.isfunction(function) and function.__doc__ and function.__qualname__.startswith(value.__name__)
        if name.startswith("_") or not written or (is_dataclass(value) and name == "replace"):
            continue
        called = _signature(function).replace("(self, ", "(").replace("(self)", "()") if callable(member) else ""
        yield from (f"**`{name}`**{f' `{called}`' if called and len(called) < 90 else ''}", "")
        yield from of_docstring(function.__doc__ or "")


# ---- Markdown of texts that are plain or nearly so: docstrings and help


def escaped(text: str) -> str:
    """The text with the marks of HTML, links and tables escaped, but for those between backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    plain = [re.sub(r"([<*|\[\]])", r"\\\1", part) if k % 2 == 0 else part for k, part in enumerate(parts)]
    return "".join(part.replace("|", r"\|") if k % 2 else plain[k] for k, part in enumerate(parts))


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """The lines of a table; none without rows."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    names = list(head)
    return [f"| {' | '.join(names)} |", "|---" * len(names) + "|", *lines, ""] if lines else []


def of_docstring(text: str) -> Iterator[str]:
    """The lines of a docstring: paragraphs, indented blocks and examples as code."""
    for block in re.split(r"\n\s*\n", inspect.cleandoc(text)):
        if block.lstrip().startswith(">>>"):
            yield from ("```pycon", *block.splitlines(), "```")
        elif all(line.startswith("    ") for line in block.splitlines()):
            yield from ("```text", *(line[4:] for line in block.splitlines()), "```")
        else:
            yield escaped(block)
        yield ""

"""Make the site for a browser: `python docs/make_site.py build/site`, then open build/site/index.html.

It needs Sphinx, MyST and Furo (the extra `docs`), and no network, neither here nor where it is read. Exits with 1 and
the warnings of Sphinx where there are any: a link that leads nowhere is one.
"""

from __future__ import annotations

import io
import re
import shutil
import sys
from pathlib import Path

from web.pages import stage

import lacmesh

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


def main() -> int:
    """Make the site in the folder that is named; 1 where Sphinx warns of anything."""
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "build/site")
    warnings = make_site(target)
    print("\n".join(warnings) or f"{target / 'index.html'}: open it in a browser")
    return 1 if warnings else 0


if __name__ == "__main__":
    sys.exit(main())

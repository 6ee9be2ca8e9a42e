"""Report as one self-contained page of HTML: no script, no font, no external reference."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape

from lacmesh.report.charts import svg
from lacmesh.report.outline import Charts, Fact, Facts, ReportBlock, Table, Text, Title

#: an option of the command in a sentence, and its value
_OPTION = re.compile(r"--[a-z]+(?:-[a-z]+)*(?: (?:pyramid|hexa|auto)\b)?")
_STYLE = """
:root { --ink: #1d2733; --soft: #5c6b7a; --line: #dde3ea; --paper: #ffffff; --ground: #f5f7f9; --before: #a9b4c0;
  --after: #2563b8; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6ebf1; --soft: #9aa8b6; --line: #33404d; --paper: #1c242d;
  --ground: #141a21; --before: #6d7a88; --after: #6aa5f5; --bad: #ff8a80; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 32px 24px 64px; }
h1 { font-size: 26px; margin: 0 0 20px; overflow-wrap: anywhere; }
h2 { font-size: 19px; margin: 40px 0 12px; }
p { margin: 0 0 10px; max-width: 78ch; }
code { font: 13.5px ui-monospace, monospace; white-space: nowrap; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 12px; margin-bottom: 20px; }
.fact { background: var(--paper); border: 1px solid var(--line); border-radius: 8px; padding: 12px 14px; }
.fact b { display: block; font-size: 24px; font-weight: 600; font-variant-numeric: tabular-nums; }
.fact.bad b, b.bad { color: var(--bad); }
.fact span { color: var(--soft); font-size: 13px; display: block; overflow-wrap: anywhere; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(320px, 1fr)); gap: 12px; margin-bottom: 16px; }
.charts svg { background: var(--paper); border: 1px solid var(--line); border-radius: 8px; width: 100%; height: auto; }
svg .name { font: 600 13px system-ui, sans-serif; fill: var(--ink); }
svg .tick { font: 10.5px system-ui, sans-serif; fill: var(--soft); }
svg .grid { stroke: var(--line); } svg .mark { stroke: var(--soft); }
rect.before, i.before { fill: var(--before); background: var(--before); }
rect.after, i.after { fill: var(--after); background: var(--after); }
.legend { color: var(--soft); font-size: 13px; }
.legend i { display: inline-block; width: 11px; height: 11px; border-radius: 2px; margin: 0 6px 0 14px; }
.legend i:first-child { margin-left: 0; }
.scroll { overflow-x: auto; background: var(--paper); border: 1px solid var(--line); border-radius: 8px;
  margin-bottom: 14px; }
table { border-collapse: collapse; width: 100%; font-size: 13.5px; }
th, td { padding: 6px 10px; text-align: left; border-top: 1px solid var(--line); white-space: nowrap; }
thead th { border-top: 0; color: var(--soft); font-weight: 600; }
.n { text-align: right; font-variant-numeric: tabular-nums; }
tr.again td { border-top: 0; padding-top: 0; } tr.again td:first-child { color: transparent; }
details { margin-bottom: 10px; } summary { cursor: pointer; margin-bottom: 8px; }
footer { margin-top: 40px; color: var(--soft); font-size: 13px; }
@media print { body { background: white; } details { break-inside: avoid; } }
"""


def html(blocks: Iterable[ReportBlock], title: str, footer: str) -> str:
    """A page of the blocks of `outline`."""
    body = "\n".join(_block(block) for block in blocks)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<main>\n{body}\n"
        f"<footer>{escape(footer)}</footer>\n</main>\n</body>\n</html>\n"
    )


def _block(block: ReportBlock) -> str:
    match block:
        case Title():
            return f"<h{block.level}>{escape(block.text)}</h{block.level}>"
        case Text():
            marked = ' class="bad"' if block.bad else ""
            lead = f"<b{marked}>{escape(block.lead)}</b>: " if block.lead else ""
            text = _OPTION.sub(r"<code>\g<0></code>", escape(block.text))
            return f"<p>{lead}{text}</p>"
        case Facts():
            return f'<div class="facts">{"".join(_fact(fact) for fact in block.facts)}</div>'
        case Charts():
            charts = "\n".join(svg(chart) for chart in block.charts)
            legend = '<p class="legend"><i class="before"></i>before<i class="after"></i>after; share of the cells</p>'
            return f'{legend}\n<div class="charts">\n{charts}\n</div>'
        case Table():
            return _table(block)


def _fact(fact: Fact) -> str:
    return (
        f'<div class="fact{" bad" if fact.bad else ""}"><span>{escape(fact.label)}</span>'
        f"<b>{escape(fact.value)}</b><span>{escape(fact.note)}</span></div>"
    )


def _table(table: Table) -> str:
    classes = [' class="n"' if right else "" for right in table.right]
    head = "".join(f"<th{c}>{escape(name)}</th>" for c, name in zip(classes, table.columns, strict=True))
    rows = []
    previous = ""
    for row in table.rows:
        again = ' class="again"' if row[0] == previous and row[1] == "after" else ""
        previous = row[0]
        rows.append(f"<tr{again}>{''.join(f'<td{c}>{escape(v)}</td>' for c, v in zip(classes, row, strict=True))}</tr>")
    body = f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'
    return f"<details><summary>{escape(table.folded)}</summary>{body}</details>" if table.folded else body

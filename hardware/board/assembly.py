# SPDX-License-Identifier: BSD-3-Clause
"""A page for the bench: which part goes where. One HTML file that loads nothing."""
from __future__ import annotations

import json

from footprints import ALL
from kicad_pcb import labels
from layout import Layout
from model import Board, box_at, pad_box
from production import number

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>TITLE: assembly</title><style>
body{font:14px sans-serif;margin:0;display:flex;height:100vh}
#list{width:34em;overflow:auto;padding:8px}svg{flex:1;background:#f4f4f0}
table{border-collapse:collapse;width:100%}td,th{padding:2px 6px;text-align:left;border-bottom:1px
solid #ddd}tr.on{background:#ffe08a}tr.done{color:#999}
.part{fill:#ddd;stroke:#555;stroke-width:.08}.pad{fill:#b8860b}.one{fill:#c0392b}
.out{opacity:.25}.on .part{fill:#ff5d3a}.done .part{fill:#9bd59b}
text{font-size:.9px;pointer-events:none}.small{font-size:.75px}.word{fill:#555;font-size:1px}
</style></head><body><div id="list"><h3>TITLE</h3>
<p>Variant <select id="variant"></select> Click a row to see its parts, or a part to see its row;
tick a row when its parts are soldered (this browser remembers). The red pad is pin 1.</p>
<table id="rows"></table></div>SVG<script>
const DATA=JSON;const key="assembly-"+DATA.name;
const done=new Set(JSON_PARSE(localStorage.getItem(key)||"[]"));
const variant=document.getElementById("variant"),table=document.getElementById("rows");
for(const v of DATA.variants)variant.add(new Option(v));
function group(ref){return document.getElementById("p-"+ref)}
function show(row,refs){document.querySelectorAll(".on").forEach(e=>e.classList.remove("on"));
row.classList.add("on");refs.forEach(r=>group(r).classList.add("on"))}
function draw(){table.innerHTML="<tr><th></th><th>parts</th><th>value</th><th>MPN</th></tr>";
const fitted=r=>DATA.parts[r].fitted.includes(variant.value);
for(const r in DATA.parts)group(r).classList.toggle("out",!fitted(r));
for(const row of DATA.rows){const refs=row.refs.filter(fitted);if(!refs.length)continue;
const tr=table.insertRow(),box=document.createElement("input");box.type="checkbox";
box.checked=done.has(row.id);tr.insertCell().append(box);
for(const text of [refs.length+": "+refs.join(" "),row.value,row.mpn])
tr.insertCell().textContent=text;
const mark=()=>{tr.classList.toggle("done",box.checked);
refs.forEach(r=>group(r).classList.toggle("done",box.checked))};mark();
box.onclick=e=>{e.stopPropagation();box.checked?done.add(row.id):done.delete(row.id);
localStorage.setItem(key,JSON_STRING([...done]));mark()};
tr.onclick=()=>show(tr,refs);
refs.forEach(r=>group(r).onclick=()=>{show(tr,refs);tr.scrollIntoView({block:"center"})})}}
variant.onchange=draw;draw();
</script></body></html>
"""


def svg(board: Board) -> str:
    rows = [f'<svg viewBox="-2 -2 {board.width + 4:g} {board.height + 4:g}">',
            f'<rect width="{board.width:g}" height="{board.height:g}" rx="1" fill="#fff" '
            'stroke="#333" stroke-width=".2"/>']
    for part in board.parts.values():
        footprint, place = ALL[part.component.footprint], board.places[part.ref]
        rows.append(f'<g id="p-{part.ref}">' + rect(box_at(footprint.body, place), "part"))
        rows += [rect(pad_box(pad, place), "pad one" if pad.number == "1" else "pad")
                 for pad in footprint.pads]
        x0, y0, x1, y1 = box_at(footprint.courtyard, place)
        x, y, about = (x0 + x1) / 2, (y0 + y1) / 2, ""
        if y1 - y0 > 1.3 * (x1 - x0):
            about = f' transform="rotate(-90 {x:g} {y:g})"'
        small = ' class="small"' if min(x1 - x0, y1 - y0) < 2 else ""
        rows.append(f'<text x="{x:g}" y="{y + .3:g}" text-anchor="middle"{about}{small}>{part.ref}'
                    '</text></g>')
    for x, y, turn, _, text in labels(board):
        about = f' transform="rotate({-turn} {x:g} {y:g})"' if turn else ""
        rows.append(f'<text class="word" x="{x:g}" y="{y + .35:g}" text-anchor="middle"{about}>'
                    f'{text}</text>')
    return "\n".join(rows) + "</svg>"


def rect(box: tuple[float, float, float, float], kind: str) -> str:
    x0, y0, x1, y1 = box
    return (f'<rect class="{kind}" x="{x0:.3f}" y="{y0:.3f}" width="{x1 - x0:.3f}" '
            f'height="{y1 - y0:.3f}"/>')


def page(board: Board, _: Layout) -> str:
    parts = [part for part in board.parts.values() if part.component.mpn]
    order = {"smd": 0, "thru": 1}
    groups: dict[tuple[str, str], list[str]] = {}
    for part in sorted(parts, key=lambda p: (order.get(ALL[p.component.footprint].kind, 2),
                                             ALL[p.component.footprint].height, number(p.ref))):
        groups.setdefault((part.component.name, part.component.mpn), []).append(part.ref)
    data = {"name": board.name, "variants": board.variants,
            "parts": {part.ref: {"fitted": sorted(part.fitted)} for part in board.parts.values()},
            "rows": [{"id": f"{value} {mpn}", "refs": sorted(refs, key=number), "value": value,
                      "mpn": mpn} for (value, mpn), refs in groups.items()]}
    return (PAGE.replace("TITLE", board.title).replace("SVG", svg(board))
            .replace("JSON_PARSE", "JSON.parse").replace("JSON_STRING", "JSON.stringify")
            .replace("DATA=JSON;", f"DATA={json.dumps(data)};"))

# SPDX-FileCopyrightText: 2026 TetFlora Authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that gave way to those of the field and to American spelling; `problems` finds the places where one came back.

Names that are common words where they are right cannot be found by their letters: ``look``, ``afford`` and ``real`` of
what is counted, ``code`` of coordinate systems, ``form`` of skeletons and proxies, ``girth`` of trunks' diameters.
Reviews have to see these. `fillers` finds variables, fields and functions of the product whose names tell nothing.
"""

from __future__ import annotations

import ast
import re
from fnmatch import fnmatch

#: Parts of words in another spelling, and what stands in their place.
_SPELLING = {
    r"c[o]lour": "color",
    r"gr[e]y": "gray",
    r"(?<!dia)(?<!peri)(?<!tin)(?<!incenti)m[e]tre": "meter",
    r"c[e]ntre": "center",
    r"n[e]ighbour": "neighbor",
    r"b[e]haviour": "behavior",
    r"f[a]vour": "favor",
    r"v[i]gour": "vigor",
    r"c[a]talogue": "catalog",
    r"u[n]derstorey": "understory",
    r"r[a]steris": "rasteriz",
    r"s[u]mmaris": "summariz",
    r"n[o]rmalis": "normaliz",
    r"r[e]cognis": "recogniz",
    r"\blab[e]lled|\bmod[e]ll(?:ed|ing)|\btrav[e]ll": "one l",
}
#: Names as whole words, and those of the field.
_NAMES = {
    r"S[i]ght|P[o]rtions|A[s]setPortions|S[e]enNodes": "PartVisibility, VisibleParts, NodeVisibility",
    r"T[h]rownShadows|t[h]rown_shadows|t[h]rown shadows?": "ShadowReach, cast shadow",
    r"F[a]milies": "SiblingGroups",
    r"H[o]ldings|p[u]sh_down": "PolygonsByCell, sort_into_children",
    r"b[o]unding_bodies|b[o]dy_area": "bounding_capsules, closed_leaf_area",
    r"E[N]OUGH_A_PIXEL": "PRIMITIVES_PER_PIXEL",
    r"r[e]al_fraction|r[e]al_wood": "explicit_fraction, explicit_wood",
    r"k[e]pt_out_of_view": "pushed_outside_view",
    r"E[m]issionForm|P[r]oxyForm|p[r]oxy_form|p[r]oxy forms?": "ProxyEmitter, ProxyKind, proxy_kind",
    r"h[i]des_from": "min_occluding_depth",
    r"s[t]rays_of|S[t]rays": "outliers",
    r"\w*_A[T]_ONCE": "_BATCH",
    r"j[s]on_of|f[i]nd_out": "parse_json, compute",
    r"a[t]_once": "run_to_end",
    r"c[r]own_forms|c[r]own forms?|f[o]rmed_totals": "crown shapes, shaped_totals",
    r"G[u]ilds?|g[u]ilds?|S[e]edRain|s[e]ed rain": "StandSpecies, StandTraits, SeedDispersal",
    r"w[a]rmth|l[e]ast_height": "degree_days, min_height",
    r"_(?:B[L]OT|S[H]ARDS?|L[O]OSE|G[I]VES_WAY)": "what it limits",
    r"s[l]ope_limit|F[I]RST_BEFORE": "slope_max",
}
_PATTERNS = [(re.compile(old, re.IGNORECASE), new) for old, new in _SPELLING.items()]
_PATTERNS += [(re.compile(rf"(?<!\w)(?:{old})(?!\w)"), new) for old, new in _NAMES.items()]
#: What variables, parameters, fields and functions are not called, with or without a first underscore: a noun says what
#: they hold, a verb what they do.
_FILLERS = {"at", "found", "made", "own", "some", "there"}
#: Functions may be called that: they evaluate something at places. And a property that is saved in files.
_EVALUATES, _SAVED = "at", {("tetflora_addon/blender/placing/properties.py", "TetFloraLayer", "made")}
#: Files of foreign words, of others and of tests by earlier names; and units of coordinate systems, as standards spell
#: them, and addresses.
_FOREIGN = ("tetflora_addon/geodata/*.json", "tests/data/*", "examples/data/*", "LICENSE", "devtools/proofs.json")
_KEPT = re.compile(r"\"m[e]tre\"|https?://\S+")


def problems(name: str, lines: list[str]) -> list[str]:
    """Words of a file that gave way, one line each."""
    if any(fnmatch(name, pattern) for pattern in _FOREIGN):
        return []
    found = []
    for number, line in enumerate(lines, 1):
        text = _KEPT.sub("", line)
        for pattern, new in _PATTERNS:
            if word := pattern.search(text):
                found.append(f'{name}:{number}: "{word[0]}" gave way to: {new}')
    return found


def fillers(name: str, tree: ast.Module) -> list[str]:
    """Variables, parameters, fields and functions of a file that have a filler for a name, one line each."""
    nodes = list(ast.walk(tree))
    saved = {
        part.target
        for one in nodes
        if isinstance(one, ast.ClassDef)
        for part in one.body
        if isinstance(part, ast.AnnAssign) and (name, one.name, getattr(part.target, "id", "")) in _SAVED
    }
    stored = [n for n in nodes if isinstance(getattr(n, "ctx", None), ast.Store) and n not in saved]
    bound = [(n.lineno, n.id) for n in stored if isinstance(n, ast.Name)]
    # Only of the object itself: others may be Blender's.
    bound += [(n.lineno, n.attr) for n in stored if isinstance(n, ast.Attribute) and ast.unparse(n.value) == "self"]
    bound += [(n.lineno, n.arg) for n in nodes if isinstance(n, ast.arg)]
    functions = [n for n in nodes if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    bound += [(n.lineno, n.name) for n in functions if n.name != _EVALUATES]
    words = sorted({(line, word) for line, word in bound if word.removeprefix("_") in _FILLERS})
    return [f'{name}:{line}: "{word}" says nothing of what it holds or does' for line, word in words]

#!/usr/bin/env python3
"""Writes the tables of docs/replay.md, docs/retargeting.md, docs/identification.md and docs/tracking.md and the numbers of README from results of the harness.

    python3 tests/replay/document.py LEVEL.json DISTURBED.json GROUND.json FIRMWARE.json [ROBOT.json ...]
    python3 tests/replay/document.py --retargeted RETARGETED.json
    python3 tests/replay/document.py --identified IDENTIFIED.json
    python3 tests/replay/document.py --tracking TRACKING.json

They stand between `<!-- NAME -->` and `<!-- end -->`. Without results of imported robots that table stays.
"""

import json
import sys
from pathlib import Path

import tables

ROOT = Path(__file__).resolve().parents[2]


def main(*paths):
    if paths[:1] == ("--retargeted",):
        text = tables.retargeted(json.loads(Path(paths[1]).read_text()))
        return replace(ROOT / "docs/retargeting.md", {"retargeted": f"\n{text}\n"})
    if paths[:1] == ("--identified",):
        results = json.loads(Path(paths[1]).read_text())
        texts = {"identified": tables.identified(results), "predicted": tables.predicted(results)}
        return replace(ROOT / "docs/identification.md", {name: f"\n{text}\n" for name, text in texts.items()})
    if paths[:1] == ("--tracking",):
        text = tables.tracked(json.loads(Path(paths[1]).read_text()))
        return replace(ROOT / "docs/tracking.md", {"tracked": f"\n{text}\n"})
    level, disturbed, ground, firmware, *imported = (json.loads(Path(path).read_text()) for path in paths)
    texts = {
        "shipped": tables.both(level),
        "disturbed": tables.robustness(disturbed),
        "compared": tables.compared(level, ground),
        "compared-words": tables.compared_in_words(level, ground),
        "firmware": tables.behind_firmware(firmware),
        "firmware-words": tables.behind_firmware_in_words(firmware),
    }
    if imported:
        texts["imported"] = tables.both([result for results in imported for result in results])
    replace(ROOT / "docs/replay.md", {name: f"\n{text}\n" for name, text in texts.items()})
    replace(ROOT / "README.md", {"replay": f"\n{tables.in_words(level)}\n  "})


def replace(path, texts):
    """Puts texts between their marks."""
    whole = path.read_text(encoding="utf-8")
    for name, text in texts.items():
        mark, end = f"<!-- {name} -->", "<!-- end -->"
        if whole.count(mark) != 1 or end not in whole.split(mark)[1]:
            sys.exit(f"{path}: expected one {mark} and {end} after it")
        before, after = whole.split(mark)
        whole = before + mark + text + after[after.index(end) :]
    path.write_text(whole, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])

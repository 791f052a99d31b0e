#!/usr/bin/env python3
"""Prints a page of docs/measured from results of the harness: first a line with the verdict, then Markdown.

    python3 tests/replay/document.py replay LEVEL.json DISTURBED.json GROUND.json FIRMWARE.json [ROBOT.json ...]
    python3 tests/replay/document.py tracked TRACKING.json
    python3 tests/replay/document.py retargeted RETARGETED.json
    python3 tests/replay/document.py identified IDENTIFIED.json
    python3 tests/replay/document.py terrain TERRAIN.json
"""

import json
import sys
from pathlib import Path

import tables


def page(name, results):
    """Verdict and sections of a page."""
    if name == "replay":
        level, disturbed, ground, firmware, *imported = results
        sections = {
            "Shipped motions, level": f"{tables.in_words(level)}\n\n{tables.both(level)}",
            "Disturbed": tables.robustness(disturbed),
            "MuJoCo and Rollwalk's simulator": f"{tables.compared_in_words(level, ground)}\n\n{tables.compared(level, ground)}",
            "Behind firmware and bus": f"{tables.behind_firmware_in_words(firmware)}\n\n{tables.behind_firmware(firmware)}",
        }
        if imported:
            sections["Imported robots"] = tables.both([result for results in imported for result in results])
        return tables.verdict(level), sections
    (result,) = results
    if name == "tracked":
        return "compared", {"Achieved by planned": tables.tracked(result)}
    if name == "retargeted":
        return "compared", {"Achieved by planned": tables.retargeted(result)}
    if name == "terrain":
        return "measured", {"Plans and runs": f"{tables.terrain_in_words(result)}\n\n{tables.terrain(result)}"}
    return "compared", {"Parameters": tables.identified(result), "Predicted runs": tables.predicted(result)}


def main(name, *paths):
    verdict, sections = page(name, [json.loads(Path(path).read_text()) for path in paths])
    print(verdict)
    print("\n\n".join(f"## {title}\n\n{text}" for title, text in sections.items()))


if __name__ == "__main__":
    main(*sys.argv[1:])

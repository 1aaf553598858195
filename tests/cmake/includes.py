#!/usr/bin/python3
"""Includes go downwards: a folder of src/ and include/tendril/ knows only itself and those before it in the list. And no
file is longer than 400 lines.

    tests/cmake/includes.py <repository>
"""
import re
import sys
from pathlib import Path

ORDER = "geometry model layout state energy coupling embedding contact solver dynamics accuracy io".split()
root = Path(sys.argv[1])
MOST_LINES = 400
upward, found = [], 0
for base in (root / "src", root / "include/tendril"):
    for path in sorted(base.rglob("*.?pp")):
        folder = path.relative_to(base).parts[0]
        assert folder in ORDER, f"{path}: folder '{folder}' has no place in the order; write it into ORDER of this script"
        if (lines := path.read_text().count("\n")) > MOST_LINES:
            upward.append(f"{path.relative_to(root)} has {lines} lines, at most {MOST_LINES}: split it by topics")
        for other in re.findall(r'#include "tendril/(\w+)/', path.read_text()):
            found += 1
            if ORDER.index(other) > ORDER.index(folder):
                upward.append(f"{path.relative_to(root)} includes {other}/, which stands above {folder}/")
print("\n".join(upward) or f"{found} includes, all downwards")
assert found > 100, "the includes were not found"
sys.exit(1 if upward else 0)

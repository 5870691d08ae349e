"""Refuse text files that no editor should leave behind: `python tools/check_text.py FILE ...`."""

import sys
from pathlib import Path

LARGEST_BYTES = 1_000_000
MERGE_MARKS = ("<" * 7 + " ", ">" * 7 + " ")


def faults(path: Path) -> list[str]:
    """What is wrong with a file, as lines for a person; nothing if nothing is."""
    data = path.read_bytes()
    if len(data) > LARGEST_BYTES:
        return [f"{path}: {len(data)} bytes; the repository takes files up to {LARGEST_BYTES}"]
    found = []
    if b"\r\n" in data:
        found.append(f"{path}: lines end with CR LF")
    if data and (not data.endswith(b"\n") or data.endswith(b"\n\n")):
        found.append(f"{path}: must end with one line end")
    for number, line in enumerate(data.decode(errors="replace").split("\n"), start=1):
        if line != line.rstrip(" \t"):
            found.append(f"{path}:{number}: trailing blanks")
        if line.startswith(MERGE_MARKS):
            found.append(f"{path}:{number}: a mark left by a merge")
    return found


if __name__ == "__main__":
    lines = [fault for name in sys.argv[1:] for fault in faults(Path(name))]
    print("\n".join(lines), end="\n" if lines else "")
    sys.exit(bool(lines))

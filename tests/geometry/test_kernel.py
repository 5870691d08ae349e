"""Compiled kernels are dropped when any kernel's source changes, whoever calls it."""

from pathlib import Path

from artiskill.geometry.kernel import drop_stale_code


def test_code_is_dropped_when_a_kernel_changes(tmp_path: Path) -> None:
    room = tmp_path / "room"
    cache = room / "__pycache__"
    cache.mkdir(parents=True)
    called, other = room / "called.py", room / "other.py"
    called.write_text("@kernel\ndef f(): ...")
    other.write_text("x = 1")
    assert drop_stale_code(tmp_path), "no stamp yet"
    compiled = [cache / "caller.f-1.py311.nbi", cache / "caller.f-1.py311.1.nbc"]
    for path in compiled:
        path.write_bytes(b"code")
    assert not drop_stale_code(tmp_path)
    other.write_text("x = 2")
    assert not drop_stale_code(tmp_path), "no kernel in there"
    assert all(path.exists() for path in compiled)
    called.write_text("@kernel\ndef f(): pass")
    assert drop_stale_code(tmp_path)
    assert not any(path.exists() for path in compiled)
    assert not drop_stale_code(tmp_path)

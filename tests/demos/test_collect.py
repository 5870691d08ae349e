import dataclasses
import json
import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from artiskill.assets.articulated_object import ArticulatedObject
from artiskill.assets.catalog import load_object
from artiskill.demos import plan as planning
from artiskill.demos.attempts import Attempt, run_block
from artiskill.demos.collect import Collection, collect
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demos import Demos
from artiskill.demos.hdf5 import load_h5py
from artiskill.demos.manifest import read_manifest, write_manifest
from artiskill.demos.plan import Plan
from artiskill.demos.staging import Staging
from artiskill.demos.unfinished import UNFINISHED, unfinished_objects, unlisted_files
from artiskill.demos.verify import verify
from artiskill.errors import ConfigError, DemoError, PolicyError, UnknownNameError
from artiskill.jobs.reservation import reserved

from .conftest import PER_OBJECT, contents

MakePlan = Callable[..., Plan]

# Collects, and is killed at the third attempt that it hears of, or writes files of at most so many bytes.
COLLECTOR = """
import os, resource, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from tests.demos.conftest import drawer_plan
from artiskill.demos.collect import collect

heard = []
def on_attempt(attempt):
    heard.append(attempt)
    if len(heard) == 3 and sys.argv[4] == "kill":
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    if sys.argv[4].isdigit():
        env = drawer_plan().settings.make_env(["cabinet-0002"])
        env.reset(seed=0)
        env.step(env.action_space.sample())  # compiled code is on the disk from now on
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[4]),) * 2)
    collect(drawer_plan(), Path(sys.argv[2]), int(sys.argv[3]), on_attempt)
"""


def collector(root: Path, folder: Path, workers: int, what: str) -> subprocess.CompletedProcess[str]:
    script = folder.parent / "collector.py"
    script.write_text(COLLECTOR)
    command = [sys.executable, str(script), str(root), str(folder), str(workers), what]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_what_is_collected(drawers: Path) -> None:
    demos = Demos(drawers, check=True)
    assert demos.objects == ("cabinet-0002", "cabinet-0026")
    assert len(demos) == 2 * PER_OBJECT
    assert all(trajectory.success for trajectory in demos.trajectories())
    with demos.open("cabinet-0026") as file:
        targets = [(count.target, count.wanted, count.successes) for count in file.header.targets]
        assert [wanted for _, wanted, _ in targets] == [2, 1]
        levels = [(trajectory.target, trajectory.level) for trajectory in file]
    first, second = (target for target, _, _ in targets)
    assert levels == [(first, 0), (first, 2), (second, 1)]
    assert not (drawers / UNFINISHED).exists()
    with pytest.raises(UnknownNameError, match="did you mean 'cabinet-0026'"):
        demos.open("cabinet-26")


def test_two_workers_make_the_same_files(drawers: Path, plan: MakePlan, tmp_path: Path) -> None:
    collect(plan(), tmp_path / "two", workers=2)
    assert contents(tmp_path / "two") == contents(drawers)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_collection_goes_on(
    drawers: Path, root: Path, plan: MakePlan, tmp_path: Path, workers: int
) -> None:
    folder = tmp_path / "killed"
    assert collector(root, folder, workers, "kill").returncode == -signal.SIGKILL
    assert list((folder / UNFINISHED).rglob("*.npz")) or list(folder.glob("*.h5"))
    attempts = []
    collect(plan(), folder, 3 - workers, attempts.append)
    assert contents(folder) == contents(drawers)
    assert len(attempts) <= 2 * PER_OBJECT - 3  # the first three are not made again


def test_nothing_is_made_twice(own_drawers: Path, plan: MakePlan) -> None:
    before = contents(own_drawers)
    attempts = []
    collect(plan(), own_drawers, on_attempt=attempts.append)
    assert not attempts
    assert contents(own_drawers) == before


def test_a_killed_end_is_made_up_for(own_drawers: Path, plan: MakePlan, drawers: Path) -> None:
    """Killed after the file was written and before the manifest, with half a file left over."""
    lost = plan(objects=["cabinet-0002"])
    write_manifest(dataclasses.replace(read_manifest(own_drawers), files={}), own_drawers)
    (own_drawers / ".part-abcd1234.h5").write_bytes(b"half")
    (own_drawers / UNFINISHED / "cabinet-0026").mkdir(parents=True)
    (own_drawers / UNFINISHED / "cabinet-0026" / "1.npz").write_bytes(b"half")
    collect(lost, own_drawers)
    collect(plan(), own_drawers)
    assert contents(own_drawers) == contents(drawers)


def test_objects_may_follow_later(drawers: Path, plan: MakePlan, tmp_path: Path) -> None:
    for name in ("cabinet-0026", "cabinet-0002"):
        collect(plan(objects=[name]), tmp_path / "one by one")
    assert contents(tmp_path / "one by one") == contents(drawers)


def test_other_settings_need_another_folder(own_drawers: Path, plan: MakePlan) -> None:
    with pytest.raises(DemoError, match=r"other settings \(per_object 3 there, 4 here\); choose another folder"):
        collect(plan(per_object=4), own_drawers)
    with pytest.raises(DemoError, match=r"config\.episode_steps 200 there, 150 here"):
        collect(plan(config={"episode_steps": 150}), own_drawers)
    with pytest.raises(DemoError, match=r"variety true there, false here; expert\.config_hash "):
        collect(plan(variety=False), own_drawers)


def test_what_varies_is_part_of_the_settings(plan: MakePlan, monkeypatch: pytest.MonkeyPatch) -> None:
    before = plan().settings.expert
    variation = planning.load_variation("OpenCabinetDrawer")
    calm = dataclasses.replace(variation, disturbance=dataclasses.replace(variation.disturbance, base_m=0.0))
    for changed in (calm, dataclasses.replace(variation, ranges={})):
        monkeypatch.setattr(planning, "load_variation", lambda task, changed=changed: changed)
        assert plan().settings.expert.config_hash != before.config_hash
    assert plan(variety=False).settings.expert.config_hash != before.config_hash


def test_without_variety_nothing_is_disturbed(plan: MakePlan, drawers: Path, tmp_path: Path) -> None:
    collect(plan(objects=["cabinet-0002"], per_object=1, variety=False), tmp_path)
    with DemoFile(tmp_path / "cabinet-0002.h5") as plain, DemoFile(drawers / "cabinet-0002.h5") as varied:
        assert not plain.trajectory(0).disturbed.any()
        assert varied.trajectory(0).disturbed.any()
    assert not verify(tmp_path)[0].faults


def test_another_object_of_the_same_name_is_refused(own_drawers: Path, plan: MakePlan) -> None:
    manifest = own_drawers / "manifest.json"
    known = read_manifest(own_drawers).files["cabinet-0002.h5"].content_hash
    manifest.write_text(manifest.read_text().replace(known, "0" * len(known)))
    with pytest.raises(DemoError, match="holds demonstrations of another 'cabinet-0002'"):
        collect(plan(), own_drawers)


def test_a_changed_file_is_noticed(own_drawers: Path, plan: MakePlan) -> None:
    with (own_drawers / "cabinet-0002.h5").open("ab") as file:
        file.write(b"more")
    with pytest.raises(DemoError, match=r"is not the file that the manifest lists.*remove it and collect again"):
        collect(plan(), own_drawers)


def test_a_removed_file_is_made_again(own_drawers: Path, plan: MakePlan, drawers: Path) -> None:
    (own_drawers / "cabinet-0002.h5").unlink()
    collect(plan(), own_drawers)
    assert contents(own_drawers) == contents(drawers)


def test_one_collector_at_a_time(own_drawers: Path, plan: MakePlan) -> None:
    before = contents(own_drawers)
    with (
        reserved(own_drawers, "collector"),
        pytest.raises(ConfigError, match=rf"another collector or replay \(process {os.getpid()}\) writes to"),
    ):
        collect(plan(), own_drawers)
    assert contents(own_drawers) == before


def test_what_no_expert_solves_is_given_up(plan: MakePlan, tmp_path: Path) -> None:
    steps = {"episode_steps": 5}
    for workers in (1, 2):
        collect(plan(config=steps, objects=["cabinet-0026"]), tmp_path / str(workers), workers)
    assert contents(tmp_path / "1") == contents(tmp_path / "2")
    (entry,) = read_manifest(tmp_path / "1").files.values()
    assert [(c.attempts, c.successes, c.gave_up) for c in entry.targets] == [(4, 0, True), (4, 0, True)]
    assert entry.trajectories == 0
    with DemoFile(tmp_path / "1" / "cabinet-0026.h5") as file:
        assert len(file) == 0
        assert file.attempts["steps"].tolist() == [5] * 8
        assert file.attempts["trajectory"].tolist() == [-1] * 8
    assert not verify(tmp_path / "1")[0].faults


def test_failures_are_kept_on_request(plan: MakePlan, tmp_path: Path) -> None:
    collect(plan(config={"episode_steps": 5}, objects=["cabinet-0002"], keep_failures=True), tmp_path)
    with DemoFile(tmp_path / "cabinet-0002.h5") as file:
        assert [(len(t), t.success) for t in file] == [(5, False)] * 4
    (verdict,) = verify(tmp_path)
    assert (verdict.exact, verdict.faults) == (4, ())


def test_operational_space(plan: MakePlan, tmp_path: Path) -> None:
    collect(plan(control_mode="operational_space", objects=["cabinet-0002"], per_object=1), tmp_path)
    with DemoFile(tmp_path / "cabinet-0002.h5") as file:
        trajectory, env = file.trajectory(0), file.make_env()
        assert trajectory.success
        assert env.control.mode == "operational_space"
        assert trajectory.env_state(45, env).elapsed == 45
    assert not verify(tmp_path)[0].faults


def test_chosen_targets(plan: MakePlan, drawers: Path, tmp_path: Path) -> None:
    chosen = [count.target for count in read_manifest(drawers).files["cabinet-0026.h5"].targets][1]
    collect(plan(objects=["cabinet-0026"], targets=[chosen], per_object=1), tmp_path)
    with DemoFile(tmp_path / "cabinet-0026.h5") as file, DemoFile(drawers / "cabinet-0026.h5") as other:
        assert [count.target for count in file.header.targets] == [chosen]
        ours, theirs = file.trajectory(0), other.trajectory(2)
        assert (ours.target, ours.level) == (theirs.target, theirs.level)
        np.testing.assert_array_equal(ours.actions, theirs.actions)
    with pytest.raises(UnknownNameError, match="target link 'link_99'"):
        plan(targets=["link_99"])
    with pytest.raises(UnknownNameError, match=f"target link '{chosen}0'; did you mean '{chosen}'"):
        plan(objects=["cabinet-0026"], targets=[chosen, f"{chosen}0"])


@pytest.mark.parametrize("most_bytes", [20_000, 30_000])
def test_a_full_disk_damages_nothing(
    drawers: Path, root: Path, plan: MakePlan, tmp_path: Path, most_bytes: int
) -> None:
    """The first limit is too small for an attempt, the second for the file of an object."""
    folder = tmp_path / "full"
    done = collector(root, folder, 1, str(most_bytes))
    assert done.returncode == 1
    assert "DemoError: cannot write" in done.stderr
    assert "File too large" in done.stderr
    assert not list(folder.rglob(".part-*"))
    collect(plan(), folder)
    assert contents(folder) == contents(drawers)


def test_every_target_can_have_as_many(plan: MakePlan) -> None:
    made = plan(objects=["cabinet-0012", "cabinet-0002"], per_object=None, per_target=4)
    for one in made.objects:
        assert [stream.wanted for stream in made.streams(one)] == [4] * len(one.targets)
        assert made.wanted(one) == 4 * len(one.targets)
    assert len({len(one.targets) for one in made.objects}) == 2
    with pytest.raises(ConfigError, match="per object or per target, not both"):
        plan(per_object=3, per_target=4)
    with pytest.raises(ConfigError, match=r"per target must be a whole number from 1 to \d+, not 0"):
        plan(per_object=None, per_target=0)
    assert plan(per_object=None).settings.per_object == 300


class Stop(Exception):  # noqa: N818 - no error
    """Ends a collection."""


def begin(made: Plan, folder: Path, attempts: int) -> None:
    """Collect, and stop after so many attempts."""
    heard = []

    def on_attempt(attempt: object) -> None:
        heard.append(attempt)
        if len(heard) == attempts:
            raise Stop

    with pytest.raises(Stop):
        collect(made, folder, on_attempt=on_attempt)


def test_a_lost_manifest_is_no_licence(own_drawers: Path, plan: MakePlan, tmp_path: Path) -> None:
    """Neither finished files nor staged attempts go over to another plan, even of other objects."""
    (own_drawers / "manifest.json").unlink()
    begin(plan(), tmp_path / "begun", 2)
    (tmp_path / "begun" / "manifest.json").unlink()
    for folder, told in (
        (
            own_drawers,
            r"does not fit: cabinet-0002.h5 was made with other settings \(per_object 3 there, 1 here\)",
        ),
        (tmp_path / "begun", "holds attempts made with other settings: their hash was"),
    ):
        before = contents(folder)
        for objects in (["cabinet-0002"], ["cabinet-0012"]):
            with pytest.raises(DemoError, match=told):
                collect(plan(objects=objects, per_object=1), folder)
            assert contents(folder) == before


@pytest.mark.parametrize("text", [None, ""])
def test_a_lost_manifest_is_made_anew(own_drawers: Path, plan: MakePlan, drawers: Path, text: str | None) -> None:
    manifest = own_drawers / "manifest.json"
    manifest.unlink()
    if text is not None:
        manifest.write_text(text)
    with pytest.raises(DemoError, match=r"remove what is left of manifest.json and collect with the options of"):
        Demos(own_drawers)
    manifest.unlink(missing_ok=True)
    attempts = []
    collect(plan(objects=["cabinet-0002"]), own_drawers, on_attempt=attempts.append)
    assert not attempts
    assert contents(own_drawers) == contents(drawers)


def test_files_of_another_machine_are_taken_in(own_drawers: Path, plan: MakePlan, drawers: Path) -> None:
    """Copied in without their manifest: neither overlooked nor overwritten."""
    name = "cabinet-0026.h5"
    listed = read_manifest(own_drawers)
    write_manifest(
        dataclasses.replace(listed, files={"cabinet-0002.h5": listed.files["cabinet-0002.h5"]}), own_drawers
    )
    assert unlisted_files(own_drawers) == [own_drawers / name]
    before = (own_drawers / name).stat().st_ino
    attempts = []
    collect(plan(), own_drawers, on_attempt=attempts.append)
    assert not attempts
    assert (own_drawers / name).stat().st_ino == before
    assert contents(own_drawers) == contents(drawers)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("cabinet-0002.h5", r"cabinet-0002.h5 was made with other settings \(variety true there, false here"),
        ("copy.h5", r"copy.h5 holds demonstrations of 'cabinet-0026'"),
        ("damaged.h5", r"damaged.h5': it is truncated"),
        ("foreign.h5", r"foreign.h5' holds no demonstrations"),
    ],
)
def test_files_that_do_not_fit_are_an_error(own_drawers: Path, plan: MakePlan, name: str, told: str) -> None:
    manifest, source, given = own_drawers / "manifest.json", own_drawers / "cabinet-0026.h5", own_drawers / name
    if name == "cabinet-0002.h5":
        (own_drawers / "cabinet-0026.h5").unlink()
        manifest.unlink()
    elif name == "copy.h5":
        given.write_bytes(source.read_bytes())
    elif name == "damaged.h5":
        given.write_bytes(source.read_bytes()[:1000])
    else:
        load_h5py().File(given, "w").close()
    before = contents(own_drawers)
    with pytest.raises(DemoError, match=rf"does not list, and that does not fit: .*{told}.*; move it elsewhere"):
        collect(plan(variety=name != "cabinet-0002.h5"), own_drawers)
    assert contents(own_drawers) == before


def test_a_folder_that_is_refused_stays_as_it_is(own_drawers: Path, plan: MakePlan) -> None:
    (own_drawers / ".part-abcd1234.h5").write_bytes(b"somebody's")
    before = contents(own_drawers)
    with pytest.raises(
        DemoError, match="holds demonstrations of OpenCabinetDrawer, not of OpenCabinetDoor; choose"
    ):
        collect(plan(task="OpenCabinetDoor", objects=["cabinet-0006"]), own_drawers)
    assert contents(own_drawers) == before


KILLED = """
import os, sys
sys.path.insert(0, sys.argv[1])
import artiskill.demos.collect as module
from tests.demos.conftest import drawer_plan

before, when = module.write_manifest, sys.argv[3]
def write(manifest, folder):
    if when == "between" and manifest.files:
        os._exit(9)
    before(manifest, folder)
    if when == "boundary" and manifest.files:
        os._exit(9)
module.write_manifest = write
module.collect(drawer_plan(), sys.argv[2], on_attempt=lambda attempt: os._exit(9) if when == "first" else None)
"""


@pytest.mark.parametrize(
    ("when", "missing", "beside"),
    [
        ("first", ["cabinet-0002", "cabinet-0026"], []),
        ("boundary", ["cabinet-0026"], []),
        ("between", ["cabinet-0002", "cabinet-0026"], ["cabinet-0002.h5"]),
    ],
)
def test_whenever_it_is_killed_the_folder_says_what_is_missing(
    root: Path, plan: MakePlan, drawers: Path, tmp_path: Path, when: str, missing: list[str], beside: list[str]
) -> None:
    folder = tmp_path / "killed"
    command = [sys.executable, "-c", KILLED, str(root), str(folder), when]
    assert subprocess.run(command, capture_output=True, timeout=120).returncode == 9
    assert unfinished_objects(folder) == missing
    assert [path.name for path in unlisted_files(folder)] == beside
    collect(plan(), folder)
    assert unfinished_objects(folder) == []
    assert contents(folder) == contents(drawers)


def test_what_is_left_of_a_finished_object_goes(own_drawers: Path, plan: MakePlan) -> None:
    """Killed after the manifest was written, and before its attempts were removed."""
    left = own_drawers / UNFINISHED / "cabinet-0026"
    left.mkdir(parents=True)
    (left / "1.npz").write_bytes(b"an attempt")
    collect(plan(), own_drawers)
    assert not (own_drawers / UNFINISHED).exists()


@pytest.mark.parametrize("changes", [{"target": "../../up"}, {"level": -2}, {"object": "cabinet-0026"}])
def test_attempts_that_nobody_would_make_count_for_nothing(
    drawers: Path, plan: MakePlan, tmp_path: Path, changes: dict[str, object]
) -> None:
    begin(plan(), tmp_path, 2)
    restage(tmp_path, **changes)
    collect(plan(), tmp_path)
    assert contents(tmp_path) == contents(drawers)


def test_links_may_be_called_anything(plan: MakePlan, tmp_path: Path) -> None:
    """Names of own URDFs' links are no names of files."""
    for link in ("top/1", "../../up", "a" * 300):
        folder = tmp_path / str(len(link)) / "demos"
        mine = renamed(load_object("cabinet-0002"), "link_0", link)
        begin(plan(objects=[mine]), folder, 2)
        staged = sorted(path.relative_to(folder).as_posix() for path in folder.parent.rglob("*.npz"))
        assert staged == [f"{UNFINISHED}/mine/{level}.npz" for level in (0, 1)]
        (entry,) = collect(plan(objects=[mine]), folder).files.values()
        assert [(count.target, count.successes) for count in entry.targets] == [(link, 3)]


def renamed(obj: ArticulatedObject, link: str, name: str) -> ArticulatedObject:
    """An object of one's own with another name of a link."""
    links = tuple(dataclasses.replace(one, name=name) if one.name == link else one for one in obj.links)
    handles = tuple(dataclasses.replace(one, link=name) if one.link == link else one for one in obj.handles)
    return dataclasses.replace(obj, id="mine", links=links, handles=handles, metadata={})


def test_an_edited_entry_is_noticed(own_drawers: Path, plan: MakePlan) -> None:
    entry = read_manifest(own_drawers).files["cabinet-0002.h5"]
    edited = dataclasses.replace(entry, trajectories=entry.trajectories + 1)
    write_manifest(read_manifest(own_drawers).with_file("cabinet-0002.h5", edited), own_drawers)
    with pytest.raises(DemoError, match="holds something else than the manifest says"):
        collect(plan(), own_drawers)
    with pytest.raises(DemoError, match="holds something else than the manifest says"):
        Demos(own_drawers).open("cabinet-0002")


def test_an_object_is_not_finished_while_somebody_is_at_it(plan: MakePlan, tmp_path: Path) -> None:
    """Its targets are given up before the workers have come to the end of what they were handed."""
    hopeless = plan(config={"episode_steps": 5}, objects=["cabinet-0026"], per_object=20)
    (tmp_path / "crew").mkdir()
    collection = Collection(hopeless, tmp_path / "crew", lambda attempt: None)
    blocks = list(iter(collection.next, None))
    assert sum(len(block.levels) for block in blocks) == 20
    for number, block in enumerate(blocks):
        assert collection.manifest.files == {}
        run_block(block, collection.take_in)
        collection.finished(number, None)
    collect(hopeless, tmp_path / "one")
    assert contents(tmp_path / "crew") == contents(tmp_path / "one")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("settings_hash", "attempts made with other settings: their hash was 0000, now it is [0-9a-f]{16};"),
        ("content_hash", "attempts made with another 'cabinet-0002': its content hash was 0000, now it is"),
    ],
)
def test_attempts_of_others_are_refused(plan: MakePlan, tmp_path: Path, change: str, message: str) -> None:
    begin(plan(), tmp_path, 2)
    restage(tmp_path, **{change: "0000"})
    with pytest.raises(DemoError, match=message):
        collect(plan(), tmp_path)


def restage(folder: Path, **changes: object) -> None:
    """Change what a staged attempt says about itself."""
    path = sorted((folder / UNFINISHED / "cabinet-0002").glob("*.npz"))[0]
    with np.load(path) as file:
        arrays = dict(file)
    arrays["about"] = np.array(json.dumps(json.loads(str(arrays["about"])) | changes))
    np.savez(path, **arrays)


def test_two_objects_of_one_name_do_not_mix(plan: MakePlan, tmp_path: Path) -> None:
    """An imported object that was changed between two runs keeps its id."""
    mine = dataclasses.replace(load_object("cabinet-0002"), id="mine")
    changed = dataclasses.replace(mine, metadata=dict(mine.metadata) | {"edition": 2})
    begin(plan(objects=[mine]), tmp_path, 2)
    with pytest.raises(DemoError, match=r"mine' holds attempts made with another 'mine': its content hash was"):
        collect(plan(objects=[changed]), tmp_path)
    assert collect(plan(objects=[mine]), tmp_path).files["mine.h5"].content_hash == mine.content_hash


def test_a_spoilt_attempt_is_made_again(plan: MakePlan, drawers: Path, tmp_path: Path) -> None:
    """Spoilt before the next run, or between an attempt and the end of its object."""
    spoilt = []

    def spoil(attempt: object) -> None:
        if not spoilt:
            spoilt.extend((tmp_path / UNFINISHED / "cabinet-0002").glob("*.npz"))
            spoilt[0].write_bytes(spoilt[0].read_bytes()[:100])

    with pytest.raises(DemoError, match=r"1 of 3 attempts at 'cabinet-0002' were damaged.*makes them again"):
        collect(plan(), tmp_path, on_attempt=spoil)
    collect(plan(), tmp_path)
    assert contents(tmp_path) == contents(drawers)


def test_whatever_is_wrong_with_a_staged_file_it_was_never_made(drawers: Path, tmp_path: Path) -> None:
    staging = Staging(tmp_path, "settings")
    with DemoFile(drawers / "cabinet-0002.h5") as file:
        first = file[0]
    attempt = Attempt("cabinet-0002", first.target, first.level, True, len(first), "", first.recording)
    staging.save(attempt, "object")
    (path,) = (tmp_path / UNFINISHED).rglob("*.npz")
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    (found,) = staging.load("cabinet-0002", "object")
    np.testing.assert_array_equal(found.recording.states, first.recording.states)
    for k in range(900):
        data = bytearray(whole)
        if k % 4 == 0:
            data = data[: rng.integers(len(data))]
        else:  # anywhere, in the first header, or in the directory at the end
            where = (int(rng.integers(len(data))), int(rng.integers(900)), len(data) - 1 - int(rng.integers(900)))
            data[where[k % 4 - 1]] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        for one in staging.load("cabinet-0002", "object"):
            assert one.recording is not None
            told = (one.target, one.level, one.success, one.steps)
            assert told == (first.target, first.level, True, len(first))
            np.testing.assert_array_equal(one.recording.actions, first.actions)


def test_levels_that_there_are_not(plan: MakePlan, tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"5 trajectories of 'cabinet-0002', .*2147483645 to 2147483649; the last"
    ):
        plan(objects=["cabinet-0002"], per_object=5, first_level=2147483645)
    last = plan(objects=["cabinet-0002"], per_object=3, first_level=2147483645, config={"episode_steps": 5})
    (entry,) = collect(last, tmp_path).files.values()
    assert [(c.attempts, c.successes, c.gave_up) for c in entry.targets] == [(3, 0, True)]
    assert not verify(tmp_path)[0].faults


def test_a_killed_worker_is_no_end(plan: MakePlan, drawers: Path, tmp_path: Path) -> None:
    def kill(attempt: object) -> None:
        for child in multiprocessing.active_children():
            child.kill()

    with pytest.raises(
        PolicyError, match=r"killed by signal 9.*all that was made before is kept: the same command"
    ):
        collect(plan(), tmp_path, 2, on_attempt=kill)
    collect(plan(), tmp_path)
    assert contents(tmp_path) == contents(drawers)


def test_bad_numbers(plan: MakePlan, tmp_path: Path) -> None:
    for bad in (0, -1, 2.5, True, 2**31):
        with pytest.raises(ConfigError, match="trajectories per object must be a whole number from 1 to"):
            plan(per_object=bad)
    for bad in (0, -1, 2.5, True):
        with pytest.raises(ConfigError, match="workers must be a whole number of at least 1"):
            collect(plan(), tmp_path / "out", workers=bad)
    with pytest.raises(UnknownNameError, match="unknown control mode 'joints'; did you mean 'joint'"):
        plan(control_mode="joints")
    assert not (tmp_path / "out").exists()

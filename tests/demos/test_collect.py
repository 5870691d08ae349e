import dataclasses
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
from artiskill.demos.collect import Collection, collect
from artiskill.demos.demo_file import DemoFile
from artiskill.demos.demonstrator import run_collect_job
from artiskill.demos.demos import (
    UNFINISHED,
    Demos,
    read_manifest,
    unfinished_objects,
    unlisted_files,
    write_manifest,
)
from artiskill.demos.plan import CollectionPlan
from artiskill.demos.verify import verify
from artiskill.errors import ConfigError, DemoError, PolicyError, UnknownNameError
from artiskill.files import lock_folder
from artiskill.jobs.fork_server import fork_server
from artiskill.tasks.levels import FIRST_DEMONSTRATED

from .conftest import PER_OBJECT, begin, contents

MakePlan = Callable[..., CollectionPlan]

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
    assert levels == [(name, FIRST_DEMONSTRATED + k) for name, k in ((first, 0), (first, 2), (second, 1))]
    assert not (drawers / UNFINISHED).exists()
    with pytest.raises(UnknownNameError, match="did you mean 'cabinet-0026'"):
        demos.open("cabinet-26")


def test_two_workers_make_the_same_files(drawers: Path, plan: MakePlan, tmp_path: Path) -> None:
    collect(plan(), tmp_path / "two", workers=2)
    assert contents(tmp_path / "two") == contents(drawers)


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 2])
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
        lock_folder(own_drawers, "collector"),
        pytest.raises(ConfigError, match=rf"another collector or replay \(process {os.getpid()}\) is already"),
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
    (result,) = verify(tmp_path)
    assert (result.exact, result.faults) == (4, ())


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


@pytest.mark.parametrize("most_bytes", [20_000, pytest.param(30_000, marks=pytest.mark.slow)])
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
        assert [queue.wanted for queue in made.queues(one)] == [4] * len(one.targets)
        assert made.wanted(one) == 4 * len(one.targets)
    assert len({len(one.targets) for one in made.objects}) == 2
    with pytest.raises(ConfigError, match="per object or per target, not both"):
        plan(per_object=3, per_target=4)
    with pytest.raises(ConfigError, match=r"per target must be a whole number from 1 to \d+, not 0"):
        plan(per_object=None, per_target=0)
    assert plan(per_object=None).settings.per_object == 300


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
        pytest.param("boundary", ["cabinet-0026"], [], marks=pytest.mark.slow),
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


def test_links_may_be_called_anything(plan: MakePlan, tmp_path: Path) -> None:
    """Names of own URDFs' links are no names of files."""
    for link in ("top/1", "../../up", "a" * 300):
        folder = tmp_path / str(len(link)) / "demos"
        mine = renamed(load_object("cabinet-0002"), "link_0", link)
        begin(plan(objects=[mine]), folder, 2)
        staged = sorted(path.relative_to(folder).as_posix() for path in folder.parent.rglob("*.npz"))
        assert staged == [f"{UNFINISHED}/mine/{FIRST_DEMONSTRATED + k}.npz" for k in (0, 1)]
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
    jobs = list(iter(collection.next, None))
    assert sum(len(job.levels) for job in jobs) == 20
    for number, job in enumerate(jobs):
        assert collection.manifest.files == {}
        run_collect_job(job, collection.add_attempt)
        collection.finished(number, None)
    collect(hopeless, tmp_path / "one")
    assert contents(tmp_path / "crew") == contents(tmp_path / "one")


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
        server = fork_server()._process.pid
        for child in Path(f"/proc/{server}/task/{server}/children").read_text().split():
            os.kill(int(child), signal.SIGKILL)

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

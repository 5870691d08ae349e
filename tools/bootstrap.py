"""Make the virtual environment in which `make` runs everything; standard library only.

    python3 tools/bootstrap.py [--venv .venv] [extra ...]

creates the environment if there is none, installs ArtiSkill into it (editable, with the named extras), and does
nothing, in well under a second, when that has been done before. It works where nothing but `python3` exists:
Debian ships Python without `ensurepip`, so pip itself has to be fetched, and a bare machine lacks certificates.

Written so that Python 3.6 can still parse it: only then can it say that 3.11 is needed.
"""

import argparse
import contextlib
import fcntl
import hashlib
import html
import importlib.util
import json
import os
import re
import shutil
import ssl
import subprocess
import sys
import tempfile
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OLDEST_PYTHON = (3, 11)
# The one file fetched without pip. Its digest stands here, so neither index nor connection has to be trusted.
PIP_WHEEL = "pip-26.1.2-py3-none-any.whl"
PIP_WHEEL_SHA256 = "382ff9f685ee3bc25864f820aa50505825f10f5458ffff07e30a6d96e5715cab"
DEFAULT_INDEX = "https://pypi.org/simple"
TIMEOUT_S = 60
UNFINISHED = {"state": "unfinished"}
NO_NETWORK = "cannot reach the package index: is there a network (or PIP_INDEX_URL, HTTPS_PROXY)?"
# what pip prints -> what to say instead
_PIP_EXPLAINED = {
    "CERTIFICATE_VERIFY_FAILED": "the package index's certificate is not known; behind a proxy that has its own, "
    "name that certificate's file in PIP_CERT",
    "NewConnectionError": NO_NETWORK,
    "NameResolutionError": NO_NETWORK,
    "ProxyError": NO_NETWORK,
    "No space left on device": "the disk is full: about 1 GB is needed",
}


class BootstrapError(Exception):
    """Why there is no environment, in a sentence for the person at the terminal."""


def main(arguments=None):
    """Make the environment; returns the exit status."""
    parser = argparse.ArgumentParser(
        description="Make ArtiSkill's virtual environment, unless it is there already."
    )
    parser.add_argument("--venv", default=".venv", help="where, relative to the checkout (default: .venv)")
    parser.add_argument("extras", nargs="*", help="extras of pyproject.toml to install as well, such as test")
    options = parser.parse_args(arguments)
    try:
        check_python(sys.version_info)
        with one_at_a_time(ROOT):
            ensure_environment(ROOT, ROOT / options.venv, options.extras)
    except BootstrapError as error:
        print("bootstrap: " + str(error), file=sys.stderr)
        return 1
    return 0


def check_python(version):
    """Raise BootstrapError if this Python is too old."""
    if tuple(version[:2]) < OLDEST_PYTHON:
        raise BootstrapError(
            "ArtiSkill needs Python 3.11 or newer, and {} is {}.{}; name another, for example: "
            "make setup PYTHON=python3.12".format(sys.executable or "python3", *version[:2])
        )


@contextlib.contextmanager
def one_at_a_time(folder):
    """Hold a lock on a folder, so that `make -j` does not build one environment twice at once."""
    descriptor = os.open(str(folder), os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def ensure_environment(root, venv, extras):
    """Create, repair or extend the environment until ArtiSkill and the extras are in it."""
    stamp = read_stamp(venv)
    healthy = is_healthy(venv)
    wanted = sorted(set(extras) | (set(stamp.get("extras", ())) if healthy else set()))
    key = environment_key(root)
    if healthy and stamp.get("key") == key and stamp["extras"] == wanted and is_installed(venv):
        return
    if not healthy or stamp == UNFINISHED:
        create(venv)
        stamp = UNFINISHED
    install(root, venv, wanted, stamp)
    write_stamp(venv, {"key": key, "extras": wanted})


def environment_key(root):
    """Digest of what decides the contents: requirements, Python, and the place (the install is editable)."""
    digest = hashlib.sha256((root / "pyproject.toml").read_bytes())
    digest.update(f"{sys.version}\n{root}".encode())
    return digest.hexdigest()


def is_healthy(venv):
    """Whether the environment's Python runs, is of this version, believes to be where it is, and has pip."""
    code = "import sys, pip; print(sys.version_info[:2], sys.prefix)"
    command = [str(venv / "bin" / "python"), "-I", "-c", code]
    try:
        answer = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired):
        return False
    wanted = f"{tuple(sys.version_info[:2])} {venv}"
    return answer.returncode == 0 and answer.stdout.decode().strip() == wanted and scripts_fit(venv)


def is_installed(venv):
    """Whether ArtiSkill is still in the environment."""
    return any(venv.glob("lib/python*/site-packages/artiskill-*.dist-info"))


def scripts_fit(venv):
    """Whether the scripts start this environment's Python: a copied or moved checkout's still name the old one."""
    script = venv / "bin" / "pip"
    try:
        return str(venv) in script.read_text(errors="replace").split("import", 1)[0]
    except OSError:
        return False


def create(venv):
    """Make an empty environment with pip, in place of whatever stood there."""
    if (
        venv.exists()
        and not (venv / "pyvenv.cfg").exists()
        and read_stamp(venv) != UNFINISHED
        and any(venv.iterdir())
    ):
        raise BootstrapError(f"{venv} exists and is no virtual environment; remove it or name another one")
    print(f"bootstrap: creating {venv}", flush=True)
    shutil.rmtree(str(venv), ignore_errors=True)
    base_python = getattr(sys, "_base_executable", "") or sys.executable  # not the environment just removed
    command = [base_python, "-m", "venv"]
    if importlib.util.find_spec("ensurepip") and quietly([*command, str(venv)]).returncode == 0:
        write_stamp(venv, UNFINISHED)
        return
    made = quietly([*command, "--clear", "--without-pip", str(venv)])
    if made.returncode != 0:
        raise BootstrapError(f"cannot create {venv}: {last_line(made.stderr)}")
    write_stamp(venv, UNFINISHED)
    with tempfile.TemporaryDirectory() as folder:
        wheel = Path(folder) / PIP_WHEEL
        wheel.write_bytes(fetch_pip())
        # a wheel is a zip archive, and pip can run out of its own
        run_pip(
            [str(venv / "bin" / "python"), "-I", str(wheel / "pip")], ["install", "--no-index", str(wheel)], folder
        )


def fetch_pip():
    """The pinned pip wheel from the package index, its digest verified."""
    index = os.environ.get("PIP_INDEX_URL", DEFAULT_INDEX).rstrip("/") + "/pip/"
    page = fetch(index).decode(errors="replace")
    for link in re.findall(r"""href\s*=\s*["']([^"']+)["']""", page):
        url = urllib.parse.urljoin(index, html.unescape(link))
        if urllib.parse.urlparse(url).path.endswith("/" + PIP_WHEEL):
            data = fetch(url)
            if hashlib.sha256(data).hexdigest() != PIP_WHEEL_SHA256:
                raise BootstrapError(f"{url} is not the file it should be: its SHA-256 differs")
            return data
    raise BootstrapError(f"{index} does not offer {PIP_WHEEL}; install pip for Python (Debian: python3-venv)")


def fetch(url):
    """The bytes at a URL."""
    request = urllib.request.Request(url, headers={"Accept": "text/html, */*"})
    context = ssl.create_default_context(cafile=os.environ.get("PIP_CERT"))
    try:
        return read(request, context)
    except urllib.error.URLError as error:
        if not isinstance(error.reason, ssl.SSLCertVerificationError):
            raise BootstrapError(f"cannot reach the package index at {url}: {error.reason}") from error
    # A bare machine has no certificates to verify with (pip brings its own). The digest above is the real check.
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    try:
        return read(request, context)
    except urllib.error.URLError as error:
        raise BootstrapError(f"cannot reach the package index at {url}: {error.reason}") from error


def read(request, context):
    """Open a request and read all of it; a connection that breaks off is a URLError as well."""
    try:
        with urllib.request.urlopen(request, context=context, timeout=TIMEOUT_S) as answer:
            return answer.read()
    except urllib.error.URLError:
        raise
    except OSError as error:
        raise urllib.error.URLError(error) from error


def install(root, venv, extras, stamp):
    """Install the checkout, editable, with its extras.

    Cut short, it leaves the mark `UNFINISHED`, and the next call begins with a new environment. Where pip itself
    gives up it has undone its changes, and the environment is worth what it was worth before: its old `stamp`.
    """
    write_stamp(venv, UNFINISHED)
    package = ".[{}]".format(",".join(extras)) if extras else "."
    print(f"bootstrap: installing artiskill {package} into {venv} (about a minute the first time)", flush=True)
    pip = [str(venv / "bin" / "python"), "-I", "-m", "pip"]
    try:  # what is imported is compiled then: all of it would take half of the time
        run_pip(pip, ["install", "--no-compile", "--editable", package], root)
    except BootstrapError:
        write_stamp(venv, stamp)
        raise


def run_pip(pip, arguments, folder):
    """Run pip quietly in a folder; raise BootstrapError with its own words if it fails."""
    environment = dict(os.environ, PIP_USER="0", PIP_DISABLE_PIP_VERSION_CHECK="1")
    done = quietly([*pip, *arguments, "--quiet"], cwd=str(folder), env=environment)
    if done.returncode == 0:
        return
    for words, meaning in _PIP_EXPLAINED.items():
        if words in done.stderr:
            raise BootstrapError(meaning)
    print(done.stderr, file=sys.stderr)
    raise BootstrapError("pip failed, in its own words above; `make clean-env` and then another try start afresh")


def quietly(command, **options):
    """Run a command and keep what it prints."""
    return subprocess.run(command, capture_output=True, text=True, **options)


def last_line(text):
    """The last line that says anything."""
    return (text.strip().splitlines() or ["no reason given"])[-1]


def read_stamp(venv):
    """What the last run left: a key and extras, `UNFINISHED`, or nothing."""
    try:
        stamp = json.loads((venv / "artiskill-stamp.json").read_text())
    except (OSError, ValueError):
        return {}
    return stamp if isinstance(stamp, dict) else {}


def write_stamp(venv, stamp):
    """Record how far the environment is."""
    (venv / "artiskill-stamp.json").write_text(json.dumps(stamp))


if __name__ == "__main__":
    sys.exit(main())

"""The prepared process: one for its owner, a child for each file, and nothing of it left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from tests.io import good
from tests.io.test_isolate import not_prepared, prepared_with
from toolkit.errors import BadInputError
from toolkit.io import interpreter, prepared
from toolkit.io.decoded import Limits
from toolkit.io.read import read

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="a fresh interpreter decodes there")

# what the children do is told by the photograph's name
BY_NAME = """
import json, sys, time
name = os.path.basename(json.loads(request)['path']).partition('.')[0].rstrip('0123456789')
if name == 'crash': os.abort()
if name == 'fail': raise SystemExit('no such codec')
if name == 'hang': time.sleep(600)
if name == 'who': raise SystemExit(f'{os.getppid()} {os.getpid()}')
if name == 'swell':
    child.limit_process(Limits(), 0)
    bytearray(2 << 30)
if name == 'alarm':
    child.limit_process(Limits(wall_s=-0.9), 0)
    time.sleep(600)
if name == 'holds':
    places = [f'/proc/self/fd/{number}' for number in range(20)]
    raise SystemExit(' '.join(os.readlink(place).partition(':')[0] for place in places if os.path.islink(place)))
if name == 'hush':  # its owner takes it for ended
    os.close(1); os.close(2); time.sleep(600)
if name == 'spin':
    child.limit_process(Limits(cpu_s=0), 0)
    while True: pass
main(request)
"""
BOOT = prepared_with("from toolkit.io.decoded import Limits\n" + BY_NAME)


@pytest.fixture
def by_name(monkeypatch):
    """A prepared process whose children do what the photograph's name says, or decode."""
    prepared.end()
    monkeypatch.setattr(prepared, "_BOOT", BOOT)
    yield
    prepared.end()


def pid():
    return prepared._own().process.pid


def children(of):
    return Path(f"/proc/{of}/task/{of}/children").read_text(encoding="ascii").split()


def descriptors(of):
    return sorted(entry.name for entry in Path(f"/proc/{of}/fd").iterdir())


def at_rest():
    """Whether the prepared process soon has no child, and no descriptor but its socket and two of nothing."""
    return becomes(lambda: children(pid()) == [] and descriptors(pid()) == ["0", "1", "2"])


def limits_of(process):
    return Path(f"/proc/{process}/limits").read_text(encoding="ascii")


def ended(of):
    """Whether a process has ended; where nobody reaps orphans a zombie is left of it."""
    try:
        return Path(f"/proc/{of}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def becomes(what, within_s=20.0):
    """Whether it turns true; the time is for a busy machine."""
    until = time.monotonic() + within_s
    while not (true := what()) and time.monotonic() < until:
        time.sleep(0.01)
    return true


def complaint_of(path, **limits):
    with pytest.raises(BadInputError) as caught:
        read(path, limits=Limits(**limits))
    return str(caught.value)


def who(folder):
    """The parent's and the child's process ids."""
    found = complaint_of(good.png(folder / "who.png")).partition("SystemExit: ")[2].partition(")")[0]
    return [int(word) for word in found.split()]


def script(code, *words):
    """A process of its own that runs `code`, with the photographs' folder and such as sys.argv[1:]."""
    head = (
        "import os, sys, signal, threading, time\nfrom toolkit.io import prepared\nfrom toolkit.io.read import read\n"
    )
    head += f"prepared._BOOT = {BOOT!r}\n"
    head += "def say(*words): os.write(1, (' '.join(map(str, words)) + '\\n').encode())\n"
    head += "from tests.io.test_prepared import pid, children\n"
    return subprocess.Popen(
        [sys.executable, "-X", "dev", "-c", head + code, *map(str, words)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(entry for entry in sys.path if entry)},
        start_new_session=True,
    )


def said(process):
    """What a script says, line by line; it must end well."""
    out, complaints = process.communicate(timeout=60)
    assert (process.returncode, complaints) == (0, "")
    return out.splitlines()


@pytest.mark.usefixtures("by_name")
def test_reads_share_the_prepared_process_and_no_child(tmp_path):
    """Two reads: the same parent, which is this process's, and a child each."""
    (parent, first), (again, second) = who(tmp_path), who(tmp_path)
    assert parent == again == pid() != os.getpid()
    assert len({parent, first, second}) == 3
    assert os.getsid(parent) != os.getsid(0)  # out of reach of the terminal's Ctrl-C


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("crash", "crashed"),
        ("fail", "no such codec"),
        ("hang", "took longer"),
        ("swell", "crashed"),
        ("spin", "processor time"),
        ("hush", "processor time"),
    ],
)
@pytest.mark.usefixtures("by_name")
def test_a_decoder_that_fails_takes_nothing_with_it(tmp_path, name, message):
    """The prepared process stays as it was, without a child, and decodes the next file."""
    photograph = good.dng(tmp_path / "a.dng")
    read(photograph)
    before = pid()
    assert message in complaint_of(good.png(tmp_path / f"{name}.png"), wall_s=2.0 if name == "hang" else 60.0)
    assert children(pid()) == []
    assert np.array_equal(read(photograph).values, good.mosaic())
    assert pid() == before
    assert at_rest()


@pytest.mark.usefixtures("by_name")
def test_nothing_is_left_of_many_reads(tmp_path):
    """No descriptor in either process, no zombie in the prepared one, no limit in it."""
    paths = [good.dng(tmp_path / "a.dng"), good.png(tmp_path / "crash.png"), good.png(tmp_path / "fail.png")]
    read(paths[0])
    before = descriptors(os.getpid()), limits_of(pid())
    for number in range(30):
        if number % 3:
            complaint_of(paths[number % 3])
        else:
            read(paths[0])
    assert (descriptors(os.getpid()), limits_of(pid())) == before
    assert at_rest()


@pytest.mark.usefixtures("by_name")
def test_threads_share_the_prepared_process(tmp_path):
    """Files that decode, crash and hang at the same time each end as they would alone."""
    wanted = {"a": "", "crash": "crashed", "hang": "took longer", "fail": "no such codec"}
    found = []

    def one(name, number):
        path, limits = tmp_path / f"{name}{number}.dng", Limits(wall_s=5 if name == "hang" else 60)
        try:
            found.append((name, "" if np.array_equal(read(path, limits=limits).values, good.mosaic()) else "?"))
        except BadInputError as error:
            found.append((name, str(error)))

    own, threads = pid(), []
    for number in range(3):
        for name in wanted:
            good.dng(tmp_path / f"{name}{number}.dng")
            threads.append(threading.Thread(target=one, args=(name, number)))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == len(threads)
    assert all(wanted[name] in text and bool(wanted[name]) == bool(text) for name, text in found), found
    assert pid() == own
    assert at_rest()


def test_a_killed_prepared_process_is_replaced(tmp_path):
    """The file asked of the dead one is decoded all the same, the next by another."""
    photograph = good.dng(tmp_path / "a.dng")
    read(photograph)
    before = pid()
    os.kill(before, signal.SIGKILL)
    assert becomes(lambda: ended(before))
    for _ in range(2):
        assert np.array_equal(read(photograph).values, good.mosaic())
    assert pid() != before
    assert not Path(f"/proc/{before}").exists()  # reaped


@pytest.mark.usefixtures("by_name")
def test_a_prepared_process_killed_at_work_costs_no_photograph(tmp_path):
    """A fresh interpreter decodes instead, as soon as the child has ended, too."""
    photograph = good.dng(tmp_path / "hang.dng")

    def kill():
        if becomes(lambda: children(pid())):
            (child,) = children(pid())
            os.kill(pid(), signal.SIGKILL)
            os.kill(int(child), signal.SIGKILL)  # it sets no limits here; one that does is the next test's

    killer = threading.Thread(target=kill)
    killer.start()
    assert np.array_equal(read(photograph).values, good.mosaic())
    killer.join()


def test_a_prepared_process_that_serves_nobody_takes_no_longer_than_the_limit(tmp_path, monkeypatch):
    """No fresh interpreter is given the same time once more."""
    prepared.end()
    monkeypatch.setattr(prepared, "_BOOT", "import time; time.sleep(600)")
    monkeypatch.setattr(prepared, "_GRACE_S", 0.2)
    monkeypatch.setattr(interpreter, "run", None)
    assert "took longer" in complaint_of(good.dng(tmp_path / "a.dng"), wall_s=1.0)
    assert prepared._parent is None


@pytest.mark.usefixtures("by_name")
def test_a_child_that_nobody_stops_stops_itself(tmp_path):
    """The time limit holds within the child, too, should its parents be gone."""
    assert f"status {-signal.SIGALRM}" in complaint_of(good.dng(tmp_path / "alarm.dng"))


@pytest.mark.usefixtures("by_name")
def test_a_child_holds_what_is_its_own(tmp_path):
    """Nothing, the answer and its words, while another child is at work; neither line nor socket of anybody."""
    hanging = threading.Thread(target=complaint_of, args=(good.dng(tmp_path / "hang.dng"),))
    hanging.start()
    assert becomes(lambda: children(pid()))
    (at_work,) = children(pid())
    found = complaint_of(good.dng(tmp_path / "holds.dng"))
    assert at_work in children(pid())
    os.kill(int(at_work), signal.SIGKILL)
    hanging.join()
    assert "(SystemExit: /dev/null /memfd socket)" in found


@pytest.mark.usefixtures("by_name")
def test_an_owner_that_has_gone_harms_nobody(tmp_path):
    """A reader interrupted as soon as it has asked: its child is not kept, the prepared process is."""
    request, own = json.dumps({"path": str(good.dng(tmp_path / "hang.dng"))}), pid()
    for _ in range(20):
        with (tmp_path / "answer").open("wb") as answer, prepared._own().child(request, answer):
            pass
    assert at_rest()
    assert np.array_equal(read(good.dng(tmp_path / "a.dng")).values, good.mosaic())
    assert pid() == own


def test_an_address_space_means_what_it_meant(tmp_path, monkeypatch):
    """A fork begins with no more memory mapped than a fresh interpreter has once it decodes a raw."""
    say = "raise SystemExit(open('/proc/self/statm').read().split()[0])"
    pages = {}
    photograph = good.dng(tmp_path / "a.dng")
    prepared.end()
    monkeypatch.setattr(prepared, "_BOOT", prepared_with(say))
    pages["forked"] = complaint_of(photograph)
    prepared.end()
    monkeypatch.setattr(prepared, "run", not_prepared)
    imports = "import rawpy, exifread, tifffile; from toolkit.io import plausible, raw, exr, raster, tiff; "
    monkeypatch.setattr(interpreter, "_BOOT", "from toolkit.io import child; " + imports + say)
    pages["fresh"] = complaint_of(photograph)
    found = {name: int("".join(filter(str.isdigit, text.partition("(")[2]))) for name, text in pages.items()}
    assert found["forked"] < 1.03 * found["fresh"]  # sockets; OpenCV would be three times as much


def test_a_fork_does_not_share_the_prepared_process(tmp_path):
    """It starts its own, and does not keep the owner's alive."""
    code = """
path = sys.argv[1]
read(path)
own = pid()
child = os.fork()
if child == 0:
    read(path)
    say(own, pid(), os.getppid(), *children(os.getpid()))
    sys.exit()
os.waitpid(child, 0)
read(path)
say(own == pid())
child = os.fork()
if child == 0:
    time.sleep(60)
say(child)
"""
    process = script(code, good.dng(tmp_path / "a.dng"))
    try:
        lines = [process.stdout.readline().split() for _ in range(3)]
        own, forked, owner, *of_the_fork = map(int, lines[0])
        assert own != forked
        assert owner == process.pid
        assert of_the_fork == [forked]
        assert lines[1] == ["True"]
        assert becomes(lambda: ended(own)), "the fork that sleeps keeps the owner's process"
        assert not ended(int(lines[2][0]))
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def test_a_daemonic_worker_reads(tmp_path):
    """Forked by multiprocessing, which allows it no children of its own."""
    code = """
import multiprocessing
read(sys.argv[1])
def work(): say(pid(), read(sys.argv[1]).values.shape)
worker = multiprocessing.get_context('fork').Process(target=work, daemon=True)
worker.start(); worker.join()
say(pid(), worker.exitcode)
"""
    (theirs, *shape), (ours, code) = (line.split() for line in said(script(code, good.dng(tmp_path / "a.dng"))))
    assert shape == ["(48,", "64)"]
    assert code == "0"
    assert theirs != ours
    assert becomes(lambda: ended(theirs))


@pytest.mark.parametrize("end", ["sys.exit()", "os._exit(0)", "os.kill(os.getpid(), signal.SIGKILL)"])
def test_it_ends_with_its_owner(tmp_path, end):
    """However the owner ends, idle or at work, the prepared process and its child do."""
    code = f"""
def hang():
    try: read(sys.argv[1])
    except Exception: pass  # its process ends, whatever the read makes of that
threading.Thread(target=hang, daemon=True).start()
while not children(pid()): time.sleep(0.01)
say(pid(), *children(pid()))
{end}
"""
    process = script(code, good.dng(tmp_path / "hang.dng"))
    out, complaints = process.communicate(timeout=60)
    assert process.returncode in (0, -signal.SIGKILL)
    assert complaints == ""
    assert len(out.split()) == 2
    assert becomes(lambda: all(map(ended, out.split())))


def test_an_interrupt_ends_the_child_and_not_the_prepared_process(tmp_path):
    """As from the terminal, to the whole group; the next read goes on as before."""
    code = """
signal.signal(signal.SIGINT, signal.default_int_handler)
read(sys.argv[2])
say(pid())
for _ in range(3):
    try: read(sys.argv[1])
    except KeyboardInterrupt: say('interrupted')
until = time.monotonic() + 20
while children(pid()) and time.monotonic() < until: time.sleep(0.01)
say(pid(), *children(pid()), read(sys.argv[2]).values.shape, len(os.listdir('/proc/self/fd')))
"""
    process = script(code, good.dng(tmp_path / "hang.dng"), good.dng(tmp_path / "a.dng"))
    own = process.stdout.readline().strip()
    for _ in range(3):
        assert becomes(lambda: children(own))
        before = children(own)
        os.killpg(process.pid, signal.SIGINT)
        assert process.stdout.readline() == "interrupted\n"
        assert becomes(lambda before=before: children(own) != before)
    (last,) = said(process)
    assert last == f"{own} (48, 64) 5"  # the three standard ones, the socket, the folder being listed


def test_a_fork_meanwhile_keeps_no_child(tmp_path):
    """Another thread forks while this one reads, and so holds the line as well; an interrupt ends the child."""
    code = """
import warnings
warnings.simplefilter('ignore')
signal.signal(signal.SIGINT, signal.default_int_handler)
own = pid()
def fork():
    while not children(own): time.sleep(0.01)
    child = os.fork()
    if child == 0: time.sleep(60)
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=fork).start()
try: read(sys.argv[1])
except KeyboardInterrupt: pass
until = time.monotonic() + 20
while children(own) and time.monotonic() < until: time.sleep(0.01)
say(*children(own), own == pid())
"""
    process = script(code, good.dng(tmp_path / "hang.dng"))
    try:
        assert process.stdout.readline() == "True\n"
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def test_what_the_owner_ignores_or_blocks_matters_not(tmp_path):
    """Signals blocked in the reading thread, and children that nobody waits for."""
    code = """
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
say(read(sys.argv[1]).values.shape)
for path in sys.argv[2:]:
    try: read(path)
    except Exception as error: say(error)
"""
    alarm, crash = good.dng(tmp_path / "alarm.dng"), good.dng(tmp_path / "crash.dng")
    shape, first, second = said(script(code, good.dng(tmp_path / "a.dng"), alarm, crash))
    assert shape == "(48, 64)"
    assert f"crashed on it (status {-signal.SIGALRM})" in first
    assert f"crashed on it (status {-signal.SIGABRT})" in second


def test_a_prepared_process_that_cannot_start_is_not_needed(tmp_path, monkeypatch):
    """The fresh interpreter decodes, or tells what is wrong."""
    prepared.end()
    monkeypatch.setattr(prepared, "_BOOT", "raise SystemExit(1)")
    assert np.array_equal(read(good.dng(tmp_path / "a.dng")).values, good.mosaic())
    monkeypatch.setattr(interpreter, "_BOOT", "raise SystemExit('no such library')")
    assert "no such library" in complaint_of(tmp_path / "a.dng")


def test_requests_as_long_as_paths_can_be(tmp_path):
    """Four kilobytes of path, each letter six in JSON."""
    folder = tmp_path
    while len(os.fsencode(str(folder / ("ж" * 100)))) < 3900:
        folder = folder / ("ж" * 100)
    folder.mkdir(parents=True)
    path = folder / "a.dng"
    path.write_bytes(good.dng(tmp_path / "a.dng").read_bytes())
    assert len(json.dumps(str(path))) > 10_000
    assert np.array_equal(read(path).values, good.mosaic())

"""The decoders' process: what kills, stops or swells it ends in one line for the user."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from tests.io import good
from toolkit.errors import BadInputError
from toolkit.io import interpreter, prepared
from toolkit.io.decoded import Limits
from toolkit.io.read import read

SPIN = """
from toolkit.io import child
from toolkit.io.decoded import Limits
child.limit_process(Limits(cpu_s=0), 0)
while True: pass
"""


@pytest.fixture(params=["forked", "fresh"])
def decoder(request, monkeypatch):
    """What has the child run other code, from the moment its answer is its standard output; both kinds of child."""
    if request.param == "fresh":
        monkeypatch.setattr(prepared, "run", not_prepared)
        yield lambda code: monkeypatch.setattr(interpreter, "_BOOT", f"import os\n{code}")
        return
    prepared.end()
    yield lambda code: monkeypatch.setattr(prepared, "_BOOT", prepared_with(code))
    prepared.end()


def not_prepared(*_):
    raise prepared.NotPreparedError


def prepared_with(code):
    """The program of a prepared process whose children run `code` instead of decoding; `main` decodes."""
    return (
        "import os; from toolkit.io import child; main = child.main\n"
        f"child.main = lambda request: exec({code!r}, {{**globals(), 'request': request}})\n"
        "from toolkit.io import parent; parent.main()"
    )


def test_a_crash_is_one_line(tmp_path, decoder):
    """A decoder that dies of a signal."""
    decoder("os.abort()")
    with pytest.raises(BadInputError, match=r"crashed on it \(status -6\)"):
        read(good.png(tmp_path / "a.png"))


def test_a_failure_quotes_its_last_line(tmp_path, decoder):
    """A decoder's process that ends with an error of its own."""
    decoder("raise SystemExit('no such codec')")
    with pytest.raises(BadInputError, match="no such codec"):
        read(good.png(tmp_path / "a.png"))


@pytest.mark.parametrize(
    "written",
    [b"", b"x" * 100, b"{}" + bytes([2]) + bytes(7)],
    ids=["nothing", "no JSON", "no pixels"],
)
def test_an_answer_that_does_not_add_up_is_not_believed(tmp_path, decoder, written):
    """A compromised decoder cannot hand over what it likes."""
    decoder(f"os.write(1, {written!r}); os._exit(0)")
    with pytest.raises(BadInputError, match="answer"):
        read(good.png(tmp_path / "a.png"))


def test_a_decoder_that_hangs_is_stopped(tmp_path, decoder):
    """Nothing waits longer than the limit of time."""
    decoder("import time; time.sleep(600)")
    with pytest.raises(BadInputError, match="took longer"):
        read(good.png(tmp_path / "a.png"), limits=Limits(wall_s=2))


def test_a_decoder_that_spins_is_stopped(tmp_path, decoder):
    """Processor time is limited by the system itself."""
    decoder(SPIN)
    with pytest.raises(BadInputError, match="processor time"):
        read(good.png(tmp_path / "a.png"))


def test_a_decoder_that_swells_is_stopped(tmp_path):
    """Too little memory for a good file: said with the figure."""
    with pytest.raises(BadInputError, match=r"more than 0\.\d GB|crashed|fails"):
        read(
            good.tiff(
                tmp_path / "a.tif", np.zeros((3000, 3000, 3), np.uint16) + np.arange(3000, dtype=np.uint16)[:, None]
            ),
            limits=Limits(memory_bytes=150 << 20, memory_per_file_byte=0),
        )


def test_a_flood_of_complaints_is_bounded(tmp_path, decoder):
    """Megabytes on standard error leave a short line."""
    decoder("import sys; sys.stderr.write('bad\\n' * 2_000_000); sys.stderr.flush(); os._exit(3)")
    with pytest.raises(BadInputError, match="bad") as caught:
        read(good.png(tmp_path / "a.png"))
    assert len(str(caught.value)) < 300


def test_pixels_come_shared_and_read_only(tmp_path):
    """The mapped pixels cannot be written, and outlive everything else."""
    values = read(good.dng(tmp_path / "a.dng")).values
    assert not values.flags.writeable
    assert np.array_equal(values, good.mosaic())


def test_the_folder_of_the_photograph_runs_no_code(tmp_path):
    """A numpy.py beside the photograph is not imported, even where that is the current folder."""
    good.dng(tmp_path / "a.dng")
    for name in ("numpy.py", "rawpy.py", "json.py"):
        (tmp_path / name).write_text("raise SystemExit('taken over')")
    code = "import sys; sys.path.remove(''); from toolkit.io.read import read; print(read('a.dng').values.shape)"
    path = os.pathsep.join(entry for entry in sys.path if entry)
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert done.stdout.strip() == "(48, 64)", done.stderr


def test_reading_works_in_threads(tmp_path):
    """Four files at once in four threads."""
    paths = [good.dng(tmp_path / f"{number}.dng") for number in range(4)]
    shapes = []
    threads = [threading.Thread(target=lambda path=path: shapes.append(read(path).values.shape)) for path in paths]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert shapes == [(48, 64)] * 4


@pytest.mark.parametrize("name", ["b\u00e4ll \u7403.dng", "two\nlines.dng", os.fsdecode(b"latin\xe4.dng")])
def test_any_file_name_is_read(tmp_path, name):
    """Names beyond ASCII, with a line break, and that are no Unicode."""
    assert read(good.dng(tmp_path / "a.dng").rename(tmp_path / name)).values.shape == (48, 64)
    (tmp_path / name).write_bytes(b"nothing of the kind" * 9)
    with pytest.raises(BadInputError) as caught:
        read(tmp_path / name)
    assert "\n" not in str(caught.value)

"""Engines: the choice among them, what they refuse, and that they draw the same image."""

import json
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import trimesh

from ncti.render import EngineError, available_engines, choice, range_image
from ncti.render.choice import choose_engine, engines, start_engine

ASPECTS = (0.0, 12.7, 37.3, 90.0, 141.9, 203.0)


def needs(*names):
    missing = [name for name in names if name not in available_engines()]
    return pytest.mark.skipif(bool(missing), reason=f"no {' and no '.join(missing)} library here")


PRELUDE = """
import json, os, signal, sys
import numpy as np, trimesh
from ncti.render import *
from ncti.render.choice import choose_engine, engines, start_engine
ball = trimesh.creation.icosphere(3, radius=8)
hull = trimesh.creation.box((60, 9, 5))
mast = trimesh.creation.cylinder(0.3, 20, sections=12).apply_translation((5, 0, 10))
ship = trimesh.util.concatenate([ball, hull, mast])
view = {"aspect": 33.0, "depression": 7.0}
"""
# What was imported before serves all scripts; each runs and ends as a process does.
SERVER = (
    PRELUDE
    + """
for line in sys.stdin:
    script, output, seconds = json.loads(line)
    child = os.fork()
    if child == 0:
        signal.alarm(seconds)
        for stream, suffix in ((1, ""), (2, ".errors")):
            os.dup2(os.open(output + suffix, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
        exec(script)
        break
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Output of a script in a process of its own, where OpenGL is bound to nothing yet."""
    output = tmp_path_factory.mktemp("scripts") / "output"
    with subprocess.Popen(
        [sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:

        def ran(script, *, seconds=120):
            asked = textwrap.dedent(script), str(output), seconds
            server.stdin.write(json.dumps(asked) + "\n")
            server.stdin.flush()
            status = server.stdout.readline()
            assert status == "0\n", output.with_suffix(".errors").read_text()
            return output.read_text().strip()

        yield ran
        server.stdin.close()


@pytest.fixture
def present(monkeypatch):
    """Sets which engines' libraries seem to be there, on a process not yet bound to a platform."""

    def these(*names):
        monkeypatch.setattr(choice, "_present", names.__contains__)
        monkeypatch.setattr(choice, "bound_platform", lambda: None)

    return these


@pytest.mark.parametrize(
    ("there", "chosen"),
    [
        (("osmesa", "egl", "embree"), "osmesa"),
        (("egl", "embree"), "egl"),
        (("embree",), "embree"),
    ],
)
def test_auto_takes_the_first_that_is_there(present, there, chosen):
    present(*there)
    assert available_engines() == there
    assert choose_engine("auto") == chosen
    for name in there:
        assert choose_engine(name) == name


@pytest.mark.parametrize(
    ("name", "there", "words"),
    [
        ("osmesa", ("egl", "embree"), ["osmesa", "apt install libosmesa6", "egl or embree"]),
        ("egl", ("osmesa", "embree"), ["egl", "libegl1", "libgl1-mesa-dri", "osmesa or embree"]),
        ("osmesa", ("embree",), ["libosmesa6", "or use embree"]),
    ],
)
def test_a_missing_engine_is_named_with_its_package_and_the_others(present, name, there, words):
    present(*there)
    box = trimesh.creation.box((4, 2, 1))
    with pytest.raises(EngineError) as refusal:
        range_image(box, aspect=0, depression=0, engine=name)
    message = str(refusal.value)
    assert all(word in message for word in words)
    assert "\n" not in message


def test_an_unknown_engine_is_a_wrong_value():
    with pytest.raises(ValueError, match="it must be auto, osmesa, egl, embree"):
        choose_engine("povray")
    assert engines() == ("osmesa", "egl", "embree")


def test_probing_looks_for_the_libraries(monkeypatch):
    monkeypatch.setattr(choice.ctypes, "CDLL", lambda file: (_ for _ in ()).throw(OSError(file)))
    choice._present.cache_clear()
    try:
        assert available_engines() == ("embree",)
    finally:
        choice._present.cache_clear()


def test_asking_what_is_available_imports_no_opengl(run):
    assert (
        run("""
        available_engines()
        print([name for name in ("OpenGL", "pyrender") if name in sys.modules])
    """)
        == "[]"
    )


@needs("osmesa", "egl")
@pytest.mark.parametrize("first", ["osmesa", "egl"])
def test_one_opengl_platform_a_process(run, first):
    second = {"osmesa": "egl", "egl": "osmesa"}[first]
    said = run(f"""
        range_image(ship, engine="{first}", **view)
        assert choose_engine("auto") == "{first}"
        try:
            range_image(ship, engine="{second}", **view)
        except EngineError as error:
            print(error)
        range_image(ship, engine="{first}", **view)
        range_image(ship, engine="embree", **view)
    """)
    assert said.startswith(f"render engine {second} cannot start")
    assert f"use {first} or embree" in said


@needs("osmesa")
def test_a_user_of_pyrender_elsewhere_in_the_process_is_told(run):
    """PyOpenGL imported without a platform binds to the display server's."""
    said = run("""
        import os
        os.environ.pop("PYOPENGL_PLATFORM", None)
        import OpenGL.platform
        assert choose_engine("auto") == "embree"
        try:
            range_image(ship, **view)
        except EngineError as error:
            print(error)
    """)
    assert said.startswith("render engine osmesa cannot start")


@needs("egl")
def test_a_driver_that_cannot_start_is_an_engine_error(run):
    said = run("""
        import ncti.render.gl as gl
        def fail(platform): raise AssertionError("no display")
        gl._open_canvas = fail
        try:
            range_image(ship, engine="egl", **view)
        except EngineError as error:
            print(error)
    """)
    assert said.startswith("render engine egl has its libraries but cannot start here")
    assert "use embree" in said


@needs("osmesa", "egl")
def test_egl_and_osmesa_draw_the_same_image_bit_for_bit(run, tmp_path):
    for engine in ("osmesa", "egl"):
        run(f"""
            images = [
                range_image(ship, aspect=a, depression=5.5, slant_range=r, engine="{engine}")
                for a in {ASPECTS} for r in (None, 4e3)
            ]
            np.savez(r"{tmp_path / engine}.npz",
                     *[i.down_range for i in images], *[i.gradient for i in images])
        """)
    one, other = (np.load(tmp_path / f"{engine}.npz") for engine in ("osmesa", "egl"))
    assert len(one.files) == 4 * len(ASPECTS)
    for name in one.files:
        assert one[name].tobytes() == other[name].tobytes()


def test_an_engine_is_started_once():
    with ThreadPoolExecutor(4) as pool:
        assert len({id(e) for e in pool.map(start_engine, ["auto"] * 8)}) == 1


AT_ONCE = """
import threading

def at_once(*tasks):
    sys.setswitchinterval(1e-5)
    barrier, results = threading.Barrier(len(tasks)), [None] * len(tasks)
    def run(place):
        barrier.wait()
        try:
            results[place] = tasks[place]()
        except Exception as error:
            results[place] = repr(error)
    threads = [threading.Thread(target=run, args=(i,)) for i in range(len(tasks))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results

class Slow:
    \"\"\"Holds the import of OpenGL where it is half done, and tells when it is there.\"\"\"

    def __init__(self, module):
        self.module, self.there = module, threading.Event()
        sys.meta_path.insert(0, self)

    def find_spec(self, name, path=None, target=None):
        if name == self.module:
            self.there.set()
            threading.Event().wait(0.3)
"""


@needs("osmesa")
@pytest.mark.parametrize("attempt", range(4))
@pytest.mark.parametrize("engine", ["osmesa", "auto"])
def test_two_threads_start_an_engine_at_once(run, engine, attempt):
    said = run(
        AT_ONCE
        + textwrap.dedent(f"""
        def draw():
            name = choose_engine("{engine}")
            return name, range_image(ship, engine=name, **view)
        (one, first), (other, second) = at_once(draw, draw)
        print(one, other, np.array_equal(first.down_range, second.down_range, equal_nan=True),
              int(first.hit.sum()) > 100, start_engine(one) is start_engine(other))
    """)
    )
    assert said == "osmesa osmesa True True True"


@needs("osmesa")
@pytest.mark.parametrize("module", ["OpenGL.platform", "OpenGL.platform.osmesa", "pyrender"])
def test_a_choice_waits_for_the_engine_that_is_being_started(run, module):
    """At each of these OpenGL is imported in part; it must not pass for one bound to elsewhere."""
    said = run(
        AT_ONCE
        + textwrap.dedent(f"""
        slow = Slow("{module}")
        def choose():
            slow.there.wait(60)
            return choose_engine("auto")
        def bound():
            slow.there.wait(60)
            return __import__("ncti.render.opengl").render.opengl.bound_platform()
        def start():
            return int(range_image(ship, engine="osmesa", **view).hit.sum()) > 100
        print(*at_once(start, choose, bound))
    """)
    )
    # While PyOpenGL's module for platforms is not there at all, it is bound to nothing.
    assert said in ("True osmesa osmesa", "True osmesa None")


@needs("osmesa", "egl")
def test_the_choice_follows_what_another_thread_is_starting(run):
    said = run(
        AT_ONCE
        + textwrap.dedent("""
        slow = Slow("OpenGL.platform")
        def draw():
            slow.there.wait(60)
            return start_engine("auto") is start_engine("egl")
        print(*at_once(lambda: type(start_engine("egl")).__name__, draw, draw))
    """)
    )
    assert said == "PyrenderEngine True True"


@pytest.mark.parametrize("engine", [choose_engine("auto"), "embree"])
def test_threads_share_an_engine(engine):
    """Four threads at once get what one gets alone: an OpenGL context would crash."""
    ship = trimesh.creation.icosphere(3, radius=20)

    def draw(aspect):
        return range_image(ship, aspect=aspect, depression=5, engine=engine).down_range

    alone = list(map(draw, ASPECTS))
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(draw, ASPECTS * 5))
    for expected, image in zip(alone * 5, together, strict=True):
        assert np.array_equal(image, expected, equal_nan=True)


@needs("osmesa")
def test_a_forked_process_is_refused_instead_of_hanging(run):
    said = run("""
        import os
        range_image(ship, **view)
        if os.fork() == 0:
            try:
                range_image(ship, **view)
            except EngineError as error:
                range_image(ship, engine="embree", **view)
                print(error, flush=True)
            os._exit(0)
        os.wait()
        range_image(ship, **view)
    """)
    assert "forked" in said
    assert "use embree" in said

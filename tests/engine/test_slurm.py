"""Jobs of a real Slurm run as workers; killed ones are replaced, refused ones are reported."""

import logging
import os
import signal
import stat

import pytest
import slurm
from executors import (
    IMPORTS,
    blas_threads,
    eventually,
    meanwhile,
    refuse_odd,
    result_of,
    started_with,
)
from running import python
from small_stores import files
from toys import SPRINGS, go

from sweeps.engine.command.line import Command
from sweeps.engine.run import dask_cluster
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor
from sweeps.engine.run.process import ONE_THREAD

pytestmark = [
    pytest.mark.usefixtures("at_a_terminal", "queue"),
    pytest.mark.skipif(bool(slurm.missing()), reason=slurm.missing()),
]
ON_SLURM = ["cluster=slurm", "cluster.workers=2", "cluster.memory=500MiB", "cluster.interface=lo"]


@pytest.fixture(scope="module")
def daemons(tmp_path_factory):
    with slurm.started(tmp_path_factory.mktemp("slurm") / "daemons") as configuration:
        yield configuration


@pytest.fixture
def queue(daemons, tmp_path, monkeypatch):
    """Use this Slurm and poll it often; wait for an idle node before, and for jobs to end after."""
    monkeypatch.setenv("SLURM_CONF", str(daemons))
    monkeypatch.setenv("PYTHONPATH", IMPORTS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dask_cluster, "LOST_SECONDS", 0.1)
    monkeypatch.setattr(dask_cluster, "JOB_INTERVAL", 0.3)
    eventually(lambda: "idle" in slurm.asked("sinfo", "-h", "-o", "%T"))
    yield
    eventually(lambda: jobs() == [])
    # Dask's finalizer may log that the scheduler's scratch folder is gone after the tests.
    logging.getLogger("distributed.diskutils").setLevel(logging.CRITICAL)


def jobs(*states):
    """Return the sorted numbers of jobs in some states, or of all jobs that have not ended."""
    chosen = ["-t", ",".join(states)] if states else []
    return sorted(map(int, slurm.asked("squeue", "-h", "-o", "%A", *chosen)))


def test_jobs_are_single_threaded_with_requested_slurm_options(tmp_path):
    options = {"queue": "compute", "account": "radar", "walltime": "0-00:10:00", "memory": "500MiB"}
    sentences = []
    choice = ClusterChoice(kind="slurm", workers=2, interface="lo", **options)
    with open_executor(choice, tasks=1, say=sentences.append) as run:
        assert run.worker_count == 1
        result_of(run, refuse_odd, 2)
        assert set(result_of(run, blas_threads)) == {1}
        assert {f"{name}=1" for name in ONE_THREAD} <= result_of(run, started_with)
        (number,) = jobs()
        details = slurm.asked("scontrol", "show", "job", str(number))
        expected = {"Account=radar", "TimeLimit=00:10:00", "MinMemoryNode=500M", "NumTasks=1"}
        assert {*expected, "Partition=compute", "CPUs/Task=1", "JobState=RUNNING"} <= {*details}
        script = slurm.asked("scontrol", "write", "batch_script", str(number), "-")
        (folder,) = tmp_path.glob(".sweep-*")
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        assert f"{folder}/key.pem" in script and "--nworkers" not in script
        assert {f"{name}={value}" for name, value in dask_cluster.ENVIRONMENT.items()} <= {*script}
        assert script[script.index("--nthreads") + 1] == "1"
        assert any(word.startswith("tls://127.0.0.1:") for word in script)
    assert sentences == ["submitting 1 job to Slurm"]
    assert list(tmp_path.iterdir()) == []


def test_store_is_unaffected_by_killed_jobs_and_drained_nodes(tmp_path, capsys):
    (node,) = slurm.asked("sinfo", "-h", "-o", "%n")

    def meddle():
        eventually(lambda: len(jobs("running")) == 2)
        eventually(lambda: list((tmp_path / "cache").rglob("*.pack")))
        first, second = jobs()
        slurm.asked("scancel", str(first))
        eventually(lambda: max(jobs("running")) > second)  # a third job runs
        slurm.asked("scontrol", "update", f"NodeName={node}", "State=DRAIN", "Reason=test")
        slurm.asked("scancel", str(second))
        eventually(lambda: jobs("pending"))  # a fourth job waits
        slurm.asked("scontrol", "update", f"NodeName={node}", "State=RESUME")

    with meanwhile(meddle):
        arguments = [*ON_SLURM, "store=s.zarr", "cache=cache", "measured.pause=1.5"]
        assert Command(SPRINGS).main(arguments) == 0
    assert capsys.readouterr().err.splitlines()[1] == "springs: submitting 2 jobs to Slurm"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cache", "s.zarr"]
    go(tmp_path / "inline.zarr", measured__pause=1.5)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "inline.zarr")


def test_ctrl_c_cancels_jobs(tmp_path, capsys):
    def interrupt():
        eventually(lambda: list((tmp_path / "cache").rglob("*.pack")))
        os.kill(os.getpid(), signal.SIGINT)

    with meanwhile(interrupt):
        arguments = [*ON_SLURM, "store=s.zarr", "cache=cache", "measured.pause=5"]
        assert Command(SPRINGS).main(arguments) == 130
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "springs: interrupted; the same command resumes the sweep"
    assert [path.name for path in tmp_path.iterdir()] == ["cache"]


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ("cluster.queue=nowhere", "invalid partition specified: nowhere"),
        ("cluster.interface=ib7", "'ib7' is not a valid network interface"),
    ],
)
def test_unknown_partition_or_interface_is_refused(asked, why, capsys):
    assert Command(SPRINGS).main(["cache=cache", "store=s.zarr", *ON_SLURM, asked]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("springs: cluster.kind is slurm, but no job starts: ")
    assert why in lines[-1] and len(lines) == 3


def test_jobs_ending_before_a_worker_starts_abort_the_sweep(monkeypatch, capsys):
    monkeypatch.setenv("PYTHONHOME", "/nowhere")
    assert Command(SPRINGS).main(["cache=cache", "store=s.zarr", *ON_SLURM]) == 2
    message = "springs: cluster.kind is slurm, but its jobs end before a worker starts ("
    assert capsys.readouterr().err.splitlines()[-1].startswith(message)
    assert jobs() == []


def test_pending_job_reports_the_reason():
    sentences = []
    choice = ClusterChoice(kind="slurm", workers=1, memory="1GiB", walltime="3-0:0:0")
    with open_executor(choice, say=sentences.append):
        eventually(lambda: len(sentences) == 2)
    assert sentences[1].startswith("no Slurm job has a worker yet (Partition")


def test_submitit_launcher_runs_one_slurm_job_per_sweep(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    (tmp_path / "springs.py").write_text(
        "import sys\nfrom toys import SPRINGS\nfrom sweeps.engine.command.line import Command\n"
        "if __name__ == '__main__':\n    sys.exit(Command(SPRINGS).main())\n"
    )
    launcher = {"partition": "compute", "timeout_min": 5, "mem_gb": 1, "cpus_per_task": 1}
    overrides = [f"hydra.launcher.{name}={value}" for name, value in launcher.items()]
    overrides += ["hydra/launcher=submitit_slurm", "hydra.sweep.dir=out", "spring.mass=1"]
    overrides += ["measured.rule=max,mean", "cluster=inline", f"cache={tmp_path / 'cache'}"]
    python("springs.py", "-m", *overrides, cwd=tmp_path, PYTHONPATH=IMPORTS)
    for number, rule in enumerate(["max", "mean"]):
        store, again = tmp_path / "out" / str(number) / "sweep.zarr", tmp_path / f"{rule}.zarr"
        go(again, spring__mass=1, measured__rule=rule)
        assert files(store) == files(again)


JOBQUEUE = """
import signal, threading
from sweeps.engine.run.cluster import import_jobqueue
from sweeps.engine.declare.errors import ConfigurationError

def refused():
    try:
        import_jobqueue("slurm")
    except ConfigurationError as error:
        print(error)

before = signal.getsignal(signal.SIGINT)
thread = threading.Thread(target=refused)
thread.start()
thread.join()
import_jobqueue("slurm")
print(signal.getsignal(signal.SIGINT) is before)
"""


def test_jobqueue_import_needs_main_thread_and_keeps_sigint_handler():
    refused, handler = python("-c", JOBQUEUE).stdout.splitlines()
    assert refused.startswith("cluster.kind is slurm, but dask-jobqueue (pip install dask-jobqueue")
    assert "main thread" in refused and handler == "True"

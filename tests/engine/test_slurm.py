"""Jobs of Slurm as workers, on a machine whose Slurm is made of two scripts."""

import gc
import os
import shlex
import signal
import stat

import pytest
from executors import IMPORTS, blas_threads, eventually, refuse_odd, result_of, started_with

from sweeps.engine import workers
from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.process import ONE_THREAD

pytestmark = pytest.mark.usefixtures("at_a_terminal")


@pytest.fixture
def slurm_machine(tmp_path, monkeypatch):
    """Folder of a machine whose Slurm starts each job at once, as a session of its own."""
    commands = tmp_path / "bin"
    commands.mkdir()
    jobs = shlex.quote(str(tmp_path))
    sbatch = f"""#!/bin/bash
script=$(cat "$1")
setsid bash -c "$script" > /dev/null 2>&1 < /dev/null &
echo "$script" > {jobs}/$!.sh
echo "Submitted batch job $!"
"""
    scancel = f"#!/bin/bash\necho $1 >> {jobs}/cancelled\nkill -KILL -- -$1\n"
    for name, text in {"sbatch": sbatch, "scancel": scancel}.items():
        (commands / name).write_text(text)
        (commands / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{commands}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", IMPORTS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(workers, "LOST", 0.1)
    monkeypatch.setattr(workers, "JOBS_CHECKED", 0.1)
    yield tmp_path
    # The files of certificates went with their folder, of which their finalizers complain. Where
    # that happened while a module is parsed, CPython 3.11 would take the parser to be broken.
    gc.collect()


ON_SLURM = ClusterChoice(
    kind="slurm",
    workers=2,
    queue="short",
    account="radar",
    walltime="1-12:00:00",
    memory="2GiB",
    interface="lo",
)


def test_slurm_jobs_run_tasks_and_are_replaced(slurm_machine):
    def submitted():
        return {path.stem: path.read_text() for path in slurm_machine.glob("*.sh")}

    sentences = []
    with executor(ON_SLURM, tasks=1, say=sentences.append) as run:
        assert run.workers == 1
        ((job, script),) = submitted().items()
        result_of(run, refuse_odd, 2)
        assert set(result_of(run, blas_threads)) == {1}
        assert {f"{name}=1" for name in ONE_THREAD} <= result_of(run, started_with)
        (folder,) = slurm_machine.glob(".sweep-*")
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        assert f"--tls-key {folder}/" in script
        # Its time is up.
        os.killpg(int(job), signal.SIGKILL)
        eventually(lambda: len(submitted()) == 2)
        result_of(run, refuse_odd, 2)
    for line in ("-p short", "-A radar", "-t 1-12:00:00", "--mem=2G", "--cpus-per-task=1", "-n 1"):
        assert f"#SBATCH {line}\n" in script
    for name, value in workers.ENVIRONMENT.items():
        assert f"export {name}={value}\n" in script
    assert " tls://127.0.0.1:" in script and "--nthreads 1 " in script
    assert "--nworkers" not in script
    assert sentences == ["submitting 1 job to Slurm"]
    # Certificates and jobs are gone.
    assert not folder.exists()
    assert set((slurm_machine / "cancelled").read_text().split()) == set(submitted())

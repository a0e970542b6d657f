"""Executors: equal results, errors by number, who may run code, and what outlives what."""

import json
import os
import re
import shlex
import signal
import socket
import ssl
import stat
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from itertools import pairwise
from pathlib import Path

import distributed
import numpy as np
import psutil
import pytest
from distributed.security import Security
from small_stores import files
from threadpoolctl import threadpool_info, threadpool_limits
from toys import go

from sweeps.engine import workers
from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.code import package_digest
from sweeps.engine.errors import ConfigurationError, SweepIncomplete
from sweeps.engine.process import ONE_THREAD

IMPORTS = f"{Path(__file__).parent}:{Path(__file__).parents[2]}"
QUIET = ("--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")


def silent(_sentence):
    pass


def draw(seed, size):
    return np.random.default_rng(seed).normal(size=size)


def refuse_odd(number):
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number


def span(seconds):
    """Process and thread of a task, and when it ran."""
    begin = time.monotonic()
    time.sleep(seconds)
    return os.getpid(), threading.get_ident(), begin, time.monotonic()


def blas_threads():
    return [library["num_threads"] for library in threadpool_info()]


def interrupt_oneself():
    """Ctrl-C as a worker would get it; the time for it to act."""
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.1)
    return os.getpid(), signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def die(marker=None):
    """Kill this process; with a marker, only where that does not exist yet."""
    if marker is not None and marker.exists():
        return "survived"
    if marker is not None:
        marker.touch()
    os.kill(os.getpid(), signal.SIGKILL)


def started_with():
    """What the process itself was started with, whatever was set in it since."""
    lines = Path("/proc/self/environ").read_bytes().split(b"\0")
    return {line.decode() for line in lines}


def gather(run):
    """Outcomes of all submitted tasks, by number."""
    outcomes = {}
    while batch := run.finished():
        outcomes |= {number: (result, error) for number, result, error in batch}
    return outcomes


def result_of(run, function, *arguments):
    run.submit(0, function, *arguments)
    ((result, error),) = gather(run).values()
    assert error is None
    return result


def eventually(condition):
    """Wait until a condition holds."""
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "it never came about"
        time.sleep(0.02)


@pytest.fixture(scope="module", autouse=True)
def _at_a_terminal():
    """Interrupts are heard, as by a command that is typed: what runs in the background ignores
    them, and so would all that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def inline():
    with threadpool_limits(2), executor(ClusterChoice(kind="inline"), say=silent) as run:
        yield run


@pytest.fixture(scope="module")
def local(_at_a_terminal):
    # The environment of the user does not decide, whatever it holds.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "7")
        with executor(ClusterChoice(workers=2), say=silent) as run:
            yield run


def written(security, folder):
    """Choice of certificates that are written into a folder."""
    texts = {"ca": security.tls_ca_file, "key": security.tls_client_key}
    texts["cert"] = security.tls_client_cert
    for name, text in texts.items():
        (folder / f"{name}.pem").write_text(text)
    return {"ca_file": f"{folder}/ca.pem", "cert": f"{folder}/cert.pem", "key": f"{folder}/key.pem"}


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """Choice of a scheduler that runs on its own, with two workers of two threads each."""
    folder = tmp_path_factory.mktemp("scheduler")
    files = written(Security.temporary(), folder)
    tls = ("--tls-ca-file", files["ca_file"], "--tls-cert", files["cert"], "--tls-key")
    shared = ("--scheduler-file", folder / "scheduler.json", *QUIET, *tls, files["key"])
    commands = [("scheduler", *shared, "--protocol", "tls://", "--port", "0")] + [
        ("worker", *shared, "--nthreads", "2", "--no-nanny")
    ] * 2
    with ExitStack() as stack:
        for name, *arguments in commands:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{name}", *map(str, arguments)],
                cwd=folder,
                env=os.environ | dict.fromkeys(ONE_THREAD, "2") | {"PYTHONPATH": IMPORTS},
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
        eventually((folder / "scheduler.json").exists)
        address = json.loads((folder / "scheduler.json").read_text())["address"]
        choice = ClusterChoice(kind="address", address=address, **files)
        with executor(choice, say=silent) as run:
            eventually(lambda: run.workers == 2)
        yield choice


@pytest.fixture(scope="module")
def remote(running):
    with executor(running, say=silent) as run:
        yield run


@pytest.fixture(params=["inline", "local", "remote"])
def any_executor(request):
    return request.getfixturevalue(request.param)


def test_results_are_those_of_plain_calls(any_executor):
    for seed in range(20):
        any_executor.submit(seed, draw, seed, 100)
    outcomes = gather(any_executor)
    assert sorted(outcomes) == list(range(20))
    for seed, (result, error) in outcomes.items():
        assert error is None
        np.testing.assert_array_equal(result, draw(seed, 100))
    assert any_executor.finished() == []


def test_errors_come_back_with_their_number(any_executor):
    for number in range(7):
        any_executor.submit(10 + number, refuse_odd, number)
    outcomes = gather(any_executor)
    for number in range(7):
        result, error = outcomes[10 + number]
        if number % 2:
            assert isinstance(error, ValueError) and str(error) == f"{number} is odd"
        else:
            assert error is None and result == number


def test_tasks_of_a_process_run_one_at_a_time_in_one_thread(any_executor):
    for number in range(8):
        any_executor.submit(number, span, 0.05)
    spans = sorted((result for result, _ in gather(any_executor).values()), key=lambda s: s[2])
    processes = {process for process, *_ in spans}
    assert len(processes) <= any_executor.workers
    for process in processes:
        here = [s for s in spans if s[0] == process]
        assert len({thread for _, thread, *_ in here}) == 1
        assert all(a[3] <= b[2] for a, b in pairwise(here))


def test_numerical_libraries_have_one_thread(any_executor):
    assert set(result_of(any_executor, blas_threads)) == {1}


def test_inline_opens_no_port_starts_no_process_and_limits_what_is_loaded_later():
    code = """
import psutil, sys
from sweeps.engine.cluster import ClusterChoice, executor

def look():
    import scipy.linalg
    from threadpoolctl import threadpool_info
    process = psutil.Process()
    return (
        {library["num_threads"] for library in threadpool_info()},
        process.net_connections("inet"),
        process.children(),
    )

with executor(ClusterChoice(kind="inline"), say=print) as run:
    run.submit(0, look)
    ((_, result, error),) = run.finished()
assert error is None, error
assert result == ({1}, [], []), result
assert "distributed" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# -- who may run code on a local cluster


def listening():
    """Addresses on which this process and the workers that were forked for it listen."""
    children = psutil.Process().children(recursive=True)
    forked = [process for process in children if "forkserver" in " ".join(process.cmdline())]
    sockets = [s for p in (psutil.Process(), *forked) for s in p.net_connections("inet")]
    return [s.laddr for s in sockets if s.status == psutil.CONN_LISTEN]


def test_a_local_cluster_listens_on_the_loopback_interface_only(local):
    addresses = listening()
    assert len(addresses) >= 5  # of a scheduler, two nannies and two workers
    assert {address.ip for address in addresses} == {"127.0.0.1"}


def heard(port, security):
    """First byte that a server sends to a peer that trusts anybody, if it accepts the peer."""
    if security is None:
        own = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    else:
        own = security.get_connection_args("client")["ssl_context"]
    own.check_hostname, own.verify_mode = False, ssl.CERT_NONE
    try:
        with (
            socket.create_connection(("127.0.0.1", port), timeout=5) as plain,
            own.wrap_socket(plain) as encrypted,
        ):
            return encrypted.recv(1)
    except (ssl.SSLError, ConnectionError):
        return b""


def page(port):
    """Answer to a plain HTTP request."""
    with socket.create_connection(("127.0.0.1", port), timeout=5) as plain:
        plain.sendall(b"GET /info/main/workers.html HTTP/1.0\r\n\r\n")
        try:
            return plain.recv(1000)
        except ConnectionError:
            return b""


def test_only_holders_of_the_certificate_are_heard_by_a_local_cluster(local):
    ports = [address.port for address in listening()]
    pages = {port: page(port) for port in ports}
    encrypted = [port for port in ports if not pages[port].startswith(b"HTTP")]
    # every port speaks TLS or is an HTTP server without pages
    assert len(encrypted) >= 5
    assert all(b" 404 " in pages[port] for port in set(ports) - set(encrypted))
    for port in encrypted:
        assert heard(port, local._client.security)
        assert not heard(port, Security.temporary())
        assert not heard(port, None)


@pytest.mark.parametrize("security", [None, Security.temporary()], ids=["plain", "other TLS"])
def test_another_client_cannot_reach_a_local_scheduler(local, security):
    address = local._client.scheduler.address.removeprefix("tls://")
    protocol = "tls" if security else "tcp"
    with pytest.raises(OSError):  # noqa: PT011
        distributed.Client(f"{protocol}://{address}", security=security, timeout=0.5)


# -- what a worker starts with, and what it survives


def test_a_worker_starts_with_one_thread_and_an_allocator_that_keeps(local):
    there = result_of(local, started_with)
    assert {f"{name}={value}" for name, value in workers.ENVIRONMENT.items()} <= there
    assert set(ONE_THREAD) <= set(workers.ENVIRONMENT)


def test_no_more_workers_than_tasks_and_nothing_left_behind():
    environment, sentences = dict(os.environ), []
    handler, blocked = signal.getsignal(signal.SIGINT), signal.pthread_sigmask(signal.SIG_BLOCK, [])
    before = set(psutil.Process().children(recursive=True))
    with executor(ClusterChoice(workers=2), tasks=1, say=sentences.append) as run:
        assert run.workers == 1
        assert result_of(run, refuse_odd, 2) == 2
    assert sentences == ["starting 1 worker process"]
    assert set(psutil.Process().children(recursive=True)) <= before
    assert dict(os.environ) == environment
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == blocked


def test_a_worker_does_not_hear_an_interrupt_nor_does_its_successor(local):
    first, blocked = result_of(local, interrupt_oneself)
    assert blocked and first != os.getpid()
    os.kill(first, signal.SIGKILL)
    for number in range(4):
        local.submit(number, interrupt_oneself)
    for (process, blocked), error in gather(local).values():
        assert error is None and blocked and process != first


def test_a_task_whose_worker_is_killed_is_run_again(local, tmp_path):
    assert result_of(local, die, tmp_path / "marker") == "survived"


def test_a_task_that_kills_its_workers_fails_alone(local):
    for number in range(20):
        local.submit(number, *((die,) if number == 3 else (span, 0.01)))
    outcomes = {}
    while batch := local.finished():
        for number, result, error in batch:
            outcomes[number] = result, error
            if error:  # what is submitted before others may run again is kept
                local.submit(100, refuse_odd, number + 1)
    assert sorted(outcomes) == [*range(20), 100]
    assert [number for number, (_, error) in outcomes.items() if error] == [3]
    assert "worker process died" in str(outcomes[3][1])
    assert outcomes[100] == (4, None)


def test_waiting_is_interrupted(local):
    local.submit(0, span, 0.5)
    threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        local.finished()
    assert list(gather(local)) == [0]


@contextmanager
def another_thread():
    """A thread of this process that takes signals, as a progress bar has."""
    done = threading.Event()
    threading.Thread(target=done.wait, daemon=True).start()
    yield
    done.set()


@pytest.mark.parametrize(("times", "thread"), [(1, False), (2, True)])
def test_an_interrupt_while_workers_start_is_delivered_afterwards(times, thread, monkeypatch):
    clusters = []
    start = distributed.LocalCluster

    def interrupted(**options):
        for _ in range(times):
            interrupt_oneself()
        clusters.append(start(**options))
        return clusters[0]

    monkeypatch.setattr(workers, "LocalCluster", interrupted)
    entered = False
    with ExitStack() as stack:
        if thread:
            stack.enter_context(another_thread())
        with (
            pytest.raises(KeyboardInterrupt),
            executor(ClusterChoice(workers=1), say=silent),
        ):
            entered = True
    # It was started all the same, nothing ran on it, and it was ended in order.
    assert not entered
    assert clusters[0].status == distributed.Status.closed


def ended(process):
    """Whether a process runs no more, even if nobody has asked for its exit status."""
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def test_workers_end_with_a_driver_that_is_killed():
    code = """
import os, sys, time
from sweeps.engine.cluster import ClusterChoice, executor

if __name__ == "__main__":
    with executor(ClusterChoice(workers=1), say=print) as run:
        run.submit(0, os.getpid)
        print(run.finished()[0][1], flush=True)
        run.submit(1, time.sleep, 1000)
        run.finished()
"""
    driver = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    with driver:
        assert driver.stdout.readline() == "starting 1 worker process\n"
        worker = psutil.Process(int(driver.stdout.readline()))
        children = psutil.Process(driver.pid).children(recursive=True)
        assert worker in children
        driver.kill()
    eventually(lambda: all(ended(process) for process in children))


# -- a scheduler at an address


def test_an_address_has_as_many_workers_as_processes(remote):
    assert remote.workers == 2


def test_a_scheduler_makes_the_same_store_as_this_process(running, tmp_path):
    asked = {"spring__limit": 1.5}  # the stiffest spring fails
    stores = {kind: tmp_path / f"{kind}.zarr" for kind in ("inline", "remote")}
    inline = go(stores["inline"], **asked)
    remote = go(stores["remote"], kind=running, **asked)
    assert inline.failures and sorted(inline.failures) == sorted(remote.failures)
    assert files(stores["inline"]) == files(stores["remote"])
    done = {name: one.done for name, one in remote.progress.items()}
    assert done["noisy"] and done["answers"]  # which draws, and which gathers
    assert done == {name: one.done for name, one in inline.progress.items()}


def test_a_worker_with_other_code_is_refused(running, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "of_this_process.py").write_text("")
    with (
        pytest.raises(ConfigurationError) as refused,
        executor(running, packages=("toys", "of_this_process"), say=silent),
    ):
        pass
    assert re.fullmatch(
        rf"cluster.address is {running.address}, but its worker tls://127.0.0.1:\d+ has other code "
        "of of_this_process; it must have that of this process",
        str(refused.value),
    )


def test_a_worker_that_comes_later_with_other_code_gets_no_task(running, tmp_path):
    with executor(running, say=silent) as run:
        run._code = {**run._code, "toys": "another"}
        run.submit(0, Path.touch, tmp_path / "ran")
        with pytest.raises(ConfigurationError, match="a worker of the cluster has other code of"):
            run.finished()
    assert not (tmp_path / "ran").exists()


def test_code_of_the_same_package_elsewhere_is_the_same(tmp_path, monkeypatch):
    digests = set()
    for place, text in (("one", "x = 1"), ("two", "x = 1"), ("three", "x = 2")):
        folder = tmp_path / place / "pack"
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text("")
        (folder / "inner.py").write_text(text)
        with monkeypatch.context() as patch:
            patch.syspath_prepend(folder.parent)
            package_digest.cache_clear()
            digests.add(package_digest("pack"))
    package_digest.cache_clear()
    assert len(digests) == 2 and "" not in digests and package_digest("no_such_pack") == ""


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(workers, "ANSWER", 0.5)


def unanswered(address):
    return rf"cluster.address is {address}, but no scheduler answers there \(.+\)"


def fails_with(choice, sentence):
    with (
        pytest.raises(ConfigurationError, match=f"^{sentence}$"),
        executor(choice, say=silent),
    ):
        pass


@contextmanager
def nobody(listens=False):
    """Port that nobody, or somebody who never answers, listens on."""
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        if listens:
            mute.listen()
        yield mute.getsockname()[1]


def somebody_mute():
    return nobody(listens=True)


@contextmanager
def web_server():
    with HTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}).start()
        yield server.server_port
        server.shutdown()


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("protocol", ["tcp", "tls"])
@pytest.mark.parametrize("peer", [nobody, somebody_mute, web_server])
def test_nobody_answers_at_an_address(protocol, peer, tmp_path):
    with peer() as port:
        address = f"{protocol}://127.0.0.1:{port}"
        files = written(Security.temporary(), tmp_path) if protocol == "tls" else {}
        choice = ClusterChoice(kind="address", address=address, **files)
        fails_with(choice, unanswered(address))


@pytest.mark.usefixtures("impatient")
def test_a_scheduler_answers_neither_other_certificates_nor_none(running, tmp_path):
    files = written(Security.temporary(), tmp_path)
    others = ClusterChoice(kind="address", address=running.address, **files)
    plain = ClusterChoice(kind="address", address=running.address.replace("tls:", "tcp:"))
    for choice in (others, plain):
        fails_with(
            choice, f"cluster.address is {choice.address}, but no scheduler answers there .*"
        )


def test_files_that_are_no_certificates_are_refused(tmp_path):
    path = tmp_path / "ca.pem"
    path.write_text("nothing")
    choice = ClusterChoice(
        kind="address", address="tls://127.0.0.1:1", ca_file=str(path), cert=str(path)
    )
    fails_with(
        choice, "cluster.ca_file, cluster.cert and cluster.private_key are .*, but must be PEM .*"
    )


@contextmanager
def thread_cluster(count):
    """A scheduler and workers in this process."""
    with distributed.LocalCluster(
        n_workers=count,
        processes=False,
        threads_per_worker=1,
        protocol="tcp://",
        dashboard_address=None,
        scheduler_kwargs=workers.SCHEDULER,
    ) as cluster:
        yield cluster


def test_a_scheduler_without_workers_is_refused(monkeypatch):
    monkeypatch.setattr(workers, "ARRIVAL", 0.5)
    with thread_cluster(0) as cluster:
        address = cluster.scheduler_address
        choice = ClusterChoice(kind="address", address=address)
        fails_with(choice, f"cluster.address is {address}, but its scheduler has no workers")


def test_a_scheduler_that_goes_away_ends_the_sweep(monkeypatch):
    monkeypatch.setattr(workers, "ANSWER", 2)
    with thread_cluster(1) as cluster:
        choice = ClusterChoice(kind="address", address=cluster.scheduler_address)
        with executor(choice, say=silent) as run:
            run.submit(0, span, 0.5)
            cluster.close()
            with pytest.raises(SweepIncomplete, match="the scheduler of the cluster is gone"):
                run.finished()


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(
    ("host", "warned"), [("192.0.2.1", True), ("localhost", False), ("[::1]", False)]
)
def test_traffic_that_leaves_the_machine_in_the_open_is_said(host, warned):
    sentences = []
    address = f"tcp://{host}:1"
    with (
        pytest.raises(ConfigurationError),
        executor(ClusterChoice(kind="address", address=address), say=sentences.append),
    ):
        pass
    said = [f"the traffic with {address} is neither encrypted nor authenticated"]
    assert sentences == (said if warned else [])


# -- Slurm


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
    return tmp_path


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


def test_slurm_that_refuses_a_job_is_quoted(slurm_machine):
    refusal = "sbatch: error: Invalid account"
    (slurm_machine / "bin" / "sbatch").write_text(f"#!/bin/bash\necho {refusal!r} >&2\nexit 1\n")
    fails_with(ON_SLURM, f"cluster.kind is slurm, but sbatch refuses the job: {refusal}")


def test_slurm_that_is_not_there_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    fails_with(ON_SLURM, "cluster.kind is slurm, but this machine has no sbatch command")
    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    fails_with(
        ON_SLURM,
        "cluster.kind is slurm, but dask-jobqueue is not installed: pip install dask-jobqueue",
    )


# -- settings


TLS = {"address": "tls://10.0.0.1:8786"}


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"kind": "k8s"}, "kind is k8s, but must be one of inline, local, address, slurm"),
        ({"workers": 0}, "workers is 0, but must be at least 1"),
        (
            {"kind": "inline", "workers": 2},
            "workers is 2, but must be null where cluster.kind is inline",
        ),
        (
            {"address": "tcp://127.0.0.1:1"},
            "address is tcp://127.0.0.1:1, but must be null where cluster.kind is local",
        ),
        (
            {"kind": "address"},
            "address is null, but must be the address of a dask scheduler "
            "where cluster.kind is address",
        ),
        (
            {"kind": "address", "address": "10.0.0.1:8786"},
            "address is 10.0.0.1:8786, but must be like tls://10.0.0.1:8786",
        ),
        (
            {"kind": "address", **TLS},
            "ca_file is null, but must be a PEM file where cluster.address begins with tls://",
        ),
        (
            {"kind": "address", **TLS, "ca_file": "absent.pem"},
            "ca_file is absent.pem, but must be an existing PEM file",
        ),
        (
            {"kind": "address", "address": "tcp://10.0.0.1:1", "cert": "x.pem"},
            "cert is x.pem, but must be null where cluster.address does not begin with tls://",
        ),
        (
            {"kind": "address", "address": "tcp://10.0.0.1:1", "queue": "short"},
            "queue is short, but must be null where cluster.kind is address",
        ),
        (
            {"kind": "slurm", "memory": "1GB"},
            "workers is null, but must be the number of jobs where cluster.kind is slurm",
        ),
        (
            {"kind": "slurm", "workers": 1},
            "memory is null, but must be the memory of a job, such as 4GiB "
            "where cluster.kind is slurm",
        ),
        (
            {"kind": "slurm", "workers": 1, "memory": "much"},
            "memory is much, but must be a number of bytes such as 4GiB",
        ),
        (
            {"kind": "slurm", "workers": 1, "memory": "1GB", "walltime": "a day"},
            "walltime is a day, but must be a time of Slurm such as 12:00:00 or 1-12:00:00",
        ),
        (
            {"kind": "slurm", "workers": 1, "memory": "1GB", "queue": "x\n#SBATCH -A y"},
            "queue is x\n#SBATCH -A y, but must be the name of a Slurm partition",
        ),
    ],
)
def test_settings_that_do_not_fit_are_refused(settings, sentence):
    with pytest.raises(ConfigurationError) as refused:
        ClusterChoice(**settings)
    assert str(refused.value) == f"cluster.{sentence}"

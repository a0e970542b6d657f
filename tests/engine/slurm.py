"""Run a real Slurm (Debian packages) of one node on loopback, with all of its files in a folder."""

import os
import secrets
import shutil
import signal
import socket
import subprocess
from contextlib import contextmanager, suppress

DAEMONS = ("munged", "slurmctld", "slurmd")
PACKAGES = "slurmctld slurmd slurm-client munge"
MEMORY = 4000  # MiB that jobs may ask for
CORES = 4  # the machine may have fewer

CONFIGURATION = """
ClusterName=loopback
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
MpiDefault=none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmdParameters=config_overrides
ReturnToService=2
SchedulerParameters=sched_interval=1,sched_min_interval=0,batch_sched_delay=0,default_queue_depth=10
CompleteWait=0
KillWait=1
MinJobAge=2
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=compute Nodes={host} Default=YES MaxTime=1:00:00 State=UP
"""


def missing():
    """Return why no Slurm can be started here; an empty string if one can."""
    lacking = [name for name in (*DAEMONS, "sbatch") if shutil.which(name) is None]
    if lacking:
        return f"no {', '.join(lacking)} here (apt install {PACKAGES})"
    return "" if os.geteuid() == 0 else "daemons of Slurm are started by root"


def asked(command, *arguments):
    """Run a command of Slurm; return the words that it prints."""
    done = subprocess.run([command, *arguments], capture_output=True, text=True, check=True)
    return done.stdout.split()


def free_ports(count):
    """Return ports of the loopback interface on which no process listens."""
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [socket_.getsockname()[1] for socket_ in sockets]
    for socket_ in sockets:
        socket_.close()
    return ports


@contextmanager
def started(folder):
    """Run the daemons; yield the path of their configuration, for `SLURM_CONF`."""
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    key, configuration = folder / "munge.key", folder / "slurm.conf"
    key.write_bytes(secrets.token_bytes(1024))
    key.chmod(0o400)
    host = socket.gethostname().partition(".")[0]
    names = {"folder": folder, "host": host, "ports": free_ports(2)}
    configuration.write_text(CONFIGURATION.format(**names, cores=CORES, memory=MEMORY))
    files = {"socket": "munge.socket", "pid-file": "munged.pid", "log-file": "munged.log"}
    files |= {"key-file": "munge.key", "seed-file": "munge.seed"}
    options = [f"--{name}={folder / file}" for name, file in files.items()]
    environment = os.environ | {"SLURM_CONF": str(configuration)}
    try:
        for command in (["munged", "--force", *options], ["slurmctld"], ["slurmd"]):
            subprocess.run(command, check=True, capture_output=True, env=environment)
        yield configuration
    finally:
        for name in reversed(DAEMONS):
            with suppress(OSError, ValueError):  # the daemon may not have started
                os.kill(int((folder / f"{name}.pid").read_text()), signal.SIGKILL)

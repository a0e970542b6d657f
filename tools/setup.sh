#!/usr/bin/env bash
# Set up everything the project needs: a render library where that is possible, a virtual
# environment, and the locked dependencies, with those of the groups that are named (dev, docs).
# Safe to run again; it does only what is missing.
set -euo pipefail
cd "$(dirname "$0")/.."

as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; elif sudo -n true 2>/dev/null; then sudo "$@"; else return 1; fi
}

apt_install() {
    command -v apt-get >/dev/null || return 1
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y "$@" >/dev/null 2>&1 && return
    as_root apt-get update -qq >/dev/null 2>&1 || return 1
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y "$@" >/dev/null 2>&1
}

has_library() { /sbin/ldconfig -p 2>/dev/null | grep -q "$1"; }

if ! has_library libOSMesa.so; then
    echo "setup: installing libosmesa6"
    if ! apt_install libosmesa6 &&
        ! has_library libEGL.so.1 && ! apt_install libegl1 libopengl0 libgl1-mesa-dri; then
        echo "setup: could not; range images will be drawn with embree, which needs no library"
    fi
fi

# The tests open reports in a real browser; Ubuntu's package of this name is a snap.
case " $* " in *" dev "*)
    if ! command -v chromium google-chrome chromium-browser >/dev/null; then
        echo "setup: installing chromium"
        apt_install --no-install-recommends chromium ||
            echo "setup: could not; tests of reports in a browser will be skipped"
    fi
    if [ ! -x /usr/sbin/slurmctld ]; then
        echo "setup: installing Slurm"
        apt_install --no-install-recommends slurmctld slurmd slurm-client munge ||
            echo "setup: could not; tests of Slurm will be skipped"
    fi
    ;;
esac

if [ ! -x .venv/bin/python ]; then
    python=
    for candidate in "${PYTHON:-}" python3.12 python3.11 python3.13 python3; do
        if [ -n "$candidate" ] && "$candidate" -c \
            'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; then
            python=$candidate
            break
        fi
    done
    if [ -z "$python" ]; then
        echo "setup: no Python from 3.11 to 3.13 was found; install one, or name it: PYTHON=..." >&2
        exit 1
    fi
    echo "setup: making .venv with $("$python" --version)"
    if ! "$python" -m venv .venv >/dev/null 2>&1; then
        rm -rf .venv
        version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        if ! apt_install "python$version-venv" || ! "$python" -m venv .venv; then
            echo "setup: $python cannot make virtual environments: apt install python$version-venv" >&2
            exit 1
        fi
    fi
fi

uv=.venv/bin/uv
if [ ! -x "$uv" ]; then
    uv=$(command -v uv) || {
        .venv/bin/python -m pip --version >/dev/null 2>&1 || .venv/bin/python -m ensurepip -q
        .venv/bin/python -m pip install --quiet --disable-pip-version-check "uv>=0.5"
        uv=.venv/bin/uv
    }
fi
# --inexact keeps pip and uv itself, which are not the project's dependencies, and other groups.
"$uv" sync --quiet --compile-bytecode --locked --inexact --no-default-groups "${@/#/--group=}" \
    --python .venv/bin/python
# Its own modules, too: containers that write no bytecode would compile them at every start.
.venv/bin/python -m compileall -q -j 0 ncti studies sweeps

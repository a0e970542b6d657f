"""Fixtures of several tests of stages."""

import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where sweeps of flights in one module find what others finished."""
    return tmp_path_factory.mktemp("flights")

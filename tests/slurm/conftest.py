"""The fixture that starts a Slurm, and leaves no process behind."""

import os

import pytest

from support.cluster import Cluster, missing


@pytest.fixture(scope="session")
def cluster(tmp_path_factory):
    """A Slurm with two nodes."""
    if reason := missing():
        # Nobody would notice that these tests no longer run where it matters.
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)(reason)
    found = Cluster(tmp_path_factory.mktemp("slurm"))
    try:
        found.start()
        yield found
    finally:
        found.stop()

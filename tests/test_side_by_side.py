"""Work shared among forks: the same results, in order, and the same errors."""

import os
import signal

import numpy as np
import pytest

from softnn.workers import side_by_side


@pytest.mark.parametrize("jobs", [1, 2, 3, 9])
def test_results_come_in_order_whoever_made_them(jobs):
    large = np.arange(1e5)
    found = side_by_side(lambda k: k * large, range(7), jobs)
    assert [x[-1] for x in found] == [k * large[-1] for k in range(7)]
    assert side_by_side(str, [], jobs) == []


def test_forks_do_share_the_work():
    assert len(set(side_by_side(lambda _: os.getpid(), range(4), 2))) == 2


def test_an_error_in_a_fork_is_an_error_here():
    def work(k):
        if k == 1:
            raise ValueError("of the second")
        return k

    with pytest.raises(ValueError, match="of the second"):
        side_by_side(work, range(4), 2)


def test_a_killed_fork_is_told():
    here = os.getpid()

    def work(k):
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    with pytest.raises(RuntimeError, match="killed"):
        side_by_side(work, range(4), 2)


def test_an_error_here_leaves_no_fork_behind():
    def work(k):
        if k == 0:
            raise ValueError("of the first")
        signal.pause()

    with pytest.raises(ValueError, match="of the first"):
        side_by_side(work, range(2), 2)
    with pytest.raises(ChildProcessError):  # none is left
        os.waitpid(-1, os.WNOHANG)

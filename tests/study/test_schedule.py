"""The counter: every number once, from all ranks, also while the rank that holds it computes."""

import json

from cvt_hpc.study.batches import Assignment
from cvt_hpc.study.ranks.progress import Counter
from cvt_hpc.study.sweep import Claims

PLAN = [Assignment((5, 2)), Assignment((9,)), Assignment((0, 1, 3))]


def claimed(counter, may_claim=lambda: True, fits=lambda batch: True, plan=PLAN):
    return list(Claims(plan, counter, may_claim, fits))


def claim_under_mpi(start, ranks, options, environment=None):
    finished = start(options, ranks, "claiming.py", environment).finish()
    assert finished.returncode == 0, finished.stderr
    return json.loads(finished.stdout)


def test_serial_claims_follow_the_plan():
    with Counter() as counter:
        assert claimed(counter) == PLAN
        assert claimed(counter) == []
        counter.rewind()
        assert claimed(counter) == PLAN


def test_no_claim_when_it_is_not_allowed():
    counter = Counter()
    answers = iter([True, True, False])
    assert claimed(counter, lambda: next(answers)) == PLAN[:2]
    assert counter.claim() == 2  # the refusal has cost no number


def test_serial_interruption_is_beyond_every_plan():
    counter = Counter()
    assert not counter.is_interrupted()
    counter.interrupt_all()
    counter.rewind()
    assert counter.is_interrupted()
    assert claimed(counter) == []


def test_three_ranks_claim_every_number_once(start):
    found = claim_under_mpi(start, 3, {"task": "claim", "limit": 600})
    claims = found["claims"]
    assert sorted(sum(claims, [])) == list(range(600))
    assert all(mine == sorted(mine) for mine in claims)
    assert len(claims) == 3
    assert sorted(found["rewound"]) == [0, 1, 2]
    assert found["tallies"] == [[600, 60]] * 3


def test_claims_are_served_while_the_host_computes(start, tmp_path):
    # Without shared memory, as between nodes: there a claim waits for rank 0 to enter the MPI library.
    environment = {"MPIR_CVAR_NOLOCAL": "1", "OMPI_MCA_btl": "self,tcp", "OMPI_MCA_osc": "rdma"}
    options = {"task": "busy host", "marker": tmp_path / "claimed"}
    assert claim_under_mpi(start, 2, options, environment) == {"served": True}


def test_all_ranks_learn_of_an_interruption(start):
    found = claim_under_mpi(start, 2, {"task": "interrupt"})
    assert found["before"] == [False, False]
    assert found["after"] == [True, True]
    assert min(found["claims"]) > 10**9


def test_a_counter_that_miscounts_is_refused(start):
    errors = claim_under_mpi(start, 2, {"task": "miscount"})["errors"]
    assert len(errors) == 2  # on all ranks alike
    assert all("self-test of the shared counter" in error for error in errors)


def test_a_batch_that_does_not_fit_is_passed_over():
    counter = Counter()
    assert claimed(counter, fits=lambda batch: batch != (5, 2)) == PLAN[1:]
    assert claimed(counter) == []  # nobody else does it either


def test_runs_that_are_to_be_done_alone_come_one_by_one():
    plan = [Assignment((4, 5, 6), alone=True), Assignment((1, 2))]
    singles = [Assignment((index,), alone=True) for index in (4, 5, 6)]
    assert claimed(Counter(), plan=plan) == [*singles, plan[1]]
    assert claimed(Counter(), fits=lambda batch: batch != (5,), plan=plan) == [*singles[::2], plan[1]]
    answers = iter([True, True, False])
    assert claimed(Counter(), lambda: next(answers), plan=plan) == singles[:2]


def test_batches_join_in_the_order_of_the_plan_until_one_has_to_be_done_apart():
    plan = [Assignment((k,), joins=k != 3) for k in range(6)]
    claims = Claims(plan, Counter(), lambda: True, lambda batch: True)
    work = iter(claims)
    assert next(work).runs == (0,)
    assert [claims.joining(lambda runs: runs == (1,)) for _ in range(2)] == [(1,), ()]
    assert next(work).runs == (2,)  # claimed already, and not lost
    assert claims.joining(lambda runs: True) == ()
    assert [claimed.runs for claimed in work] == [(3,), (4,), (5,)]
    assert claims.joining(lambda runs: True) == ()

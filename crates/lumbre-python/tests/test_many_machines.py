"""The formula for many machines, and the simulation that it is compared with."""

from __future__ import annotations

import sys
from dataclasses import replace

import pytest
from conftest import ROOT

BENCHES = ROOT / "crates/lumbre-python/benches"
sys.path.insert(0, str(BENCHES))

from many_machines import (  # noqa: E402
    SIZE,
    SPP,
    Accidents,
    Costs,
    Job,
    Rest,
    Simulation,
    Stages,
    default,
    predict,
    scene_arrivals,
    spread,
)

from lumbre.distributed import _Plan, _wanted  # noqa: E402

COSTS = Costs.measured()
FREE = Costs(**dict.fromkeys(vars(COSTS), 0.0))
JOB = Job(pixels=640 * 360, work=900.0, tiles=60, passes=8, spread=spread(), build=0.5)


def test_one_worker_takes_the_sum_of_the_work() -> None:
    outcome = Simulation(replace(JOB, spread=(1.0,), build=0.0), FREE, 1).run()
    assert outcome.seconds == pytest.approx(900.0, rel=1e-9)
    assert outcome.busy["workers"] == pytest.approx(900.0, rel=1e-9)
    uneven = Simulation(replace(JOB, spread=(0.5, 1.5), build=7.0), FREE, 1).run()
    assert uneven.seconds == pytest.approx(uneven.busy["workers"] + 7.0, rel=1e-9) and uneven.seconds != pytest.approx(907.0)


@pytest.mark.parametrize("workers", [1, 3, 40, 700])
@pytest.mark.parametrize("seed", [1, 2])
def test_every_task_is_in_the_picture_once(workers: int, seed: int) -> None:
    for job in (JOB, replace(JOB, fan_in=8), replace(JOB, fan_in=4, scene=1e8), replace(JOB, tiles=7)):
        slow = Accidents(slowness=0.6)
        assert Simulation(job, COSTS, workers, slow, seed).run().merged == [1] * job.tasks
    mortal = Accidents(deaths=0.05, restart=3.0)
    outcome = Simulation(JOB, COSTS, workers, mortal, seed).run()
    assert outcome.merged == [1] * JOB.tasks and outcome.deaths > 10
    assert outcome.seconds > Simulation(JOB, COSTS, workers, seed=seed).run().seconds


def test_a_seed_says_all() -> None:
    accidents = Accidents(deaths=0.01, slowness=0.2)
    seconds = [Simulation(JOB, COSTS, 9, accidents, seed).run().seconds for seed in (3, 3, 4)]
    assert seconds[0] == seconds[1] != seconds[2]


def test_the_formula_is_within_a_tenth_of_the_simulation_where_workers_have_four_tasks() -> None:
    limits = set()
    for job in (JOB, replace(JOB, work=90000.0), replace(JOB, passes=64), replace(JOB, passes=64, fan_in=16), replace(JOB, threads=4.0)):
        for workers in (1, 2, 5, 20, 60, 120, 400, 800):
            if job.tasks < 4 * workers:
                continue
            predicted = predict(job, COSTS, workers)
            simulated = sum(Simulation(job, COSTS, workers, seed=seed).run().seconds for seed in range(5)) / 5
            assert predicted.seconds == pytest.approx(simulated, rel=0.1), (job.passes, job.work, workers, predicted, simulated)
            limits.add(predicted.limit)
    assert "workers" in limits and len(limits) > 1, "no case was limited by client or scheduler"


def test_the_slowest_place_says_how_long_it_takes() -> None:
    # A thousand workers, for tasks that take no time: nothing but the client is at work.
    slow = replace(FREE, client=0.01)
    job = Job(pixels=640 * 360, work=1e-6, tiles=600)
    assert Simulation(job, slow, 1000).run().seconds == pytest.approx(6.0, rel=1e-3)
    assert predict(job, slow, 1000).limit == "client"
    assert predict(job, replace(FREE, schedule=0.01), 1000).limit == "scheduler"
    # Merges at workers take the client's share away.
    merging = replace(FREE, merge_part=0.05)
    tree = replace(JOB, fan_in=8)
    assert Stages.of(tree, merging).client == pytest.approx(0.05 / 8)
    assert Simulation(JOB, merging, 400).run().busy["client"] == pytest.approx(480 * 0.05)
    assert Simulation(tree, merging, 400).run().busy["client"] == pytest.approx(60 * 0.05)


def test_what_is_left_of_tasks_at_a_random_time() -> None:
    # Of equal times any part may be left; of times 1 and 3 the longer is met three times in four: mean 1/4 * 1/2 + 3/4 * 3/2.
    even, uneven = Rest([2.0, 2.0]), Rest([3.0, 1.0])
    assert even.mean == 1.0 and [even.quantile(q) for q in (0.0, 0.25, 1.0)] == [0.0, 0.5, 2.0]
    assert uneven.mean == 1.25
    # P(rest < 1) = 1/2: the density is 1/2 up to 1, and 1/4 from there to 3.
    assert [uneven.quantile(q) for q in (0.25, 0.5, 0.75, 1.0)] == pytest.approx([0.5, 1.0, 2.0, 3.0])


def test_a_scene_goes_from_worker_to_worker() -> None:
    assert scene_arrivals(1, 3.0) == [6.0]
    assert sorted(scene_arrivals(8, 1.0)) == [2, 3, 4, 4, 5, 5, 5, 5]
    sent = replace(JOB, scene=2e9)
    late = Simulation(sent, COSTS, 64).run().seconds - Simulation(JOB, COSTS, 64).run().seconds
    assert late == pytest.approx(COSTS.ship * 2e9 * 8, rel=0.2)


def test_what_is_not_simulated_is_refused() -> None:
    with pytest.raises(ValueError, match="multiple of the fan-in"):
        Simulation(replace(JOB, fan_in=3), COSTS, 2)
    with pytest.raises(ValueError, match="deaths"):
        Simulation(replace(JOB, fan_in=2), COSTS, 2, Accidents(deaths=1.0))


def test_renders_are_cut_as_the_package_cuts_them() -> None:
    for slots in (1, 2, 30, 256, 1000, 10000):
        job = default(replace(JOB, pixels=SIZE[0] * SIZE[1]), slots)
        plan = _Plan(1, (0, 0, *SIZE), SPP, _wanted(slots), None, None, False)
        assert (job.tiles, job.tasks) == (len(plan.tiles), sum(1 for _ in plan.tasks()))

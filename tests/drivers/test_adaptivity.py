"""What adaptivity must show, smaller versions of `drivers.adaptive_study`."""

import numpy as np
import pytest

from drivers.adaptive_study.runs import STUDIES, energy_errors, rate, run_of

# The error of the best marking, driven by the true error, at a number of unknowns, and by how much
# it may be exceeded.
BEST = {"hertz a=0.3": (2, 14_300, 2.89e-3, 1.3), "hertz a=0.05": (1, 6620, 7.63e-2, 1.1)}


@pytest.mark.parametrize("name", ["one transition", "hertz a=0.3", "hertz a=0.05"])
@pytest.mark.parametrize(("order", "unknowns"), [(1, 8000), (2, 12_000), (3, 40_000)])
@pytest.mark.study(witness=["2-12000-hertz a=0.3", "2-12000-hertz a=0.05", "1-8000-hertz a=0.05"])
def test_levels_of_exact_solutions(name, order, unknowns):
    """Rates, effectivities, errors beside the best ones, Newton steps and factorisations."""
    study = STUDIES[name]()
    found = list(run_of(name, study, "adaptive", order, energy_errors(study), unknowns))
    rows = [row for _, row in found]
    # N^(-p/2), over the last factor 10 in N, which must not reach back to the first meshes of 2000
    # unknowns at order 3. Order 4 needs 50k unknowns and stays in the driver.
    if name != "hertz a=0.05":  # whose zone is not resolved early enough
        assert abs(rate(rows) / (-order / 2) - 1) < 0.1
    effectivities = np.array([row.effectivity for row in rows])[2:]
    assert len(effectivities) >= 2
    assert ((effectivities >= 1) & (effectivities <= 6)).all()
    assert effectivities.max() / effectivities.min() < 1.2  # measured drift at most 14 %
    p, size, best, factor = BEST.get(name, (0, 0, 0, 0))
    if p == order:
        assert rows[-1].error <= factor * best * (size / rows[-1].unknowns) ** (p / 2)
    # A level has two to four times the contact points of the one that starts it, and one run
    # a third of the levels that it takes without planning: the means are 1 to 2.5.
    steps = [row.steps for row in rows[2:]]
    assert max(steps) <= 3
    assert np.mean(steps) <= 2.5
    assert all(solution.work["factorizations"] == 1 for solution, _ in found[1:])


@pytest.mark.study
def test_punch_regains_the_rate():
    """Corner r^(-1/2): N^-1/4 uniformly, N^-1/2 adaptively, both of order 1."""
    study = STUDIES["flat punch"]()
    errors = energy_errors(study, reference=15_000)
    rates = {}
    for strategy in ("uniform", "adaptive"):
        levels = run_of("flat punch", study, strategy, 1, errors, max_dofs=10_000)
        rates[strategy] = rate([row for _, row in levels])
    assert abs(rates["uniform"] + 0.25) < 0.05
    assert abs(rates["adaptive"] + 0.5) < 0.075

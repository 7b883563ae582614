"""Load sequences: `adapt` goes on from another load's solution, for no more than its own levels."""

import re
from dataclasses import replace

import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import adapt
from ngcontact.geometries import disc_on_block
from ngcontact.problem import MeshArrays


def pressed(way):
    """Problem A, pressed so far; 0.005 is the benchmark's."""
    return replace(cases.disc_on_rigid_plane(), displacement={"top": (None, -way)})


def unknowns(solution):
    return solution.displacement.space.ndof


def size_at(solution, place):
    """Diameter of the element whose centre is nearest to a place."""
    centres = MeshArrays(solution.mesh).corners.mean(axis=1)
    return MeshArrays(solution.mesh).diameters[np.linalg.norm(centres - place, axis=1).argmin()]


@pytest.fixture(scope="module")
def sequence():
    """Deeper and back: all levels of each load."""
    loads = [list(adapt(pressed(0.002), tolerance=1e-3))]
    for way in (0.005, 0.008, 0.005, 0.002):
        loads.append(list(adapt(pressed(way), tolerance=1e-3, start=loads[-1][-1])))
    return loads


def test_each_load_takes_two_levels_of_less_than_twice_the_unknowns(sequence):
    for levels in sequence[1:]:
        assert len(levels) == 2
        assert levels[-1].relative_error_estimate <= 1e-3
        assert sum(map(unknowns, levels)) < 2 * unknowns(levels[-1])
        assert levels[0].work["factorizations"] <= 2
        assert levels[1].work["factorizations"] == 1
        assert len(levels[1].steps) <= 2


def test_loads_have_the_forces_of_a_run_of_their_own(sequence):
    # Of an error of 1e-3 in the energy norm, forces have about the square.
    assert 2 * sequence[1][-1].contact_force()[1] == pytest.approx(0.4465326527, rel=1e-5)
    forces = [levels[-1].contact_force()[1] for levels in sequence]
    assert forces[:2] == pytest.approx(forces[:2:-1], rel=1e-5)
    assert forces[0] < 0.3 * forces[2]


def test_meshes_do_not_grow_with_the_sequence(sequence):
    *_, alone = adapt(pressed(0.002), tolerance=1e-3)
    assert unknowns(sequence[-1][-1]) <= 1.3 * unknowns(alone)  # measured 1.0
    # Where contact ended under the largest load, elements are large again.
    [end] = sequence[2][-1].transitions()
    assert size_at(sequence[4][-1], end) > 4 * size_at(sequence[2][-1], end)


@pytest.mark.usefixtures("no_work")
def test_what_cannot_be_continued_is_refused(sequence):
    start, problem = sequence[0][0], pressed(0.005)
    other = replace(problem, geometry=disc_on_block())

    def refused(error, words, problem=problem, **options):
        with pytest.raises(error, match=re.escape(words)):
            adapt(problem, **({"start": start} | options))

    refused(TypeError, "start is a list: give a Solution", start=[start])
    refused(ValueError, "start has order=4", order=3)
    refused(ValueError, "element='superparametric'", element="superparametric")
    refused(ValueError, "maxh=0.1 has no effect", maxh=0.1)
    refused(ValueError, "start has 1 contact pairs, the problem 0", replace(problem, contact=[]))
    renamed = [replace(problem.contact[0], secondary="top")]
    refused(ValueError, "('arc', None)", replace(problem, contact=renamed))
    refused(ValueError, "the geometry is not the one of start", other)
    refused(
        ValueError, "the geometry is not the one of start", replace(problem, geometry=start.mesh)
    )
    refused(ValueError, "more than max_dofs=100", max_dofs=100)

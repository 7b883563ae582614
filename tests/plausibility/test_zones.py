"""Connected parts of a contact line."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ngcontact.plausibility.zones import connected


@pytest.mark.parametrize("kept", [1.0, 0.9, 0.5, 0.0])
def test_parts_are_those_of_a_graph(kept):
    """Of lines and a circle whose points are numbered anyhow, of which some links are open."""
    random = np.random.default_rng(7)
    number = random.permutation(300)
    links = np.stack([number, np.roll(number, -1)], axis=1)
    links = links[random.random(len(links)) < kept]
    graph = sp.coo_array((np.ones(len(links)), links.T), shape=(300, 300))
    count, label = connected_components(graph, directed=False)
    least = np.array([np.flatnonzero(label == k)[0] for k in range(count)])
    assert np.array_equal(connected(300, links), least[label])

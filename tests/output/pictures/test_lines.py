"""Lines of contact points."""

from types import SimpleNamespace

import numpy as np

from ngcontact.output.pictures.lines import contact_lines


def lines_of(points, direction=None, pair=None):
    contact = [SimpleNamespace(direction=direction)] * 2
    pair = np.zeros(len(points), dtype=int) if pair is None else pair
    solution = SimpleNamespace(points=points, pair=pair, problem=SimpleNamespace(contact=contact))
    return contact_lines(solution)


def test_contact_line_follows_an_arc_in_any_numbering():
    angle = np.sort(np.random.default_rng(1).uniform(0, 5.5, 60))
    shuffle = np.random.default_rng(2).permutation(60)
    points = np.column_stack([np.cos(angle), np.sin(angle)])[shuffle]
    [(pair, rows, s)] = lines_of(points)
    along = angle[shuffle][rows]
    assert pair == 0
    assert np.all(np.diff(along) > 0) or np.all(np.diff(along) < 0)
    chords = 2 * np.sin(np.abs(np.diff(along)) / 2)
    np.testing.assert_allclose(np.diff(s), chords, rtol=1e-12)
    assert s[0] == 0


def test_contact_line_keeps_both_rows_of_a_corner():
    points = np.array([[0, 0], [1, 0], [2, 0], [2, 0], [2, 1], [2, 2.0]])
    [(_, rows, s)] = lines_of(points)
    assert rows.tolist() == [0, 1, 2, 3, 4, 5]
    assert s.tolist() == [0, 1, 2, 2, 3, 4]


def test_contact_lines_of_pairs_and_of_separate_pieces():
    x = np.arange(20) / 20
    piece = np.column_stack([x, 0 * x])
    points = np.concatenate([piece, np.add(piece, (5, 0)), np.add(piece, (0, 9))])
    (a, first, s), (b, second, t), (c, third, _) = lines_of(points, pair=np.arange(60) // 40)
    assert (a, b, c) == (0, 0, 1)
    assert s[-1] <= t[0]
    assert first.tolist() == list(range(20))
    assert second.tolist() == list(range(20, 40))
    assert third.tolist() == list(range(40, 60))

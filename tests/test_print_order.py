"""The order of printing: the nozzle's distance in closed form, known orders, impossible frames, real frames."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from small_frames import tower

from frametwin.errors import Cancelled, InputError
from frametwin.formats import read_frame
from frametwin.geometry import bezier
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.records.sequence import PrintSequence
from frametwin.printing.sequencing.batches import split_batches
from frametwin.printing.sequencing.check import check_sequence
from frametwin.printing.sequencing.clearance import StrutChords, collision_bits, joined_struts, unpacked_hits
from frametwin.printing.sequencing.directions import tool_directions
from frametwin.printing.sequencing.nozzle import Nozzle
from frametwin.printing.sequencing.order import OrderSettings, closing_struts, plan_sequence
from frametwin.printing.sequencing.removal_kernels import bridges, joint_compliance
from frametwin.printing.sequencing.stability import batch_sag, total_compliance
from frametwin.printing.sequencing.tool_orientation import allowed_orientations
from frametwin.progress import Progress

FRAMES = Path(__file__).resolve().parents[1] / "datasets" / "frames"
CONE = Nozzle(tip_radius=1.0, cone_length=10.0, cone_radius=11.0, body_radius=15.0, body_length=100.0, bead=2.0)
UP = np.array([0.0, 0.0, 1.0])


def stands_at_every_step(frame: Wireframe, sequence: PrintSequence) -> bool:
    """Every strut begins at the plate or at a joint of an earlier one; by a graph of networkx."""
    graph = nx.Graph()
    graph.add_nodes_from(np.flatnonzero(frame.grounded).tolist())
    for strut, start in zip(sequence.struts.tolist(), sequence.start.tolist(), strict=True):
        if start not in graph:
            return False
        graph.add_edge(*frame.edges[strut].tolist())
    return True


def planted(*chords: tuple[list[float], list[float]], radius: float = 0.5) -> Wireframe:
    """Struts that touch nowhere, all on the ground."""
    vertices = np.array(chords).reshape(-1, 3)
    return Wireframe.create(
        vertices, np.arange(len(vertices)).reshape(-1, 2), radius=radius, grounded=np.ones(len(vertices), dtype=bool)
    )


def test_distance_from_the_nozzle_in_closed_form() -> None:
    root = np.sqrt(0.5)
    points = [
        [0.0, 0.0, -3.0],
        [4.0, 0.0, 0.0],
        [0.0, 11.0, 5.0],
        [20.0, 0.0, 50.0],
        [4.0, 0.0, -4.0],
        [0.0, 0.0, 60.0],
    ]
    expected = [3.0, 3.0 * root, 5.0 * root, 5.0, 5.0, -15.0]
    np.testing.assert_allclose(CONE.distance(np.array(points)), expected, atol=1e-12)


@pytest.mark.parametrize("tilt", [0.0, 0.4, 1.2])
def test_lowest_point_is_that_of_the_surface(tilt: float) -> None:
    around = np.linspace(0.0, 2.0 * np.pi, 721)
    rims = np.array(
        [[r * np.cos(a), r * np.sin(a), h] for h, r in ((0, 1), (10, 11), (10, 15), (110, 15)) for a in around]
    )
    turn = np.array([[np.cos(tilt), 0.0, np.sin(tilt)], [0.0, 1.0, 0.0], [-np.sin(tilt), 0.0, np.cos(tilt)]])
    assert CONE.lowest(UP, turn @ UP) == pytest.approx((rims @ turn.T)[:, 2].min(), abs=1e-9)


def test_impossible_nozzles_are_refused() -> None:
    sizes = CONE.as_dict()
    for field, value in (
        ("tip_radius", 0.0),
        ("cone_radius", 0.5),
        ("body_radius", 5.0),
        ("bead", 0.5),
        ("clearance", -1.0),
    ):
        with pytest.raises(InputError, match=field):
            Nozzle(**{**sizes, field: value})


@pytest.mark.parametrize(("gap", "hit"), [(-0.06, True), (0.06, False)])
def test_rod_beside_the_cone(gap: float, hit: bool) -> None:
    """A rod across the cone of 45 degrees, touched or missed by 0.06 mm while the tip passes along another strut."""
    x, z, radius = 8.0, 4.0, 0.5
    distance = (x - 1.0 - z) * np.sqrt(0.5)  # of the rod's axis, as the tip is at its nearest
    frame = planted(([-5.0, 0.0, 0.0], [0.0, 0.0, 0.0]), ([x, -30.0, z], [x, 30.0, z]), radius=radius)
    nozzle = Nozzle(1.0, 10.0, 11.0, 15.0, 100.0, bead=2.0, clearance=distance - radius - gap)
    axes, joined = UP[None], joined_struts(frame)
    bits = collision_bits(frame, nozzle, axes, np.ones((2, 1), dtype=bool), joined)
    assert unpacked_hits(bits, 2)[0, 0].tolist() == [False, hit]
    sequence = PrintSequence([1, 0], [2, 0], np.tile(UP, (2, 1)), [0, 0])
    found = check_sequence(frame, sequence, nozzle)
    assert [f.strut for f in found if f.strut == 0 and 1 in f.others] == ([0] if hit else [])


def test_some_struts_are_looked_at_as_among_all(curved_frame: Wireframe) -> None:
    some, axes = np.array([7, 2, 11]), tool_directions(0.8)
    np.testing.assert_array_equal(joined_struts(curved_frame, struts=some), joined_struts(curved_frame)[some])
    nozzle = Nozzle.fitting(curved_frame)
    every = allowed_orientations(curved_frame, nozzle, axes)
    np.testing.assert_array_equal(allowed_orientations(curved_frame, nozzle, axes, some), every[some])


def test_collisions_of_curved_struts_agree_with_dense_sampling(curved_frame: Wireframe) -> None:
    """What samples hit is in the table; what the table adds is within its small excess of caution."""
    frame, axes = curved_frame, tool_directions(0.8)
    nozzle, wanted = Nozzle.fitting(frame), np.ones((frame.strut_count, len(axes)), dtype=bool)
    joined = joined_struts(frame)
    table = unpacked_hits(collision_bits(frame, nozzle, axes, wanted, joined), frame.strut_count)
    points = bezier.evaluate(frame.control_points, np.linspace(0.0, 1.0, 81))
    rng = np.random.default_rng(3)
    agree = 0
    for i, d, j in rng.integers(0, [frame.strut_count, len(axes), frame.strut_count], size=(400, 3)).tolist():
        if i == j:
            continue
        w = (points[j][None] - points[i][:, None]).reshape(-1, 3)
        height = w @ axes[d]
        rho = np.sqrt(np.maximum(0.0, (w**2).sum(axis=1) - height**2))
        far = np.linalg.norm(w, axis=1) > (nozzle.bead if joined[i, j] else 0.0)
        gap = nozzle.distance(np.stack([rho, 0.0 * rho, height], axis=1))[far].min(initial=np.inf)
        depth = frame.radius[j] + nozzle.clearance - gap
        assert table[i, d, j] or depth <= 0.0
        assert not table[i, d, j] or depth > -0.7 * frame.radius[j]
        agree += bool(table[i, d, j] == (depth > 0.0))
    assert agree > 360


def test_chords_follow_their_curves(curved_frame: Wireframe) -> None:
    chords = StrutChords.of(curved_frame.control_points, curved_frame.radius)
    points = bezier.evaluate(curved_frame.control_points, np.linspace(0.0, 1.0, 201))
    for strut in range(curved_frame.strut_count):
        pieces = slice(chords.first[strut], chords.first[strut + 1])
        start, way = chords.start[pieces], chords.end[pieces] - chords.start[pieces]
        s = np.clip(((points[strut][:, None] - start) * way).sum(axis=2) / (way**2).sum(axis=1), 0.0, 1.0)
        away = np.linalg.norm(start + s[..., None] * way - points[strut][:, None], axis=2).min(axis=1)
        assert away.max() <= chords.slack[strut] + 1e-9
        assert chords.slack[strut] <= 0.11 * curved_frame.radius[strut]


def test_bridges_are_those_of_networkx() -> None:
    rng = np.random.default_rng(1)
    for _ in range(30):
        pairs = rng.permutation(np.array([(a, b) for a in range(14) for b in range(a)]))[:18]
        grounded = rng.random(14) < 0.2
        graph = nx.MultiGraph(
            [(-1 if grounded[a] else a, -1 if grounded[b] else b, k) for k, (a, b) in enumerate(pairs.tolist())]
        )
        component = nx.node_connected_component(graph, -1) if -1 in graph else set()
        simple = nx.Graph(graph)
        simple.remove_edges_from(nx.selfloop_edges(simple))
        wanted = {frozenset(e) for e in nx.bridges(simple) if graph.number_of_edges(*e) == 1 and e[0] in component}
        found = np.zeros(len(pairs), dtype=bool)
        bridges(pairs.astype(np.int64), grounded, np.ones(len(pairs), dtype=bool), found)
        ends = [frozenset(-1 if grounded[v] else v for v in pairs[k].tolist()) for k in np.flatnonzero(found)]
        assert set(ends) == wanted
        assert len(ends) == len(wanted)


def test_a_chain_has_one_order() -> None:
    points = [[0.0, 0.0, 0.0], [0.0, 0.0, 10.0], [7.0, 0.0, 17.0], [17.0, 0.0, 17.0], [17.0, 7.0, 24.0]]
    edges = [[3, 4], [1, 0], [2, 3], [1, 2]]
    frame = Wireframe.create(points, edges, radius=0.5)
    sequence = plan_sequence(frame, OrderSettings(batch_size=2))
    assert sequence.struts.tolist() == [1, 3, 2, 0]
    assert sequence.start.tolist() == [0, 1, 2, 3]
    assert sequence.batch.tolist() == [0, 0, 1, 1]
    assert not closing_struts(frame, sequence).any()


def test_what_stands_under_a_table_comes_before_its_top() -> None:
    corners = [[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]]
    vertices = [[*c, 0.0] for c in corners] + [[*c, 14.0] for c in corners]
    vertices += [[0.0, 0.0, 14.0], [0.0, 0.0, 0.0], [0.0, 0.0, 10.0]]
    edges = [[i, 4 + i] for i in range(4)] + [[4 + i, 8] for i in range(4)] + [[9, 10]]
    frame = Wireframe.create(vertices, edges, radius=0.8)
    order = np.argsort(plan_sequence(frame, OrderSettings(max_tilt_deg=0.0)).struts)
    assert order[8] < order[4:8].min()


def test_struts_that_bar_each_other_in_a_ring_are_refused_or_touched() -> None:
    """With an upright tool each side's diagonal bars the post it ends on, and is barred by the one it begins beside."""
    upright = OrderSettings(max_tilt_deg=0.0, attempts=2)
    with pytest.raises(InputError, match=r"no order is found for 20 of 24 struts: the tool would collide") as caught:
        plan_sequence(tower(), upright)
    assert "\n" not in str(caught.value)
    sequence = plan_sequence(tower(), OrderSettings(max_tilt_deg=0.0, attempts=2, allow_contact=True))
    found = check_sequence(tower(), sequence)
    assert {fault.kind for fault in found} == {"collision"}
    assert all(len(fault.others) >= 1 and fault.depth > 0.0 for fault in found)


def test_a_strut_that_hides_under_its_own_start_is_refused() -> None:
    """Begun at its top, it would have to go where the upright nozzle is."""
    arch = Wireframe.create([[0, 0, 0], [0, 0, 30], [20, 0, 30], [20, 0, 10]], [[0, 1], [1, 2], [2, 3]], radius=1.0)
    with pytest.raises(InputError, match=r"strut 2 has no direction .* own beginning"):
        plan_sequence(arch, OrderSettings(max_tilt_deg=0.0))
    assert len(plan_sequence(arch)) == 3


def test_floating_struts_are_named() -> None:
    frame = tower()
    vertices = np.vstack([frame.vertices, [[50.0, 0.0, 20.0], [60.0, 0.0, 20.0]]])
    edges = np.vstack([frame.edges, [[12, 13]]])
    with pytest.raises(InputError, match="strut 24 has no way to the plate"):
        plan_sequence(Wireframe.create(vertices, edges, radius=1.0))


@pytest.mark.parametrize("name", ["bridge", "half_bowl"])
def test_own_frames_can_be_printed(name: str) -> None:
    check_plan(read_frame(FRAMES / f"{name}.json"))


@pytest.mark.parametrize("name", ["simple_frame", "mars_bubble_S1_03-14-2019_w_layer", "klein_bottle_S1.5"])
def test_assembly_instances_can_be_printed(shared_frames: Path, name: str) -> None:
    check_plan(read_frame(shared_frames / "assembly_instances" / f"{name}.json"))


def test_femur_can_be_printed(shared_frames: Path) -> None:
    frame = read_frame(shared_frames / "rl3dp" / "NodeFemur_wireframe.txt")
    sequence = check_plan(frame)
    assert batch_sag(frame, sequence).max() < 0.01  # mm; a hardened Femur hardly sags, half-built or whole


def check_plan(frame: Wireframe) -> PrintSequence:
    """All struts, each from the structure, free of collisions, and no more cycles closed than there are."""
    sequence = plan_sequence(frame)
    assert sorted(sequence.struts.tolist()) == list(range(frame.strut_count))
    assert stands_at_every_step(frame, sequence)
    assert check_sequence(frame, sequence) == []
    used = np.unique(frame.edges)
    assert closing_struts(frame, sequence).sum() == frame.strut_count - (~frame.grounded[used]).sum()
    size = min(12.0, max(4.0, frame.strut_count / 20.0))
    assert sequence.batch_count == pytest.approx(frame.strut_count / size, rel=0.15)
    return sequence


def test_same_frame_same_order() -> None:
    first, second = (plan_sequence(tower(4)) for _ in range(2))
    for field in ("struts", "start", "axis", "batch"):
        np.testing.assert_array_equal(getattr(first, field), getattr(second, field))


def test_planning_can_be_cancelled() -> None:
    def stop(progress: Progress) -> bool:
        return False

    with pytest.raises(Cancelled):
        plan_sequence(tower(), progress=stop)


def test_planted_faults_are_found() -> None:
    """A strut below others that are printed already, one begun in the air, one below the plate's tilt, one left out."""
    frame = tower(3)
    good = plan_sequence(frame)
    assert check_sequence(frame, good) == []
    turned = PrintSequence(good.struts[::-1], good.start[::-1], good.axis[::-1], good.batch)
    kinds = [fault.kind for fault in check_sequence(frame, turned)]
    assert {"collision", "in the air"} <= set(kinds)
    short = PrintSequence(good.struts[:-1], good.start[:-1], good.axis[:-1], good.batch[:-1])
    assert [(f.kind, f.strut) for f in check_sequence(frame, short)] == [("left out", int(good.struts[-1]))]
    axis = good.axis.copy()
    axis[0] = [1.0, 0.0, 0.0]
    level = PrintSequence(good.struts, good.start, axis, good.batch)
    assert "plate" in [f.kind for f in check_sequence(frame, level) if f.strut == good.struts[0]]


def test_flexibility_is_the_largest_eigenvalue_of_the_inverse() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        a = rng.normal(size=(3, 3))
        k = a @ a.T + 0.1 * np.eye(3)
        assert joint_compliance(k) == pytest.approx(1.0 / np.linalg.eigvalsh(k)[0], rel=1e-6)
    assert joint_compliance(np.zeros((3, 3))) == 0.0
    assert joint_compliance(2.0 * np.eye(3)) == pytest.approx(0.5)


def test_cantilevers_count_and_tripods_do_not() -> None:
    feet = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]]
    frame = Wireframe.create([*feet, [3.0, 3.0, 8.0]], [[0, 3], [1, 3], [2, 3]], radius=0.3)
    loose = total_compliance(frame, np.arange(3))
    assert loose[0] == pytest.approx((frame.lengths[0] / np.median(frame.lengths)) ** 3, rel=1e-4)
    assert 0.25 * loose[0] < loose[1] < 0.75 * loose[0]
    assert loose[2] < 0.01


def test_batches_end_where_little_hangs() -> None:
    loose = np.ones(30)
    loose[[10, 18]] = 0.0
    assert np.bincount(split_batches(loose, 10)).tolist() == [11, 8, 11]
    assert np.bincount(split_batches(np.zeros(7), 100)).tolist() == [7]

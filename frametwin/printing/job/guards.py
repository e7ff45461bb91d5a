"""When a job stops instead of printing on: the wrong pictures, or a twin that cannot be built on."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from frametwin.errors import Doubt, Held
from frametwin.files import PathLike
from frametwin.fitting.judgement import FAR
from frametwin.geometry.wireframe import Wireframe
from frametwin.printing.adaptation.evidence import Evidence
from frametwin.printing.job.batch_capture import BatchCapture
from frametwin.printing.process.added_struts import without_last
from frametwin.printing.records.sequence import PrintSequence
from frametwin.ranges import above, between, check_settings, within
from frametwin.raster.silhouette import silhouettes
from frametwin.twin.findings import DARK
from frametwin.twin.twin import Twin
from frametwin.twin.verdict import WRONG
from frametwin.wording import enumerated, listed

KINDS = (
    "old-capture",
    "wrong-batch",
    "collapsed",
    "poor-fit",
    "wrong-twin",
    "camera-moved",
    "displacement",
    "lost-struts",
    "low-confidence",
    "below-plate",
)
"""Why a job may stop; each can be accepted by name."""

NEAR_SHARE, NEAR_RADII = 0.15, 1.5
"""A strut is seen at its joint if any of it is within this share of its length of the joint, or this many radii."""


PartOfAll = Annotated[float, between(0.0, 1.0, "a share")]


@dataclass(frozen=True)
class GuardLimits:
    """Where a job stops.

    Attributes
    ----------
    mismatch
        Share of the pictures' white without a strut of the twin, or of the twin on black;
        whole prints have 0.02 to 0.05.
    displacement
        Way of a joint since the last twin, in median strut lengths: further, and struts are taken for their neighbours.
    confidence
        Of the best seen strut at the joint where a next one starts. At 0.1 its standard deviation is 0.3 radii, a
        sixth of what a bead bridges.
    collapsed
        Share of all printed struts that are lost at once.
    elsewhere
        Share of a batch's struts that are not in the pictures, or of the next one's that are, above which the pictures
        are those of another batch.
    whiteness
        Share of its pixels that must be white for a strut to be taken as there.
    changed_pixels
        Pixels by which the struts of a batch should change a view, so that an unchanged one is an old one.

    Raises
    ------
    InputError
        If a value is out of its range; one so wide that nothing would ever be doubted is, too. A doubt is put aside by
        accepting it, batch by batch and on record.
    """

    mismatch: PartOfAll = 0.15
    displacement: Annotated[float, above(0.0, up_to=10.0)] = 1.0
    confidence: Annotated[float, above(0.0, up_to=1.0)] = 0.1
    collapsed: PartOfAll = 0.3
    elsewhere: PartOfAll = 0.5
    whiteness: PartOfAll = 0.5
    changed_pixels: Annotated[int, within(1, 100_000)] = 50

    def __post_init__(self) -> None:
        check_settings(self, "limits")


def hold(source: PathLike, doubts: Sequence[Doubt], accept: Collection[str]) -> None:
    """Stop unless all doubts are accepted.

    Raises
    ------
    Held
        With those that are not.
    """
    rest = tuple(doubt for doubt in doubts if doubt.kind not in accept)
    if not rest:
        return
    first, kinds = rest[0], enumerated(dict.fromkeys(doubt.kind for doubt in rest))
    held = Held.at(source, first.kind, first.problem, f"{first.remedy}, or accept {kinds} to print on all the same")
    held.doubts = rest
    raise held


@dataclass(frozen=True, eq=False)
class Expectation:
    """What the cameras should see after a batch.

    Attributes
    ----------
    batch
        Its number.
    sequence
        The job's, as it stands.
    frame
        The plan that the robot followed, with what should be printed by now.
    coupon
        How many of its last struts are a test coupon, which may droop and fall.
    """

    batch: int
    sequence: PrintSequence
    frame: Wireframe
    coupon: int = 0

    @property
    def of_frame(self) -> np.ndarray:
        """(E,) bool: struts that are not those of a coupon."""
        return without_last(self.frame.strut_count, self.coupon)

    @property
    def laid(self) -> np.ndarray:
        """Struts of the batch itself."""
        return self.sequence.in_batch(self.batch).struts

    @property
    def next_struts(self) -> PrintSequence | None:
        """Those of the next batch; ``None`` after the last."""
        last = self.batch + 1 >= self.sequence.batch_count
        return None if last else self.sequence.in_batch(self.batch + 1)


def doubts_of_capture(
    capture: BatchCapture, expected: Expectation, earlier: Mapping[int, Mapping[str, str]], limits: GuardLimits
) -> list[Doubt]:
    """What can be said against a capture before its pictures are understood.

    Parameters
    ----------
    capture
        The capture.
    expected
        What it should show.
    earlier
        For each batch that has been answered, the hashes of its pictures by name.
    limits
        See `GuardLimits`.
    """
    remedy = f"give the pictures taken after batch {expected.batch}"
    doubts = []
    pictures = capture.pictures
    known = {digest: batch for batch, hashes in earlier.items() for digest in hashes.values()}
    again = {name: known[digest] for name, digest in pictures.items() if digest in known}
    if len(again) == len(pictures):
        problem = f"its pictures are those of batch {max(again.values())}, which has been answered"
        doubts.append(Doubt("old-capture", problem, remedy))
    elif again and (stale := _unchanged(capture, expected, again, limits)):
        problem = f"the picture {stale} is that of batch {again[stale]} again, though struts have come into its view"
        doubts.append(Doubt("old-capture", problem, f"look after that camera, and {remedy}"))
    laid = expected.sequence.laid_before(expected.batch + 1, expected.frame.strut_count)
    claimed = capture.claimed
    if claimed is not None and not any(np.array_equal(claimed, mask) for mask in (expected.frame.printed, laid)):
        problem = f"its frame.json has {int(claimed.sum())} struts printed where batch {expected.batch} makes"
        problem += f" {int(laid.sum())}"
        if int(claimed.sum()) == int(laid.sum()):
            problem = f"its frame.json has other struts printed than there are after batch {expected.batch}"
        doubts.append(Doubt("wrong-batch", problem, remedy))
    return doubts


def _unchanged(
    capture: BatchCapture, expected: Expectation, again: Mapping[str, int], limits: GuardLimits
) -> str | None:
    """The first of the pictures that are old ones, although the struts of the batch should be seen in it."""
    frame = expected.frame
    before = np.array(frame.printed)
    before[expected.laid] = False
    if not before.any():
        return None
    for view in capture.capture.views:
        name = capture.capture.name_of(view.image)
        if name in again:
            camera = [view.camera.without_distortion()]
            now, then = (silhouettes(frame.replace(printed=mask), camera)[0] for mask in (frame.printed, before))
            if int((now != then).sum()) >= limits.changed_pixels:
                return name
    return None


def doubts_of_twin(
    expected: Expectation, twin: Twin, adapted: Wireframe, evidence: Evidence, limits: GuardLimits
) -> list[Doubt]:
    """What can be said against printing on after the twin was found.

    Parameters
    ----------
    expected
        What the pictures should show.
    twin
        Relative to ``expected.frame``.
    adapted
        The plan for what follows; its printed struts are those that stand.
    evidence
        With the whiteness of the next batch's struts, where ``adapted`` has them.
    limits
        See `GuardLimits`.
    """
    batch, printed = expected.batch, expected.frame.printed
    lost = np.flatnonzero(printed & ~adapted.printed)
    doubts = _doubts_of_batch(expected, lost, evidence, limits)
    before = printed & expected.of_frame
    before[expected.laid] = False
    gone = int(before[lost].sum())
    if gone > limits.collapsed * max(1, int(before.sum())):
        problem = f"{gone} of {int(before.sum())} struts that stood before batch {batch} are not seen any more"
        remedy = "look whether the print has collapsed or a camera was moved"
        doubts.append(Doubt("collapsed", problem, remedy))
    if evidence.mismatch > limits.mismatch:
        problem = f"the twin leaves {evidence.unexplained:.0%} of the pictures' white unexplained, and"
        problem += f" {evidence.contradicted:.0%} of it lies on black"
        remedy = "look at the pictures, the lights and the cameras' calibration"
        doubts.append(Doubt("poor-fit", problem, remedy))
    doubts += doubts_of_verdict(twin)
    joints = adapted.replace(printed=adapted.printed & expected.of_frame).printed_vertices()
    way = np.linalg.norm(twin.vertices[joints] - expected.frame.vertices[joints], axis=1).max(initial=0.0)
    length = float(np.median(expected.frame.lengths))
    if way > limits.displacement * length:
        problem = (
            f"a joint has moved by {way:.1f} mm since the last twin, and the typical strut is {length:.1f} mm long"
        )
        remedy = (
            "look whether the print has collapsed or was moved, whether all cameras were, and whose pictures these are"
        )
        doubts.append(Doubt("displacement", problem, remedy))
    return doubts


def doubts_of_verdict(twin: Twin) -> list[Doubt]:
    """What the fit itself holds against its twin, and cameras that are not where the rig has them any more."""
    doubts = []
    if twin.verdict.status == WRONG:
        remedy = "look at the pictures, and at the cameras' calibration"
        doubts.append(Doubt("wrong-twin", f"the twin is called wrong: {twin.verdict.reasons[0]}", remedy))
    moved = [camera for camera in twin.cameras if camera["sigmas"] > FAR]
    if moved:
        worst = max(moved, key=lambda camera: float(camera["sigmas"]))
        others = f" and {len(moved) - 1} more" if len(moved) > 1 else ""
        problem = f"{worst['name']}{others} stand far from where they were calibrated, by up to"
        problem += f" {worst['sigmas']:.0f} standard deviations"
        doubts.append(Doubt("camera-moved", problem, "look whether a camera was moved, and calibrate again"))
    return doubts


def _doubts_of_batch(expected: Expectation, lost: np.ndarray, evidence: Evidence, limits: GuardLimits) -> list[Doubt]:
    """Whether the pictures are those of an earlier or later batch."""
    batch, laid = expected.batch, expected.laid
    absent = len(np.intersect1d(lost, laid))
    remedy = f"give the pictures taken after batch {batch}"
    if absent > limits.elsewhere * len(laid):
        problem = f"{absent} of the {len(laid)} struts of batch {batch} are not in the pictures"
        return [Doubt("wrong-batch", problem, f"{remedy}, and look whether it was printed")]
    seen = evidence.whiteness[np.isfinite(evidence.whiteness)]
    early = int((seen > limits.whiteness).sum())
    return [too_early(expected)] if early > limits.elsewhere * len(seen) else []


def too_early(expected: Expectation) -> Doubt:
    """The pictures are those of a later batch."""
    problem = f"struts of batch {expected.batch + 1}, which is still to come, are in the pictures"
    return Doubt("wrong-batch", problem, f"give the pictures taken after batch {expected.batch}")


def doubts_of_starts(
    adapted: Wireframe, twin: Twin, following: PrintSequence, batch: int, limits: GuardLimits
) -> list[Doubt]:
    """Whether the struts of the next batch, and those after it, start on something that is there and known.

    Parameters
    ----------
    adapted
        The plan for what follows; its printed struts are those that stand.
    twin
        Of what stands.
    following
        The sequence as it goes on, with what is laid again.
    batch
        The next one.
    limits
        See `GuardLimits`.
    """
    doubts = []
    hanging = starts_in_the_air(adapted, following, batch)
    if len(hanging):
        problem = f"{listed(hanging)}, still to come, would start where nothing stands any more"
        remedy = "have the lost struts laid again (reprint), or mend the print by hand and take new pictures"
        doubts.append(Doubt("lost-struts", problem, remedy))
    there, known = _joints(adapted, twin, limits)
    to_come = following.in_batch(batch)
    begun = adapted.printed_vertices()[to_come.start]
    gaps = to_come.struts[begun & ~there[to_come.start]]
    if len(gaps):
        problem = f"{listed(gaps)} would start at a joint that is not in the pictures"
        doubts.append(Doubt("lost-struts", problem, "look at the print there, and take new pictures"))
    unsure = to_come.struts[begun & there[to_come.start] & ~known[to_come.start]]
    if len(unsure):
        problem = f"the views cannot tell where {listed(unsure)} would start"
        remedy = "take the pictures again, with a camera that sees the place"
        doubts.append(Doubt("low-confidence", problem, remedy))
    return doubts


def doubts_of_depth(design: Wireframe, adapted: Wireframe, following: PrintSequence, batch: int) -> list[Doubt]:
    """Whether the struts of the next batch lie where the robot cannot go: below everything that was designed.

    Parameters
    ----------
    design
        The frame.
    adapted
        The plan for what follows.
    following
        The sequence as it goes on.
    batch
        The next one.
    """
    floor = float(design.bounds[0][2] - design.radius.max())
    struts = following.in_batch(batch).struts
    ends = adapted.edges[struts]
    depth = floor - adapted.vertices[ends, 2]
    sunk = struts[depth.max(axis=1) > 0.0]
    if not len(sunk):
        return []
    joint = int(ends.ravel()[np.argmax(depth)])
    problem = f"{listed(sunk)} would be laid below the plate, where joint {joint} has sunk by"
    problem += f" {float(design.vertices[joint, 2] - adapted.vertices[joint, 2]):.0f} mm"
    remedy = "lift the print there and take new pictures, or print anew with what this print has told of its material"
    return [Doubt("below-plate", problem, remedy)]


def starts_in_the_air(standing: Wireframe, sequence: PrintSequence, batch: int) -> np.ndarray:
    """Find struts of the batches from ``batch`` on that would start neither on the plate nor on anything laid."""
    there = standing.printed_vertices() | standing.grounded
    later = sequence.batch >= batch
    ends = sequence.end_in(standing)
    hanging = []
    for strut, start, end in zip(sequence.struts[later], sequence.start[later], ends[later], strict=True):
        if there[start]:
            there[end] = True
        else:
            hanging.append(int(strut))
    return np.array(hanging, dtype=np.int64)


def _joints(adapted: Wireframe, twin: Twin, limits: GuardLimits) -> tuple[np.ndarray, np.ndarray]:
    """Joints (V,) bool at which a standing strut is seen, and those whose place the views tell."""
    there, known = (np.zeros(adapted.vertex_count, dtype=bool) for _ in range(2))
    kernels = twin.opacity.shape[1]
    # Within a radius or two of a joint, its disc is what is seen, not the ends of the struts that meet there.
    near = np.clip(np.maximum(NEAR_SHARE, NEAR_RADII * adapted.radius / adapted.lengths), 1.0 / kernels, 1.0)
    along = (np.arange(kernels) + 0.5) / kernels
    sure = adapted.printed & (twin.confidence >= limits.confidence)
    for side, place in ((0, along), (1, 1.0 - along)):
        close = place[None, :] <= near[:, None]
        seen = adapted.printed & ((twin.opacity >= DARK) & close).any(axis=1)
        there[adapted.edges[seen, side]] = True
        known[adapted.edges[seen & sure, side]] = True
    return there, known

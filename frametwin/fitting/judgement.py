"""The verdict on a fit: what is seen in its views, cameras and struts, turned into words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from frametwin.cameras import Camera
from frametwin.fitting.camera_freedoms import SHIFT, TURN
from frametwin.fitting.part_fit import PartFit, ViewsFit
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.verdict import DOUBTFUL, GOOD, Verdict

POOR, HOPELESS = 0.12, 0.35
"""Share of pixels of the typical view that twin and picture disagree on, from which a twin is doubtful, and wrong."""

LOOSE, LOST = 0.25, 1.0
"""Standard deviation of the typical strut in radii, likewise."""

MANY_UNCERTAIN = 0.3
"""Share of struts that the views do not determine, from which a twin is wrong."""

WHOLE, MANY_BROKEN = 0.9, 0.1
"""Share of a strut that is there, below which it seems broken; share of such struts that makes a twin doubtful."""

LOOSE_ON_PHOTOGRAPHS = 0.06
"""Standard deviation of the typical strut in radii from which a twin of photographs is doubtful: masks that are sound
leave less, and what is lost by unsound ones shows in it only in part."""

UNSETTLED = 0.02
"""How far in radii a last look at the photographs may move the typical strut: what is left is about as much again, and
there is no further look."""

FAR = 4.0
"""Standard deviations of its rig by which a camera may be corrected without a word."""

FAR_ON_PHOTOGRAPHS = 2.5
"""The same of the typical camera where the masks were found in photographs: a rig that errs as it says is corrected by
about two, and masks that lose one side of every strut are explained by cameras as well as by struts."""

TOO_SOFT = 0.18
"""Blur of the typical photograph in half widths of a strut, from which a twin is doubtful. Rendered photographs with
0.14 had a mean error of 0.1 mm; with 0.21 it was 0.17 to 0.24 mm, the most for dark print, and no deviation told it."""

TOLD = 5
"""Torn ends that are named."""


def verdict(part: PartFit, printed: Wireframe, cameras: Sequence[Camera], struts: np.ndarray | None = None) -> Verdict:
    """Judge a fit.

    Parameters
    ----------
    part : PartFit
        What was found, with its views and standard deviations.
    printed : Wireframe
        The plan of it.
    cameras : sequence of Camera
        Of all views.
    struts : (E,) array of int, optional
        What the struts of the part are called in the whole frame; they are counted through by default.
    """
    views = part.views
    if views is None or part.sigma_across is None:
        return Verdict()
    wrong, doubtful, notes = [], [], []
    typical = float(np.median((views.unexplained + views.unseen)[views.used]))
    if typical > HOPELESS:
        wrong.append(f"twin and pictures disagree on {typical:.0%} of the pixels of a typical view")
    elif typical > POOR:
        doubtful.append(f"twin and pictures disagree on {typical:.0%} of the pixels of a typical view")
    loose = float(np.median(part.sigma_across / printed.radius))
    if loose > LOST:
        wrong.append("the typical strut may be off by more than its radius")
    elif loose > LOOSE:
        doubtful.append(f"the typical strut may be off by {loose:.0%} of its radius")
    uncertain = float((part.confidence < 0.5).mean())
    if uncertain > MANY_UNCERTAIN:
        wrong.append(f"the views do not determine {uncertain:.0%} of the struts")
    broken = int((part.opacity.mean(axis=1) < WHOLE).sum())
    if broken > MANY_BROKEN * len(part.opacity):
        doubtful.append(
            f"parts of {broken} of {len(part.opacity)} struts seem to be missing: where a print is far from its plan, "
            "struts may have been looked for in wrong places"
        )
    if views.holds == "cameras":
        doubtful.append("the feet are not where they were planned: where the print stands rests on the cameras alone")
    if float(np.median(views.sigmas[views.used])) > FAR:
        doubtful.append(
            "most cameras would have to be far from where they were calibrated: pictures may be out of focus"
        )
    left = [camera.name for camera, used in zip(cameras, views.used, strict=True) if not used]
    if len(left) * 3 > len(cameras):
        doubtful.append(f"only {int(views.used.sum())} of {len(cameras)} views agree with each other")
    notes += [
        f"view {name} disagrees with all others and was left out: look whether its camera was touched, or its picture"
        " belongs to another camera or moment"
        for name in left
    ]
    return Verdict.of(wrong, doubtful, [*notes, *torn_ends(part, struts), *moved_cameras(views, cameras)])


def torn_ends(part: PartFit, struts: np.ndarray | None = None) -> list[str]:
    """A sentence on the ends of struts that are torn off their joints, the widest gaps first; see `verdict`."""
    if part.attached is None or part.gap is None or part.attached.all():
        return []
    gap = part.gap
    torn = sorted(np.argwhere(~part.attached).tolist(), key=lambda end: -float(gap[end[0], end[1]]))
    names = np.arange(len(gap)) if struts is None else struts
    told = [f"strut {names[e]} at its {('start', 'end')[side]} by {gap[e, side]:.1f} mm" for e, side in torn[:TOLD]]
    rest = f", and {len(torn) - TOLD} more" if len(torn) > TOLD else ""
    return [f"torn off their joints: {'; '.join(told)}{rest}"]


def judged_on_photographs(
    judged: Verdict, loose: float, moved: float, corrected: float = 0.0, softness: float = 0.0
) -> Verdict:
    """The verdict on a twin whose masks were found in photographs.

    Parameters
    ----------
    judged : Verdict
        By what is asked of every twin.
    loose : float
        Standard deviation of the typical strut, in radii.
    moved : float
        How far the last look at the photographs has moved it, in radii.
    corrected : float
        By how many standard deviations of its rig the typical camera was corrected.
    softness : float
        Blur of the typical photograph, in half widths of a strut.
    """
    if judged.status != GOOD:
        return judged
    doubts = []
    if loose > LOOSE_ON_PHOTOGRAPHS:
        doubts.append(f"the masks leave the typical strut uncertain by {loose:.0%} of its radius{_cure(corrected)}")
    if moved > UNSETTLED:
        doubts.append(f"the last look at the photographs still moved the typical strut by {moved:.0%} of its radius")
    if corrected > FAR_ON_PHOTOGRAPHS:
        doubts.append(f"the typical camera was corrected by {corrected:.1f} standard deviations of its rig")
    if softness > TOO_SOFT:
        doubts.append(f"the typical photograph is out of focus by {softness:.0%} of half a strut's width")
    if not doubts:
        return judged
    doubts[-1] += ": look at the masks with frametwin mask"
    return Verdict(DOUBTFUL, (*doubts, *judged.reasons))


def _cure(corrected: float) -> str:
    """What would hold the world better, where cameras had to move."""
    return "; a rig.json that says how well each camera is known would leave less" if corrected > 0.0 else ""


def moved_cameras(views: ViewsFit, cameras: Sequence[Camera]) -> list[str]:
    """A sentence for each camera that was corrected by far more than its rig's errors."""
    result = []
    for camera, own, sigmas in zip(cameras, views.cameras, views.sigmas, strict=True):
        if sigmas > FAR:
            turned = np.rad2deg(np.linalg.norm(own[TURN]))
            result.append(
                f"view {camera.name}: its camera was found {np.linalg.norm(own[SHIFT]):.1f} mm and {turned:.2f} degrees"
                f" from where the rig has it ({sigmas:.0f} standard deviations): calibrate it again"
            )
    return result

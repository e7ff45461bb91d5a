"""Recipes and what is drawn from them: the ones of the project, every kind of mistake, and what a sample depends on."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from frametwin.dataset.recipe import parse_recipe, read_recipe
from frametwin.dataset.specification import Sampler
from frametwin.errors import InputError

ROOT = Path(__file__).resolve().parent.parent
RECIPES = sorted((ROOT / "datasets").glob("*.toml"))
HEAD = 'format = "frametwin-recipe"\nversion = 1\nname = "t"\ncount = 4\n'
BRIDGE = '[[frames]]\nframe = "bridge"\n'


def recipe_file(folder: Path, text: str) -> Path:
    path = folder / "recipe.toml"
    path.write_text(HEAD + text, encoding="utf-8")
    return path


def sampler_of(folder: Path, text: str, seed: int | None = None) -> Sampler:
    return Sampler(read_recipe(recipe_file(folder, text)), seed)


def test_the_recipes_that_are_promised_are_there() -> None:
    assert {path.stem for path in RECIPES} >= {
        "demo",
        "paper",
        "ablation-views",
        "partial-prints",
        "photo",
        "calibration",
    }


@pytest.mark.parametrize("path", RECIPES, ids=lambda path: path.stem)
def test_recipes_of_the_project_can_be_read_and_drawn_from(path: Path) -> None:
    source = read_recipe(path)
    assert source.recipe.name == path.stem and source.recipe.description
    sampler = Sampler(source)
    for index in range(min(6, source.recipe.count)):
        specification = sampler.specification(index)
        assert sampler.plan(specification).strut_count > 0


def test_the_papers_conditions() -> None:
    rig = read_recipe(ROOT / "datasets" / "paper.toml").recipe.rig
    assert rig.views == (8,) and rig.size == (1200, 1600)
    assert read_recipe(ROOT / "datasets" / "ablation-views.toml").recipe.rig.views == (4, 6, 8, 10)
    assert read_recipe(ROOT / "datasets" / "demo.toml").recipe.count == 2


MISTAKES = {
    "no TOML": ("name == 3", "is not TOML"),
    "an unknown key": (BRIDGE + "[rig]\nvews = 8", "rig.vews: is not known"),
    "no frames": ("[rig]\nviews = 8", "[[frames]]"),
    "another kind": (BRIDGE + '[[deformations]]\nkind = "melt"', "deformations[0].kind: is 'melt'"),
    "an engine that is gone": (BRIDGE + '[[deformations]]\nkind = "sag"\nengine = "pynite"', "engine: is 'pynite'"),
    "falling range": (BRIDGE + '[[deformations]]\nkind = "sag"\npeak_fraction = [0.1, 0.05]', "two rising"),
    "out of range": (BRIDGE + "[printing]\nprinted = [0.5, 1.5]", "printing.printed: is [0.5, 1.5]"),
    "not a number": (BRIDGE + "[rig]\nmargin = nan", "rig.margin"),
    "infinite": (BRIDGE + "[rig]\nstart_deg = inf", "rig.start_deg"),
    "negative count": (BRIDGE + "[printing]\nmissing = -1", "printing.missing"),
    "one view": (BRIDGE + "[rig]\nviews = 1", "rig.views"),
    "no views": (BRIDGE + "[rig]\nviews = []", "views is empty"),
    "a text for a number": (BRIDGE + '[rig]\nfov_deg = "wide"', "rig.fov_deg"),
    "a weight of zero": ('[[frames]]\nframe = "bridge"\nweight = 0', "frames[0].weight"),
    "passes without Blender": (BRIDGE + '[render]\nstyle = "silhouette"\npasses = true', "made by Blender"),
    "blend without file": ('[[deformations]]\nkind = "blend"', "needs file and object"),
    "file without blend": (BRIDGE + '[[deformations]]\nkind = "sag"\nfile = "a.blend"', "belong to the kind 'blend'"),
    "a text for a count": (BRIDGE + '[printing]\nmissing = "2"', "printing.missing"),
    "a text for a truth": (BRIDGE + '[render]\npasses = "no"', "render.passes"),
    "half a pixel": (BRIDGE + "[rig]\nsize = [90.5, 120]", "rig.size[0]"),
    "an absurd count": (BRIDGE + "[printing]\nmissing = 100000000000000000000", "printing.missing"),
    "a rig of two minds": (BRIDGE + '[rig]\nkind = "file"\nfile = "a.json"\nviews = 4', "remove views"),
    "no filament": (BRIDGE + '[render.look]\nplastics = ["steel"]', "render.look.plastics[0]: is 'steel'"),
    "no table": (BRIDGE + "[render.look]\ntables = []", "render.look.tables"),
    "too much clutter": (BRIDGE + "[render.look]\nclutter = [0, 400]", "render.look.clutter: is [0, 400]"),
    "a lamp below the table": (BRIDGE + "[render.look]\nlight_elevation = -5", "render.look.light_elevation"),
    "no lens model": (BRIDGE + '[rig.lens]\nmodel = "BALL"', "rig.lens.model: is 'BALL'"),
    "a fisheye's coefficient": (BRIDGE + "[rig.lens]\nk4 = 0.1", "the model OPENCV has no k4"),
    "a lens that is not there": (BRIDGE + "[errors]\nlens_ignored = true", "lens_ignored needs a lens"),
    "errors below zero": (BRIDGE + "[errors]\nturned_deg = [-1, 1]", "errors.turned_deg: is [-1, 1]"),
    "an error of what": (BRIDGE + "[errors]\nrolled = 1", "errors.rolled: is not known"),
    "no board": (BRIDGE + '[calibration]\nboard = "chess:3x3:10"', "'chess' is not a kind of board"),
    "a flat block": (BRIDGE + '[calibration]\nblock = "charuco:7x5:24:18"', "give a cuboid"),
    "boards without Blender": (BRIDGE + '[calibration]\n[render]\nstyle = "silhouette"', "made by Blender"),
    "rig file without name": (BRIDGE + '[rig]\nkind = "file"', "belong together"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_with_file_field_and_remedy(tmp_path: Path, mistake: str) -> None:
    text, expected = MISTAKES[mistake]
    path = recipe_file(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_recipe(path)
    sentence = str(caught.value)
    assert sentence.startswith(f"{path}: ") and expected in sentence and "\n" not in sentence and ";" in sentence


@pytest.mark.parametrize(
    ("key", "value"), [("format", "other"), ("version", 2), ("count", 0), ("seed", -1), ("name", "../x"), ("name", "")]
)
def test_the_head_is_checked(key: str, value: Any) -> None:
    data = {"format": "frametwin-recipe", "version": 1, "name": "t", "count": 1, "frames": [{"frame": "bridge"}]}
    parse_recipe(data, "r.toml")
    with pytest.raises(InputError, match=f"r.toml: {key}: "):
        parse_recipe({**data, key: value}, "r.toml")
    with pytest.raises(InputError, match="r.toml: count: is missing"):
        parse_recipe({name: item for name, item in data.items() if name != "count"}, "r.toml")


def test_missing_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"frames\[0\].frame: .*nothing.json.*bridge"):
        sampler_of(tmp_path, '[[frames]]\nframe = "nothing.json"')
    with pytest.raises(InputError, match="bent.blend"):
        sampler_of(tmp_path, '[[deformations]]\nkind = "blend"\nfile = "bent.blend"\nobject = "Frame"')


def test_a_damaged_rig_is_told_at_once(tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text("[]", encoding="utf-8")
    with pytest.raises(InputError, match="rig.json"):
        sampler_of(tmp_path, BRIDGE + '[rig]\nkind = "file"\nfile = "rig.json"')


def test_a_sample_depends_on_seed_and_index_alone(tmp_path: Path) -> None:
    text = (ROOT / "datasets" / "partial-prints.toml").read_text(encoding="utf-8").split("[[frames]]", 1)[1]
    text = "[[frames]]" + text.replace('"photo"', '"mask"')
    first, again = sampler_of(tmp_path, text), sampler_of(tmp_path, text)
    backwards = [again.specification(index) for index in (3, 2, 1, 0)][::-1]
    assert [first.specification(index) for index in range(4)] == backwards
    assert len({first.specification(index).printing.seed for index in range(40)}) == 40
    zero, one = sampler_of(tmp_path, text, seed=0), sampler_of(tmp_path, text, seed=1)
    assert zero.specification(0) == first.specification(0) != one.specification(0)


def test_draws_fill_their_ranges_and_follow_the_weights(tmp_path: Path) -> None:
    text = (
        '[[frames]]\nframe = "bridge"\nweight = 3\n[[frames]]\nframe = "half_bowl"\nradius = 1.5\n'
        '[[deformations]]\nkind = "sag"\npeak_fraction = [0.02, 0.06]\ndrift_mm = 2\n[printing]\nmissing = [1, 3]\n'
    )
    sampler = sampler_of(tmp_path, text)
    drawn = [sampler.specification(index) for index in range(600)]
    peaks = np.array([item.deformation.peak_fraction for item in drawn])
    assert 0.02 <= peaks.min() < 0.0205 and 0.0595 < peaks.max() <= 0.06
    assert abs(peaks.mean() - 0.04) < 4.0 * 0.04 / np.sqrt(12.0 * 600.0)
    assert Counter(item.printing.missing for item in drawn).keys() == {1, 2, 3}
    share = np.mean([item.frame == "bridge" for item in drawn])
    assert abs(share - 0.75) < 4.0 * np.sqrt(0.75 * 0.25 / 600.0)
    assert np.allclose([np.hypot(*item.deformation.drift_mm) for item in drawn], 2.0, rtol=1e-4)
    bowl = next(item for item in drawn if item.frame == "half_bowl")
    assert (sampler.plan(bowl).radius == 1.5).all()


def test_several_numbers_of_views_show_the_same_print(tmp_path: Path) -> None:
    sampler = sampler_of(tmp_path, BRIDGE + "[rig]\nviews = [4, 6]\n")
    a, b, c = (sampler.specification(index) for index in (2, 3, 4))
    assert (a.scene, b.scene, c.scene) == (1, 1, 2) and (a.rig.views, b.rig.views) == (4, 6)
    assert a.deformation == b.deformation and a.printing == b.printing and a.deformation != c.deformation


def test_other_cameras_do_not_change_the_print(tmp_path: Path) -> None:
    few = sampler_of(tmp_path, BRIDGE + "[rig]\nviews = 4\n").specification(3)
    many = sampler_of(tmp_path, BRIDGE + "[rig]\nviews = 9\njitter_mm = 3\n").specification(3)
    assert few.deformation == many.deformation and few.printing == many.printing and few.rig != many.rig


def test_what_a_frame_holds_counts_not_its_name(tmp_path: Path) -> None:
    text = '[[frames]]\nframe = "plan.json"\n'
    bridge = (ROOT / "datasets" / "frames" / "bridge.json").read_text(encoding="utf-8")
    (tmp_path / "plan.json").write_text(bridge, encoding="utf-8")
    before = sampler_of(tmp_path, text).specification(0)
    bowl = (ROOT / "datasets" / "frames" / "half_bowl.json").read_text(encoding="utf-8")
    (tmp_path / "plan.json").write_text(bowl, encoding="utf-8")
    assert before.frame_sha256 != sampler_of(tmp_path, text).specification(0).frame_sha256

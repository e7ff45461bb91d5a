"""Fields on disk: every kind comes back as it was, and damaged files are refused."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from frametwin.errors import InputError
from frametwin.fields import DeformationField, load_field, save_field
from frametwin.fields.free import FreeField
from frametwin.fields.lattice import LatticeField
from frametwin.fields.lattice_torch import TrainableLattice
from frametwin.fields.network import NetworkField, NetworkShape
from frametwin.fields.nodes import NodesField

BOX = [[0.0, 0.0, 0.0], [10.0, 20.0, 30.0]]
POINTS = np.random.default_rng(1).uniform(-5.0, 30.0, (50, 3))


def randomised(field: torch.nn.Module) -> DeformationField:
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.normal_(std=0.3, generator=generator)
    return field


def lattice() -> LatticeField:
    rng = np.random.default_rng(2)
    return LatticeField(BOX, [rng.normal(size=(4, 4, 4, 3)), rng.normal(size=(5, 6, 7, 3))])


FIELDS = {
    "lattice": lattice,
    "trainable lattice": lambda: TrainableLattice(lattice(), scale=5.0),
    "network": lambda: randomised(NetworkField(BOX, NetworkShape(4, 5, 16, 2))),
    "network in double": lambda: randomised(NetworkField(BOX, NetworkShape(2, 3, 8, 1)).double()),
    "network with pi": lambda: randomised(NetworkField(BOX, NetworkShape(4, 5, 16, 2), encoding="with_pi")),
    "free": lambda: randomised(FreeField(POINTS[:20], scale=3.0)),
    "nodes": lambda: randomised(NodesField(POINTS[:20], scale=3.0, neighbours=3)),
}


@pytest.mark.parametrize("name", FIELDS)
def test_round_trip(name: str, tmp_path: Path) -> None:
    field = FIELDS[name]()
    save_field(tmp_path / "field.safetensors", field)
    again = load_field(tmp_path / "field.safetensors")
    assert again.kind == field.kind
    np.testing.assert_allclose(again.evaluate(POINTS), field.evaluate(POINTS), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(again.laplacian(POINTS), field.laplacian(POINTS), rtol=1e-12, atol=1e-10)


class BeforeEncodings(NetworkField):
    """A network as it was written before its file told the encoding, which then had a pi."""

    def metadata(self) -> dict[str, str]:
        return {name: text for name, text in super().metadata().items() if name != "encoding"}


def test_networks_that_do_not_tell_their_encoding_have_pi(tmp_path: Path) -> None:
    field = randomised(BeforeEncodings(BOX, NetworkShape(4, 5, 16, 2), encoding="with_pi"))
    save_field(tmp_path / "field.safetensors", field)
    again = load_field(tmp_path / "field.safetensors")
    np.testing.assert_allclose(again.evaluate(POINTS), field.evaluate(POINTS), rtol=1e-12, atol=1e-12)


def test_unknown_encodings_are_refused(tmp_path: Path) -> None:
    field = NetworkField(BOX, NetworkShape(4, 5, 16, 2))
    field.encoding = "wavelets"
    save_field(tmp_path / "field.safetensors", field)
    with pytest.raises(InputError, match="does not hold a whole field"):
        load_field(tmp_path / "field.safetensors")


def test_the_same_field_gives_the_same_bytes_in_every_process(tmp_path: Path) -> None:
    code = (
        "import sys; from frametwin.fields import save_field; from frametwin.fields.lattice import LatticeField;"
        "save_field(sys.argv[1], LatticeField.zeros([[0, 0, 0], [1, 1, 1]], [(1, 2, 3)]))"
    )
    contents = set()
    for i in range(3):
        path = tmp_path / f"{i}.safetensors"
        root = Path(__file__).resolve().parents[1]
        subprocess.run([sys.executable, "-c", code, str(path)], check=True, cwd=root)
        contents.add(path.read_bytes())
    assert len(contents) == 1


def test_a_lattice_is_read_without_torch(tmp_path: Path) -> None:
    path = tmp_path / "field.safetensors"
    save_field(path, lattice())
    code = (
        "import sys; from frametwin.fields import load_field; field = load_field(sys.argv[1]);"
        "field.evaluate([[1.0, 2.0, 3.0]]); assert 'torch' not in sys.modules"
    )
    root = Path(__file__).resolve().parents[1]
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, cwd=root)


def rewritten(path: Path, **changes: str | None) -> None:
    """Change or remove texts in the header."""
    data = path.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    for key, value in changes.items():
        header["__metadata__"].pop(key, None)
        if value is not None:
            header["__metadata__"][key] = value
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + data[8 + length :])


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"format": "other"}, "format"),
        ({"format": None}, "format"),
        ({"version": "2"}, "version"),
        ({"kind": "wavelet"}, "kind"),
        ({"kind": None}, "kind"),
        ({"levels": "3"}, "file"),
        ({"levels": "many"}, "file"),
        ({"levels": None}, "file"),
        ({"kind": "network"}, "file"),
        ({"kind": "nodes"}, "file"),
    ],
)
def test_unknown_texts_are_refused(changes: dict, field: str, tmp_path: Path) -> None:
    path = tmp_path / "field.safetensors"
    save_field(path, lattice())
    rewritten(path, **changes)
    with pytest.raises(InputError, match=rf"field\.safetensors: {field}: .*; .*\.") as caught:
        load_field(path)
    assert "\n" not in str(caught.value)


def test_values_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    field = FreeField(POINTS[:5])
    with torch.no_grad():
        field.offsets[2, 1] = float("nan")
    save_field(tmp_path / "field.safetensors", field)
    with pytest.raises(InputError, match="offsets: holds values that are not finite"):
        load_field(tmp_path / "field.safetensors")


@pytest.mark.parametrize("keep", [0, 5, 40, 300, -1])
def test_cut_files_are_refused(keep: int, tmp_path: Path) -> None:
    path = tmp_path / "field.safetensors"
    save_field(path, lattice())
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(InputError, match="cannot be read"):
        load_field(path)


def test_missing_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.safetensors: file: does not exist"):
        load_field(tmp_path / "nowhere.safetensors")


def test_folders_that_do_not_exist_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        save_field(tmp_path / "missing" / "field.safetensors", lattice())

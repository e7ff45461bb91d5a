"""Picture files of an export: copies of the dataset's, or hard links to them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from frametwin.capture.picture import Picture
from frametwin.errors import InputError


def put_image(picture: Picture, folder: Path, link: bool) -> str:
    """Copy or link a picture into a folder, which is made where it is missing; its name there.

    Raises
    ------
    InputError
        If another picture has the same name, or it cannot be written.
    """
    image = picture.path
    folder.mkdir(exist_ok=True)
    target = folder / image.name
    if target.exists():
        remedy = "give the pictures of a capture different names"
        raise InputError.at(image, "images", "has the name of another picture", remedy)
    if link:
        try:
            os.link(image, target)
            return image.name
        except OSError:
            pass  # another file system, or one without links: a copy does as well
    try:
        shutil.copyfile(image, target)
    except OSError as error:
        raise InputError.at(target, "file", f"cannot be written ({error.strerror})", "make room for it") from error
    return image.name

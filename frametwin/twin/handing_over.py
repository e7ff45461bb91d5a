"""A run as arrays, from the process that fits to one that shows it.

The text of ``twin.json`` takes a tenth of a second to be read for thousands of struts, in which no other thread of the
same Python gets its turn; arrays take some milliseconds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from frametwin.formats import frame_json
from frametwin.geometry.wireframe import Wireframe
from frametwin.twin.bent import bent_as_records, bent_from_records
from frametwin.twin.runs import Truth
from frametwin.twin.twin import Twin

SOURCE = "run of the answer"


def handed_over(twin: Twin, plan: Wireframe, truth: Truth | None = None) -> dict[str, Any]:
    """A twin, its plan and the truth, if there is one, for the worker's protocol: arrays stay arrays."""
    fields = {item.name: getattr(twin, item.name) for item in dataclasses.fields(twin)}
    fields["verdict"] = dataclasses.asdict(twin.verdict)
    fields["bent"] = bent_as_records(twin.bent)  # keys of objects are texts in the protocol
    run: dict[str, Any] = {"twin": fields, "plan": frame_json.to_dict(plan)}
    if truth is not None:
        run["truth"] = {"frame": frame_json.to_dict(truth.frame), "present": truth.present}
    return run


def taken_over(run: Mapping[str, Any]) -> tuple[Twin, Wireframe, Truth | None]:
    """What `handed_over` made it of, to the last bit.

    Raises
    ------
    InputError
        If a field is missing or wrong, as in a file.
    """
    fields = {**run["twin"], "bent": bent_from_records(run["twin"]["bent"], SOURCE)}
    twin = Twin(**fields, source=SOURCE)
    plan = frame_json.parse(dict(run["plan"]), SOURCE)
    twin.as_wireframe(plan)  # refuses a twin of another frame
    truth = run.get("truth")
    if truth is None:
        return twin, plan, None
    return twin, plan, Truth(frame_json.parse(dict(truth["frame"]), SOURCE), truth["present"])

"""The same runs for another model of the ladder, which knows fewer tables."""

from typing import Any

from cvt_hpc.errors import mismatch
from cvt_hpc.job.definition import Job
from cvt_hpc.job.schema import load_schema
from cvt_hpc.models.contract import load_model


def answering_model(job: Job) -> tuple[str, str] | None:
    """Return the model that answers the job's question, and the reason; None for its own model.

    Raises
    ------
    InputError
        If the runs have different questions.
    """
    answered_by = load_model(job.model).answered_by
    if any(axis.name == "question" for axis in job.axes):
        raise mismatch(f"{job.source}: [axes] question", "one question for all runs", "several")
    return answered_by.get(job.parameters.get("question", ""))


def handed_to(job: Job, model: str, why: str) -> dict[str, Any]:
    """Return a document of the same runs for another model, with the keys that it knows.

    Parameters
    ----------
    job : Job
        A validated job.
    model : str
        The other model.
    why : str
        The purpose, for the description and the error.

    Raises
    ------
    InputError
        If the other model does not know an axis. A formula may still name keys that it does not know.
    """
    document, known = job.resolved(), load_schema(model, None, job.source).section_of
    for axis in job.axes:
        if axis.name not in known:
            where = f"{job.source}: [axes] {axis.name}"
            raise mismatch(where, f"a key of {model}, since {why}", "one without effect there")
    tables: dict[str, dict[str, Any]] = {}
    for section in job.schema.sections:
        for key, value in document[section].items():
            if key in job.given and key in known:
                tables.setdefault(known[key], {})[key] = value  # it may belong in another table there
    derived = {key: text for key, text in document.get("derived", {}).items() if key in known}
    linked = {
        axis: {key: values for key, values in table.items() if key in known}
        for axis, table in document.get("linked", {}).items()
    }
    text = f"{job.description}{'; ' if job.description else ''}{model}: {why}"
    head = {"name": job.name, "model": model, "description": text}
    rest = {key: document[key] for key in ("axes", "design") if key in document}
    tables |= {"derived": derived, "linked": {axis: table for axis, table in linked.items() if table}}
    tables = {name: table for name, table in tables.items() if table}
    return head | tables | rest

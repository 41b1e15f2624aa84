"""The JSON Schemas that ship with the package, and checking documents against them."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

from garmentc.errors import GarmentcError


def schema_path(name: str) -> Path:
    """The file of the schema `name`: inside the installed package, or in schemas/ of a source checkout."""
    package = Path(__file__).parent
    installed = package / "schemas" / f"{name}.schema.json"
    return installed if installed.exists() else package.parent / "schemas" / f"{name}.schema.json"


@cache
def _validator(name: str) -> Callable[[Any], Any]:
    import fastjsonschema

    compiled: Callable[[Any], Any] = fastjsonschema.compile(json.loads(schema_path(name).read_text(encoding="utf-8")))
    return compiled


def check_schema(document: Any, name: str, file: str | PathLike[str] | None = None) -> None:
    """Raise GarmentcError, naming the first offending entry, unless `document` follows schemas/`name`.schema.json."""
    from fastjsonschema import JsonSchemaValueException

    try:
        _validator(name)(document)
    except JsonSchemaValueException as error:
        entry = ".".join(str(part) for part in error.path[1:])
        rule = error.message.removeprefix(error.name).strip()
        if error.rule in ("anyOf", "oneOf"):  # fastjsonschema does not say which came closest
            rule = f"is not what it should be: {error.definition.get('description', 'one of several kinds')}"
        said = f"'{entry}' {rule}" if entry else f"the document {rule}"
        raise GarmentcError(f"{said.rstrip('.')}; see schemas/{name}.schema.json", file) from None

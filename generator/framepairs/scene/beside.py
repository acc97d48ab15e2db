"""JSON files that stand beside a scene file: read alike, whatever they say."""

import json
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from ..errors import InputError

Model = TypeVar("Model", bound=BaseModel)


def read_beside(model: type[Model], file: Path, largest: int) -> Model:
    """largest: bytes that are read at most. Raises InputError naming the file and the field."""
    try:
        if file.stat().st_size > largest:
            raise InputError(f"larger than {largest} bytes", file=file)
        return model.model_validate(json.loads(file.read_bytes()))
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=file) from None
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"]) or None
        raise InputError(first["msg"].removeprefix("Value error, "), file=file, field=field) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not JSON: {error}", file=file) from None

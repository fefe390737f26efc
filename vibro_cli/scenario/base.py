"""What scenarios of every system have in common: strict tables, rules between fields, places."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails

from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.problems import Fault, KeyPath, Place
from vibro_cli.scenario.source import Source


def as_tuple(value: object) -> object:
    """Return a list of a file as a tuple, which does not change."""
    return tuple(value) if isinstance(value, list) else value


class Table(BaseModel):
    """A table of the scenario file: unknown keys are errors, and nothing changes afterwards."""

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        defer_build=True,
    )


class ScenarioTable(Table):
    """The scenario of some system; its rules between fields are checked with the fields."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Keys of one table of which at most one may be given."""

    name: Annotated[str, kinds.NAME] = "scenario"
    """Name of the scenario and of its folder of results; the file's stem if not given."""

    _source: Source = PrivateAttr(default_factory=Source)

    @model_validator(mode="wrap")
    @classmethod
    def _with_rules(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Check the rules between fields in one pass with the fields themselves."""
        if isinstance(data, cls):
            return handler(data)
        data = plain(data)
        rules_apply = isinstance(data, dict)
        faults = cls.between_fields(data) if rules_apply else []
        own: list[InitErrorDetails] = [
            {"type": kinds.fault(f.found, f.expected), "loc": f.loc, "input": None} for f in faults
        ]
        try:
            model = handler(cls.prepared(data) if rules_apply else data)
        except ValidationError as error:
            raise ValidationError.from_exception_data(
                cls.__name__, [*_details(error), *own]
            ) from None
        if own:
            raise ValidationError.from_exception_data(cls.__name__, own)
        return model

    def resolved(self) -> dict[str, Any]:
        """Return the scenario as plain data, in SI units and with every default.

        Keys without a value are left out; reading the data again gives an equal scenario.
        """
        return self.model_dump(mode="json", exclude_none=True)

    def place(self, key_path: str | KeyPath) -> Place:
        """Return where a key such as `balls[2].radius` was given, or the nearest table to it."""
        return self._source.place(key_path)

    @classmethod
    def between_fields(cls, data: dict[str, Any]) -> list[Fault]:
        """Return every broken rule between fields."""
        raise NotImplementedError

    @classmethod
    def prepared(cls, data: dict[str, Any]) -> dict[str, Any]:
        """Return the data with the defaults that depend on other fields filled in."""
        raise NotImplementedError


def plain(value: Any) -> Any:
    """Return data in which models are replaced by dictionaries, and tuples by lists."""
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_none=True)
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


def _details(error: ValidationError) -> list[InitErrorDetails]:
    """Return the errors of a model in the form that makes a new error of them and others."""
    details: list[InitErrorDetails] = []
    for item in error.errors(include_url=False):
        context = item.get("ctx", {})
        kind = item["type"]
        details.append(
            {
                "type": kinds.fault(context["found"], context["expected"])
                if kind == "vibro"
                else kind,
                "loc": item["loc"],
                "input": item["input"],
                "ctx": context,
            }
        )
    return details

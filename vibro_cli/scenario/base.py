"""Common parts of the scenarios of all systems: strict tables, rules between fields, places.

Several systems share the tables of bodies and of sampled motion. The key `system` of a scenario
selects the object of its system, which provides the model that reads the scenario.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    model_validator,
)
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, core_schema

from vibro_cli.errors import counted
from vibro_cli.scenario import quantities as kinds
from vibro_cli.scenario.forms import Source
from vibro_cli.scenario.problems import Fault, KeyPath, Place, parsed_path, shown
from vibro_cli.systems import NAMES, system_named

# Keys of one table of which at most one may be given.
MASS = ("density", "mass")
KIND = ("body", "inertia_ratio")
SAMPLES = ("step", "times")

Rule = dict[str, Any]
"""A rule between the keys of one table, in JSON Schema."""


def exactly_one(*keys: str) -> Rule:
    """Return the rule that a table has exactly one of these keys."""
    return {"oneOf": [{"required": [key]} for key in keys]}


def at_least_one(*keys: str) -> Rule:
    """Return the rule that a table has at least one of these keys."""
    return {"anyOf": [{"required": [key]} for key in keys]}


def at_most_one(*keys: str) -> Rule:
    """Return the rule that a table has at most one of these keys."""
    pairs = [[a, b] for i, a in enumerate(keys) for b in keys[i + 1 :]]
    return {"not": {"anyOf": [{"required": pair} for pair in pairs]}}


@dataclass(frozen=True)
class Listed:
    """Annotation of a list, which becomes a tuple: name and allowed number of its entries."""

    entries: str
    least: int = 0
    most: int | None = None

    def read(self, value: object) -> tuple[Any, ...]:
        """Return the list as a tuple, or raise a `PydanticCustomError`; entries are not checked."""
        if not isinstance(value, (list, tuple)):
            raise kinds.fault(shown(value), f"a list of {self.entries}")
        if len(value) < self.least:
            raise kinds.fault(shown(value), f"a list of at least {self.least}")
        if self.most is not None and len(value) > self.most:
            raise kinds.fault(shown(value), f"a list of at most {self.most}")
        return tuple(value)

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        lengths = {"minItems": self.least or None, "maxItems": self.most}
        return {**handler(schema), **{key: n for key, n in lengths.items() if n is not None}}


@dataclass(frozen=True)
class Texts(Listed):
    """Annotation of a list of texts."""

    def read(self, value: object) -> tuple[str, ...]:
        """Return the texts as a tuple, or raise a `PydanticCustomError`."""
        found = super().read(value)
        for entry in found:
            if not isinstance(entry, str):
                raise kinds.fault(shown(entry), f"a list of {self.entries}, each a text")
        return found


class Table(BaseModel):
    """A table of the scenario file: it is immutable, and unknown keys are errors.

    The text below a field describes it (see `fields.descriptions`). It is read from the source only
    on demand, as this takes longer than declaring the models.
    """

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        defer_build=True,
    )

    rules: ClassVar[tuple[Rule, ...]] = ()
    """The rules between its keys, as far as JSON Schema can express them."""


class AnyScenario(Table):
    """The scenario of a system; rules between fields are checked together with the fields."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Keys of one table of which at most one may be given."""

    name: Annotated[str, kinds.NAME] = "scenario"
    """Name of the scenario and of its results folder; by default the file name without its
    suffix."""

    if TYPE_CHECKING:  # each system declares its own types
        system: str
        balls: tuple[Any, ...]
        collision: Any
        stop: Any
        output: Any

    _source: Source = PrivateAttr(default_factory=Source)

    @model_validator(mode="wrap")
    @classmethod
    def _with_rules(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Check the rules between fields in the same pass as the fields."""
        if isinstance(data, cls):
            return handler(data)
        data = plain(data)
        rules_apply = isinstance(data, dict)
        faults = cls.between_fields(data) if rules_apply else []
        own: list[InitErrorDetails] = [
            {"type": kinds.fault(f.found, f.expected, f.on_key), "loc": f.loc, "input": None}
            for f in faults
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

    def given(self) -> dict[str, Any]:
        """Return the data from which the scenario was read, with all changes and no defaults."""
        return self.resolved() if self._source.data is None else self._source.data

    def resolved(self) -> dict[str, Any]:
        """Return the scenario as plain data, in SI units and with all defaults.

        Keys without a value are omitted; reading the data again gives an equal scenario.
        """
        return self.model_dump(mode="json", exclude_none=True)

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> AnyScenario:
        """Return a scenario from plain data with the keys of a scenario file.

        Parameters
        ----------
        data
            Dictionaries, lists, strings and numbers of Python or numpy. Numbers are in SI units and
            radians; strings may have units, such as ``"0.4 m"`` and ``"-60 deg"``. The key
            ``system`` is one of ``vibro_cli.systems.NAMES``, by default ``"trace"``.

        Raises
        ------
        ScenarioError
            With all faults and their paths.
        """
        from vibro_cli.scenario.loading import any_scenario_of

        checked("data", data, kinds.Dictionary("values by the keys of a scenario file"))
        return any_scenario_of(data)

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """Return the scenario with changed values, as ``--set`` does on the command line.

        Parameters
        ----------
        changes
            Values by path, counted from 1: ``{"collision.k": 0.8, "balls[1].angle": "-60 deg"}``.
            Numbers are in SI units and radians. Of keys that exclude one another, such as ``mass``
            and ``density``, the new one replaces the other.

        Raises
        ------
        ScenarioError
            With all unknown paths, and all faults of the changed scenario.
        """
        from vibro_cli.scenario.loading import replaced

        checked("changes", changes, kinds.Dictionary("values by their paths"))
        return replaced(self, changes)

    def _repr_html_(self) -> str:
        """Return the resolved scenario as a table of paths with units and values, for notebooks."""
        from html import escape

        from vibro_cli.scenario.fields import unit_at

        rows = ""
        for path, value in _flat(self.resolved()):
            unit = unit_at(parsed_path(path), type(self))
            head = escape(f"{path} [{unit}]" if unit else path)
            rows += f"<tr><th>{head}</th><td>{escape(str(value))}</td></tr>"
        return f"<table><caption>{escape(str(self))}</caption>{rows}</table>"

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self}>"

    def __str__(self) -> str:
        data = self.resolved()
        pieces = len(data.get("trace", {}).get("arcs", ()))
        where = f"{pieces} pieces of a trace, " if pieces > 1 else ""
        bodies = counted(len(data.get("balls", ())), "body", "bodies")
        return f"{self.name}: {where}{bodies}"

    def place(self, key_path: str | KeyPath) -> Place:
        """Return the place of a key such as `balls[2].radius`, or of the nearest table above it."""
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
    """Return data in which models are dictionaries, and sequences and arrays are lists."""
    if type(value) in (str, int, float, bool):  # most values; the checks below take longer
        return value
    if isinstance(value, BaseModel):
        return value.model_dump(exclude_none=True)
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # a number or an array of numpy, without importing numpy
        return value.tolist()
    if hasattr(value, "__array__"):  # convertible to an array, such as a series of polars
        return value.__array__().tolist()
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        return [plain(item) for item in value]
    return value


def _details(error: ValidationError) -> list[InitErrorDetails]:
    """Return the errors of a model in the form from which a combined error is made."""
    details: list[InitErrorDetails] = []
    for item in error.errors(include_url=False):
        context = item.get("ctx", {})
        kind = item["type"]
        details.append(
            {
                "type": kinds.fault(**context) if kind == "vibro" else kind,
                "loc": item["loc"],
                "input": item["input"],
                "ctx": context,
            }
        )
    return details


def _flat(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of plain data with their paths, counted from 1."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and any(isinstance(item, dict | list) for item in value):
        for number, inner in enumerate(value, 1):
            yield from _flat(inner, f"{path}[{number}]")
    else:
        yield path, value


def check_scenario(found: object) -> None:
    """Raise ``TypeError`` unless an argument is a scenario (not, say, the name of its file)."""
    if not isinstance(found, AnyScenario):
        shown = f"{found!r:.60} ({type(found).__name__})"
        raise TypeError(f"found {shown}, expected a scenario: load_scenario(file) reads one")


def check_scenarios(found: object) -> None:
    """Raise ``TypeError`` unless an argument is iterable; its scenarios are checked when used."""
    none = isinstance(found, (AnyScenario, str, bytes)) or not isinstance(found, Iterable)
    if none or getattr(found, "shape", None) == ():  # an array of numpy without an axis
        raise TypeError(f"scenarios: found {shown(found)}, expected a list of scenarios")


def checked(name: str, value: Any, kind: kinds.Kind | Listed) -> Any:
    """Return an argument of a function, validated by a kind.

    Raises ``ValueError``, or ``TypeError`` for a flag, with the argument's name, what was found and
    what was expected.
    """
    try:
        return kind.read(plain(value))
    except PydanticCustomError as error:
        wrong = TypeError if isinstance(kind, kinds.Flag) else ValueError
        raise wrong(f"{name}: {error.message()}") from None


def checked_path(name: str, value: Any, meaning: str = "file") -> Path:
    """Return an argument of a function that must be the path of a file or folder.

    Raises ``ValueError`` as :func:`checked`.
    """
    text = os.fspath(value) if isinstance(value, os.PathLike) else value
    if isinstance(text, str) and _can_be_a_path(text):
        path = Path(text)
        if path.name or meaning != "file":
            return path
    expected = f"the path of a {meaning}, a text or a pathlib.Path"
    raise ValueError(f"{name}: found {shown(text)}, expected {expected}")


def _can_be_a_path(text: str) -> bool:
    """Return whether a text can be a path: not empty, encodable and without a zero byte."""
    try:
        return text != "" and b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        return False


def checked_page(name: str, value: Any) -> Path:
    """Return an argument that must be the path of an HTML page.

    Raises ``ValueError`` for other suffixes.
    """
    path = checked_path(name, value)
    if path.suffix.lower() not in ("", ".htm", ".html"):
        raise ValueError(f"{name}: found {str(value)!r}, expected a .html file")
    return path


def system_of(data: Any) -> str:
    """Return the system named in the data of a scenario, `trace` if missing or unknown."""
    system = data.get("system") if isinstance(data, Mapping) else None
    return system if isinstance(system, str) and system in NAMES else "trace"


def model_of(data: Any) -> type[AnyScenario]:
    """Return the model for the data of a scenario, that of a trace without a known system."""
    return system_named(system_of(data)).model


BodyKind = Literal["ball", "disk", "hollow_ball", "hoop", "particle"]


class BodyTable(Table):
    """What a body is: its kind, its radius and its mass."""

    rules: ClassVar[tuple[Rule, ...]] = (
        exactly_one(*MASS),
        at_most_one(*KIND),
        at_most_one("inertia_ratio", "density"),
    )

    body: Annotated[BodyKind | None, kinds.Word(get_args(BodyKind))] = Field(
        default=None, json_schema_extra={"default": "ball"}
    )
    """Kind of body, which determines its moment of inertia; ball if inertia_ratio is not given
    either."""
    inertia_ratio: Annotated[float | None, kinds.RATIO] = None
    """J_C/(m r^2) of any other body, given instead of its kind; requires the mass."""
    radius: Annotated[float, kinds.RADIUS]
    """Radius of the body in m; 0 is allowed only for a lone particle."""
    density: Annotated[float | None, kinds.DENSITY] = None
    """Density in kg/m^3; give either density or mass."""
    mass: Annotated[float | None, kinds.MASS] = None
    """Mass in kg; give either mass or density."""
    thickness: Annotated[float | None, kinds.LENGTH] = None
    """Thickness in m of a disk, of the wall of a thin hollow ball, or of a hoop of square section,
    which these require if density is given."""


class Sampling(Table):
    """Optional output: sampled motion."""

    rules = (at_most_one(*SAMPLES),)

    step: Annotated[float | None, kinds.TIME] = None
    """Time step of the sampled motion in s."""
    times: Annotated[tuple[Annotated[float, kinds.INSTANT], ...] | None, Listed("times")] = None
    """Times at which the motion is sampled, in s, ascending; given instead of step."""

"""Write the XML description of an FMU for a control law.

The functional mock-up unit (FMU) follows FMI 2.0 or FMI 3.0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from typing import Any, Final
from xml.etree import ElementTree as Xml

from .law_design import WEAKER_NUMBER, LawDesign

_BASE_UNITS: Final[dict[str, dict[str, int]]] = {
    "s": {"s": 1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.s": {"kg": 1, "m": 1, "s": -1},
    "N.s2": {"kg": 1, "m": 1},
    "1": {},
}
_READING: Final = "unit of the readings"
_TYPES: Final = {  # by the name that this file uses: the names in FMI 2.0 and FMI 3.0
    "real": ("Real", "Float64"),
    "integer": ("Integer", "Int32"),
    "boolean": ("Boolean", "Boolean"),
}


_PLACES: Final = {  # by the causality of a variable: where the C structure of an instance has it
    "independent": "m->",
    "input": "m->sample.",
    "parameter": "m->parameters.law.",
    "output": "m->out.",
}


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of a functional mock-up unit (FMU).

    Args:
        causality: what FMI calls its role, such as "input".
        name: its name.
        about: its meaning.
        unit: its unit; empty for flags.
        kind: "real", "integer" or "boolean".
        variability: when it may change, as FMI calls it.
        start: its start value; empty if it follows from other variables.
        bounds: smallest and largest value; None if there are none.
        follows: names of the variables that determine its value before the first step.
    """

    causality: str
    name: str
    about: str
    unit: str = ""
    kind: str = "real"
    variability: str = "continuous"
    start: str = ""
    bounds: tuple[float, float] | None = None
    follows: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """The C expression for the variable in an FMU instance."""
        return _PLACES[self.causality] + self.name


_input, _output = partial(Variable, "input"), partial(Variable, "output")
_TIME: Final = Variable("independent", "time", "Time of the simulation", "s")
_INPUTS: Final = (
    _input(
        "reading",
        "Raw output of the sensor, with the polarity of the calibration",
        _READING,
        variability="discrete",
        start="0",
    ),
    _input(
        "fresh",
        "Whether the reading arrived since the last step",
        kind="boolean",
        variability="discrete",
        start="false",
    ),
    _input(
        "no_object",
        "Whether a fresh message says that the sensor sees no object; then the reading does not count",
        kind="boolean",
        variability="discrete",
        start="false",
    ),
    _input("age", "Time since the reading was measured", "s", variability="discrete", start="0"),
    _input(
        "contact_force",
        "Force of the object on the robot along x, negative while the object presses; 0 without a force sensor",
        "N",
        start="0",
    ),
    _input("reference_position", "Reference x_d of the robot at the start of the step", "m", start="0"),
    _input("reference_velocity", "Velocity of the reference at the start of the step", "m/s", start="0"),
    _input("reference_acceleration", "Acceleration of the reference during the step", "m/s2", start="0"),
)
_OUTPUTS: Final = (
    _output(
        "position", "Commanded position x_v at the end of the period of the law", "m", follows=("reference_position",)
    ),
    _output(
        "velocity", "Commanded velocity at the end of the period of the law", "m/s", follows=("reference_velocity",)
    ),
    _output(
        "acceleration",
        "Commanded acceleration, its mean over the last period",
        "m/s2",
        follows=("reference_acceleration",),
    ),
    _output("virtual_force", "Virtual force F_p of the last period, after its limit", "N", start="0"),
    _output("log_level", "ln(xi / floor) after the filters; 0 while nothing is detected", "1", start="0"),
    _output(
        "status",
        "Sum of the status flags of the last period",
        kind="integer",
        variability="discrete",
        start="0",
    ),
)


def variables(design: LawDesign) -> tuple[Variable, ...]:
    """Return the variables of an FMU.

    The index of each variable is its FMI value reference.
    """
    return (_TIME, *_INPUTS, _number(design), *_OUTPUTS)


def _number(design: LawDesign) -> Variable:
    """Return the FMU parameter for the gain or drag. Users may weaken the value, but not strengthen it."""
    name, symbol, unit = ("drag", "phi", "N.s2") if design.is_drag else ("gain", "D_p", "N.s")
    value: float = getattr(design.controller.parameters().law, name)
    return Variable(
        "parameter",
        name,
        f"The {name} {symbol} of the control law. Only values between 0 and the exported value are allowed. "
        f"{WEAKER_NUMBER.format(name=name)}",
        unit,
        variability="fixed",
        start=repr(value),
        bounds=(min(value, 0.0), max(value, 0.0)),
    )


def model_description(design: LawDesign, standard: int, identifier: str, token: str) -> str:
    """Return the text of the file `modelDescription.xml` of an FMU.

    Args:
        design: the design.
        standard: the major version of FMI, 2 or 3.
        identifier: the model identifier, a C name.
        token: the token that connects the file with the library.

    Returns:
        The text of the file.
    """
    names = {
        "fmiVersion": f"{standard}.0",
        "modelName": identifier,
        ("guid" if standard == 2 else "instantiationToken"): token,
        "description": f"Pre-contact controller, {design.law_text}, from {design.origin}. {design.verdict_text}",
        "version": version("pretouch"),
        "generationTool": f"pretouch {version('pretouch')}",
        "variableNamingConvention": "flat",
    }
    root = Xml.Element("fmiModelDescription", names)
    period = design.controller.period
    state = "FMUstate" if standard == 2 else "FMUState"
    abilities = ("canHandleVariableCommunicationStepSize", f"canGetAndSet{state}", f"canSerialize{state}")
    unit = Xml.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **dict.fromkeys(abilities, "true")})
    if standard == 2:
        _add(_add(unit, "SourceFiles"), "File", name="fmi2.c")
    else:
        unit.set("fixedInternalStepSize", repr(period))
    units = _add(root, "UnitDefinitions")
    for name, base in _BASE_UNITS.items():
        _add(_add(units, "Unit", name=name), "BaseUnit", **base)
    _add(units, "Unit", name=_READING)
    _add(_add(root, "LogCategories"), "Category", name="logStatusError", description="Refused calls, with the reason")
    stop = float(f"{len(design.cases[0].samples) * period:.12g}")
    _add(root, "DefaultExperiment", startTime=0.0, stopTime=stop, stepSize=period)
    chosen = variables(design)
    listed = _add(root, "ModelVariables")
    for reference, variable in enumerate(chosen):
        (_add_variable_2 if standard == 2 else _add_variable_3)(listed, reference, variable)
    _add_structure(_add(root, "ModelStructure"), chosen, standard)
    return as_text(root)


def build_description(identifier: str) -> str:
    """Return the text of the FMI 3.0 file `buildDescription.xml`.

    This file lists the C sources of the FMU.
    """
    root = Xml.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = _add(root, "BuildConfiguration", modelIdentifier=identifier)
    sources = _add(configuration, "SourceFileSet", language="C99")
    _add(sources, "SourceFile", name="fmi3.c")
    about = "for a shared library: function names without the model identifier"
    name = "FMI3_OVERRIDE_FUNCTION_PREFIX"
    _add(sources, "PreprocessorDefinition", name=name, optional="true", value="1", description=about)
    return as_text(root)


def as_text(root: Xml.Element) -> str:
    """Return the text of an XML tree, one element per line."""
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _add(parent: Xml.Element, tag: str, **attributes: Any) -> Xml.Element:
    return Xml.SubElement(parent, tag, {name: str(value) for name, value in attributes.items()})


def _role(variable: Variable, reference: int) -> dict[str, Any]:
    """Return the variable attributes that both FMI versions share."""
    initial = {"parameter": "exact", "output": "calculated" if variable.follows else "exact"}.get(variable.causality)
    return {
        "name": variable.name,
        "valueReference": reference,
        "description": variable.about,
        "causality": variable.causality,
        "variability": variable.variability,
        **({"initial": initial} if initial else {}),
    }


def _value(variable: Variable) -> dict[str, Any]:
    """Return unit, bounds and start value as XML attributes."""
    bounds = variable.bounds or ()
    attributes = {"unit": variable.unit, **dict(zip(("min", "max"), bounds, strict=False)), "start": variable.start}
    return {name: value for name, value in attributes.items() if value != ""}


def _add_variable_2(parent: Xml.Element, reference: int, variable: Variable) -> None:
    scalar = _add(parent, "ScalarVariable", **_role(variable, reference))
    _add(scalar, _TYPES[variable.kind][0], **_value(variable))


def _add_variable_3(parent: Xml.Element, reference: int, variable: Variable) -> None:
    _add(parent, _TYPES[variable.kind][1], **_role(variable, reference), **_value(variable))


def _add_structure(parent: Xml.Element, chosen: tuple[Variable, ...], standard: int) -> None:
    """Add the FMU outputs and their dependencies to the XML tree; FMI 2.0 counts variables from 1."""
    number = {variable.name: i + (standard == 2) for i, variable in enumerate(chosen)}
    key = "index" if standard == 2 else "valueReference"
    outputs = [variable for variable in chosen if variable.causality == "output"]
    after_a_step = _add(parent, "Outputs") if standard == 2 else parent
    for variable in outputs:
        tag = "Unknown" if standard == 2 else "Output"
        _add(after_a_step, tag, **{key: number[variable.name]}, dependencies="")
    before = _add(parent, "InitialUnknowns") if standard == 2 else parent
    for variable in outputs:
        if variable.follows:
            tag = "Unknown" if standard == 2 else "InitialUnknown"
            needed = " ".join(str(number[name]) for name in variable.follows)
            _add(before, tag, **{key: number[variable.name]}, dependencies=needed)

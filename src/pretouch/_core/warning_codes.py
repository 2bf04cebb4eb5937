"""Explain the code of every warning.

An explanation says what the warning means, why it matters and what to do. The pages in docs/warnings/ are generated
from this table: python docs/make_pages.py.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from .errors import InvalidInputError

_CODED: Final = re.compile(r"(PT\d{3}): ")


@dataclass(frozen=True, slots=True, kw_only=True)
class WarningCode:
    """The explanation of one kind of warning.

    Args:
        code: code of the warning, such as PT101.
        title: what the warning is about, in a few words.
        meaning: what the warning means.
        why: why the warning matters.
        remedy: what to do.
        example: example of the text of such a warning.
    """

    code: str
    title: str
    meaning: str
    why: str
    remedy: str
    example: str


def caution(code: str, text: str) -> str:
    """Return the text of a warning with its code in front.

    Args:
        code: a key of WARNING_CODES.
        text: what is wrong, with value and unit.

    Returns:
        Code and text, such as `PT301: the optimal gain lies on its bound -10 N s`.

    Raises:
        InvalidInputError: there is no such code.
    """
    if code not in WARNING_CODES:
        raise InvalidInputError(f"code: found {code!r}, expected one of the warning codes in WARNING_CODES")
    return f"{code}: {text}"


def split_code(text: str) -> tuple[str, str]:
    """Split a warning into its code and its text.

    Returns:
        The code, such as PT101, and the text; the code is empty if the warning has none.
    """
    match = _CODED.match(text)
    return (match[1], text[match.end() :]) if match else ("", text)


def with_context(context: str, text: str) -> str:
    """Return a warning with a context, such as a sensor name.

    The context, such as the name of a sensor site, follows the warning code.
    """
    code, rest = split_code(text)
    return f"{code}: {context}: {rest}" if code else f"{context}: {rest}"


def codes_in(texts: Iterable[str]) -> tuple[str, ...]:
    """Return the warning codes that occur in several texts.

    Each code occurs once. The codes are in ascending order.
    """
    return tuple(sorted({code for text in texts for code in _CODED.findall(text) if code in WARNING_CODES}))


def page_of_code(code: str) -> str:
    """Return the documentation page of a warning code.

    The path is relative to the source tree.
    """
    return f"docs/warnings/{code}.md"


_TABLE: Final = (
    # --- calibration
    (
        "PT101",
        "Too few distances",
        "The usable range contains few distances, compared with the number of unknown parameters of the curve.",
        "A curve through few distances cannot be tested, so an error of its slope goes unnoticed. With fewer than 4 "
        "distances, or 5 if the offset is fitted, no curve is fitted.",
        "Measure at 8 or more distances in the usable range, several readings each. `pretouch record` proposes them.",
        "The usable range from 0 mm to 80 mm contains only 5 different distances",
    ),
    (
        "PT102",
        "Every distance was read once",
        "There is one reading at each distance, so the noise is estimated from deviations from the curve.",
        "Noise and an error of the curve cannot be told apart, and all uncertainties are rough.",
        "Read each distance three times or more, and record at least five readings without an object.",
        "Every distance was read once, so the noise is estimated from deviations from the curve",
    ),
    (
        "PT103",
        "The offset contradicts the readings",
        "The offset is negative, larger than some readings, or does not agree with the readings at large distances.",
        "The offset does not cancel from the slope. With a wrong offset the virtual force is too weak or too strong.",
        "Record the output with no object, as rows with the distance `inf`, or let the fit determine the offset: "
        "`--offset fit`.",
        "The declared offset of 90 counts is larger than some readings, such as 61 counts",
    ),
    (
        "PT104",
        "Several distances are inconsistent",
        "The readings at several distances do not agree with any curve through the other readings.",
        "The fit leaves these readings out. If they are right, the true curve has another shape than the fitted curve.",
        "Measure again at these distances. Check the object, its orientation, and whether it moved.",
        "The readings at 3 distances are inconsistent with every curve through the other readings",
    ),
    (
        "PT105",
        "The output hardly falls",
        "Over the usable range the sensor output falls by a small factor.",
        "The controller needs the relative change of the output. A small change is easily hidden by noise.",
        "Measure over a wider range, and start nearer to the sensor.",
        "From 20 mm to 30 mm the output falls only by a factor of 1.3",
    ),
    (
        "PT106",
        "Rows without an output",
        "Many rows of the file have a distance but no output.",
        "Readings that are missing systematically, for example near contact, change the curve.",
        "Check the recording and the columns of the file.",
        "120 rows have no output",
    ),
    (
        "PT107",
        "The slope is uncertain",
        "Where most of the virtual force acts, the 95 % uncertainty of the slope g is too large for a design.",
        "The virtual force is proportional to the slope, so the force has the same relative error as the slope.",
        "Follow the remedy in the message: more distances, more readings, or readings without an object.",
        "The uncertainty of the sensor slope g is 38 % at the distance 24 mm, but a design needs at most 15 %",
    ),
    (
        "PT108",
        "The readings have another slope than the curve",
        "Between two distances, the readings are significantly flatter or steeper than the best curve.",
        "The true curve has another shape there, so the virtual force differs by the same percentage.",
        "Use the table model, which follows the readings, or check how the distances were set.",
        "Between the distances 5 mm and 9 mm, the readings are 20 % flatter than the best model",
    ),
    (
        "PT109",
        "The curve does not fit as well as the noise allows",
        "Averaged readings deviate from the best curve by more than their noise explains.",
        "Averaging does not remove such an error. It acts like an error of the distance.",
        "Check how the distances were set and whether the object stayed parallel. The table follows the readings.",
        "Averaged readings deviate from the best model, inverse-power, by 6 % of the signal",
    ),
    (
        "PT110",
        "There is no usable signal",
        "The output does not fall with the distance, or exceeds the noise at too few distances.",
        "Without a signal there is no slope, and no curve is fitted.",
        "Check power, orientation, range and amplification of the sensor. Measure in finer steps near the sensor.",
        "The sensor output does not fall significantly with the distance (rank test, p = 0.4)",
    ),
    (
        "PT111",
        "Parameters that the readings cannot distinguish",
        "Several combinations of parameters describe the readings equally well.",
        "The curve and its slope can still be right. The single parameters have no meaning.",
        "Use the curve, not the single parameters. Measure over a wider range to separate them.",
        "Scale and exponent cannot be distinguished",
    ),
    (
        "PT112",
        "A remark on one fitted model",
        "The fit reached a limit of its parameters, its offset was fitted and not measured, or the model is a table.",
        "The intervals of such a fit are rough. A table passes through the readings, so residuals do not test it.",
        "Compare the models in the ranking, and record readings without an object.",
        "The offset was fitted, not measured. If the offset is wrong by one standard error, the slope changes by 4 %.",
    ),
    (
        "PT113",
        "The output rises with the distance, or is a distance",
        "The column is not a signal that falls with the distance.",
        "The controller interprets a rising output as an approach, so the robot would move the wrong way.",
        "For a sensor that reports distances, write a scenario with `pretouch init --part VL53L0X`; it needs no "
        "calibration. Invert an inverted signal, in the file and on the robot.",
        "The sensor output rises with the distance",
    ),
    (
        "PT114",
        "The distances are very large",
        "The farthest distance of the calibration is more than 10 m, so the unit of the distances is probably wrong.",
        "If distances in mm count as m, the sensor slope is a thousand times too small, and so is the virtual force.",
        "Write the right unit into the header of the column, such as `distance [mm]`.",
        "The distances reach 80 m, which is too far for a proximity sensor",
    ),
    (
        "PT115",
        "Repeated readings are equal",
        "Repeated readings are equal at every distance with repeats, or each reading occurs equally often.",
        "Copies, averages and readings of a coarse sensor do not show the noise. The fit counts equal readings once.",
        "Remove copies, and record raw readings. With a coarse sensor, measure at more distances instead.",
        "26 of 52 readings repeat another reading exactly",
    ),
    (
        "PT116",
        "The readings allow a wide range of contact speeds",
        "The sensor curves that agree with the readings lead to contact speeds that differ from the prediction by more "
        "than 15 %. The stated range contains 90 % of these curves, weighted by how well they fit.",
        "The fitted curve is only the most probable one. The contact may be as hard as the upper end of the range.",
        "Follow the advice in the message: repeat the reading nearest to the sensor, record the output with no object, "
        "or measure at more distances.",
        "The readings also allow sensor curves with which contact occurs at 0.0762 to 0.121 m/s",
    ),
    (
        "PT117",
        "The nearest reading is probably wrong",
        "The reading nearest to the sensor disagrees with every curve through the other readings.",
        "No nearer reading confirms it, and it decides the slope near contact. So it changes the contact speed most.",
        "Repeat the reading at this distance five times or more, and check how the distance was set.",
        "The reading of 3120 counts at the smallest distance 2 mm is probably wrong",
    ),
    # --- what the calibration says about an answer
    (
        "PT201",
        "The readings allow another contact speed",
        "On other sensor curves that fit the same readings, the contact speed is clearly different.",
        "The answer depends more on the choice of the curve than on the readings.",
        "Measure at more distances between contact and start, several times at each distance.",
        "Not supported by the readings: on 12 of 100 sensor curves that fit the readings, contact is harder",
    ),
    (
        "PT202",
        "The curve is used where there are no readings",
        "The encounter uses distances, for example near contact, that the calibration does not cover.",
        "Outside of the readings the curve is an extrapolation, and nothing has tested it.",
        "Mount the sensor behind the contact surface (`recess`), calibrate these distances, or start nearer.",
        "Not supported by data: this result uses the fitted curve where the calibration has no usable readings",
    ),
    (
        "PT203",
        "The object recedes at the start",
        "The relative velocity at the start is positive, so the distance between robot and object increases.",
        "An object that recedes can touch the robot only if it comes back later.",
        'Give the obstacle a negative velocity, for example `velocity = "-0.3 m/s"`.',
        "The object recedes at the start.",
    ),
    # --- design
    (
        "PT301",
        "The optimum lies on a bound",
        "The best gain in the range of `[gain]` is the first or the last one of the range.",
        "A gain outside of the range may be better.",
        "Widen `bounds`, unless the bound is a limit of your robot. If the message names the gain margin, read the "
        "sensor faster, or reduce the latency.",
        "the optimal gain lies on its bound -0.5 N s; a wider range may contain a better value",
    ),
    (
        "PT302",
        "The optimum lies at the edge of contact",
        "With a slightly stronger gain, the object does not reach the robot.",
        "A small error of the sensor decides whether there is a contact. The designed gain therefore keeps a distance "
        "of 1 % of the gain and the rounding of its printed digits.",
        "Limit the excursion, or use `pretouch robust`, which weighs both cases.",
        "the lowest objective lies at the edge of contact, D_p = -0.4458 N s: with a slightly stronger gain, the "
        "object is missed",
    ),
    (
        "PT303",
        "The uniform motion is approximate",
        "The method `uniform-motion`, L(16) to L(19), does not start from the given state.",
        "The optimal gain shifts, for example by 10 % in the letter's example.",
        "Use the method `auto` or `integration`.",
        "the uniform motion L(16)-(19) does not start from the given state",
    ),
    (
        "PT304",
        "The optimum depends on the noise of one run",
        "The gain was optimized on the sampled loop with one draw of the noise.",
        "Another run has another optimum.",
        "Use `design_robust_gain` with the same `evaluate`, which averages over runs.",
        "the gain is optimal only for the noise of one run; with other noise, another gain is optimal",
    ),
    (
        "PT305",
        "The gain moves the robot toward the object",
        "The optimal number of the law has the wrong sign for mitigation.",
        "The robot chases the object, and the contact is harder.",
        "Check signs of velocity and bounds: an approach is negative, and a mitigating D_p is negative.",
        "the optimal gain is positive, so the virtual force moves the robot toward the object",
    ),
    (
        "PT306",
        "The computed motion is less accurate than usual",
        "The impulse of the computed virtual force differs from the gain times the change of ln xi.",
        "Every exact motion fulfills this balance. A larger error means that the numbers have fewer correct digits.",
        "Check the curve for steps and kinks. If it has none, please report the scenario.",
        "the impulse balance of the computed motion has a relative error of 1e-07",
    ),
    (
        "PT307",
        "Encounters without contact",
        "With some gains the object does not reach the robot within the horizon or the range of the curve.",
        "Such gains have no contact speed, so the objective excludes them.",
        "Read the reason. Often the sensor curve starts too far out, or the velocity has the wrong sign.",
        "for 12 of 64 scanned gains, the encounter ended without contact",
    ),
    (
        "PT308",
        "No contact without mitigation",
        "With gain 0 the encounter does not end in contact.",
        "There is no contact speed to compare with.",
        "Check speed, position and horizon of the encounter.",
        "without mitigation the encounter does not end in contact",
    ),
    (
        "PT309",
        "Some random encounters have no contact",
        "In some of the fresh random encounters, the object does not reach the robot.",
        "The risk measure excludes these encounters, or is infinite.",
        "Truncate the distributions with `between`, or accept that some encounters end without contact.",
        "3 % of the fresh encounters end without contact: truncate the distributions, or accept these encounters",
    ),
    (
        "PT310",
        "A limit is missed in the validation",
        "On fresh samples, a limit is met less often than required, beyond what chance explains.",
        "The samples of the design were too few, so the gain fits them better than other encounters.",
        "Use more `samples`, or require a slightly larger probability.",
        "the excursion limit is met in only 93 % of the fresh samples (95 % required)",
    ),
    (
        "PT311",
        "The drag was designed for another approach",
        "The object accelerates, or is faster than the speeds for which the drag was designed.",
        "The ratio of contact speed to approach speed holds for a constant velocity within the designed range.",
        "Use the bound for accelerated approaches (`contact_speed_bound`), or raise `largest_speed`.",
        "the virtual drag was designed for approach speeds up to 0.5 m/s, but this object approaches at 0.8 m/s",
    ),
    (
        "PT312",
        "The lowest objective lies next to a jump",
        "At some gain, the objective, a limited quantity or the contact itself changes suddenly. The lowest objective "
        "lies directly next to this gain, for example because an object nearly stops just before the contact.",
        "A small error of the sensor or of the encounter decides which side of the jump occurs. The designed gain "
        "therefore keeps a distance of 1 % of the gain and the rounding of its printed digits.",
        "Compare the two values in the warning. Use `pretouch robust` with the uncertainty of the encounter, which "
        "weighs both sides.",
        "the lowest objective lies next to a jump at D_p = -0.4458 N s: contact at 0.03371 m/s with a slightly "
        "stronger gain, at 0 m/s with a weaker one",
    ),
    (
        "PT313",
        "No gain keeps a distance from a jump",
        "The optimum lies directly next to a jump of the objective, of a limited quantity or of contact, and the range "
        "of feasible gains is too narrow for a distance of 1 %.",
        "A small error of the sensor or of the encounter decides which side of the jump occurs.",
        "Relax a limit, or widen the bounds of the gain.",
        "the lowest objective lies next to a jump at D_p = -0.4458 N s. No feasible gain stays "
        "0.0047 N s (1 %) away from it",
    ),
    (
        "PT316",
        "An exported law is not verified",
        "The law was exported without a verification. Its gain may be 0, or may pull the robot toward the object.",
        "Nobody knows whether the law keeps its limits on the sampled loop, whether the loop is stable, and what noise "
        "or a broken cable does.",
        "Run `pretouch verify` with the same file and gain. If the gain holds, export the law again without "
        "`--unverified`.",
        "The exported law is not verified.",
    ),
    # --- sampled loop
    (
        "PT401",
        "There is no ideal gain",
        "The design in continuous time finds no gain that meets all limits and ends in contact.",
        "The verdict is about the gain that you gave, and there is no optimum to compare it with.",
        "Run `pretouch design`, which names the limits that conflict.",
        "The ideal design has no gain",
    ),
    (
        "PT402",
        "Controller and prediction use different admittances",
        "The virtual mass, damping or stiffness of the controller differ from those of the scenario.",
        "Simulated and predicted motions differ even with a perfect sensor.",
        "Use the same admittance in both.",
        "The controller and the prediction use different admittances",
    ),
    (
        "PT403",
        "The robot chases the object, or contact is harder",
        "With this gain the virtual force points toward the object, or the contact speed is higher than with gain 0.",
        "The gain does the opposite of mitigation.",
        "Check the sign of the gain. Then check noise, delay and stability of the loop.",
        "D_p = 0.5 N s makes the robot chase the object: mitigating gains are negative.",
    ),
    (
        "PT404",
        "A broken cable makes the robot jump",
        "Readings that fall suddenly look like a receding object, and the controller accepts them.",
        "The virtual damper then pulls the robot toward the object.",
        "Set `largest_rate` in `[controller]` to the value in the message: twice the largest rate of ln xi in an "
        "approach, plus noise. The controller then rejects a change of ln xi beyond `largest_rate` times one sensor "
        "period. If this lasts, the sensor is lost after `timeout`, and the law starts anew without the impulse of the "
        "jump. A fall that is smaller, from a weak signal to 0, is still believed: it moves the robot by at most "
        "the speed that `pretouch verify` reports as its bound. With a smaller value, the controller also rejects good "
        "readings.",
        "A broken sensor cable makes the robot jump toward the object",
    ),
    (
        "PT405",
        "The object is detected late, or never",
        "The first reading above the floor comes late, or no reading is above it.",
        "The law cannot act before detection, so the excursion is shorter and the contact harder.",
        "Lower the floor, reduce the noise, or use a faster sensor. See [a slow sensor](../how-to/slow-sensor.md).",
        "The object was never detected in 4 % of the runs: check floor, offset and sensor range.",
    ),
    (
        "PT406",
        "Noise moves a robot at rest",
        "Without any motion of the object, the noise of the readings moves the robot.",
        "The robot drifts or trembles while it waits near an object.",
        "Raise the floor to the value in the message, or use the virtual drag, which has a dead zone. With "
        "`approach_only`, do not set `release` below the range of the noise of ln xi: each rise of the noise would "
        "push the robot away, and no fall would return it.",
        "Sensor noise alone moves a robot at rest by up to 12 mm within 30 s",
    ),
    (
        "PT407",
        "The robot pushes after the impact",
        "The contact force after the impact is larger than without mitigation, or larger than at the impact itself.",
        "The drive or the admittance pulls the robot back toward the object while the object is still there.",
        "Let the controller yield to contact forces (`contact_gain`), or limit the force.",
        "After the impact, the robot's drive pushes with a mean peak force of 40 N",
    ),
    (
        "PT408",
        "The simulated impact force differs from the prediction",
        "The peak force of the impact is not that of an elastic impact of two free bodies.",
        "A limit of the impact force that was set for the prediction may be missed.",
        "Use the simulated force. Check stiffness and dissipation of `[contact]`.",
        "The simulated impact force is 1.4 times the predicted force of an elastic impact",
    ),
    (
        "PT409",
        "The controller reported a problem",
        "In some runs the controller set a flag: saturation, invalid or implausible readings, lost sensor, or a limit.",
        "While a flag is set, the virtual force is weaker than designed, or zero.",
        "Read which flag it is. Change amplification, `largest_rate`, `timeout` or the limits.",
        "In 3 % of the runs the sensor was saturated.",
    ),
    (
        "PT410",
        "Readings are missing",
        "After detection, an expected reading had not arrived at some controller steps.",
        "The virtual force fades while a reading is overdue.",
        "Check `dropout` and the timing of the sensor.",
        "After detection of the object, the expected sensor reading was missing in 2 % of the controller steps.",
    ),
    (
        "PT411",
        "The calibration is too small for a check",
        "The calibration has too few usable distances to draw other curves that fit the readings.",
        "The verdict cannot test the gain on the curves that the readings allow.",
        "Record more distances.",
        "The calibration has only 4 usable distances",
    ),
    (
        "PT412",
        "The loop is unstable, or close to it",
        "The gain is beyond the stability limit of the sampled loop at some distance, or its margin is below 2.",
        "An unstable loop oscillates: the robot bounces in front of the object.",
        "Weaken the gain, read the sensor faster, or reduce the delay. See [the robot bounces](../how-to/bounces.md).",
        "The gain margin of the sampled loop is only 1.3 at a distance of 0 mm; a gain margin of 2 is usual.",
    ),
    (
        "PT413",
        "Several contacts",
        "The robot and the object touch more than once.",
        "A later contact can be harder than the first.",
        "Check the stability and the reference: the admittance pulls the robot back after the first contact.",
        "There are 3 contacts; the first is the fastest.",
    ),
    (
        "PT414",
        "The virtual force is much larger than predicted",
        "Noise, slow readings or a loop close to instability cause peaks of the virtual force.",
        "The robot jerks, and its drive may saturate.",
        "Add a median filter, raise the floor, or weaken the gain.",
        "The virtual force reaches 80 N on the simulated loop, but only 20 N is predicted",
    ),
    (
        "PT415",
        "The gain has no effect",
        "The contact speed with the gain equals that without mitigation.",
        "The robot does not retreat before contact.",
        "Check that the object is detected, that the robot follows commands, and that the gain is not too weak.",
        "The gain has no effect in this run",
    ),
    (
        "PT416",
        "The exported law has no limits",
        "The controller has no limit of force, speed, acceleration or excursion.",
        "A faulty sensor can then move the robot as far as its drive allows.",
        "Set `largest_force` and `largest_excursion` in `[controller]`, and verify again.",
        "The law limits neither force nor motion",
    ),
    (
        "PT417",
        "The compared encounters differ",
        "The candidates of a comparison have different motions of the object or different limits.",
        "The lower contact speed may come from the slower object, and not from the better sensor or law.",
        "Use the same `[obstacle]` and `[constraints]` in all files.",
        "The candidates differ in the motion of the object",
    ),
    (
        "PT419",
        "A sensor that fails makes contact harder",
        "`pretouch verify` also simulates sensors that fail during an approach: a broken cable, an object that leaves "
        "the beam, a reflectance that doubles or halves, readings at full scale, and readings that are stuck. In some "
        "of these runs, contact is harder than without mitigation.",
        "The robot moves toward the object when the readings change for another reason than the motion of the object.",
        "Follow the message. `largest_rate` rejects jumps of the readings. `approach_only` with `release` as in the "
        "message never pulls the robot toward the object; the robot then does not follow a receding object.",
        "A sensor that fails makes contact harder than without mitigation: set approach_only = true and release = 0.11 "
        "in [controller].",
    ),
    (
        "PT421",
        "The controller detects the object elsewhere than the encounter starts",
        "The floor of the controller detects the object clearly before or after the start of the encounter. There is "
        "no such warning if both distances agree within 5 %, or if neither the predicted contact speed nor the largest "
        "excursion changes by 3 %.",
        "On the robot, the law acts from the detection distance. A design assumes that it acts from the start, and so "
        "do simulated runs that begin nearer. So gain, contact speed and excursion are those of another encounter.",
        "Set the start or the floor to the value in the message. If the object comes from farther away than it is "
        "detected, start the encounter at the detection distance, and set `start_distance` in `[loop]`.",
        "The floor of 100 detects the object at 164.5 mm, but the encounter starts at 42.2 mm: set position = "
        '"164.5 mm" in [obstacle], or set floor = 1980 in [controller].',
    ),
    (
        "PT423",
        "A part of a report is missing",
        "A figure or a section could not be drawn, or the report could not be written.",
        "The result does not depend on its report: printed numbers, JSON output and exit status are those of the "
        "computation. The exit status is 3 only if the report was requested with `--output` and was not written.",
        "Read the reason in the message. For a full disk or a missing permission, choose another path with "
        "`--output`. If a figure cannot be drawn, please report the scenario file and the message.",
        "The figure 'Measure over the gain' cannot be drawn. The reason is: ...",
    ),
    # --- robot models
    (
        "PT501",
        "The posture is close to a singularity",
        "In this direction the joints move a much larger mass than in the easiest direction.",
        "The robot follows the commanded motion less exactly, so simulation and prediction differ.",
        "Choose another posture or another axis.",
        "The posture is close to a singularity: choose another posture if a design needs more acceleration",
    ),
    (
        "PT502",
        "The model does not limit the forces",
        "Some actuators of the robot model have no force range.",
        "Acceleration and force then have no limit, and a design may ask for more than the robot can do.",
        "Add `forcerange` to the actuators of the model.",
        "The model does not limit the forces of all actuators",
    ),
    (
        "PT503",
        "Joints without an actuator",
        "Some joints of the robot model have no actuator.",
        "pretouch treats these joints as free, which changes the moved mass.",
        "Add the actuators, or lock the joints.",
        "No actuator moves these joints, so pretouch lets them move freely (wrist)",
    ),
    (
        "PT504",
        "The sensor leaves its axis",
        "While the robot moves back along the axis, the sensor also turns or moves sideways.",
        "The prediction is along one axis, so predicted and simulated contact speeds differ.",
        "Simulate the robot, or choose an axis and a posture in which the sensor moves straight.",
        "Per 100 mm of motion, the sensor turns by 4.1 deg and moves 12 mm off its axis: simulate the robot.",
    ),
    (
        "PT505",
        "A drive is at its limit",
        "In the simulation of the whole robot, a drive reaches its largest torque before contact.",
        "The robot then lags behind the commanded motion, and touches harder than predicted.",
        "Choose a weaker gain, another posture, or a stronger drive.",
        "At the site fingertip, a drive is at its limit during up to 36 % of the encounter",
    ),
    (
        "PT506",
        "The reference of a site stops before contact",
        "In the simulation of the whole robot, a joint range or a singularity ends the motion along the axis.",
        "The robot stops before the law has reduced the contact speed, and touches harder than predicted.",
        "Choose a weaker gain or a posture with a longer retreat.",
        "The reference motion of the site fingertip stops before contact, at a joint range: choose a weaker gain",
    ),
    (
        "PT507",
        "Prediction and simulation differ",
        "The contact speed of the simulated robot differs from the prediction by more than 5 %.",
        "A gain that was designed for one axis then does not have the designed effect on this robot.",
        "Rely on the simulation. Other warnings of the result name the reason, if it is known.",
        "At the site fingertip, the simulated contact speed is 12 % higher than the predicted contact speed",
    ),
    (
        "PT508",
        "Joints without a range",
        "Some hinges of the robot model have no range.",
        "pretouch treats them as turning without end, so the robot may have less room to retreat than stated.",
        "Add the range to each joint that has one.",
        "The model has no range for these hinges, so pretouch lets them turn without limit (elbow)",
    ),
    # --- recordings
    (
        "PT601",
        "A remark on the recording",
        "The file is truncated, parts of it are missing, or its clock was set back.",
        "Only the readable part was used.",
        "Record again if the part that you need is missing.",
        "The file bag.mcap is truncated or damaged; pretouch read only its beginning.",
    ),
    (
        "PT602",
        "A remark on the calibration that was recorded",
        "Lines could not be read, or the output drifted while it was recorded.",
        "A drift changes the curve, and skipped lines may hide a wrong column.",
        "Check sensor and object, and record the distance again.",
        "10 mm: the sensor output drifted during the recording; check sensor and object.",
    ),
    (
        "PT603",
        "Readings that the law cannot use",
        "Readings are saturated, not numbers, or nearer than the sensor can measure.",
        "The law ignores saturated readings and NaN. If the object is too near, the reading counts as the start of the "
        "curve.",
        "Reduce the amplification, and check the driver of the sensor.",
        "312 of 5,000 readings are saturated, and the law ignores them",
    ),
    (
        "PT604",
        "The times of the readings are wrong",
        "Readings arrive out of order, have equal times, or arrive faster than the controller takes them.",
        "The law uses the rate of change, so a wrong time results in a wrong force.",
        "Use the time stamps of the sensor, not of the arrival (`--clock header`).",
        "12 readings arrived too late, after readings with a later time stamp",
    ),
    (
        "PT605",
        "No reading was above the floor",
        "The recording contains no detection.",
        "Unit, offset or floor may be wrong, or no object came near.",
        "Check that the topic has the unit of the scenario, and that an object came near.",
        "No reading was above the noise floor (largest signal 12, noise floor 100)",
    ),
    (
        "PT606",
        "The sensor is slower than the scenario says",
        "The recorded rate is below that of `[chain]`.",
        "Stability and contact speed depend on the rate, so the verification does not hold.",
        "Put the measured section `[chain]` into the scenario (`--chain`), and verify again.",
        "The sensor is slower than the scenario says",
    ),
    (
        "PT607",
        "The sensor is noisier than the scenario says",
        "The recorded noise is larger than that of `[chain]`, or too large for the floor.",
        "Noise alone can be detected as an object, and the verification is too optimistic.",
        "Put the measured section `[chain]` into the scenario, and raise the floor.",
        "The recorded noise of 27 is 1.4 times the noise in the scenario",
    ),
    (
        "PT608",
        "The offset of the controller is wrong",
        "Without an object, the median reading differs from the offset that the controller subtracts.",
        "The difference acts like a signal, and the virtual force becomes too weak or too strong.",
        "Set `offset` in `[controller]` to the median.",
        "Without an object, the median reading is 152, but the controller subtracts the offset 120",
    ),
    (
        "PT609",
        "An object is detected nearly all the time",
        "The recording has hardly any time without a detection.",
        "A detection that never ends shows nothing about contacts: offset, floor or sign of the readings may be wrong.",
        "Check that the reading rises when the object comes near, and set offset and floor above the readings without "
        "an object.",
        "An object is detected in 100 % of the recording",
    ),
    # --- the letter
    (
        "PT901",
        "A finding about the letter is not confirmed",
        "The recomputation does not confirm one of the documented findings.",
        "Either the finding or the program is wrong.",
        "Please report it with the version of pretouch.",
        "Does not hold: finding 7",
    ),
    (
        "PT902",
        "A printed number is not explained",
        "A number of the letter differs from the computed one, and no reason is documented.",
        "Either the number is a misprint or the program is wrong.",
        "Please report it with the version of pretouch.",
        "Unexplained disagreement: Table II",
    ),
)

WARNING_CODES: Final[Mapping[str, WarningCode]] = MappingProxyType(
    {
        code: WarningCode(code=code, title=title, meaning=meaning, why=why, remedy=remedy, example=example)
        for code, title, meaning, why, remedy, example in _TABLE
    }
)
"""The explanations of all warnings by their codes."""

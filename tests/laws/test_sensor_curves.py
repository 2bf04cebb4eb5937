"""Laws of every sensor curve: g is the derivative of ln xi, and the valid range is respected.

Rounding is counted in units of EPS = 2^-53. The documented relative error of the Mittag-Leffler function is 1e-13.
"""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import Phase, assume, given
from hypothesis import strategies as st
from scipy.special import erfcx

from pretouch._core.errors import OutOfRangeError
from pretouch._core.units import parse_unit
from pretouch.motion.curve import curve_pieces
from pretouch.sensors import (
    CustomSensor,
    ExponentialFirstOrder,
    ExponentialSecondOrder,
    InversePower,
    MittagLeffler,
    PiecewiseCubic,
    Recessed,
    SensorModel,
    Table,
    mittag_leffler,
)
from properties import examples
from refusals import refused
from sensor_samples import RATE, SAMPLES, SCALE, concrete_sensors, distances, looked_at, rescaled

EPS = 2.0**-53
MITTAG_LEFFLER = 1e-13  # relative, as its docstring promises
EVERY_SENSOR = pytest.mark.parametrize("kind", concrete_sensors(), ids=lambda cls: cls.__name__)
LAW = examples(40)
TABLE_I = ExponentialSecondOrder(scale=0.480, rate=-74.0, curvature=474.0)


def test_no_sensor_class_was_forgotten_here() -> None:
    missing = [cls.__name__ for cls in concrete_sensors() if cls not in SAMPLES]
    assert not missing, f"add a strategy for {missing} to SAMPLES in tests/sensor_samples.py"
    assert set(SAMPLES) == set(concrete_sensors())


def _integral_of_slope(sensor: SensorModel, start: float, end: float) -> float:
    """Gauss's rule of 32 nodes from corner to corner, on panels that double in width.

    A panel is at most as wide as it is far from the start of the range, or 0.1 mm, where all curves here are analytic
    within 0.6 half widths or more: the rule leaves (0.6 + sqrt(1 + 0.36))^-64 < 1e-18 of the slope.
    """
    low, _ = sensor.valid_range
    inner = [e for e in (*(low + 1e-4 * 2.0 ** np.arange(11)), *sensor.knots) if start < e < end]
    edges = np.array([start, *sorted(inner), end])
    node, weight = np.polynomial.legendre.leggauss(32)
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    at = np.clip(middle[:, None] + half[:, None] * node, start, end)
    return float(np.sum(sensor.log_slope(at) @ weight * half))


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_g_is_the_derivative_of_ln_xi(kind: type[SensorModel], data: st.DataObject) -> None:
    """Between any two distances, ln xi changes by the integral of g, which an error of g anywhere would spoil."""
    sensor = data.draw(SAMPLES[kind])
    start, end = sorted(data.draw(st.tuples(distances(sensor), distances(sensor))))
    a, b = sensor.log_output(start), sensor.log_output(end)
    # both functions round, or are Mittag-Leffler's, whose ratio E'/E is g: two promises
    tolerance = (2 * MITTAG_LEFFLER + 8 * EPS) * (1 + abs(a) + abs(b))
    assert abs(b - a - _integral_of_slope(sensor, start, end)) <= tolerance


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_the_output_is_positive_and_never_grows_with_distance(kind: type[SensorModel], data: st.DataObject) -> None:
    sensor = data.draw(SAMPLES[kind])
    at = np.array(data.draw(st.lists(distances(sensor), min_size=1, max_size=30)))
    at = np.concatenate([at, np.linspace(*looked_at(sensor), 40), sensor.knots])
    output = sensor.output(at)
    assert (output > 0).all()
    assert np.isfinite(output).all()
    assert (sensor.log_slope(at) <= 0).all()


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_the_output_is_the_exponential_of_ln_xi(kind: type[SensorModel], data: st.DataObject) -> None:
    sensor = data.draw(SAMPLES[kind])
    distance = data.draw(distances(sensor))
    assert sensor.output(distance) == np.exp(sensor.log_output(distance))


@EVERY_SENSOR
@LAW
@given(data=st.data(), factor=st.floats(1e-6, 1e6))
def test_the_scale_of_xi_changes_neither_g_nor_a_difference_of_ln_xi(
    kind: type[SensorModel], data: st.DataObject, factor: float
) -> None:
    sensor = data.draw(SAMPLES[kind])
    other = rescaled(sensor, factor)
    near, far = data.draw(distances(sensor)), data.draw(distances(sensor))
    logs = [s.log_output(d) for s in (sensor, other) for d in (near, far)]
    # each ln xi rounds, and so do its terms, which cancel: all but |ln scale| < 20 is as large as ln xi and that
    rounding = 8 * EPS * (40 + max(map(abs, logs)) + abs(np.log(factor)))
    assert abs((logs[1] - logs[0]) - (logs[3] - logs[2])) <= rounding
    # a table divides differences of rounded ln xi by steps of 1 mm or more; all else leaves the scale out of g,
    # and a weighted harmonic mean of such quotients, or the formula at an end, is worth no more than three of them
    inner = sensor.sensor if isinstance(sensor, Recessed) else sensor
    allowed = 12 * rounding / 1e-3 if isinstance(inner, Table | PiecewiseCubic) else 0.0
    assert abs(sensor.log_slope(near) - other.log_slope(near)) <= allowed
    assert other.log_output(near) - sensor.log_output(near) == pytest.approx(np.log(factor), abs=rounding)


@pytest.mark.slow(keep=4)
@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_a_scalar_gives_a_float_and_an_array_its_own_shape(kind: type[SensorModel], data: st.DataObject) -> None:
    sensor = data.draw(SAMPLES[kind])
    distance = data.draw(distances(sensor))
    for function in (sensor.log_output, sensor.log_slope, sensor.output):
        one = function(distance)
        for scalar in (distance, np.float64(distance), np.array(distance)):
            assert type(function(scalar)) is float
        for shape in ((1,), (3,), (2, 3), (1, 2, 1), (0,), (2, 0)):
            many = function(np.full(shape, distance))
            assert isinstance(many, np.ndarray)
            assert many.shape == shape
            assert many.dtype == np.float64
            # vectorized functions may round otherwise, by an ulp of the largest term, 8 |ln 5e-4| = 61
            np.testing.assert_allclose(many, one, rtol=256 * EPS, atol=256 * EPS)
        assert function([distance]).shape == (1,)


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_outside_its_range_a_curve_says_nothing_and_names_the_range(
    kind: type[SensorModel], data: st.DataObject
) -> None:
    sensor = data.draw(SAMPLES[kind])
    low, high = sensor.valid_range
    outside = [low - data.draw(st.floats(1e-12, 1)), -np.inf, np.nan]
    if np.isfinite(high):
        outside += [high + data.draw(st.floats(1e-12, 1)) * (1 + high), np.inf]
    for distance in outside:
        assert not sensor.contains(distance)
        for function in (sensor.log_output, sensor.log_slope, sensor.output):
            for argument in (distance, [low, distance], [[distance], [low]]):
                with pytest.raises(OutOfRangeError) as refused:
                    function(argument)
                assert f"valid only from {low:g} m to {high:g} m" in str(refused.value)
                assert f"found {distance:g} m" in str(refused.value)
                assert sensor.name in str(refused.value)


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_the_ends_of_the_range_belong_to_it(kind: type[SensorModel], data: st.DataObject) -> None:
    sensor = data.draw(SAMPLES[kind])
    low, high = sensor.valid_range
    ends = [end for end in (low, high) if np.isfinite(end)]
    assert low in ends, "a distance cannot come from minus infinity"
    assert sensor.contains(ends).all()
    assert np.isfinite(sensor.log_output(ends)).all()
    assert np.isfinite(sensor.log_slope(ends)).all()


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_a_curve_is_a_value_that_cannot_change(kind: type[SensorModel], data: st.DataObject) -> None:
    sensor = data.draw(SAMPLES[kind])
    twin = replace(sensor)  # type: ignore[type-var]
    assert twin == sensor
    assert hash(twin) == hash(sensor)
    for field in fields(sensor):  # type: ignore[arg-type]
        with pytest.raises(FrozenInstanceError):
            setattr(sensor, field.name, 1.0)
    low, _ = sensor.valid_range
    assert replace(sensor, minimum_distance=low + 1e-6) != sensor  # type: ignore[type-var]
    with pytest.raises((FrozenInstanceError, AttributeError, TypeError)):  # nor does it take what it has no place for
        sensor.anything = 1.0  # type: ignore[attr-defined]


@pytest.mark.slow(keep=3)
@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_knots_lie_in_order_inside_the_range(kind: type[SensorModel], data: st.DataObject) -> None:
    whole = data.draw(SAMPLES[kind])
    a, b = sorted(data.draw(st.tuples(distances(whole), distances(whole))))
    assume(a < b)
    cut = replace(whole, minimum_distance=a, maximum_distance=b) if b > 0 else whole  # type: ignore[type-var]
    for sensor in (whole, cut):
        knots = np.array(sensor.knots)
        assert ((knots > sensor.valid_range[0]) & (knots < sensor.valid_range[1])).all()
        assert (np.diff(knots) > 0).all()
    assert set(cut.knots) == {k for k in whole.knots if cut.valid_range[0] < k < cut.valid_range[1]}


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_a_slope_is_declared_constant_exactly_where_it_is(kind: type[SensorModel], data: st.DataObject) -> None:
    sensor = data.draw(SAMPLES[kind])
    slope = sensor.log_slope(np.linspace(*looked_at(sensor), 30))
    if sensor.constant_log_slope is not None:
        assert (slope == sensor.constant_log_slope).all()
        return
    inner = sensor.sensor if isinstance(sensor, Recessed) else sensor
    if isinstance(
        inner, (InversePower, ExponentialSecondOrder)
    ):  # a table, or a user's function, may happen to be flat
        curvature = getattr(inner, "curvature", 1.0)
        assert np.ptp(slope) > 0 or abs(curvature) < 1e-9


@EVERY_SENSOR
@LAW
@given(data=st.data())
def test_parameters_are_the_declared_fields_in_si(kind: type[SensorModel], data: st.DataObject) -> None:
    sensor = data.draw(SAMPLES[kind])
    inner = sensor.sensor if isinstance(sensor, Recessed) else sensor
    declared = {f.name: f.metadata for f in fields(inner) if "unit" in f.metadata}  # type: ignore[arg-type]
    assert list(sensor.parameters) == [*declared, *(["recess"] if isinstance(sensor, Recessed) else [])]
    assert {type(v) for v in sensor.parameters.values()} <= {float}
    for name, metadata in declared.items():
        assert sensor.parameters[name] == getattr(inner, name)
        assert metadata["symbol"]
        assert parse_unit(metadata["unit"]).factor == 1.0, "in SI"


@EVERY_SENSOR
@examples(40, phases=(Phase.explicit, Phase.generate))  # noise takes minutes to shrink
@given(data=st.data())
def test_every_curve_is_smooth_enough_for_the_integrator(kind: type[SensorModel], data: st.DataObject) -> None:
    """The noise of g must stay below the 1e-13 of its largest value to which polynomials have to fit it."""
    sensor = data.draw(SAMPLES[kind])
    low, high = looked_at(sensor)
    pieces = curve_pieces(sensor, max(low, 0.0), high)
    assert len(pieces) < 400  # halved by noise, they come to twenty thousand and an error


@pytest.mark.parametrize("recess", [5e-324, 2.225073858507203e-309, 1e-30, 1e-12])
def test_a_recess_far_below_the_distances_of_a_table_needs_no_more_pieces(recess: float) -> None:
    """Tables as a random search has found them: l + recess has few digits where it starts, and g is noise there."""
    distances = (0.00811326182989237, 0.017166331273051326, 0.026219, 0.0375, 0.0577)
    table = Table(distances=distances, outputs=(1.0, 0.99996, 0.0030318925335737776, 8.4e-4, 1.8e-4))
    whole = Table(distances=tuple(d - distances[0] for d in distances), outputs=table.outputs)
    for sensor in (Recessed(sensor=table, recess=recess + distances[0]), Recessed(sensor=whole, recess=recess)):
        low, high = looked_at(sensor)
        assert len(curve_pieces(sensor, max(low, 0.0), high)) < 400


class TestLetterCurves:
    """The curves of the letter against their formulas at 40 digits."""

    @LAW
    @given(data=st.data(), sensor=SAMPLES[InversePower])
    def test_the_inverse_power_curve_is_l3(self, data: st.DataObject, sensor: InversePower) -> None:
        distance = data.draw(distances(sensor))
        with mpmath.workdps(40):
            exact = mpmath.log(sensor.scale) - sensor.exponent * mpmath.log(
                mpmath.mpf(distance) + sensor.distance_offset
            )
            size = abs(mpmath.log(sensor.scale)) + abs(exact - mpmath.log(sensor.scale)) + sensor.exponent
            assert abs(sensor.log_output(distance) - exact) <= 8 * EPS * size
            slope = -sensor.exponent / (mpmath.mpf(distance) + sensor.distance_offset)
            assert abs(sensor.log_slope(distance) / slope - 1) <= 4 * EPS

    @LAW
    @given(data=st.data(), sensor=SAMPLES[ExponentialFirstOrder] | SAMPLES[ExponentialSecondOrder])
    def test_the_exponential_curves_are_l5_and_l6(self, data: st.DataObject, sensor: SensorModel) -> None:
        distance = data.draw(distances(sensor))
        p = sensor.parameters
        with mpmath.workdps(40):
            d, c, b = (mpmath.mpf(v) for v in (distance, p["rate"], p.get("curvature", 0.0)))
            terms = (mpmath.log(p["scale"]), c * d, b * d**2)
            assert abs(sensor.log_output(distance) - sum(terms)) <= 8 * EPS * sum(map(abs, terms))
            assert abs(sensor.log_slope(distance) - (c + 2 * b * d)) <= 4 * EPS * (abs(c) + abs(2 * b * d))


class TestSecondOrder:
    def test_the_letters_curve_turns_around_at_78_mm_and_refuses_to_be_used_beyond(self) -> None:
        assert TABLE_I.turning_point == pytest.approx(0.07806, abs=5e-6)  # as printed: four digits
        assert TABLE_I.valid_range == (0.0, TABLE_I.turning_point)
        assert TABLE_I.log_slope(TABLE_I.turning_point) == pytest.approx(0.0, abs=74 * 2 * EPS)
        with refused("distance", error=OutOfRangeError, value=0.0781, limit=(0.0, 0.0780591)):
            TABLE_I.log_slope(0.0781)

    def test_a_range_behind_the_turning_point_is_refused(self) -> None:
        with refused("minimum_distance", value=0.08, limit=0.0780591):
            replace(TABLE_I, minimum_distance=0.08)

    def test_a_range_that_ends_before_the_turning_point_is_kept(self) -> None:
        assert replace(TABLE_I, maximum_distance=0.05).valid_range == (0.0, 0.05)

    @given(curvature=st.floats(-1e5, -1e-3))
    def test_a_curve_that_bends_the_other_way_never_turns_in_front_of_the_sensor(self, curvature: float) -> None:
        sensor = replace(TABLE_I, curvature=curvature)
        assert sensor.turning_point == np.inf
        assert sensor.valid_range == (0.0, np.inf)

    @given(curvature=st.floats(0, 1) | st.floats(0, 1e-12), rate=RATE, scale=SCALE, distance=st.floats(0, 0.1))
    def test_without_curvature_it_goes_over_into_the_first_order(
        self, curvature: float, rate: float, scale: float, distance: float
    ) -> None:
        first = ExponentialFirstOrder(scale=scale, rate=rate)
        second = ExponentialSecondOrder(scale=scale, rate=rate, curvature=curvature)
        assert second.contains(distance)  # the turning point, 5 / 2 m or farther, moves away
        rounding = 4 * EPS * (abs(rate) + abs(np.log(scale)) + 1)
        assert abs(second.log_slope(distance) - first.log_slope(distance)) <= 2 * curvature * distance + rounding
        assert abs(second.log_output(distance) - first.log_output(distance)) <= curvature * distance**2 + rounding
        flat = replace(second, curvature=0.0)
        assert flat.constant_log_slope == rate
        assert flat.log_slope(distance) == first.log_slope(distance)


class TestMittagLeffler:
    @given(z=st.floats(-700, 0))
    def test_of_order_one_it_is_the_exponential(self, z: float) -> None:
        value, derivative = mittag_leffler(1.0, np.array(z))
        assert value == derivative == np.exp(z)

    @given(data=st.data(), scale=SCALE, rate=RATE)
    @LAW
    def test_the_curve_of_order_one_is_the_first_order_exponential(
        self, data: st.DataObject, scale: float, rate: float
    ) -> None:
        exponential = ExponentialFirstOrder(scale=scale, rate=rate)
        curve = MittagLeffler(scale=scale, rate=rate, order=1.0)
        distance = data.draw(distances(curve))
        assert curve.log_output(distance) == exponential.log_output(distance)
        assert curve.log_slope(distance) == exponential.log_slope(distance)
        assert curve.constant_log_slope == rate

    @pytest.mark.parametrize("order", [1 - 1e-3, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12, 1 - 2**-53])
    def test_near_order_one_it_goes_over_into_the_exponential(self, order: float) -> None:
        """E_alpha(-x) = exp(-x) + (1 - alpha) r(x), and |r| <= 1 for all x > 0: r is about 1 / x, and -x ln x at 0."""
        x = np.geomspace(1e-3, 600, 300)
        value, _ = mittag_leffler(order, -x)
        assert (np.abs(value - np.exp(-x)) <= (1 - order) + MITTAG_LEFFLER * value).all()

    # the series needs |z|^(1/alpha) / ln 10 digits more than are left of its largest term
    @examples(60)
    @given(
        order=st.floats(0.1, 1, exclude_max=True) | st.floats(-12, -2).map(lambda e: 1 - 10**e), root=st.floats(0, 55)
    )
    def test_it_is_its_series(self, order: float, root: float) -> None:
        z = -(root**order)
        with mpmath.workdps(40 + int(1.2 * root)):
            argument, alpha, value, derivative = mpmath.mpf(z), mpmath.mpf(order), mpmath.mpf(0), mpmath.mpf(0)
            for k in range(int((3 * root + 120) / order)):
                term = argument**k / mpmath.gamma(alpha * k + 1)
                value += term
                # d/dz z^k / Gamma(alpha k + 1), one term ahead so that z = 0 needs no division
                derivative += (k + 1) * argument**k / mpmath.gamma(alpha * (k + 1) + 1)
                if k > 3 * root / order and abs(term) < mpmath.mpf(10) ** -35:
                    break
        found, slope = mittag_leffler(order, np.array(z))
        assert abs(found / value - 1) <= MITTAG_LEFFLER
        assert abs(slope / derivative - 1) <= MITTAG_LEFFLER

    @pytest.mark.parametrize("order", [0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.9999])
    def test_far_away_it_is_its_asymptotic_series(self, order: float) -> None:
        """Of the terms (-1)^(k-1) x^-k / Gamma(1 - alpha k), the first 24 leave less than 1e-24 of their sum at 600."""
        for x in (600.0, 5e3, 1e6):
            with mpmath.workdps(40):
                alpha, far = mpmath.mpf(order), mpmath.mpf(x)
                terms = [-((-far) ** -k) * mpmath.rgamma(1 - alpha * k) for k in range(1, 25)]
                value = sum(terms)
                derivative = sum(k * t for k, t in enumerate(terms, 1)) / far
            found, slope = mittag_leffler(order, np.array(-x))
            assert abs(found / value - 1) <= MITTAG_LEFFLER
            assert abs(slope / derivative - 1) <= MITTAG_LEFFLER

    def test_of_order_one_half_it_is_the_scaled_complementary_error_function(self) -> None:
        """E_1/2(-x) = exp(x^2) erfc(x); erfcx itself is good to a few EPS."""
        x = np.concatenate([[0.0], np.geomspace(1e-8, 1e8, 400)])
        value, derivative = mittag_leffler(0.5, -x)
        np.testing.assert_allclose(value, erfcx(x), rtol=1e-12)
        near = x < 1  # farther out 2 / sqrt(pi) - 2 x erfcx(x) loses its digits
        np.testing.assert_allclose(derivative[near], (2 / np.sqrt(np.pi) - 2 * x * erfcx(x))[near], rtol=1e-12)

    @pytest.mark.parametrize("accuracy", [1e-13, 1e-9])
    def test_many_orders_in_one_call_are_each_alone(self, accuracy: float) -> None:
        rng = np.random.default_rng(3)
        orders = np.append(rng.uniform(0.05, 1, 300), [1.0, 0.68, 0.69])
        arguments = -(10 ** rng.uniform(-3, 3, (len(orders), 7)))
        together = mittag_leffler(orders, arguments, accuracy=accuracy)
        for i, order in enumerate(orders):
            for many, one in zip(together, mittag_leffler(float(order), arguments[i]), strict=True):
                np.testing.assert_allclose(many[i], one, rtol=accuracy)

    @LAW
    @given(order=st.floats(0.05, 1) | st.floats(-12, -2).map(lambda e: 1 - 10**e), start=st.floats(0, 20))
    def test_it_is_completely_monotone(self, order: float, start: float) -> None:
        """The n-th difference over steps of one has the sign (-1)^n.

        It is at least n! x^-n = 2e-6 of the value for n = 5, far above the 2^n promises by which it may be off.
        """
        value, derivative = mittag_leffler(order, -(start + np.arange(6.0)))
        assert (derivative > 0).all()
        for n in range(1, 6):
            assert ((-1) ** n * np.diff(value, n) > 0).all()

    @pytest.mark.parametrize(
        ("order", "argument", "name"),
        [
            (0.0, -1.0, "order"),
            (1.1, -1.0, "order"),
            (np.nan, -1.0, "order"),
            (0.5, 1.0, "argument"),
            (0.5, [-1.0, np.nan], "argument"),
        ],
    )
    def test_what_it_is_not_defined_for_is_refused(self, order: float, argument: object, name: str) -> None:
        with refused(name):
            mittag_leffler(order, np.array(argument))


class TestRecessed:
    @LAW
    @given(data=st.data(), recessed=SAMPLES[Recessed])
    def test_it_is_a_shift(self, data: st.DataObject, recessed: Recessed) -> None:
        bare, distance = recessed.sensor, data.draw(distances(recessed))
        low, high = bare.valid_range
        own = min(max(distance + recessed.recess, low), high)  # which may round to just outside
        assert recessed.log_output(distance) == bare.log_output(own)
        assert recessed.log_slope(distance) == bare.log_slope(own)
        assert recessed.constant_log_slope == bare.constant_log_slope
        assert recessed.valid_range == (low - recessed.recess, high - recessed.recess)

    def test_no_recess_is_the_bare_curve(self) -> None:
        bare = Recessed(sensor=TABLE_I, recess=0.0)
        assert bare.valid_range == TABLE_I.valid_range
        assert bare.log_slope(0.03) == TABLE_I.log_slope(0.03)

    def test_a_recess_beyond_the_end_of_the_curve_is_refused(self) -> None:
        with refused("recess", value=0.1, limit=TABLE_I.turning_point):
            Recessed(sensor=TABLE_I, recess=0.1)

    def test_something_else_than_a_curve_is_refused(self) -> None:
        with refused("sensor", value=5):
            Recessed(sensor=5, recess=0.1)  # type: ignore[arg-type]


class TestTable:
    @LAW
    @given(table=SAMPLES[Table])
    def test_it_reproduces_its_points(self, table: Table) -> None:
        # ln and its interpolation round, each by EPS of ln xi, and exp turns that into a relative error of xi
        size = 1 + np.abs(np.log(table.outputs)).max()
        np.testing.assert_allclose(table.output(table.distances), table.outputs, rtol=8 * EPS * size)

    @LAW
    @given(table=SAMPLES[Table])
    def test_it_never_rises_between_its_points(self, table: Table) -> None:
        at = np.linspace(*table.valid_range, 400)
        log_output = table.log_output(at)
        # a cubic is a sum of four terms of the size of ln xi
        assert (np.diff(log_output) <= 8 * EPS * (1 + np.abs(log_output).max())).all()
        assert (table.log_slope(at) <= 0).all()
        outputs = table.output(at)
        assert outputs.min() >= min(table.outputs) * (1 - 1e-13)
        assert outputs.max() <= max(table.outputs) * (1 + 1e-13)

    @LAW
    @given(table=SAMPLES[Table])
    def test_its_slope_is_continuous_at_its_points(self, table: Table) -> None:
        for knot in table.knots:
            below, above = np.nextafter(knot, 0.0), np.nextafter(knot, 1.0)
            # over one unit of the last place the slope of a cubic changes by EPS times slope over width, at most
            assert table.log_slope(below) == pytest.approx(table.log_slope(above), rel=1e-11, abs=1e-9)

    def test_a_straight_line_in_ln_xi_is_the_exponential(self) -> None:
        at = np.linspace(0, 0.06, 7)
        exponential = ExponentialFirstOrder(scale=0.458, rate=-61.0)
        table = Table(distances=tuple(at), outputs=tuple(exponential.output(at)))
        between = np.linspace(0, 0.06, 101)
        # quotients of rounded differences, 61 * 0.01 of ln xi of size 5
        np.testing.assert_allclose(table.log_slope(between), -61.0, rtol=64 * EPS * 5 / 0.61)

    @pytest.mark.parametrize(
        ("distances", "outputs", "argument"),
        [
            (
                (0.0, 0.02, 0.01),
                (3.0, 2.0, 1.0),
                "distances",
            ),
            (
                (0.0, 0.01, 0.01),
                (3.0, 2.0, 1.0),
                "distances",
            ),
            (
                (0.0, 0.01, 0.02),
                (3.0, 1.0, 2.0),
                "outputs",
            ),
            (
                (0.0, 0.01, 0.02),
                (3.0, 2.0, 2.0),
                "outputs",
            ),
            ((0.0, 0.01), (1.0, 0.0), "outputs"),
            ((0.0, 0.01), (1.0, -1.0), "outputs"),
            ((0.0, np.nan), (2.0, 1.0), "distances"),
            ((0.0, 0.01), (2.0, np.inf), "outputs"),
            ((0.0, 0.01, 0.02), (2.0, 1.0), "outputs"),
            ((0.0,), (2.0,), "distances"),
            (0.0, 2.0, "distances"),
            (((0.0, 0.01), (0.02, 0.03)), (2.0, 1.0), "distances"),
            (("a", "b"), (2.0, 1.0), "distances"),
        ],
    )
    def test_what_is_no_falling_curve_is_refused(self, distances: object, outputs: object, argument: str) -> None:
        with refused(argument):
            Table(distances=distances, outputs=outputs)  # type: ignore[arg-type]


POWER = {"scale": 1.3e-5, "distance_offset": 0.0419, "exponent": 3.32}
FIRST = {"scale": 0.458, "rate": -61.0}


@pytest.mark.parametrize(
    ("kind", "parameters", "fields"),
    [
        (InversePower, POWER | {"scale": 0.0}, {"argument": "scale", "value": 0.0}),
        (InversePower, POWER | {"exponent": -1.0}, {"argument": "exponent", "value": -1.0}),
        (InversePower, POWER | {"exponent": np.inf}, {"argument": "exponent"}),
        (InversePower, POWER | {"exponent": "3"}, {"argument": "exponent", "value": "3"}),
        (InversePower, POWER | {"exponent": True}, {"argument": "exponent", "value": True}),
        (
            InversePower,
            POWER | {"exponent": (3.0, 4.0)},
            {"argument": "exponent"},
        ),
        (InversePower, POWER | {"distance_offset": 0.0}, {"argument": "distance_offset", "value": 0.0}),
        (InversePower, POWER | {"minimum_distance": -0.05}, {"argument": "distance_offset", "value": 0.0419}),
        (InversePower, POWER | {"minimum_distance": -np.inf}, {"argument": "minimum_distance"}),
        (InversePower, POWER | {"maximum_distance": np.nan}, {"argument": "maximum_distance"}),
        (InversePower, POWER | {"maximum_distance": "far"}, {"argument": "maximum_distance", "value": "far"}),
        (
            InversePower,
            POWER | {"maximum_distance": 0.0},
            {"argument": "maximum_distance", "value": 0.0, "limit": 0.0},
        ),
        (ExponentialFirstOrder, FIRST | {"rate": 61.0}, {"argument": "rate", "value": 61.0}),
        (ExponentialFirstOrder, FIRST | {"rate": 0.0}, {"argument": "rate", "value": 0.0}),
        (ExponentialSecondOrder, FIRST | {"curvature": np.nan}, {"argument": "curvature"}),
        (ExponentialSecondOrder, FIRST | {"rate": 1.0, "curvature": 1.0}, {"argument": "rate", "value": 1.0}),
        (MittagLeffler, FIRST | {"order": 0.0}, {"argument": "order", "value": 0.0, "limit": (0.0, 1.0)}),
        (MittagLeffler, FIRST | {"order": 1.5}, {"argument": "order", "value": 1.5, "limit": (0.0, 1.0)}),
        (
            MittagLeffler,
            FIRST | {"order": 0.5, "minimum_distance": -0.01},
            {"argument": "minimum_distance", "value": -0.01},
        ),
    ],
)
def test_parameters_that_make_no_curve_are_refused(
    kind: type[SensorModel], parameters: dict[str, object], fields: dict[str, Any]
) -> None:
    with refused(**fields):
        kind(**parameters)


def test_a_class_that_is_no_dataclass_is_never_taken_for_another_one_of_its_kind() -> None:
    """Curves are looked up by equality: with the fields of the base class alone, all such curves would be one."""

    class Homemade(SensorModel):
        def __init__(self, rate: float) -> None:
            super().__init__()
            object.__setattr__(self, "rate", rate)

        def _log_output(self, distance: np.ndarray) -> np.ndarray:
            return self.rate * distance

        def _log_slope(self, distance: np.ndarray) -> np.ndarray:
            return np.full_like(distance, self.rate)

    weak, strong = Homemade(-10.0), Homemade(-80.0)
    assert weak != strong
    assert curve_pieces(weak, 0.0, 0.1)[0, 2] == pytest.approx(-10.0, rel=1e-13)  # to which polynomials fit g
    assert curve_pieces(strong, 0.0, 0.1)[0, 2] == pytest.approx(-80.0, rel=1e-13)


def test_a_function_of_the_users_that_loses_the_shape_is_refused_where_it_is_used() -> None:
    flat = CustomSensor(log_output_function=lambda d: -40 * d, log_slope_function=lambda _: np.array(-40.0))
    with refused("sensor"):
        flat.log_slope([0.0, 0.01, 0.02])


def test_corners_of_a_users_curve_make_it_no_less_of_a_value() -> None:
    curve = CustomSensor(
        log_output_function=lambda d: -40 * d,
        log_slope_function=lambda d: np.full_like(d, -40.0),
        corners=[0.02, 0.01, 5.0],  # type: ignore[arg-type]
        maximum_distance=0.1,
    )
    assert curve.knots == (0.01, 0.02)
    assert hash(curve) == hash(replace(curve))

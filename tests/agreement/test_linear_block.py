"""The vectorized kernels compared with the guaranteed path and with arithmetic of 150 digits."""

import numpy as np
import pytest
from mpmath import mp, mpf

from pretouch._core.native import INTEGER, POINTER, address, kernel
from pretouch.motion import ContactStatus
from pretouch.motion.kernels import OPEN, find_contacts, solve_linear

CONTACT = ContactStatus.CONTACT
SLOPE, HORIZON = -61.0, 60.0
BATCH = 64  # encounters that are taken through one step before the next, with the widest vectors
MASS, DAMPING, STIFFNESS, X0, U0, P, V, A, GAIN = range(9)


def letter(n, seed=1):
    """The letter's plant and obstacle, at many speeds and gains."""
    rng = np.random.default_rng(seed)
    inputs = [np.array([x]) for x in (1.0, 10.0, 25.0, 0.0, 0.0, 0.0422, 0.0, 0.0, 0.0)]
    inputs[V], inputs[GAIN] = rng.uniform(-1, -0.05, n), rng.uniform(-2, -0.05, n)
    return inputs


def scattered(n, seed, kind):
    """Encounters over many decades; each kind bends one assumption of the closed form."""
    rng = np.random.default_rng(seed)

    def spread(low, high):
        return np.exp(rng.uniform(np.log(low), np.log(high), n))

    def some(share, values):
        return np.where(rng.random(n) < share, values, 0.0)

    mass, damping, coupling = spread(0.1, 100), spread(0.1, 1e3), spread(1e-7, 1e4)
    coupling *= np.where(rng.random(n) < 0.2, -1, 1)
    p, v = spread(1e-3, 1), -spread(1e-2, 10)
    critical = (damping + coupling) ** 2 / (4 * mass)
    stiffness = critical * some(0.9, spread(1e-8, 3.0))
    x0, u0, a = np.zeros(n), np.zeros(n), np.zeros(n)
    if kind == "moving plant":
        x0, u0 = p * some(0.7, rng.uniform(-2, 0.99, n)), v * some(0.7, rng.uniform(-1.2, 1.2, n))
    elif kind == "near critical":
        stiffness = critical * (1 + spread(1e-16, 1e-3) * rng.choice([-1, 0, 1], n))
        x0, u0 = p * some(0.5, rng.uniform(-1, 0.9, n)), v * some(0.5, rng.uniform(-1, 1, n))
    elif kind == "any obstacle":
        v, a = v * rng.choice([-1, 1], n), some(0.5, rng.normal(size=n))
    return [mass, damping, stiffness, x0, u0, p, v, a, coupling / SLOPE]


KINDS = ("at rest", "moving plant", "near critical", "any obstacle")


def solve(inputs, n=None, horizon=HORIZON):
    n = max(x.size for x in inputs) if n is None else n
    time, status = np.full(n, 7.0), np.full(n, 7, np.int8)
    find_contacts(inputs, SLOPE, horizon, time, status)
    return time, status


def at_contacts(inputs, time, status, **wanted):
    """Fill what is wanted of contacts that are found."""
    find_contacts(inputs, SLOPE, HORIZON, time, status, solved=True, **wanted)


def guaranteed(inputs):
    rows = np.broadcast_arrays(*inputs)
    values = np.zeros((rows[0].size, 10))
    values[:, :8] = np.transpose(rows[:8])
    out, status = np.empty((rows[0].size, 15)), np.empty(rows[0].size, np.int64)
    solve_linear(values, SLOPE, np.ascontiguousarray(rows[GAIN]), (HORIZON, 0.0, np.inf), out, status=status)
    return out, status


def motion(q, slope, t):
    """x~, x~', x~'', l, l', the integral of x~, by the textbook in 150 digits: cosh and sinh may be complex."""
    mass, damping, stiffness, x0, u0, p, v, a, gain = q
    coupling = slope * gain
    stiffness = stiffness or mpf(10) ** -40
    sigma, square = (damping + coupling) / (2 * mass), stiffness / mass
    root = mp.sqrt(mp.mpc(sigma**2 - square)) or mpf(10) ** -40
    h = (mp.exp(-sigma * t) * mp.sinh(root * t) / root).real
    slope_h = (mp.exp(-sigma * t) * mp.cosh(root * t)).real - sigma * h
    f = (1 - slope_h - 2 * sigma * h) / square
    f3 = (t - h - 2 * sigma * f) / square
    f4 = (t**2 / 2 - f - 2 * sigma * f3) / square
    force, rate = (coupling * v - stiffness * x0) / mass, coupling * a / mass
    y, y1 = x0 + u0 * h + force * f + rate * f3, u0 * slope_h + force * h + rate * f
    y2 = (coupling * (v + a * t) - (damping + coupling) * y1 - stiffness * y) / mass
    return y, y1, y2, p + v * t + a * t * t / 2 - y, v + a * t - y1, x0 * t + u0 * f + force * f3 + rate * f4


def root(q, slope, t):
    for _ in range(9):
        y = motion(q, slope, t)
        t -= y[3] / y[4]
    return t


def exact(numbers):
    return [mpf(float(x)) for x in numbers]


@pytest.fixture(autouse=True)
def many_digits():
    with mp.workdps(150):
        yield


def exponentials(x):
    """What the kernels have of each x <= 0, one row each: pairs of e^x and 1 - e^x in three ways, and ln(1 - x)."""
    x = np.ascontiguousarray(x, dtype=np.float64)
    out = np.empty((10, x.size))
    kernel("exponentials", POINTER, INTEGER, POINTER)(address(x), x.size, address(out))
    exact, parts, phi, rough = out[:2], out[2:4], out[4:7], out[7:9]
    return exact, parts, phi, rough, out[9]


def test_the_exponential_is_right_to_a_few_units_of_the_last_digit():
    rng = np.random.default_rng(9)
    places = np.array([*-np.exp(rng.uniform(np.log(1e-18), np.log(708), 500)), -0.0, -708.0])
    exact, parts, (second, third, near), rough, _ = exponentials(places)
    for i, x in enumerate(places):
        true, rest = mp.exp(mpf(float(x))), -mp.expm1(mpf(float(x)))
        for found in (exact[:, i], parts[:, i]):
            assert abs(mpf(float(found[0])) - true) <= 4e-16 * true  # two units of 2.2e-16 of a number just above 2^n
            assert abs(mpf(float(found[1])) - rest) <= 4e-16 * rest
        assert abs(mpf(float(rough[1, i])) - rest) <= 1e-5 * rest
        assert near[i] == 1 or x < -0.34
        if near[i] and x < -1e-6:  # the same functions by their definition, in many digits
            phi = (true - 1 - mpf(float(x))) / mpf(float(x)) ** 2
            assert abs(mpf(float(second[i])) - phi) <= 4e-16
            assert abs(mpf(float(third[i])) - (phi - mpf(0.5)) / mpf(float(x))) <= 4e-15
    (value, _), *_ = exponentials([-1e5, np.nan])
    assert value[0] < 1e-300
    assert np.isnan(value[1])


def test_the_rough_logarithm_is_good_to_nine_digits():
    """The error of its polynomial in s, |s| <= 0.1716, is 2 s^13 / 13: 2e-11 of 2 s."""
    rng = np.random.default_rng(2)
    x = np.array([0.0, 1e-300, *10 ** rng.uniform(-18, 250, 2000)])
    np.testing.assert_allclose(exponentials(-x)[4], np.log1p(x), rtol=1e-9, atol=0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_contact_that_is_claimed_is_the_first_one_of_the_guaranteed_path(kind):
    inputs = scattered(6000, 3, kind)
    time, status = solve(inputs)
    rows, states = guaranteed(inputs)
    claimed = status == CONTACT
    assert np.all(states[claimed] == CONTACT)
    # 2e-11 is proved; the guaranteed path may lose digits where l' is small
    np.testing.assert_allclose(time[claimed], rows[claimed, 0], rtol=1e-9)
    assert np.all(np.isnan(time[~claimed]))
    assert np.all(status[~claimed] == OPEN)


@pytest.mark.parametrize(("kind", "least"), [("at rest", 0.99), ("moving plant", 0.9), ("near critical", 0.7)])
def test_most_over_damped_contacts_are_claimed(kind, least):
    inputs = scattered(6000, 4, kind)
    _, status = solve(inputs)
    _, states = guaranteed(inputs)
    total = inputs[DAMPING] + SLOPE * inputs[GAIN]
    fits = (total > 0) & (total**2 >= 4 * inputs[MASS] * inputs[STIFFNESS]) & (states == CONTACT)
    assert np.mean(status[fits] == CONTACT) > least


def test_the_work_of_the_letter_is_claimed_whole():
    inputs = letter(20_000)
    time, status = solve(inputs)
    rows, states = guaranteed(inputs)
    assert np.all(states == CONTACT)
    assert np.mean(status == CONTACT) >= 0.999
    np.testing.assert_allclose(time, rows[:, 0], rtol=2e-11)


@pytest.mark.parametrize("gain", [-1e-3, -1e-6, -1e-9, -1e-14, 0.0])
def test_a_gain_that_leaves_the_plant_of_the_letter_hardly_over_damped_is_no_obstacle(gain):
    inputs = letter(100)
    inputs[GAIN] = np.array([gain])
    time, status = solve(inputs)
    assert np.all(status == CONTACT)
    np.testing.assert_allclose(time, guaranteed(inputs)[0][:, 0], rtol=2e-11)


@pytest.mark.parametrize("kind", KINDS[:3])
def test_times_and_states_agree_with_arithmetic_of_many_digits(kind):
    inputs = scattered(400, 5, kind)
    time, status = solve(inputs)
    out = np.empty((5, 400))
    at_contacts(inputs, time, status, states=out)
    for i in np.flatnonzero(status == CONTACT)[:150]:
        q = exact(x[i] for x in inputs)
        t = mpf(float(time[i]))
        assert abs(root(q, mpf(SLOPE), t) / t - 1) < 2e-11  # the proof's own bound
        y, y1, y2, _, l1, integral = motion(q, mpf(SLOPE), t)
        coupling = mpf(SLOPE) * q[GAIN]
        # a plant without stiffness would follow with c v / (D + c); the rest of a small D + c is a large one
        speed = float(abs(q[V]) * (1 + abs(coupling) / (q[DAMPING] + coupling)) + abs(q[U0]))
        length = speed * time[i] + float(abs(q[X0]))
        rate = float((abs(q[DAMPING]) + abs(coupling)) / q[MASS] + mp.sqrt(q[STIFFNESS] / q[MASS]))
        scales = (length, speed + rate * float(abs(q[X0])), 0.0, 0.0, length * time[i])
        scales = (*scales[:2], scales[1] * rate, scales[1], scales[4])
        for k, true in enumerate((y, y1, y2, l1, integral)):
            # some ten roundings of 1.1e-16, each of terms as large as these scales
            assert abs(float(true - mpf(float(out[k, i])))) < 1e-13 * scales[k], (k, i)


def scales_of(q, t):
    """By how much each input would have to change to change the motion by its own size."""
    speed = abs(q[V]) + abs(q[U0])
    total = q[DAMPING] + abs(SLOPE * q[GAIN])
    return (
        *(q[MASS], total, max(q[STIFFNESS], total / t / 100)),
        *(q[P], speed, q[P], speed, speed / t),
        *(total / abs(SLOPE), total / abs(q[GAIN])),
    )


def differences(q, t):
    """Derivatives of t, x~, l' at contact to the nine inputs and the slope by central differences."""
    columns = []
    for k, scale in enumerate(scales_of(q, t)):
        ends = []
        for sign in (1, -1):
            moved, slope = list(q), mpf(SLOPE)
            if k < 9:
                moved[k] += sign * scale * mpf(10) ** -25
            else:
                slope += sign * scale * mpf(10) ** -25
            end = root(moved, slope, t)
            y = motion(moved, slope, end)
            ends.append((end, y[0], y[4]))
        columns.append([float((b - c) / (2 * mpf(10) ** -25)) for b, c in zip(*ends, strict=True)])
    return np.transpose(columns)  # to each input, times its scale


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["letter", *KINDS[:3]])
def test_gradients_are_the_differences_of_many_digits(kind):
    inputs = [np.array(x) for x in np.broadcast_arrays(*letter(60))] if kind == "letter" else scattered(60, 6, kind)
    time, status = solve(inputs)
    gradients = np.empty((3, 10, 60))
    at_contacts(inputs, time, status, gradients=gradients)
    chosen = np.flatnonzero(status == CONTACT)[:25]
    for i in chosen:
        q = exact(x[i] for x in inputs)
        t = root(q, mpf(SLOPE), mpf(float(time[i])))
        expected = differences(q, t)
        found = gradients[:, :, i] * [float(x) for x in scales_of(q, t)]
        y = motion(q, mpf(SLOPE), t)
        # the time itself is known to 2e-11 and derivatives change with it over no less than 1 / mu_2
        stretch = float(1 + t * (abs(q[DAMPING]) + abs(SLOPE * q[GAIN])) / q[MASS])
        floor = np.array([float(t), float(abs(y[0]) + q[P]), float(abs(q[V]) + abs(q[U0]))])
        error = np.abs(found - expected) / (np.abs(expected) + floor[:, None])
        assert error.max() < 1e-10 * stretch, (kind, i)
        assert kind != "letter" or error.max() < 1e-8


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("which", range(9))
def test_what_is_no_number_is_never_claimed(bad, which):
    for single in (False, True):
        inputs = letter(40)
        inputs[which] = np.full(1 if single else 40, bad)
        _, status = solve(inputs)
        assert np.all(status == OPEN)


def test_what_breaks_an_assumption_is_left_open():
    for which, value in (
        (V, 0.0),
        (V, 0.3),
        (A, 1e-9),
        (DAMPING, -500.0),
        (GAIN, 0.1),
        (P, 0.0),
        (P, -1.0),
        (MASS, 0.0),
    ):
        inputs = letter(20)
        inputs[which] = np.array([value])
        assert np.all(solve(inputs)[1] == OPEN), (which, value)


def test_a_contact_beyond_the_horizon_is_left_open():
    inputs = letter(500)
    time, _ = solve(inputs)
    middle = float(np.median(time))
    _, status = solve(inputs, horizon=middle)
    np.testing.assert_array_equal(status == CONTACT, time <= middle)


def everything(inputs, n):
    """Times, statuses and all that is found beside them, one column per encounter."""
    time, status = np.empty(n), np.empty(n, np.int8)
    states, again, gradients = np.empty((5, n)), np.empty((5, n)), np.empty((3, 10, n))
    times, approach, statuses = np.empty(n), np.empty(n), np.empty(n, np.int8)
    find_contacts(inputs, SLOPE, HORIZON, time, status, states=states)
    find_contacts(inputs, SLOPE, HORIZON, times, statuses, approach=approach)
    np.testing.assert_array_equal(times, time)
    np.testing.assert_array_equal(statuses, status)
    at_contacts(inputs, time, status, states=again)
    at_contacts(inputs, time, status, gradients=gradients)
    return np.vstack([time, status, approach, states, again, gradients.reshape(30, n)])


@pytest.mark.parametrize("n", [0, 1, 2, 7, 8, 9, BATCH - 1, BATCH, BATCH + 1, 2 * BATCH + 9])
def test_the_place_of_an_encounter_changes_no_bit(n):
    inputs = scattered(2 * BATCH + 9, 8, "moving plant")
    whole = everything(inputs, 2 * BATCH + 9)
    which = np.random.default_rng(n).permutation(2 * BATCH + 9)[:n]
    np.testing.assert_array_equal(everything([x[which] for x in inputs], n), whole[:, which])


@pytest.mark.parametrize("kind", KINDS)
def test_states_of_the_same_pass_are_those_at_the_times_found(kind):
    inputs = scattered(500, 12, kind)
    time, status = solve(inputs)
    wider, alone = np.full((5, 507), 7.0), np.empty((5, 500))
    again, approach, same = np.empty(500), np.empty(500), np.empty(500, np.int8)
    find_contacts(inputs, SLOPE, HORIZON, again, same, approach=approach, states=wider[:, 4:504])
    at_contacts(inputs, time, status, states=alone)
    np.testing.assert_array_equal(again, time)
    np.testing.assert_array_equal(same, status)
    assert (wider[:, [0, 3, 504, 506]] == 7).all()
    together = wider[:, 4:504]
    np.testing.assert_array_equal(np.isnan(together), np.isnan(alone))
    mass, damping, _, x0, u0, p, v, _, gain = np.abs(inputs)
    rate = (damping + np.abs(SLOPE) * gain) / mass
    speed = v + u0 + rate * (x0 + p)
    sizes = np.stack([x0 + p + speed * time, speed, speed * rate, speed, (x0 + p + speed * time) * time])
    # rates that are made by another division differ by some ten roundings
    assert (np.abs(together - alone) <= 1e-13 * sizes)[:, status == CONTACT].all()
    assert (np.abs(approach - alone[3]) <= 1e-13 * speed)[status == CONTACT].all()


def test_gradients_of_the_same_pass_are_those_at_the_times_found():
    time, status, gradients = np.empty(500), np.empty(500, np.int8), np.empty((2, 3, 10, 500))
    find_contacts(letter(500), SLOPE, HORIZON, time, status, gradients=gradients[0])
    at_contacts(letter(500), time, status, gradients=gradients[1])
    # as above, and what is a difference of larger numbers
    sizes = np.abs(gradients[1]).max(axis=-1, keepdims=True)
    assert (np.abs(gradients[0] - gradients[1]) <= 1e-13 * sizes).all()


def test_one_value_for_all_equals_the_same_value_for_each():
    one = letter(1000)
    each = [np.array(x) for x in np.broadcast_arrays(*one)]
    np.testing.assert_array_equal(solve(one)[0], solve(each)[0])
    time, status = solve(one)
    states, gradients = np.empty((2, 5, 1000)), np.empty((2, 3, 10, 1000))
    for k, inputs in enumerate((one, each)):
        at_contacts(inputs, time, status, states=states[k], gradients=gradients[k])
    np.testing.assert_array_equal(states[0], states[1])
    np.testing.assert_array_equal(gradients[0], gradients[1])


def test_what_is_open_has_no_state_and_no_gradient():
    inputs = letter(10)
    inputs[A] = np.array([0, 1.0] * 5)
    time, status = solve(inputs)
    states, gradients = np.empty((5, 10)), np.empty((3, 10, 10))
    at_contacts(inputs, time, status, states=states, gradients=gradients)
    for out in (time, *states, *gradients.reshape(30, 10)):
        np.testing.assert_array_equal(np.isnan(out), status == OPEN)

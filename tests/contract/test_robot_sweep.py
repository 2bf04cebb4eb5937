"""Encounters of a whole robot in many postures and directions and with many objects, as a sweep that resumes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pretouch as pt
from pretouch.robots import SensorSite, SiteLaw, load_model, make_data, random_postures, simulate_robot, sweep_robot
from pretouch.robots.scene import Ball, model_with_ball, put_ball
from pretouch.robots.sweep import RobotPlan
from refusals import refused
from robot_scenes import ARM, CURVE, DISTANCE, SLIDE, arm_with_ball, controller, share, slide_with_ball

mujoco = pytest.importorskip("mujoco", reason="needs the extra 'mujoco'")
xr = pytest.importorskip("xarray", reason="needs the extra 'sweep'")
pytest.importorskip("zarr", reason="needs the extra 'sweep'")

COUNT = 10  # three chunks
CHUNK = 4
LAW = SiteLaw(site=SensorSite("fingertip", CURVE), controller=controller())


def request(count: int = COUNT) -> dict[str, Any]:
    rng = np.random.default_rng(4)
    objects = {
        "distance": DISTANCE,
        "velocity": rng.uniform(-0.6, -0.3, count),
        "radius": rng.uniform(0.02, 0.05, count),
        "mass": rng.uniform(0.1, 1.0, count),
        "offset": rng.uniform(-0.005, 0.005, count),
    }
    postures = random_postures(load_model(ARM), LAW.site, count, seed=2)
    directions = [("+x", "+z", "-z")[i % 3] for i in range(count)]
    return {"path": ARM, "law": LAW, "postures": postures, "objects": objects, "directions": directions, "seed": 3}


@pytest.fixture(autouse=True, scope="module")
def small_chunks() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pretouch.robots.sweep._CHUNK", CHUNK)
        yield


@pytest.fixture(scope="module")
def dataset() -> Any:
    return sweep_robot(**request())


def fields_of(model: Any) -> dict[str, Any]:
    names = [name for name in dir(model) if not name.startswith("_")]
    arrays = {name: getattr(model, name) for name in names}
    return {name: value for name, value in arrays.items() if isinstance(value, np.ndarray)}


def test_a_ball_of_another_size_is_that_of_a_compiled_model() -> None:
    model = model_with_ball(ARM, gravity=False)
    data = make_data(model)
    changed, _ = put_ball(model, data, LAW.site, Ball(distance=0.1, velocity=-0.3, radius=0.02, mass=0.7))
    spec = mujoco.MjSpec.from_file(str(ARM))
    for key in list(spec.keys):
        spec.delete(key)
    body = spec.worldbody.add_body(name="pretouch ball", gravcomp=1.0)
    body.add_freejoint()
    kind = mujoco.mjtGeom.mjGEOM_SPHERE
    touching = {"contype": 3, "conaffinity": 3, "rgba": [0.9, 0.6, 0.2, 1.0]}
    body.add_geom(name="pretouch ball", type=kind, size=[0.02, 0, 0], mass=0.7, **touching)
    expected = fields_of(spec.compile())
    for name, value in fields_of(changed).items():
        np.testing.assert_allclose(value, expected[name], rtol=1e-12, atol=1e-15, err_msg=name)


@pytest.mark.slow
def test_each_encounter_is_one_of_simulate_robot(dataset: Any) -> None:
    """The ball is at the same place as one that a test adds as text; the joints, the noise and the law are the same."""
    asked = request()
    count = 0
    for i in np.flatnonzero(dataset["status"].values == 0)[:4]:
        site = SensorSite("fingertip", CURVE, axis=asked["directions"][i])
        row = {name: float(asked["objects"][name][i]) for name in ("velocity", "radius", "mass", "offset")}
        start = put_ball(
            *(model_with_ball(ARM, gravity=False), make_data(load_model(ARM), asked["postures"][i]), site),
            Ball(distance=DISTANCE, **row),
        )
        noise = int(dataset["noise_seed"][i])
        run = simulate_robot(*start, [SiteLaw(site=site, controller=controller())], seed=noise)
        for name, quantity in (("relative_velocity", "relative_velocity"), ("excursion", "excursion")):
            assert run.simulated("fingertip", quantity)[0] == float(dataset[name][i])
            assert run.predicted("fingertip", quantity)[0] == float(dataset[f"predicted_{name}"][i])
        count += 1
    assert count


@pytest.mark.slow
def test_a_ball_on_the_axis_meets_the_arm_as_in_a_scene_of_its_own() -> None:
    model = load_model(ARM)
    posture = dict(zip(("shoulder", "elbow", "wrist"), make_data(model, keyframe="bent").qpos.tolist(), strict=True))
    objects = {"distance": DISTANCE, "velocity": -0.4}
    found = sweep_robot(ARM, LAW, [posture], objects, results=["relative_velocity", "excursion", "time"])
    own = simulate_robot(*arm_with_ball("bent", 0.4, timestep=5e-4), [LAW])
    for name in ("relative_velocity", "excursion", "time"):
        assert share([float(found[name][0])], own.simulated("fingertip", name)) < 1e-9


def test_a_robot_on_a_floating_base_falls_with_its_ball(tmp_path: Path) -> None:
    path = tmp_path / "slide.xml"
    path.write_text(SLIDE.format(base="<freejoint/>", mass=5.0, gravity="0 0 -9.81"))
    law = SiteLaw(site=SensorSite("tip", CURVE), controller=controller())
    found = sweep_robot(path, law, [{"slide": 0.0}], {"distance": DISTANCE, "velocity": -0.3})
    own = simulate_robot(*slide_with_ball(5.0, 0.3, gravity=9.81), [law])
    assert share([float(found["relative_velocity"][0])], own.simulated("tip", "relative_velocity")) < 1e-9
    assert share([float(found["relative_velocity"][0])], found["predicted_relative_velocity"].values) < 0.01


@pytest.mark.slow
def test_the_dataset_has_units_and_predictions_that_hold(dataset: Any) -> None:
    assert dataset["status"].attrs["flag_meanings"].split() == ["contact", "no_contact", "refused", "touched_elsewhere"]
    assert dataset["excursion"].attrs["units"] == "m"
    assert dataset["posture.elbow"].attrs["units"] == "rad"
    assert dataset["object.mass"].attrs["units"] == "kg"
    touched = dataset["status"].values == 0
    assert touched.sum() >= COUNT // 2
    forward = touched & (dataset["direction.x"].values == 1)  # across its axis, the finger is wider than its site
    ratio = dataset["relative_velocity"].values[forward] / dataset["predicted_relative_velocity"].values[forward]
    assert forward.sum() >= 4
    assert abs(np.nanmedian(ratio) - 1) < 0.01  # a few of them reach a joint range
    assert np.isnan(dataset["relative_velocity"].values[~touched]).all()


def test_a_figure_names_the_results_of_the_robot(dataset: Any) -> None:
    figure = pt.plots.sweep(dataset, ["excursion", "predicted_relative_velocity"])
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert any("predicted" in label and "m/s" in label for label in labels)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["zarr", "nc"])
def test_an_interrupted_sweep_resumes(dataset: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix) -> None:
    if suffix == "nc":
        pytest.importorskip("h5netcdf", reason="needs the extra 'sweep'")
    output = tmp_path / f"runs.{suffix}"
    monkeypatch.setattr("pretouch.sweeps.run.chunks_per_block", lambda *_, **__: 1)
    finished: list[int] = []

    def give_up(progress: Any) -> None:
        finished.append(progress.finished)
        if progress.finished >= CHUNK:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep_robot(**request(), output=output, progress=give_up)
    assert finished == [0, CHUNK]
    computed: list[int] = []
    evaluate = RobotPlan.evaluate

    def noting(plan: RobotPlan, region: Any) -> Any:
        computed.append(region[0].start)
        return evaluate(plan, region)

    monkeypatch.setattr(RobotPlan, "evaluate", noting)
    steps: list[Any] = []
    resumed = sweep_robot(**request(), output=output, progress=steps.append)
    assert computed == [CHUNK, 2 * CHUNK]
    assert [(p.finished, p.total) for p in steps] == [(4, 10), (8, 10), (10, 10)]
    for name in dataset.data_vars:
        np.testing.assert_array_equal(resumed[name].values, dataset[name].values)
    changed = request() | {"law": SiteLaw(site=LAW.site, controller=controller(-0.5))}
    with pytest.raises(pt.errors.OutputExistsError, match="law"):
        sweep_robot(**changed, output=output)


@pytest.mark.slow
def test_a_cluster_computes_the_same(dataset: Any, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="needs the extra 'dask'")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        found = sweep_robot(**request(), output=tmp_path / "runs.zarr", dask=client)
    for name in dataset.data_vars:
        np.testing.assert_array_equal(found[name].values, dataset[name].values)


def test_a_model_that_is_loaded_again_is_the_same_for_the_record() -> None:
    def content() -> str:
        model = model_with_ball(ARM, gravity=False)
        buffer = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
        mujoco.mj_saveModel(model, None, buffer)
        return hashlib.sha256(buffer.tobytes()).hexdigest()

    assert content() == content()


def test_encounters_that_cannot_start_are_refused_and_counted() -> None:
    asked = request(2)
    inside = asked | {"objects": asked["objects"] | {"offset": [0.0, 0.0], "radius": [0.02, 3.0]}}
    found = sweep_robot(**inside)
    assert found["status"].values[1] == 2
    assert np.isnan(found["relative_velocity"].values[1])
    never = asked | {name: asked[name][1:] * 2 for name in ("postures", "directions")}
    with refused("data", value="pretouch ball"):
        sweep_robot(**(never | {"objects": inside["objects"] | {"radius": 3.0}}))


@pytest.mark.parametrize(
    ("change", "fields"),
    [
        ({"postures": []}, {"argument": "postures"}),
        ({"postures": [{"elbow": 1.0}, {"wrist": 0.1}]}, {"argument": "postures"}),
        ({"postures": [{"knee": 1.0}] * 2}, {"argument": "posture", "value": "knee"}),
        ({"directions": ["+x"]}, {"argument": "directions"}),
        ({"directions": ["up"] * 2}, {"argument": "axis", "value": "up"}),
        ({"objects": {"velocity": -0.3}}, {"argument": "objects"}),
        ({"objects": {"distance": 0.04, "velocity": [-0.3] * 3}}, {"argument": "objects", "value": 3}),
        ({"objects": {"distance": -0.04, "velocity": -0.3}}, {"argument": "objects distance", "value": -0.04}),
        ({"objects": {"distance": 0.04, "velocity": -0.3, "color": 1.0}}, {"argument": "objects", "value": "color"}),
        ({"results": ["speed"]}, {"argument": "results", "value": "speed"}),
        ({"horizon": 0.0}, {"argument": "horizon", "value": 0.0}),
        ({"seed": -1}, {"argument": "seed", "value": -1}),
        ({"dask": "tcp://127.0.0.1:9"}, {"argument": "dask"}),
        ({"output": "runs.csv"}, {"argument": "output"}),
    ],
)
def test_requests_that_cannot_be_swept_are_refused(change: dict[str, Any], fields: dict[str, Any]) -> None:
    with refused(**fields):
        sweep_robot(**(request(2) | change))

"""Motion that a rig does not keep, put back: its spectrum, its correlation, the same each time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from usdhand.anatomy.channels import Channels
from usdhand.errors import UsageError
from usdhand.motion.rotations import Array
from usdhand.reduce.method import varied
from usdhand.reduce.rig import ReducedRig, Relation
from usdhand.reduce.variation import EDGES_HZ, Residuals, Variation, band_covariances

NAMES = ("free", "slow", "also slow", "fast")
FPS = 60.0


def motion(frames: int = 6000) -> Array:
    """A free channel, two that sway together once in three seconds, and one that shakes at 6 Hz."""
    time = np.arange(frames) / FPS
    random = np.random.default_rng(0)
    sway = np.sin(2 * np.pi * 0.35 * time + 0.3 * np.sin(0.2 * time))
    shake = np.sin(2 * np.pi * 6.0 * time + np.sin(0.7 * time))
    noise = 0.01 * random.normal(size=(frames, 4))
    return np.stack([10 * sway, 3 * sway, -2 * sway, 0.5 * shake], axis=1) + noise


def residuals(values: Array) -> Residuals:
    told = np.zeros((4, 4))
    told[0, 0] = 1.0
    return Residuals.of(NAMES, told, [1, 2, 3], band_covariances(values, FPS))


def test_bands_add_up_to_the_variance() -> None:
    values = motion()
    bands = band_covariances(values, FPS)
    assert bands.shape == (len(EDGES_HZ), 4, 4)
    assert_allclose(np.einsum("bii->i", bands), values.var(axis=0), rtol=1e-9)
    power = np.einsum("bii->bi", bands)
    assert power[1, 1] > 0.95 * values[:, 1].var()  # 0.25 to 0.5 Hz
    assert power[5, 3] > 0.9 * values[:, 3].var()  # 4 to 8 Hz
    assert np.linalg.eigvalsh(bands).min() > -1e-9


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_noise_moves_as_what_is_left_out(fps: float) -> None:
    values = motion()
    found = residuals(values)
    noise = found.noise(round(200 * fps), fps, seed=4)
    assert_allclose(noise.std(axis=0), values[:, 1:].std(axis=0), rtol=0.3)
    correlation = np.corrcoef(noise.T)
    assert correlation[0, 1] < -0.95
    assert abs(correlation[0, 2]) < 0.15
    again = band_covariances(noise, fps)
    share = np.einsum("bii->bi", again) / noise.var(axis=0)
    assert share[1, 0] > 0.9
    assert share[5, 2] > 0.9


def test_the_same_seed_gives_the_same_and_clips_of_any_length_get_some() -> None:
    found = residuals(motion())
    assert_array_equal(found.noise(300, FPS, 7), found.noise(300, FPS, 7))
    assert np.abs(found.noise(300, FPS, 7) - found.noise(300, FPS, 8)).max() > 0.5
    for frames in (1, 2, 31):
        noise = found.noise(frames, FPS, 1)
        assert noise.shape == (frames, 3)
        assert np.isfinite(noise).all()
    levels = [found.noise(60, FPS, seed).std() for seed in range(30)]
    assert 0.2 < np.mean(levels) < 3.0
    assert np.isfinite(found.noise(40, 5.0, 0)).all()  # slower than some bands


def test_a_rig_varies_by_amount() -> None:
    found = residuals(motion())
    relations = (Relation("free", "free"), *(Relation(n, "constant", 5.0) for n in NAMES[1:]))
    rig = ReducedRig(relations, residuals=found)
    free = Channels(("free",), np.zeros((100, 1)))
    assert varied(rig, 100, FPS, None) is None
    assert varied(rig, 100, FPS, Variation(0.0, 3)) is None
    one, half = (
        rig.evaluate(free, varied(rig, 100, FPS, Variation(x, 3))).values for x in (1.0, 0.5)
    )
    assert_allclose(one[:, 0], 0.0)
    assert_allclose(half[:, 1:] - 5.0, 0.5 * (one[:, 1:] - 5.0))
    assert np.abs(one[:, 1:] - 5.0).max() > 0.5
    with pytest.raises(UsageError, match="does not say what it leaves out"):
        varied(ReducedRig(relations), 100, FPS, Variation(1.0))
    for wrong in ({"amount": -1.0}, {"amount": float("nan")}, {"seed": -1}):
        with pytest.raises(UsageError, match="not possible"):
            Variation(**wrong)  # type: ignore[arg-type]


def test_residuals_as_an_array() -> None:
    found = residuals(motion())
    again = Residuals.from_array(found.names, found.array)
    assert again == found
    assert found.array.shape[0] == len(EDGES_HZ)
    assert found.array.shape[2] == 3

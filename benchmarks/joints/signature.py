"""The signature of wear in load cells at the frame: arithmetic of forces over whole turns."""

import numpy as np

# The crank's speed and its first multiples are the machine's own motion.
HARMONICS = 3
# A load cell notices so much, N.
NOTICED = 50.0
# A poor one sees every fourth sample, or only what is below so many times the speed.
COARSE, LOW = 4, 200


def high_share(forces: np.ndarray, turns: int) -> float:
    """Return the share of the variance above three times the speed; shape (samples, parts).

    The samples are equally spaced over `turns` whole turns, without the end of the last.
    """
    power = _spectrum(forces)
    return float(np.sum(power[HARMONICS * turns + 1 :]) / np.sum(power[1:]))


def bursts(forces: np.ndarray, turns: int) -> float:
    """Count how often in a turn a force, shape (samples, 2), comes up from nothing."""
    there = np.hypot(*forces.T) > NOTICED
    return float(np.sum(~there[:-1] & there[1:])) / turns


def rms_ratio(one: np.ndarray, other: np.ndarray) -> float:
    """Divide the RMS of one force by that of another."""
    return float(np.sqrt(np.mean(one**2) / np.mean(other**2)))


def low_ratio(one: np.ndarray, other: np.ndarray, turns: int) -> float:
    """Divide the RMS of two forces' variations, up to `LOW` times the speed."""
    parts = (np.sum(_spectrum(forces)[1 : LOW * turns + 1]) for forces in (one, other))
    return float(np.sqrt(next(parts) / next(parts)))


def _spectrum(forces: np.ndarray) -> np.ndarray:
    """Return the power by frequency, over all parts."""
    return np.sum(np.abs(np.fft.rfft(forces, axis=0)) ** 2, axis=1)


def peak_ratio(one: np.ndarray, other: np.ndarray) -> float:
    """Divide the largest length of one force by that of another, shapes (samples, 2)."""
    return float(np.max(np.hypot(*one.T)) / np.max(np.hypot(*other.T)))


def signature(at_bearing: np.ndarray, at_pivot: np.ndarray, turns: int) -> dict[str, float]:
    """Return the signature of R_O and R_C, shapes (samples, 2)."""
    return {
        "high_share_bearing": high_share(at_bearing, turns),
        "high_share_pivot": high_share(at_pivot, turns),
        "rms_ratio": rms_ratio(at_pivot, at_bearing),
        "peak_ratio": peak_ratio(at_pivot, at_bearing),
        "bursts": bursts(at_pivot, turns),
        "bursts_coarse": bursts(at_pivot[::COARSE], turns),
        "low_ratio": low_ratio(at_pivot, at_bearing, turns),
    }


def mean_and_error(values: np.ndarray) -> tuple[float, float]:
    """Return the mean and standard error over independent starts, shape (starts,)."""
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))

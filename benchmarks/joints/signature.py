"""What load cells at the frame tell: arithmetic of forces sampled over whole turns."""

import numpy as np

# What turns with the crank, and its first multiples, is the machine's own motion.
HARMONICS = 3
# A load cell notices so much, N.
NOTICED = 50.0
# What a poor one misses: all but every fourth sample, and what is above so many times the speed.
COARSE, LOW = 4, 200


def high_share(forces: np.ndarray, turns: int) -> float:
    """Share of the variance of forces, shape (samples, parts), above three times the speed.

    The samples are equally spaced over `turns` whole turns, without the end of the last.
    """
    power = _spectrum(forces)
    return float(np.sum(power[HARMONICS * turns + 1 :]) / np.sum(power[1:]))


def bursts(forces: np.ndarray, turns: int) -> float:
    """How often in a turn a force, shape (samples, 2), comes up from nothing."""
    there = np.hypot(*forces.T) > NOTICED
    return float(np.sum(~there[:-1] & there[1:])) / turns


def rms_ratio(one: np.ndarray, other: np.ndarray) -> float:
    """RMS of one force over that of another."""
    return float(np.sqrt(np.mean(one**2) / np.mean(other**2)))


def low_ratio(one: np.ndarray, other: np.ndarray, turns: int) -> float:
    """RMS of the variation of one force over that of another, up to `LOW` times the speed."""
    parts = (np.sum(_spectrum(forces)[1 : LOW * turns + 1]) for forces in (one, other))
    return float(np.sqrt(next(parts) / next(parts)))


def _spectrum(forces: np.ndarray) -> np.ndarray:
    """Power by frequency, over all parts."""
    return np.sum(np.abs(np.fft.rfft(forces, axis=0)) ** 2, axis=1)


def peak_ratio(one: np.ndarray, other: np.ndarray) -> float:
    """Largest length of one force over that of another, shapes (samples, 2)."""
    return float(np.max(np.hypot(*one.T)) / np.max(np.hypot(*other.T)))


def signature(at_bearing: np.ndarray, at_pivot: np.ndarray, turns: int) -> dict[str, float]:
    """All of these of R_O and R_C, shapes (samples, 2)."""
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
    """Mean and standard error over starts that know nothing of each other, shape (starts,)."""
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))

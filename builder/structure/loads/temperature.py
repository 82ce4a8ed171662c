"""Temperature fields of the wall: over stations and roll angle, linear from its inner to its outer surface."""

from dataclasses import dataclass

import numpy as np

from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


@dataclass(frozen=True, eq=False, kw_only=True)
class TemperatureField:
    """Temperature above that at which the gauges were set to zero.

    Attributes
    ----------
    station : (n_x,) increasing [m]; linear in between, constant ahead of the first and behind the last.
    inner, outer : (n_x, n_roll) on the surfaces of the wall [K], at roll angles 2 pi k / n_roll; the trigonometric
        interpolant in between. The core of a solid tip has the inner one.

    Raises
    ------
    InputError
        Stations do not increase, shapes differ, or a value is not finite.
    """

    station: FloatArray
    inner: FloatArray
    outer: FloatArray

    def __post_init__(self) -> None:
        shape = np.shape(self.inner)
        if len(shape) != 2 or np.shape(self.outer) != shape or np.shape(self.station) != shape[:1] or 0 in shape:
            raise InputError(
                f"temperature: expected (n_x,) stations and (n_x, n_roll) values, got {np.shape(self.station)}, "
                f"{shape} and {np.shape(self.outer)}"
            )
        for name in ("station", "inner", "outer"):
            if not np.isfinite(getattr(self, name)).all():
                raise InputError(f"temperature: {name} must be finite")
        if np.any(np.diff(self.station) <= 0.0):
            raise InputError("temperature: stations must increase")

    @property
    def max_harmonic(self) -> int:
        """Highest harmonic in roll angle."""
        return np.shape(self.inner)[1] // 2

    def harmonics(self) -> tuple[FloatArray, FloatArray]:
        """Return cosine and sine parts (2, n_x, max_harmonic + 1) [K] of each harmonic: inner, then outer."""
        n_roll = np.shape(self.inner)[1]
        spectrum = np.fft.rfft(np.stack([self.inner, self.outer]), axis=-1) / n_roll
        m = np.arange(self.max_harmonic + 1)
        spectrum *= np.where((m == 0) | (2 * m == n_roll), 1.0, 2.0)
        return spectrum.real, -spectrum.imag

    def amplitudes(self, x: FloatArray, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return cosine and sine parts (n, max_harmonic + 1) [K] at stations (n,) [m].

        ``depth`` (n,) is 0 on the inner and 1 on the outer surface.
        """
        parts = []
        for surfaces in self.harmonics():
            inner, outer = (self._along(part, x) for part in surfaces)
            parts.append(inner + depth[:, None] * (outer - inner))
        return parts[0], parts[1]

    def at(self, x: FloatArray, roll_angle: FloatArray, depth: FloatArray) -> FloatArray:
        """Return temperatures (n,) [K] at stations [m], roll angles [rad] and depths (n,) each."""
        cosine, sine = self.amplitudes(x, depth)
        phase = np.arange(self.max_harmonic + 1) * roll_angle[:, None]
        return np.asarray((cosine * np.cos(phase) + sine * np.sin(phase)).sum(axis=1))

    def _along(self, value: FloatArray, x: FloatArray) -> FloatArray:
        return np.column_stack([np.interp(x, self.station, column) for column in value.T])


def uniform_temperature(temperature: float) -> TemperatureField:
    """Return a field of one temperature [K]."""
    value = np.full((1, 1), float(temperature))
    return TemperatureField(station=np.zeros(1), inner=value, outer=value)


def temperature_mode(
    station: FloatArray,
    amplitude: FloatArray,
    harmonic: int = 0,
    roll_angle: float = 0.0,
    through_wall: FloatArray | None = None,
) -> TemperatureField:
    """Return a field that goes as cos(m (phi - roll_angle)).

    Parameters
    ----------
    station : (n_x,) [m].
    amplitude : (n_x,) in the middle of the wall [K].
    harmonic : m.
    roll_angle : of a crest [rad].
    through_wall : (n_x,) outer less inner temperature [K], going round as the amplitude; none by default.

    Raises
    ------
    InputError
        The harmonic is negative, or as :class:`TemperatureField`.
    """
    if harmonic < 0:
        raise InputError(f"temperature: harmonic {harmonic} must be at least 0")
    n_roll = 2 * harmonic + 1
    wave = np.cos(harmonic * (2.0 * np.pi * np.arange(n_roll) / n_roll - roll_angle))
    amplitude = np.asarray(amplitude, dtype=float)
    half = 0.5 * (np.zeros_like(amplitude) if through_wall is None else np.asarray(through_wall, dtype=float))
    return TemperatureField(
        station=np.asarray(station, dtype=float),
        inner=np.outer(amplitude - half, wave),
        outer=np.outer(amplitude + half, wave),
    )


def wall_depth(x: FloatArray, radius: FloatArray, inner: FloatArray, outer: FloatArray) -> FloatArray:
    """Return where points (n,) lie in the wall: 0 on its inner, 1 on its outer surface.

    Parameters
    ----------
    x, radius : (n,) of the points [m].
    inner, outer : (k, 2) points [x, r] of the surfaces, x not decreasing [m]. Ahead of the inner surface, in a
        solid tip, it goes on in proportion to the outer radius.
    """
    outside = np.interp(x, *outer.T)
    tip = inner[0, 1] * outside / np.interp(inner[0, 0], *outer.T)
    inside = np.where(x < inner[0, 0], tip, np.interp(x, *inner.T))
    thickness = np.maximum(outside - inside, np.finfo(float).tiny)
    return np.clip((radius - inside) / thickness, 0.0, 1.0)

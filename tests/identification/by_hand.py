"""Two machines by hand, in NumPy alone: a block under a rotating unbalance, a crusher's linkage."""

import numpy as np

# A block on springs, with links of next to no mass on it: the shaft's unbalance drives it.
BLOCK = {
    "foundation.mass": 5000.0,
    "foundation.inertia": 2000.0,
    "foundation.x": 0.1,
    "foundation.y": 0.3,
    "foundation.left": -0.5,
    "foundation.right": 0.9,
    "foundation.base": -0.4,
    "foundation.horizontal_stiffness": 2e6,
    "foundation.vertical_stiffness": 3e6,
    "foundation.horizontal_damping": 1e4,
    "foundation.vertical_damping": 2e4,
    **{f"{body}.{part}": 1e-9 for body in ("jaw", "toggle") for part in ("mass", "inertia")},
    "shaft.mass": 95.0,
    "shaft.inertia": 0.2,
    "shaft.mass_centre_radius": 1e-4,
    "shaft.mass_centre_angle": 0.4,
    "gravity": 0.0,
    "joint": "ideal",
    "load_law": "none",
}
BEARING = 0.64 * np.array([np.sin(np.pi / 8), np.cos(np.pi / 8)])


def block(values, speed):
    """First harmonics, A e^(i phi), of displacement x and y of G (m) and of the rotation (rad)."""
    of = {name.removeprefix("foundation."): value for name, value in values.items()}
    mass, centre = of["shaft.mass"], np.array([of["x"], of["y"]])
    hub = BEARING - centre
    inertia = np.diag([of["mass"] + mass, of["mass"] + mass, of["inertia"] + of["shaft.inertia"]])
    inertia[2, 2] += mass * hub @ hub
    inertia[0, 2] = inertia[2, 0] = -mass * hub[1]
    inertia[1, 2] = inertia[2, 1] = mass * hub[0]
    stiffness = np.zeros((3, 3), complex)
    for side in ("left", "right"):
        x, y = np.array([of[side], of["base"]]) - centre
        at = np.array([[1, 0, -y], [0, 1, x]])
        spring = [of["horizontal_stiffness"], of["vertical_stiffness"]]
        damper = [of["horizontal_damping"], of["vertical_damping"]]
        stiffness += at.T @ np.diag(spring + 1j * speed * np.array(damper)) @ at
    unbalance = mass * of["shaft.mass_centre_radius"] * np.exp(1j * of["shaft.mass_centre_angle"])
    push = unbalance * speed**2 * np.array([1, -1j, 0])
    push[2] = hub[0] * push[1] - hub[1] * push[0]
    return np.linalg.solve(stiffness - speed**2 * inertia, push)


CRUSHER = {"joint": "ideal"}
# Tables 1 and 2 of the paper.
LINKS = {
    "speed": 30.0,
    "gravity": 9.81,
    "shaft.mass": 95.0,
    "shaft.inertia": 0.2,
    "shaft.eccentricity": 0.01,
    "shaft.mass_centre_radius": 0.006,
    "shaft.mass_centre_angle": np.radians(30.0),
    "jaw.mass": 524.0,
    "jaw.inertia": 128.48,
    "jaw.length": 0.695,
    "jaw.mass_centre_distance": 0.3,
    "jaw.mass_centre_angle": np.radians(15.0),
    "toggle.mass": 22.0,
    "toggle.inertia": 0.7154,
    "toggle.length": 0.3,
}
INSTANTS = 128


def places(values):
    """Places (m) of mass centres and angles (rad) of bodies over a turn, the shaft's from its mean.

    Circles about A and C meet in B.
    """
    v = LINKS | dict(values)
    theta = 2 * np.pi * np.arange(INSTANTS) / INSTANTS
    turn = np.exp(1j * theta)
    hub = complex(*BEARING)
    pin = hub + v["shaft.eccentricity"] * turn
    # B, from C: as far along C-A as the triangle C-A-B says, and to the left of that line.
    reach = np.abs(pin)
    along = (reach**2 + v["toggle.length"] ** 2 - v["jaw.length"] ** 2) / (2 * reach)
    elbow = pin / reach * (along - 1j * np.sqrt(v["toggle.length"] ** 2 - along**2))
    jaw = (elbow - pin) / v["jaw.length"]
    lead = np.exp(1j * v["shaft.mass_centre_angle"])
    ahead = np.exp(1j * v["jaw.mass_centre_angle"])
    found = {
        "shaft": hub + v["shaft.mass_centre_radius"] * lead * turn,
        "jaw": pin + v["jaw.mass_centre_distance"] * ahead * jaw,
        "toggle": elbow / 2,
    }
    angles = {
        "shaft": 0 * theta,
        "jaw": np.angle(jaw / jaw[0]),
        "toggle": np.angle(elbow / elbow[0]),
    }
    return found, angles


def crusher(values, speed):
    """Harmonics, A e^(i phi) by order, of the force (N) and the moment about C (N m) on the frame.

    Accelerations are those of the Fourier series of places.
    """
    v, (at, angles) = LINKS | dict(values), places(values)
    orders = np.fft.fftfreq(INSTANTS, 1 / INSTANTS)

    def second(series):
        return np.fft.ifft(-((speed * orders) ** 2) * np.fft.fft(series))

    force, moment = 0, 0
    for body, place in at.items():
        push = v[f"{body}.mass"] * (-1j * v["gravity"] - second(place))
        force = force + push
        moment = moment + (np.conj(place) * push).imag
        moment = moment - v[f"{body}.inertia"] * second(angles[body]).real
    columns = {"ground_force_x": force.real, "ground_force_y": force.imag, "ground_moment": moment}
    return {name: 2 * np.fft.rfft(column) / INSTANTS for name, column in columns.items()}

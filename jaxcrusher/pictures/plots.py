"""All figures by their names: they draw what they are given and compute no physics.

Every function takes `ax` (None: axes of a new figure) and returns it.
"""

from jaxcrusher.pictures.fits import plot_corner as plot_corner
from jaxcrusher.pictures.maps import axes_of as axes_of
from jaxcrusher.pictures.maps import plot_capacity as plot_capacity
from jaxcrusher.pictures.maps import plot_landscape as plot_landscape
from jaxcrusher.pictures.maps import plot_regimes as plot_regimes
from jaxcrusher.pictures.maps import plot_sweep as plot_sweep
from jaxcrusher.pictures.motions import force_size as force_size
from jaxcrusher.pictures.motions import pins_and_force as pins_and_force
from jaxcrusher.pictures.motions import plot_difference as plot_difference
from jaxcrusher.pictures.motions import plot_force as plot_force
from jaxcrusher.pictures.motions import plot_orbit as plot_orbit
from jaxcrusher.pictures.motions import plot_phase as plot_phase
from jaxcrusher.pictures.motions import plot_play as plot_play
from jaxcrusher.pictures.motions import plot_spectrum as plot_spectrum
from jaxcrusher.pictures.orbits import plot_bifurcation as plot_bifurcation
from jaxcrusher.pictures.orbits import plot_branch as plot_branch
from jaxcrusher.pictures.orbits import plot_campbell as plot_campbell
from jaxcrusher.pictures.orbits import plot_multipliers as plot_multipliers
from jaxcrusher.pictures.orbits import plot_orders as plot_orders
from jaxcrusher.pictures.style import BLUE as BLUE
from jaxcrusher.pictures.style import GREEN as GREEN
from jaxcrusher.pictures.style import ORANGE as ORANGE
from jaxcrusher.pictures.style import PURPLE as PURPLE
from jaxcrusher.pictures.style import SMALLEST as SMALLEST
from jaxcrusher.pictures.style import STYLE as STYLE
from jaxcrusher.pictures.style import WIDTH as WIDTH
from jaxcrusher.pictures.style import style as style
